"""How many cores this process may use: by its affinity, and by quotas of the cgroups it is in (v2, or v1).

Kernel documentation: admin-guide/cgroup-v2 (cpu.max), scheduler/sched-bwc (cpu.cfs_quota_us).
"""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Collection, Sequence
from pathlib import Path

from wall.core.system import groups_of_this_process, kernel_text

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


def quota_of(group: Path, version: int) -> float:
    """The cores that a cgroup may use; infinite where it has no quota."""
    if version == 2:
        quota, _, period = kernel_text(group / "cpu.max").partition(" ")
    else:
        quota, period = kernel_text(group / "cpu.cfs_quota_us"), kernel_text(group / "cpu.cfs_period_us")
    try:
        return int(quota) / int(period) if int(quota) > 0 else float("inf")
    except (ValueError, ZeroDivisionError):  # "max", or there is no such file
        return float("inf")
