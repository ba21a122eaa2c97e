"""Signs of life of a rank whose loop is held up: a thread says that the process lives, and since when its loop is.

A batch, a refresh or a compiler may hold a loop for longer than a rank may be silent. Kernels give the interpreter's
lock back, so that this thread goes on. It does not where the process is frozen or has ended: then nobody hears of it.
"""

from __future__ import annotations

import threading
import time

from wall.core.clock import Clock
from wall.packets.control import Alive, serialise
from wall.transport.base import Link

LATE = 1.5  # heartbeats after the last one the loop is held up; a rank is never marked before two
END_S = 1.0  # for the thread to end: it waits for nothing but its link, which others hold for less


class Beater:
    """Begins with the first heartbeat of the loop. All but the thread's own function belongs to the loop's thread."""

    def __init__(self, rank: int, manager: Link, clock: Clock, heartbeat_s: float) -> None:
        """`heartbeat_s`: between two signs of life."""
        self._rank, self._manager, self._clock, self._heartbeat_s = rank, manager, clock, heartbeat_s
        self._spoke = 0.0  # when the loop did last, seconds of this machine's monotonic clock
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def note(self, *, last: bool) -> None:
        """The loop sends a heartbeat. `last`: there will be none after it, of nobody."""
        self._spoke = time.monotonic()
        if last:
            self.close()
        elif self._thread is None:
            self._thread = threading.Thread(target=self._run, name="beater", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread. May be called twice."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(END_S)

    def _run(self) -> None:
        spoke, frozen_s = self._spoke, 0.0  # since then: what this thread woke too late by
        due = spoke + LATE * self._heartbeat_s
        while not self._ended.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            if self._spoke != spoke:
                spoke, frozen_s = self._spoke, 0.0
            frozen_s += now - max(due, spoke)
            due = spoke + LATE * self._heartbeat_s
            if now >= due:
                busy_s = max(0.0, now - spoke - frozen_s)
                alive = Alive(rank=self._rank, time=self._clock.now(), busy_s=busy_s)
                self._manager.send_beside(serialise(alive))
                due = now + self._heartbeat_s
