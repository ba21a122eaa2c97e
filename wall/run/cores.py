"""How many cores this process may use: by its affinity, and by quotas of the cgroups it is in (v2, or v1).

Kernel documentation: admin-guide/cgroup-v2 (cpu.max), scheduler/sched-bwc (cpu.cfs_quota_us).
"""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Collection, Sequence
from pathlib import Path

HEAD_WEIGHT = 0.25  # of a head among processes that share a core: it shows what renderers made


def usable_cores() -> float:
    """As many as this process may keep busy."""
    return min(float(len(own_cores())), quota())


def quota() -> float:
    """The cores that this process and others of its cgroups may keep busy together; infinite without a limit."""
    return min((quota_of(*group) for group in groups_of_this_process()), default=math.inf)


def own_cores() -> list[int]:
    """Numbers of the cores that this process may run on."""
    return sorted(os.sched_getaffinity(0))


def share_of_cores(own: int, processes: Sequence[Collection[int]], *, head: int | None, limit: float) -> float:
    """How many cores a process has among those of its run on this machine: they share what several may run on.

    own, head : which of them it is, and which is the head
    processes : of each the numbers of the cores that it may run on
    limit : as many as all of them may keep busy together, see quota
    """
    weights = [HEAD_WEIGHT if k == head else 1.0 for k in range(len(processes))]
    users: defaultdict[int, float] = defaultdict(float)
    for weight, cores in zip(weights, processes, strict=True):
        for core in cores:
            users[core] += weight
    return min(sum(weights[own] / users[core] for core in processes[own]), limit * weights[own] / sum(weights))


def groups_of_this_process(controller: str = "cpu", proc: Path = Path("/proc")) -> list[tuple[Path, int]]:
    """See groups_of."""
    return groups_of(_read(proc / "self" / "cgroup"), _read(proc / "self" / "mountinfo"), controller)


def quota_of(group: Path, version: int) -> float:
    """The cores that a cgroup may use; infinite where it has no quota."""
    if version == 2:
        quota, _, period = _read(group / "cpu.max").partition(" ")
    else:
        quota, period = _read(group / "cpu.cfs_quota_us"), _read(group / "cpu.cfs_period_us")
    try:
        return int(quota) / int(period) if int(quota) > 0 else float("inf")
    except (ValueError, ZeroDivisionError):  # "max", or there is no such file
        return float("inf")


def groups_of(cgroup: str, mountinfo: str, controller: str = "cpu") -> list[tuple[Path, int]]:
    """Folders of cgroups with a controller, with their version: this process's own first, then those above it.

    cgroup, mountinfo : texts of those files of /proc/self
    """
    own = {}  # by controller, "" for version 2: this process's path below the mount
    for line in cgroup.splitlines():
        _, controllers, path = line.split(":", 2)
        own.update(dict.fromkeys(controllers.split(","), path))
    found: list[tuple[Path, int]] = []
    for line in mountinfo.splitlines():
        left, _, right = line.partition(" - ")
        kind, _, options = right.split(" ", 2)
        root, mount = left.split()[3:5]
        if kind == "cgroup2":
            folders = _upwards(Path(mount), root, own.get("", "/"))
            found += [(folder, 2) for folder in folders if controller in _read(folder / "cgroup.controllers").split()]
        elif kind == "cgroup" and controller in options.split(","):
            found += [(folder, 1) for folder in _upwards(Path(mount), root, own.get(controller, "/"))]
    return found


def _upwards(mount: Path, root: str, path: str) -> list[Path]:
    """From a process's own folder to the mount: only folders that are there, a container may see a part of them."""
    below = path.removeprefix(root) if root != "/" else path
    own = mount / below.lstrip("/")
    chain = [own, *own.parents]
    return [folder for folder in chain[: chain.index(mount) + 1] if folder.is_dir()]


def _read(path: str | Path) -> str:
    """A file of the kernel; "" where there is none."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError:
        return ""
