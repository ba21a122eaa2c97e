"""Checks of the machine itself: packages, cores, limits, shared memory, disk, MPI, GPU."""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from wall.commands.doctor.finding import Finding, State
from wall.core.kernel_cache import cache_root, wanted_cache_root
from wall.core.mpi import under_mpi

SHARED = Path("/dev/shm")
MPI_S, GPU_S = 60.0, 30.0  # for programs that check these
FILES, FILES_A_RANK = 128, 8  # open files of the head; a head of 5 ranks has 58 without viewers
LEAST_DISK = 1 << 30  # bytes for results
OFFERED = {  # extras, and what they are for
    "data": "reads VTK's files", "film": "writes films", "denoise": "removes noise",
}  # fmt: skip
_REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)(.*)")
_BOUND = re.compile(r"(>=|==|<)\s*([0-9.]+)")
_MPI = (
    "from wall.run.bootstrap_mpi import MpiBootstrap; ranks = MpiBootstrap(); "
    "print(ranks.allgather('here'), flush=True); ranks.finish()"
)
_GPU = "from wall.reconstruction.choice import choose; print(choose('gpu').why)"


def packages() -> Iterator[Finding]:
    """Python's version, and every package that this installation needs."""
    for text in requires("wall") or ():
        if ";" in text:
            continue  # of an extra
        match = _REQUIREMENT.match(text)
        assert match is not None
        name, wanted = match[1], match[2]
        mend = f"python -m pip install '{text}'"
        try:
            there = version(name)
        except PackageNotFoundError:
            yield Finding(name="packages", state="missing", found=f"no {name}", mend=mend)
            continue
        if not satisfies(there, wanted):
            found = f"{name} {there}, wanted {name}{wanted}"
            yield Finding(name="packages", state="missing", found=found, mend=mend)
    python = ".".join(map(str, sys.version_info[:3]))
    yield Finding(name="python", state="ok", found=f"{python}, wall {version('wall')}")
    yield Finding(name="extras", state="ok", found=", ".join(f"{extra}: {said}" for extra, said in _extras()))


def _extras() -> Iterator[tuple[str, str]]:
    """What of OFFERED is installed, or what it is for."""
    for extra, what in OFFERED.items():
        wanted = [text.partition(";")[0] for text in requires("wall") or () if text.endswith(f'extra == "{extra}"')]
        names = [match[1] for match in map(_REQUIREMENT.match, wanted) if match is not None]
        try:
            yield extra, " ".join(f"{name} {version(name)}" for name in names)
        except PackageNotFoundError as error:
            yield extra, f"no {error.name}, which {what} (pip install 'wall[{extra}]')"


def satisfies(there: str, wanted: str) -> bool:
    """Whether a version is within bounds such as `>=2.9,<3`, as far as its numbers say."""
    number = _numbers(there)
    for sign, bound in _BOUND.findall(wanted):
        other = _numbers(bound)
        own = number[: len(other)] if sign == "==" else number
        good = {">=": own >= other, "==": own == other, "<": own < other}[sign]
        if not good:
            return False
    return True


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", text))


def cores(ranks: int) -> Iterator[Finding]:
    """Cores of this machine, against ranks; 0: not known."""
    own, there = len(os.sched_getaffinity(0)), os.cpu_count() or 1
    found = f"{own} that this process may use" + (f", for {ranks} ranks" if ranks else "")
    if under_mpi() and own < there:
        found += f", of {there}: mpirun may have bound it to some (--bind-to none)"
    mend = (
        "spread the ranks over several machines, or lower pixels, lights, refresh_hz (wall check says what to expect)"
    )
    yield Finding(name="cores", state="ok" if own >= ranks else "warning", found=found, mend=mend)


def open_files(ranks: int) -> Iterator[Finding]:
    """How many files, sockets among them, a process may have open."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES + FILES_A_RANK * ranks
    found = f"{soft} at once, the head needs about {wanted}"
    mend = f"ulimit -n {wanted}" if hard >= wanted else f"raise the limit, now {hard}, in /etc/security/limits.conf"
    yield Finding(name="open files", state="ok" if soft >= wanted else "missing", found=found, mend=mend)


def shared_memory(needed: int, folder: Path = SHARED) -> Iterator[Finding]:
    """Room for images between ranks of one machine, against `needed` bytes; without it they are sent."""
    about = os.statvfs(folder)
    free = about.f_bavail * about.f_frsize
    found = f"{free >> 20} MB free in {folder}"
    found += f", at most {needed >> 20} MB needed for images between ranks" if needed else ""
    mend = f"mount -o remount,size={(needed >> 20) + 64}M {folder} (docker run --shm-size); until then images are sent"
    yield Finding(name="shared memory", state="ok" if free >= needed else "warning", found=found, mend=mend)


def disk(out: Path) -> Iterator[Finding]:
    """The folder of results, and the one of compiled kernels."""
    kernels = cache_root()
    with suppress(RuntimeError):  # of a user without a home
        kernels = wanted_cache_root()
    for name, folder in (("results", out), ("compiled kernels", kernels)):
        there = folder.absolute()
        while not there.exists():
            there = there.parent
        free = shutil.disk_usage(there).free
        found = f"{folder}: {free >> 30} GB free"
        if not os.access(there, os.W_OK | os.X_OK):
            mend = f"give this user the right to write to {there}, or choose another folder"
            mend += f" (XDG_CACHE_HOME; until then {cache_root()})" * (folder is kernels)
            state: State = "missing" if folder is out else "warning"
            yield Finding(name=name, state=state, found=f"{folder}: cannot be written", mend=mend)
        else:
            yield Finding(name=name, state="ok" if free >= LEAST_DISK else "warning", found=found, mend="make room")


def mpi(*, needed: bool) -> Iterator[Finding]:
    """Whether mpirun is there and starts two ranks that find each other."""
    state: State = "missing" if needed else "warning"
    program = shutil.which("mpirun")
    mend = "source launch/setup.sh; setup local   (or the cluster's own MPI); runs on this machine alone need none"
    if program is None:
        yield Finding(name="mpi", state=state, found="no mpirun on the PATH", mend=mend)
        return
    command = [program, "--oversubscribe", "-n", "2", sys.executable, "-c", _MPI]
    found = _output(command, MPI_S, {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})
    works = found.splitlines().count("['here', 'here']") == 2
    said = "two ranks found each other" if works else f"two ranks did not find each other: {found[-300:]}"
    mend = f"see what this says: {program} --oversubscribe -n 2 hostname; mpi4py must be of the same MPI"
    yield Finding(name="mpi", state="ok" if works else state, found=f"{program}: {said}", mend=mend)


def gpu(*, needed: bool) -> Iterator[Finding]:
    """What OpenGL without a window is there; in a process of its own, since drivers may hang."""
    found = _output([sys.executable, "-c", _GPU], GPU_S, {})
    works = bool(found) and "Error" not in found
    if works or not needed:
        said = found if works else f"none ({_last(found)}); the CPU reconstructs"
        yield Finding(name="gpu", state="ok", found=said)
        return
    mend = "install the GPU's driver with EGL (Debian: libegl1 libgl1), or set reconstruction: auto"
    yield Finding(name="gpu", state="missing", found=_last(found), mend=mend)


def _last(text: str) -> str:
    return text.splitlines()[-1] if text else "it printed nothing"


def _output(command: list[str], limit_s: float, more: Mapping[str, str]) -> str:
    """What a program prints, within `limit_s`."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=limit_s, env={**os.environ, **more}, check=False
        )
    except subprocess.TimeoutExpired:
        return f"Error: no end within {limit_s:g} s"
    return (done.stdout + (done.stderr if done.returncode else "")).strip()
