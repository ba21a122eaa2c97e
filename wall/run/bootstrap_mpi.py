"""Ranks that mpirun or srun made. The only file that imports mpi4py; no MPI call between start and end."""

from __future__ import annotations

import os
import sys
import threading

from mpi4py import MPI

from wall.run.bootstrap import time_limit

START_WAIT_S = 120.0  # for all ranks to load the scene and, on a fresh machine, to compile
END_WAIT_S = 1.5  # for MPI_Finalize, which may wait for ranks that are dead


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

    def finish(self, code: int = 0) -> None:
        """Let MPI end in order, but leave with `code` where it waits for the dead."""
        timer = threading.Timer(END_WAIT_S, os._exit, [code])
        timer.daemon = True
        timer.start()

    def _give_up(self) -> None:
        text = f"rank {self.rank}: not all ranks have started after {START_WAIT_S:.0f} s; giving up"
        print(text, file=sys.stderr, flush=True)
        os._exit(1)
