"""Ranks that mpirun or srun made. The only file that imports mpi4py; no MPI call between start and end."""

from __future__ import annotations

import atexit
import faulthandler
import os
import sys

from mpi4py import MPI

from wall.run.bootstrap import time_limit

START_WAIT_S = 120.0  # for all ranks to load the scene and, on a fresh machine, to compile
END_WAIT_S = 5.0  # for MPI_Finalize, which waits for the head's results, and for ever for some dead ranks


class MpiBootstrap:
    """The processes of one MPI launch."""

    def __init__(self) -> None:
        self._world = MPI.COMM_WORLD
        self.rank: int = self._world.Get_rank()
        self.size: int = self._world.Get_size()

    def allgather(self, text: str) -> list[str]:
        """Every rank's text, in rank order. MPI has no time limits of its own, so this one ends the process."""
        with time_limit(START_WAIT_S, self._give_up):
            return list(self._world.allgather(text))

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank, once all are ready: a rank that still compiles is not silent."""
        return self.allgather(text)[0]

    def gather(self, data: bytes) -> list[bytes] | None:
        """Every rank's bytes at rank 0, None elsewhere; for results at the end of `wall render`."""
        received = self._world.gather(data, root=0)
        return None if received is None else list(received)

    def dead(self) -> dict[int, str]:
        """The launcher watches its ranks; we see them go quiet by their heartbeats."""
        return {}

    def start_again(self, rank: int) -> bool:
        """MPI has no way to put a process in another's place."""
        return False

    def finish(self) -> None:
        """At the exit of this process let MPI end in order, or leave with exit code 1 where it waits for the dead."""
        atexit.register(_finalize)

    def _give_up(self) -> None:
        text = f"rank {self.rank}: not all ranks have started after {START_WAIT_S:.0f} s; giving up"
        print(text, file=sys.stderr, flush=True)
        os._exit(1)


def _finalize() -> None:
    """End MPI within END_WAIT_S. MPI_Finalize keeps the GIL; faulthandler's thread, which needs none, can end it."""
    sys.stdout.flush()
    sys.stderr.flush()
    with open(os.devnull, "w") as nowhere:  # faulthandler wants to write where every thread stands
        faulthandler.dump_traceback_later(END_WAIT_S, exit=True, file=nowhere)
        MPI.Finalize()
        faulthandler.cancel_dump_traceback_later()
