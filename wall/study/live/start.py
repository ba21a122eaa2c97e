"""Become a command on some cores, in a cgroup perhaps, that ends with the process that started it.

    python -m wall.study.live.start 0,1 /sys/fs/cgroup/cpu/wall-12 wall run demo.yaml

A process of its own sets this before the command begins: what the command starts inherits all of it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

NO_GROUP = "-"
_PR_SET_PDEATHSIG = 1


def main(cpus: str, group: str, *command: str) -> None:
    """Never returns."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.sched_setaffinity(0, [int(cpu) for cpu in cpus.split(",")])
    if group != NO_GROUP:
        Path(group, "cgroup.procs").write_text(f"{os.getpid()}\n", encoding="ascii")
    os.execvp(command[0], command)


if __name__ == "__main__":
    main(*sys.argv[1:])
