"""Ranks as threads of this process, over the loopback transport: no sockets, no fork, easy to step through."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable

from wall.core.errors import RunError, WallError

START_WAIT_S = 30.0
STOP_WAIT_S = 2.0


class _Shared:
    """What the threads have in common: their texts, and who failed."""

    def __init__(self, size: int) -> None:
        self.texts = [""] * size
        self.barrier = threading.Barrier(size)
        self.failed: dict[int, str] = {}
        self.threads: list[threading.Thread] = []


class ThreadBootstrap:
    def __init__(self, rank: int, size: int, shared: _Shared) -> None:
        self.rank, self.size, self._shared = rank, size, shared

    @classmethod
    def start(cls, size: int, main: Callable[[ThreadBootstrap], None]) -> ThreadBootstrap:
        """Start ranks 1..size-1, each running `main`, and be rank 0."""
        shared = _Shared(size)
        for rank in range(1, size):
            thread = threading.Thread(
                target=_run, args=(cls(rank, size, shared), main), name=f"wall rank {rank}", daemon=True
            )
            shared.threads.append(thread)
            thread.start()
        return cls(0, size, shared)

    def allgather(self, text: str) -> list[str]:
        self._shared.texts[self.rank] = text
        try:
            self._shared.barrier.wait(START_WAIT_S)
        except threading.BrokenBarrierError as error:
            failed = "; ".join(f"rank {rank} {how}" for rank, how in self._shared.failed.items())
            raise RunError(f"ranks did not start: {failed or 'one is stuck'}") from error
        return list(self._shared.texts)

    def dead(self) -> dict[int, str]:
        return dict(self._shared.failed)

    def finish(self, code: int = 0) -> None:
        for thread in self._shared.threads:
            thread.join(STOP_WAIT_S)


def _run(bootstrap: ThreadBootstrap, main: Callable[[ThreadBootstrap], None]) -> None:
    shared = bootstrap._shared
    try:
        main(bootstrap)
    except WallError as error:
        shared.failed[bootstrap.rank] = str(error)
        print(f"rank {bootstrap.rank}: {error}", file=sys.stderr, flush=True)
    except Exception as error:
        shared.failed[bootstrap.rank] = repr(error)
        traceback.print_exc()
    if bootstrap.rank in shared.failed:
        shared.barrier.abort()
