"""How many cores a process may use."""

from __future__ import annotations

import math
from pathlib import Path

from wall.run.cores import groups_of, quota_of


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
