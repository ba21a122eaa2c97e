"""In-process transport: queues instead of sockets, the same credit. Ranks are threads, or take turns in one.

Each queue of control messages is guarded by the condition that wakes its reader; deque's append and popleft are atomic,
which is enough for data.
"""

from __future__ import annotations

import itertools
import threading
from collections import Counter, deque
from typing import TypeVar

from wall.transport.base import MAX_CONTROL, Hub, Link, checked
from wall.transport.credit import HubCredit

T = TypeVar("T")
_hubs: dict[str, LoopbackHub] = {}
_numbers = itertools.count()


class LoopbackHub(Hub):
    """Links find it by its endpoint, as with sockets."""

    def __init__(self, *, credit_bytes: int) -> None:
        super().__init__(credit_bytes=credit_bytes)
        self.endpoint = f"loopback:{next(_numbers)}"
        self.links: dict[bytes, LoopbackLink] = {}
        self.arrived: deque[tuple[bytes, bytes]] = deque()  # packets that links have put here
        self.control: deque[tuple[bytes, bytes]] = deque()
        self.something = threading.Condition()
        _hubs[self.endpoint] = self

    def welcome(self, link: LoopbackLink) -> bytes:
        """Connects a link, grants its first credit and returns its peer id."""
        peer = b"%d" % next(_numbers)
        self.links[peer], self._credits[peer] = link, HubCredit(self._window)
        self._grant(peer, self._credits[peer])
        return peer

    def leave(self, peer: bytes) -> None:
        """Disconnects a link; what it has sent is still here."""
        self.links.pop(peer, None)
        self._credits.pop(peer, None)

    def _pump(self, max_bytes: int) -> None:
        while self.arrived:
            peer, packet = self.arrived.popleft()
            if (credit := self._credits.get(peer)) is not None:
                credit.arrive(len(packet))
            self._data.append((peer, packet))

    def messages(self) -> list[tuple[bytes, bytes]]:
        """Takes all control messages that arrived, each with its peer."""
        return _take_all(self.control, self.something)

    def send(self, peer: bytes, message: bytes) -> None:
        """Sends a control message to one peer; counts it if the peer is gone."""
        link = self.links.get(peer)
        if link is None:
            self.counters["peer_gone"] += 1
            return
        _keep(link.inbox, checked(message), link.counters, link.something)

    def wait(self, seconds: float, link: Link | None = None) -> None:
        """Waits up to `seconds` for a packet or message; what comes at `link` meanwhile wakes nobody here."""
        if isinstance(link, LoopbackLink) and link.inbox:
            return
        with self.something:
            if not (self._data or self.arrived or self.control):
                self.something.wait(seconds)

    def close(self) -> None:
        """Disconnects all links and frees the endpoint."""
        self.links.clear()
        _hubs.pop(self.endpoint, None)

    def _send_grant(self, peer: bytes, limit: int) -> None:
        if (link := self.links.get(peer)) is not None:
            link.credit.grant(limit, self._window)
            _wake(link.something)


class LoopbackLink(Link):
    """Link to a hub in the same process; to one that is closed, it is never welcomed and has no credit."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint)
        self.inbox: deque[bytes] = deque()
        self.something = threading.Condition()
        self._hub = _hubs.get(endpoint)  # none: the other rank has ended before this one came so far
        self._peer = self._hub.welcome(self) if self._hub else b""

    def shares(self, size: int) -> bool:
        """Always: both ends are in one process."""
        return True

    def send(self, message: bytes) -> None:
        """Sends a control message to the hub; counts it if the hub is gone."""
        checked(message)
        if self._hub is None:
            self.counters["peer_gone"] += 1
            return
        _keep(self._hub.control, (self._peer, message), self._hub.counters, self._hub.something)

    def receive(self) -> list[bytes]:
        """Takes all control messages that arrived."""
        self._pump()
        return _take_all(self.inbox, self.something)

    def wait(self, seconds: float) -> None:
        """Waits up to `seconds` for a control message."""
        with self.something:
            if not self.inbox:
                self.something.wait(seconds)

    def close(self) -> None:
        """Disconnects from the hub."""
        if self._hub:
            self._hub.leave(self._peer)

    def _pump(self) -> None:
        self.credit.flush(self._put_data)

    def _put_data(self, packet: bytes) -> bool:
        assert self._hub is not None  # without one there is no credit, and nothing comes here
        self._hub.arrived.append((self._peer, packet))
        _wake(self._hub.something)
        return True


def _keep(queue: deque[T], item: T, counters: Counter[str], reader: threading.Condition) -> None:
    with reader:
        queue.append(item)
        if len(queue) > MAX_CONTROL:
            queue.popleft()
            counters["control_overflow"] += 1
        reader.notify()


def _take_all(queue: deque[T], reader: threading.Condition) -> list[T]:
    with reader:
        items = list(queue)
        queue.clear()
        return items


def _wake(condition: threading.Condition) -> None:
    with condition:
        condition.notify()
