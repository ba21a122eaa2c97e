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
from wall.transport.credit import HubCredit, LinkCredit

T = TypeVar("T")
_hubs: dict[str, LoopbackHub] = {}
_numbers = itertools.count()


class LoopbackHub(Hub):
    """Links find it by its endpoint, as with sockets."""

    def __init__(self, *, credit_bytes: int) -> None:
        self.counters = Counter[str]()
        self.endpoint = f"loopback:{next(_numbers)}"
        self.window = credit_bytes
        self.links: dict[bytes, LoopbackLink] = {}
        self.data: deque[tuple[bytes, bytes]] = deque()
        self.control: deque[tuple[bytes, bytes]] = deque()
        self.something = threading.Condition()
        self._credits: dict[bytes, HubCredit] = {}
        _hubs[self.endpoint] = self

    def welcome(self, link: LoopbackLink) -> bytes:
        """Connects a link, grants its first credit and returns its peer id."""
        peer = b"%d" % next(_numbers)
        self._credits[peer] = HubCredit(self.window)
        self.links[peer] = link
        self._grant(peer)
        return peer

    def drain(self, max_bytes: int) -> list[tuple[bytes, bytes]]:
        """Takes packets of up to `max_bytes` in all (the last may exceed it), each with its peer."""
        taken, size = [], 0
        while self.data and size < max_bytes:
            peer, packet = self.data.popleft()
            self._credits[peer].arrive(len(packet))
            taken.append((peer, packet))
            size += len(packet)
        return taken

    def release(self, peer: bytes, size: int) -> None:
        """Returns the credit of `size` processed bytes to a peer."""
        if peer in self.links:
            self._credits[peer].consume(size)
            self._grant(peer)

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

    def broadcast(self, message: bytes) -> None:
        """Sends a control message to every peer."""
        for peer in list(self.links):
            self.send(peer, message)

    def wait(self, seconds: float) -> None:
        """Waits up to `seconds` for a packet or message."""
        with self.something:
            if not (self.data or self.control):
                self.something.wait(seconds)

    def close(self) -> None:
        """Disconnects all links and frees the endpoint."""
        self.links.clear()
        _hubs.pop(self.endpoint, None)

    def _grant(self, peer: bytes) -> None:
        limit = self._credits[peer].due()
        link = self.links.get(peer)
        if limit is not None and link is not None:
            link.credit.grant(limit, self.window)
            _wake(link.something)


class LoopbackLink(Link):
    """Link to a hub in the same process."""

    def __init__(self, endpoint: str) -> None:
        self.counters = Counter[str]()
        self.credit = LinkCredit(self.counters)
        self.inbox: deque[bytes] = deque()
        self.something = threading.Condition()
        self._hub = _hubs[endpoint]
        self._peer = self._hub.welcome(self)

    def offer(self, packet: bytes) -> list[bytes]:
        """Sends a packet or queues it; returns the packets dropped for it."""
        return self.credit.offer(packet, self._put)

    def ready(self) -> bool:
        """True if the credit allows another packet."""
        self.credit.flush(self._put)
        return self.credit.ready

    def send(self, message: bytes) -> None:
        """Sends a control message to the hub."""
        _keep(self._hub.control, (self._peer, checked(message)), self._hub.counters, self._hub.something)

    def receive(self) -> list[bytes]:
        """Takes all control messages that arrived."""
        self.credit.flush(self._put)
        return _take_all(self.inbox, self.something)

    def wait(self, seconds: float) -> None:
        """Waits up to `seconds` for a control message."""
        with self.something:
            if not self.inbox:
                self.something.wait(seconds)

    def close(self) -> None:
        """Disconnects from the hub."""
        self._hub.links.pop(self._peer, None)

    def _put(self, packet: bytes) -> bool:
        self._hub.data.append((self._peer, packet))
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
