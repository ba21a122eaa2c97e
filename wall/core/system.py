"""Processes and the kernel: control groups, the memory that is left, the death of a parent, modules as programs.

Kernel documentation: admin-guide/cgroup-v2, cgroup-v1/memory; prctl(2).
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

NO_LIMIT = 1 << 60  # bytes: what version 1 of control groups says where there is none is near 2^63
FILES = {  # by version: the limit, what is used, and of memory.stat pages that the kernel drops where memory is wanted
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", ("total_inactive_file", "total_active_file")),
    2: ("memory.max", "memory.current", ("inactive_file", "active_file")),
}
_PR_SET_PDEATHSIG = 1


def end_with_parent(number: signal.Signals) -> None:
    """Let this process get a signal when the process that started it ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def die_with(parent: int) -> None:
    """Let this process be killed when its `parent` ends; at once where it has ended by now."""
    end_with_parent(signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def own_module(name: str) -> tuple[list[str], dict[str, str]]:
    """The command that runs a module of this program, and its environment: found however this process found it, and
    nothing of the current folder is run in its place."""
    here = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
    return [sys.executable, "-P", "-m", name], {**os.environ, "PYTHONPATH": path}


def available_bytes(proc: Path = Path("/proc")) -> int | None:
    """Bytes that processes here may still take, by the kernel and by the limits of this one's control groups.

    None where that is not told: not Linux.
    """
    try:
        lines = (proc / "meminfo").read_text(encoding="ascii").splitlines()
        left = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, StopIteration):
        return None
    limits = (_left_in(folder, *FILES[version]) for folder, version in groups_of_this_process("memory", proc))
    return min([left, *(limit for limit in limits if limit is not None)])


def _left_in(folder: Path, limit: str, usage: str, dropped: tuple[str, ...]) -> int | None:
    """Of one group its limit less what is used, but for pages of files; None: it has no limit, or is not seen here."""
    try:
        most = int((folder / limit).read_text(encoding="ascii"))  # "max": none
        used = int((folder / usage).read_text(encoding="ascii"))
        told = dict(line.split() for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines())
        files = sum(int(told.get(name, 0)) for name in dropped)
    except (OSError, ValueError):
        return None
    return None if most >= NO_LIMIT else max(0, most - max(0, used - files))


def groups_of_this_process(controller: str = "cpu", proc: Path = Path("/proc")) -> list[tuple[Path, int]]:
    """See groups_of."""
    return groups_of(kernel_text(proc / "self" / "cgroup"), kernel_text(proc / "self" / "mountinfo"), controller)


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
            found += [
                (folder, 2) for folder in folders if controller in kernel_text(folder / "cgroup.controllers").split()
            ]
        elif kind == "cgroup" and controller in options.split(","):
            found += [(folder, 1) for folder in _upwards(Path(mount), root, own.get(controller, "/"))]
    return found


def _upwards(mount: Path, root: str, path: str) -> list[Path]:
    """From a process's own folder to the mount: only folders that are there, a container may see a part of them."""
    below = path.removeprefix(root) if root != "/" else path
    own = mount / below.lstrip("/")
    chain = [own, *own.parents]
    return [folder for folder in chain[: chain.index(mount) + 1] if folder.is_dir()]


def kernel_text(path: str | Path) -> str:
    """A file of the kernel; "" where there is none."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError:
        return ""
