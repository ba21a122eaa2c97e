"""Byte credit, the same for every transport: both ends count bytes since the connection began, so nothing can drift.

The hub grants a limit (bytes consumed + window); a link sends while its total stays below it. Grants are absolute, so a
lost or repeated one does no harm. A link that has waited for long asks again and says how much it has sent: what was
under way then counts as consumed or lost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from wall.data import Counters
from wall.transport.base import QUEUED_PACKETS


class LinkCredit:
    """The link's side: what may be sent, and the few packets that wait."""

    def __init__(self, counters: Counters) -> None:
        self.sent = 0
        self._limit, self._window = 0, 0
        self._queue: deque[bytes] = deque()
        self._counters = counters

    def grant(self, limit: int, window: int) -> None:
        self._limit, self._window = max(limit, self._limit), window

    def allows(self, size: int) -> bool:
        """Whether `size` more bytes may go; a packet above the whole window may when nothing is under way."""
        idle = self._window > 0 and self.sent <= self._limit - self._window
        return self.sent + size <= self._limit or idle

    @property
    def ready(self) -> bool:
        return not self._queue and self._limit - self.sent > self._window // 4

    def offer(self, packet: bytes, send: Callable[[bytes], bool]) -> list[bytes]:
        """Queue a packet, send what credit allows, and give back what had to give way."""
        self._queue.append(packet)
        self.flush(send)
        dropped = []
        while len(self._queue) > QUEUED_PACKETS:
            dropped.append(self._queue.popleft())
        self._counters.add("no_credit", len(dropped))
        return dropped

    def flush(self, send: Callable[[bytes], bool]) -> None:
        while self._queue and self.allows(len(self._queue[0])) and send(self._queue[0]):
            self.sent += len(self._queue.popleft())

    @property
    def starved(self) -> bool:
        """Whether something waits, or nothing was ever granted."""
        return bool(self._queue) or self._limit - self.sent <= self._window // 4


class HubCredit:
    """The hub's side of one link."""

    def __init__(self, window: int, sent: int = 0) -> None:
        self._window, self._consumed, self._granted = window, sent, -1

    def consume(self, size: int) -> None:
        self._consumed += size

    def due(self) -> int | None:
        """The limit to grant, once it has moved by a quarter of the window; None if it is not worth a message yet."""
        limit = self._consumed + self._window
        if self._granted >= 0 and limit - self._granted < self._window // 4:
            return None
        self._granted = limit
        return limit
