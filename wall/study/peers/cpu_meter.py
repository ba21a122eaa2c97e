"""CPU time of all processes that this one started, over time: the same measure for every renderer."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

STEP_S = 0.1
PARENT, USER, SYSTEM = 1, 11, 12  # fields of /proc/PID/stat after the name


class CpuMeter:
    """Within `with`: CPU seconds of descendants, looked up every tenth of a second."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, float]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> CpuMeter:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def cores(self, first: float, last: float) -> float:
        """CPU seconds a second between two times of the monotonic clock."""
        return rate(self._rows, first, last)

    def _look(self) -> None:
        while not self._over.wait(STEP_S):
            self._rows.append((time.monotonic(), descendants_cpu_s(os.getpid())))


def rate(rows: Sequence[tuple[float, float]], first: float, last: float) -> float:
    """CPU seconds a second from `first` to `last`, of (time, CPU seconds until then) with growing times."""
    if not rows:
        return 0.0
    times, spent = np.array(rows).T
    return float(np.diff(np.interp([first, last], times, spent))[0]) / max(last - first, STEP_S)


def descendants_cpu_s(ancestor: int) -> float:
    """CPU seconds that the running descendants of a process have taken so far."""
    parents, spent = {}, {}
    for entry in os.scandir("/proc"):
        if entry.name.isdigit() and (fields := stat_of(int(entry.name))):
            parents[int(entry.name)] = int(fields[PARENT])
            spent[int(entry.name)] = int(fields[USER]) + int(fields[SYSTEM])
    below, found = {ancestor}, 0
    while children := {pid for pid, parent in parents.items() if parent in below} - below:
        below |= children
    found = sum(spent[pid] for pid in below - {ancestor} if pid in spent)
    return found / os.sysconf("SC_CLK_TCK")


def stat_of(pid: int) -> list[str]:
    """Fields of a process after its name; none if it has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return []
