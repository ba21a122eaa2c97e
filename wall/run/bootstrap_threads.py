"""Ranks as threads of this process, over the loopback transport: no sockets, no fork, easy to step through."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable

from wall.core.errors import RunError, WallError
from wall.transport.curve import Keys

START_WAIT_S = 30.0
STOP_WAIT_S = 6.0  # as in bootstrap_local


class _Shared:
    """What the threads share: the text of rank 0, and the ranks that failed."""

    def __init__(self) -> None:
        self.text = ""
        self.told = threading.Event()
        self.failed: dict[int, str] = {}
        self.threads: list[threading.Thread] = []


class ThreadBootstrap:
    """Rank 0 makes one of these by `start`; the others get theirs inside `main`."""

    killed_soon = False
    keys: Keys | None = None

    def __init__(self, rank: int, size: int, shared: _Shared) -> None:
        self.rank, self.size, self._shared = rank, size, shared

    @classmethod
    def start(cls, size: int, main: Callable[[ThreadBootstrap], None]) -> ThreadBootstrap:
        """Start ranks 1..size-1, each running `main`, and be rank 0."""
        shared = _Shared()
        for rank in range(1, size):
            thread = threading.Thread(
                target=_run, args=(cls(rank, size, shared), main), name=f"wall rank {rank}", daemon=True
            )
            shared.threads.append(thread)
            thread.start()
        return cls(0, size, shared)

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank."""
        if self.rank == 0:
            self._shared.text = text
            self._shared.told.set()
        elif not self._shared.told.wait(START_WAIT_S):
            raise RunError(f"rank 0 did not start: it said nothing for {START_WAIT_S:.0f} s")
        return self._shared.text

    def dead(self) -> dict[int, str]:
        """Ranks that have failed: how."""
        return dict(self._shared.failed)

    def start_again(self, rank: int, text: str) -> bool:
        """A thread that failed would fail again."""
        return False

    def finish(self, *, told: bool = True) -> None:
        """Wait for the threads to end."""
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
