"""Byte credit, the same for every transport: both ends count bytes since the connection began, so nothing can drift.

The hub grants a limit (bytes consumed + window); a link sends while its total stays below it. Grants are absolute, so a
lost or repeated one does no harm. A link that has waited for long asks again and says how much it has sent: since
messages keep their order, what then neither waits at the hub nor was consumed is lost, and paid back.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

QUEUED_PACKETS = 2  # that wait at a link for credit; the oldest gives way to a newer one


class LinkCredit:
    """The link's side: what may be sent, and the few packets that wait."""

    def __init__(self, counters: Counter[str]) -> None:
        self.sent = 0
        self._limit, self._last_size = 0, 1
        self.window = 0  # bytes that may be under way; 0 before the first grant
        self._queue: deque[bytes] = deque()
        self._counters = counters

    def grant(self, limit: int, window: int) -> None:
        """Takes the hub's grant: bytes allowed in all since the start, and the window, in bytes."""
        self._limit, self.window = max(limit, self._limit), window

    def allows(self, size: int) -> bool:
        """Whether `size` more bytes may go; a packet above the whole window may when nothing is under way."""
        idle = self.window > 0 and self.sent <= self._limit - self.window
        return self.sent + size <= self._limit or idle

    @property
    def left(self) -> int:
        """Bytes that may be sent now."""
        return max(0, self._limit - self.sent)

    @property
    def ready(self) -> bool:
        """Whether a packet as large as the last one would be sent at once."""
        return not self._queue and self.allows(self._last_size)

    def offer(self, packet: bytes, send: Callable[[bytes], bool]) -> list[bytes]:
        """Queue a packet, send what credit allows, and give back what had to give way."""
        self._queue.append(packet)
        self._last_size = max(len(packet), 1)
        self.flush(send)
        dropped = []
        while len(self._queue) > QUEUED_PACKETS:
            dropped.append(self._queue.popleft())
            self._counters["no_credit"] += 1
        return dropped

    def flush(self, send: Callable[[bytes], bool]) -> None:
        """Sends queued packets as far as the credit allows."""
        while self._queue and self.allows(len(self._queue[0])) and send(self._queue[0]):
            self.sent += len(self._queue.popleft())


class HubCredit:
    """The hub's side of one link."""

    def __init__(self, window: int) -> None:
        self._window, self._consumed, self._held, self._granted = window, 0, 0, -1

    def arrive(self, size: int) -> bool:
        """Whether a packet that came is within what was granted, and will be consumed."""
        if self._held and self._held + size > self._window:
            return False
        self._held += size
        return True

    def consume(self, size: int) -> None:
        """Counts `size` bytes as processed, which frees their credit."""
        size = min(size, self._held)  # what came before a reconnection was settled by resume()
        self._held -= size
        self._consumed += size

    def resume(self, sent: int) -> None:
        """The link has sent so many bytes in all, and waits: what does not lie here is no longer under way."""
        self._consumed, self._granted = max(sent - self._held, 0), -1

    def due(self) -> int | None:
        """The limit to grant; None while it stands, or moved by less than a quarter of the window with more to come."""
        limit = self._consumed + self._window
        moved = limit - self._granted
        if self._granted >= 0 and (moved <= 0 or (self._held and moved < self._window // 4)):
            return None
        self._granted = limit
        return limit
