"""How the ranks of a run come into being and learn the manager's address; after that nothing differs.

Under `mpirun` the launcher has made the ranks, and MPI broadcasts the address once. Otherwise this process forks
the others, after it has loaded the scene and the kernels, so that they start at once and share that memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from wall.transport.curve import Keys


class Bootstrap(Protocol):
    """How one rank came into being."""

    rank: int
    size: int
    killed_soon: bool  # once the launcher has told this process to end
    keys: Keys | None  # None: what ranks send each other is not encrypted

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank. Called once by all, at the start."""
        ...

    def dead(self) -> dict[int, str]:
        """Ranks known to have ended badly, with how they ended; ranks that are not watched are left out."""
        ...

    def start_again(self, rank: int, text: str) -> bool:
        """Start a rank that is dead once more; it gets `text` as a broadcast. Returns whether that can be tried."""
        ...

    def finish(self, *, told: bool = True) -> None:
        """End what was started, within a bounded time; at once where nobody `told` it to end, if that can be."""
        ...


@contextmanager
def time_limit(seconds: float, give_up: Callable[[], None]) -> Iterator[None]:
    """Call `give_up` from another thread if the block has not ended within `seconds`, whether in order or not."""
    timer = threading.Timer(seconds, give_up)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
