"""What this process has used so far."""

from __future__ import annotations

import ctypes
import os
import resource
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """The process's number, bytes of memory, and seconds of CPU time since the start."""

    process: int = 0
    memory: int = 0
    peak_memory: int = 0
    cpu_seconds: float = 0.0


STATM = Path("/proc/self/statm")  # pages: of the program, and resident


def usage() -> Usage:
    """What this process uses."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    peak = used.ru_maxrss * 1024  # Linux counts KiB
    return Usage(process=os.getpid(), memory=memory(), peak_memory=peak, cpu_seconds=_cpu_seconds(used))


def peak_of_children() -> int:
    """The most that one of the processes that this one started, and that have ended, has had; bytes."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024


def nothing_used() -> Usage:
    """For ranks that are simulated: messages then have the same bytes each time."""
    return Usage()


def cpu_seconds() -> float:
    """CPU time of this process so far, all threads."""
    return _cpu_seconds(resource.getrusage(resource.RUSAGE_SELF))


def _cpu_seconds(used: resource.struct_rusage) -> float:
    return used.ru_utime + used.ru_stime


def memory() -> int:
    """Resident set of this process now, bytes."""
    return int(STATM.read_text(encoding="ascii").split()[1]) * resource.getpagesize()


def give_memory_back() -> None:
    """Give the system what was freed: glibc keeps it, and ranks that are forked, or start together, would each have it.

    60 MB of a 480x270 panel's warm-up, and more of a larger one. Does nothing under another C library.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
