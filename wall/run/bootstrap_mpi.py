"""Ranks that mpirun or srun made. The only file that imports mpi4py; no MPI call between start and end."""

from __future__ import annotations

import atexit
import faulthandler
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mpi4py import MPI

from wall.core.errors import WallError
from wall.core.system import end_with_parent
from wall.run.bootstrap import time_limit
from wall.transport.curve import KeyPair, Keys

START_WAIT_S = 600.0  # for all ranks to load the scene and, on a fresh machine, to compile
SLOW_START_S = 20.0  # after which it is said what is being waited for
SEGMENTS = "/dev/shm/sm_segment."  # Open MPI's files of shared memory, one a process
PART = 1 << 24  # bytes of a file that other hosts are sent
REFUSE_WAIT_S = 2.0  # for all ranks to refuse what one refuses
END_WAIT_S = 5.0  # for MPI_Finalize, which waits for the head's results, and for ever for some dead ranks


class MpiBootstrap:
    """The processes of one MPI launch."""

    killed_soon = True

    keys: Keys | None = None

    def __init__(self) -> None:
        self._world = MPI.COMM_WORLD
        self.rank: int = self._world.Get_rank()
        self.size: int = self._world.Get_size()
        self._launcher = os.getppid()
        self._ending: MPI.Comm = self._world.Dup()  # on which no rank waits for anything else
        self._begun = False
        end_with_parent(signal.SIGTERM)  # or ranks would outlive an mpirun that was killed

    def allgather(self, text: str) -> list[str]:
        """Every rank's text, in rank order. MPI has no time limits of its own, so this one ends the process."""
        with time_limit(START_WAIT_S, self._give_up), time_limit(SLOW_START_S, self._say_slow):
            return list(self._world.allgather(text))

    def make_keys(self) -> None:
        """Have keys from now on, and those of the others; secret ones never leave their process."""
        own = KeyPair.new()
        self.keys = Keys(own, tuple(self.allgather(own.public)))

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank, once all are ready: a rank that still compiles is not silent."""
        told = self.allgather(text)[0]
        self._begun = True
        return told

    def shared(self, data: bytes | None) -> Iterator[bytes]:
        """Rank 0's bytes at every rank, part after part; the others have None."""
        with time_limit(START_WAIT_S, self._give_up):
            size: int = self._world.bcast(0 if data is None else len(data), root=0)
            for at in range(0, size, PART):
                part: bytes = self._world.bcast(None if data is None else data[at : at + PART], root=0)
                yield part

    def gather(self, data: bytes) -> list[bytes] | None:
        """Every rank's bytes at rank 0, None elsewhere; for results at the end of `wall render`."""
        received = self._world.gather(data, root=0)
        return None if received is None else list(received)

    def dead(self) -> dict[int, str]:
        """The launcher watches its ranks; we see them go quiet by their heartbeats."""
        return {}

    def start_again(self, rank: int, text: str) -> bool:
        """MPI has no way to put a process in another's place."""
        return False

    def finish(self, *, told: bool = True) -> None:
        """At the exit of this process let MPI end in order, or leave with exit code 1 where it waits for the dead."""
        atexit.unregister(_finalize)  # asked for twice it is done once
        atexit.register(_finalize, self._launcher)

    def refuse(self) -> None:
        """At the exit of this process end all ranks, unless all of them refuse: those of a run that has not begun wait
        for each other."""
        if not self._begun:
            atexit.register(_end_all, self._ending)

    @contextmanager
    def failing_alone(self) -> Iterator[None]:
        """While inside, what goes wrong ends this rank and no other one: by a signal, which a launcher with ULFM does
        not end the others for, as it does for an exit code."""
        try:
            yield
        except Exception as error:
            if not isinstance(error, WallError):
                traceback.print_exc()
            print(f"rank {self.rank} on {socket.gethostname()}: {error}", file=sys.stderr, flush=True)
            remove_segments()
            os.kill(os.getpid(), signal.SIGKILL)

    def _say_slow(self) -> None:
        if self.rank == 0:
            text = "waiting for the other ranks: a host compiles kernels at its first start, for one to three minutes"
            print(text, file=sys.stderr, flush=True)

    def _give_up(self) -> None:
        text = f"rank {self.rank}: not all ranks have started after {START_WAIT_S:.0f} s; giving up"
        print(text, file=sys.stderr, flush=True)
        os._exit(1)


def _end_all(ending: MPI.Comm) -> None:
    """End all ranks with exit code 2, if they have not all come here within REFUSE_WAIT_S."""
    there, limit = ending.Ibarrier(), time.monotonic() + REFUSE_WAIT_S
    while not there.Test():
        if time.monotonic() > limit:
            sys.stdout.flush()
            sys.stderr.flush()
            remove_segments()
            ending.Abort(2)
        time.sleep(0.01)


def _finalize(launcher: int) -> None:
    """End MPI within END_WAIT_S. MPI_Finalize keeps the GIL; faulthandler's thread, which needs none, can end it.

    `launcher`: the process that started this one. Without it MPI_Finalize never ends.
    """
    if os.getppid() != launcher:  # nor does anybody read what this process prints
        remove_segments()
        os._exit(1)
    sys.stdout.flush()
    sys.stderr.flush()
    with open(os.devnull, "w") as nowhere:  # faulthandler wants to write where every thread stands
        faulthandler.dump_traceback_later(END_WAIT_S, exit=True, file=nowhere)
        MPI.Finalize()
        faulthandler.cancel_dump_traceback_later()


def remove_segments() -> None:
    """Remove the files of shared memory that Open MPI has made for this process, as MPI_Finalize would."""
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
        paths = {line.split(maxsplit=5)[-1].strip() for line in maps if SEGMENTS in line}
    for path in paths:
        Path(path).unlink(missing_ok=True)
