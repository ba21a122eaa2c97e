"""Whether an MPI launcher started this process, and as which rank: told by the environment, without MPI."""

from __future__ import annotations

import os

MPI_RANKS = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")
MPI_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK", "MPI_LOCALNRANKS")


def under_mpi() -> bool:
    """Whether an MPI launcher started this process."""
    return any(mark in os.environ for mark in MPI_MARKS)


def mpi_rank() -> int:
    """The rank that an MPI launcher gave this process, before MPI is loaded; 0 without one."""
    return next((int(os.environ[name]) for name in MPI_RANKS if os.environ.get(name, "").isdecimal()), 0)
