"""Give a command so many cores: whole ones by affinity, a fraction by a quota of a cgroup (v2, or v1).

Kernel documentation: admin-guide/cgroup-v2 (cpu.max), scheduler/sched-bwc (cpu.cfs_quota_us).
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wall.core.errors import ConfigError, RunError
from wall.core.system import groups_of_this_process
from wall.study.live.start import NO_GROUP

PERIOD_US = 10_000  # of a quota: the kernel's usual 100 ms would stop a wall of 0.25 cores for 75 ms at a time
LEAST_QUOTA_US = 1000  # the kernel's
EMPTY_WAIT_S = 5.0  # for the kernel to see that a group's processes have ended
POLL_S = 0.05
WANTED = (
    "wanted: whole cores, or a cgroup below this process's whose CPU controller it may set: as root, or started by "
    "`systemd-run --user --scope -p Delegate=yes`"
)


def own_cores() -> float:
    """As many as this process may use."""
    return float(len(os.sched_getaffinity(0)))


@contextmanager
def limited(cores: float) -> Iterator[list[str]]:
    """The words before a command that give it `cores` cores in all. Raises ConfigError, RunError."""
    usable = sorted(os.sched_getaffinity(0))
    if cores > len(usable):
        raise ConfigError(f"--cores {cores:g}: this process may use {len(usable)}")
    cpus = ",".join(map(str, usable[: math.ceil(cores)]))
    launcher = [sys.executable, "-m", "wall.study.live.start", cpus]
    if cores == int(cores):
        yield [*launcher, NO_GROUP]
        return
    group = _make_group(cores)
    try:
        yield [*launcher, str(group)]
    finally:
        _remove(group)


def check(cores: float) -> None:
    """Raise what `limited` would, before anything else is done."""
    with limited(cores):
        pass


def _make_group(cores: float) -> Path:
    """A new cgroup with a quota of CPU time. Raises RunError where this process cannot make one."""
    tried = []
    for parent, version in groups_of_this_process():
        group = parent / f"wall-{os.getpid()}"
        try:
            if version == 2 and "cpu" not in (parent / "cgroup.subtree_control").read_text().split():
                (parent / "cgroup.subtree_control").write_text("+cpu")
            group.mkdir()
        except OSError as error:
            tried.append(f"{parent}: {error.strerror}")
            continue
        try:
            for name, text in quota_files(cores, version):
                (group / name).write_text(text)
        except OSError as error:
            tried.append(f"{group}: {error.strerror}")
            group.rmdir()
            continue
        return group
    why = "; ".join(tried) or "no cgroup with a CPU controller is mounted"
    raise RunError(f"--cores {cores:g}: a fraction of a core needs a cgroup with a quota ({why}); {WANTED}")


def quota_files(cores: float, version: int) -> list[tuple[str, str]]:
    """What is written to a cgroup's files, in this order."""
    period = max(PERIOD_US, math.ceil(LEAST_QUOTA_US / cores))
    quota = round(cores * period)
    if version == 2:
        return [("cpu.max", f"{quota} {period}")]
    return [("cpu.cfs_period_us", str(period)), ("cpu.cfs_quota_us", str(quota))]


def _remove(group: Path) -> None:
    """Remove an empty group; one whose processes are slow to end is left after a while."""
    limit = time.monotonic() + EMPTY_WAIT_S
    while time.monotonic() < limit:
        try:
            group.rmdir()
            return
        except OSError:
            time.sleep(POLL_S)
