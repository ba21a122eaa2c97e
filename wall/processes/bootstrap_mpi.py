"""Ranks that mpirun or srun made. The only file that imports mpi4py; no MPI call between start and end."""

from __future__ import annotations

from mpi4py import MPI


class MpiBootstrap:
    def __init__(self) -> None:
        self._world = MPI.COMM_WORLD
        self.rank: int = self._world.Get_rank()
        self.size: int = self._world.Get_size()

    def allgather(self, text: str) -> list[str]:
        return list(self._world.allgather(text))

    def gather(self, data: bytes) -> list[bytes] | None:
        """Every rank's bytes at rank 0, None elsewhere; for results at the end of `wall render`."""
        gathered = self._world.gather(data, root=0)
        return None if gathered is None else list(gathered)

    def dead(self) -> dict[int, str]:
        """The launcher watches its ranks; we see them go quiet by their heartbeats."""
        return {}

    def finish(self) -> None:
        """Leave without MPI_Finalize's barrier where a rank may be dead: the launcher reaps us."""
