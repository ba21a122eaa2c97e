"""How many cores a process may use."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from wall.core.system import groups_of
from wall.run.cores import quota_of, share_of_cores
from wall.run.tracers import threads_of


def test_cgroups_are_looked_for_from_the_own_one_upwards(tmp_path: Path) -> None:
    own = tmp_path / "v2" / "user" / "me"
    own.mkdir(parents=True)
    (tmp_path / "v1").mkdir()
    for folder in (own, own.parent):
        (folder / "cgroup.controllers").write_text("cpuset cpu memory\n")
    mounts = (
        f"32 31 0:29 / {tmp_path}/v1 rw,relatime shared:9 - cgroup cgroup rw,cpu,cpuacct\n"
        f"33 31 0:30 / {tmp_path}/v2 rw,relatime - cgroup2 cgroup2 rw\n34 31 0:31 / /proc rw - proc proc rw\n"
    )

    found = groups_of("3:cpu,cpuacct:/\n0::/user/me\n", mounts)

    assert found == [(tmp_path / "v1", 1), (own, 2), (own.parent, 2)], "the root of v2 has no CPU controller here"


def test_a_quota_is_a_number_of_cores(tmp_path: Path) -> None:
    (tmp_path / "cpu.max").write_text("25000 100000\n")
    (tmp_path / "cpu.cfs_quota_us").write_text("5000\n")
    (tmp_path / "cpu.cfs_period_us").write_text("10000\n")
    assert quota_of(tmp_path, 2) == 0.25
    assert quota_of(tmp_path, 1) == 0.5

    (tmp_path / "cpu.max").write_text("max 100000\n")
    (tmp_path / "cpu.cfs_quota_us").write_text("-1\n")
    assert quota_of(tmp_path, 2) == quota_of(tmp_path, 1) == quota_of(tmp_path / "none", 2) == math.inf


ALL = {"of a machine": [range(16)] * 5, "two": [range(2)] * 2, "one": [range(4)], "five on two": [range(2)] * 5}


@pytest.mark.parametrize(
    ("processes", "limit", "each", "threads"),
    [
        (ALL["of a machine"], math.inf, 3.76, 4), (ALL["two"], math.inf, 1.6, 2), (ALL["one"], math.inf, 4.0, 4),
        (ALL["five on two"], math.inf, 0.47, 1), (ALL["five on two"], 0.25, 0.06, 1),
        ([range(8 * k, 8 * k + 8) for k in range(4)], math.inf, 8.0, 8),
        ([range(8 * k, 8 * k + 8) for k in range(4)], 13.0, 4.0, 4),
        ([range(0, 4), range(2, 6)], math.inf, 3.6, 4),
    ],
    ids=[
        "all share", "with a head alone", "alone", "too many", "with a quota", "each bound to its own",
        "and with a quota for all", "overlapping",
    ],
)  # fmt: skip
def test_processes_share_the_cores_that_several_may_run_on(
    processes: list[range], limit: float, each: float, threads: int
) -> None:
    """The first is the head, which counts as a quarter of a process."""
    cores = share_of_cores(len(processes) - 1, processes, head=0, limit=limit)
    assert cores == pytest.approx(each, abs=0.01)
    assert threads_of(cores) == threads


def test_without_a_head_all_count_the_same() -> None:
    assert share_of_cores(0, [range(8)] * 4, head=None, limit=math.inf) == 2.0


def test_a_head_has_a_quarter_of_what_others_have() -> None:
    head, other = (share_of_cores(k, [range(8)] * 2, head=0, limit=math.inf) for k in (0, 1))
    assert (head, other) == pytest.approx((1.6, 6.4))
