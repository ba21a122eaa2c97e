"""A wall that needs more memory than a machine has left is refused, with figures."""

from __future__ import annotations

import math
import socket
from dataclasses import replace
from pathlib import Path

import pytest

from wall.commands.memory import memory_lines
from wall.config.loading import loads
from wall.core.errors import ConfigError, RunError
from wall.core.system import available_bytes
from wall.roles.memory import memory_on_host
from wall.roles.plan import Plan, make_layout, make_plan, on_one_machine
from wall.run import host_memory, launch, succession
from wall.run.host_memory import SURELY, check_memory, ranks_here
from wall.run.succession import Preparer
from wall.run.usage import Usage

KB, GB = 1024, 10**9
TEXT = """\
version: 1
scene: {{source: cornell}}
wall: {{grid: {{columns: {columns}, rows: 1, pixels: [1920, 1080], size: [0.3, 0.2]}}}}
views: [{{camera: auto}}]
reconstruction: cpu
"""


def plan_of(columns: int = 1) -> Plan:
    return make_plan(make_layout(loads(TEXT.format(columns=columns), path=Path("w.yaml"))))


def machine(folder: Path, files: dict[str, str]) -> int | None:
    """What is left on a machine with these files in /proc and, under groups, where control groups are mounted."""
    mounts = (
        f"32 31 0:29 / {folder}/groups rw - cgroup2 cgroup2 rw\n"
        f"33 31 0:30 / {folder}/groups/memory rw - cgroup cgroup rw,memory\n"
    )
    told = {"proc/meminfo": f"MemTotal: 99 kB\nMemAvailable:  {4 * GB // KB} kB\n", "proc/self/mountinfo": mounts}
    for name, text in (told | files).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return available_bytes(folder / "proc")


def test_what_is_left_is_what_the_kernel_says_unless_a_group_may_take_less(tmp_path: Path) -> None:
    assert machine(tmp_path / "none", {}) == 4 * GB // KB * KB
    files = f"anon 1\ninactive_file {GB // 4}\nactive_file {3 * GB // 4}"
    of_group = {"memory.max": f"{3 * GB}", "memory.current": f"{2 * GB}", "memory.stat": files}
    parent = {f"groups/docker/{name}": text for name, text in of_group.items()}
    group = {"groups/docker/a/memory.max": "max", "groups/docker/a/memory.current": "0"}
    named = {
        "proc/self/cgroup": "0::/docker/a\n",
        "groups/docker/cgroup.controllers": "cpu memory\n",
        "groups/docker/a/cgroup.controllers": "memory\n",
    }
    assert machine(tmp_path / "second", named | parent | group) == 2 * GB, "3 GB less what is not files"
    first = {
        "proc/self/cgroup": "5:cpu,cpuacct:/x\n4:memory:/jobs/7\n0::/\n",
        "groups/memory/jobs/7/memory.limit_in_bytes": f"{GB}",
        "groups/memory/jobs/7/memory.usage_in_bytes": f"{GB // 4}",
        "groups/memory/jobs/7/memory.stat": "total_inactive_file 0\n",
        "groups/memory/memory.limit_in_bytes": "9223372036854771712",
        "groups/memory/memory.usage_in_bytes": "5",
        "groups/memory/memory.stat": "",
    }
    assert machine(tmp_path / "first", first) == GB - GB // 4


def test_where_nothing_tells_what_is_left_nothing_is_refused(tmp_path: Path) -> None:
    assert available_bytes(tmp_path) is None
    (tmp_path / "meminfo").write_text("MemFree: 12 kB\n")
    assert available_bytes(tmp_path) is None
    check_memory(plan_of(), range(2), forked=True, available=None, host="here")


def test_a_refusal_says_where_how_much_how_much_there_is_and_what_to_lower() -> None:
    plan = on_one_machine(plan_of())
    needed = memory_on_host(plan, range(2), forked=True).total
    enough = math.ceil(needed / SURELY)
    check_memory(plan, range(2), forked=True, available=enough, host="node7")
    with pytest.raises(ConfigError) as refusal:
        check_memory(plan, range(2), forked=True, available=enough - 1, host="node7")
    text = str(refusal.value)
    assert text.startswith(f"w.yaml: 2 ranks need {needed / GB:.2f} GB of memory on node7, ")
    assert f"of it for images, and {enough / GB:.2f} are left there; wanted: fewer pixels, or fewer" in text


def test_check_refuses_a_rank_that_fits_nowhere_and_notes_a_wall_that_needs_more_machines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = plan_of(columns=4)
    alone = memory_on_host(on_one_machine(plan), [1], forked=False).total
    taken = 1 << 28
    monkeypatch.setattr("wall.commands.memory.available_bytes", lambda: alone - taken)
    monkeypatch.setattr("wall.commands.memory.memory", lambda: taken)
    monkeypatch.setattr("wall.commands.memory.usage", Usage)
    monkeypatch.setattr("wall.commands.memory.peak_of_children", lambda: 0)
    line, note = memory_lines(plan)
    assert f"by itself rank 1 needs the most, {alone / GB:.2f} GB; {alone / GB:.1f} GB are left here" in line
    assert note.startswith("note: 5 ranks need")
    monkeypatch.setattr("wall.commands.memory.usage", lambda: Usage(peak_memory=2 * alone))
    assert list(memory_lines(plan))[1].startswith(f"memory: loading the scene took {2 * alone / GB:.2f} GB for a while")
    monkeypatch.setattr("wall.commands.memory.peak_of_children", lambda: 3 * alone)
    assert list(memory_lines(plan))[1].startswith(f"memory: loading the scene took {(3 * alone + taken) / GB:.2f} GB")
    monkeypatch.setattr("wall.commands.memory.available_bytes", lambda: int(alone / SURELY) - taken - 1)
    with pytest.raises(ConfigError, match=r"^w\.yaml: rank 1 needs .* of memory on this machine"):
        list(memory_lines(plan))


def test_a_run_that_needs_too_much_ends_before_it_takes_any(monkeypatch: pytest.MonkeyPatch) -> None:
    layout, said = plan_of().layout, list[str]()
    monkeypatch.setattr(host_memory, "available_bytes", lambda: GB // 4)
    with pytest.raises(ConfigError, match=f"2 ranks need .* of memory on {socket.gethostname()}"):
        launch.prepare(layout, said.append, headless=True, ranks=range(2))
    assert said[0] == "loading the scene"
    assert all("pixels are not square" in each for each in said[1:]), "a run that goes on says more"


def test_what_a_running_wall_has_no_memory_for_is_not_adopted(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, text = plan_of(), TEXT.format(columns=1)
    monkeypatch.setattr(succession, "available_bytes", lambda: GB // 4)
    with pytest.raises(RunError, match=r"2 ranks need .* GB of memory on .* for images, and .* are left there; wanted"):
        Preparer(plan, ["", ""]).make(1, text, "w.yaml")
    elsewhere = Preparer(plan, ["another", "another"]).make(1, text, "w.yaml")
    monkeypatch.setattr(succession, "available_bytes", lambda: 4 * GB)
    assert Preparer(plan, ["", ""]).make(1, text, "w.yaml")[0].number == elsewhere[0].number == 1


def test_ranks_that_are_placed_elsewhere_are_not_looked_at() -> None:
    layout = plan_of(columns=2).layout
    assert ranks_here(layout, "me") == [0, 1, 2]
    placed = replace(layout, graph=replace(layout.graph, hosts={1: "me", 2: "another"}))
    assert ranks_here(placed, "me") == [0, 1]
