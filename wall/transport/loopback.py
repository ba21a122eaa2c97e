"""In-process transport: queues instead of sockets, the same credit, deterministic order. For tests and single processes."""

from __future__ import annotations

import itertools
from collections import deque

from wall.data import Counters
from wall.transport.base import MAX_CONTROL, Hub, Link
from wall.transport.credit import HubCredit, LinkCredit


class LoopbackHub(Hub):
    """Links are made with `LoopbackLink(hub)`; all belong to one thread."""

    _numbers = itertools.count()

    def __init__(self, *, credit_bytes: int) -> None:
        self.counters = Counters()
        self.endpoint = f"loopback:{next(self._numbers)}"
        self.window = credit_bytes
        self.links: dict[bytes, LoopbackLink] = {}
        self.data: deque[tuple[bytes, bytes]] = deque()
        self.control: deque[tuple[bytes, bytes]] = deque(maxlen=MAX_CONTROL)
        self._credits: dict[bytes, HubCredit] = {}

    def welcome(self, link: LoopbackLink) -> bytes:
        peer = b"%d" % len(self.links)
        self.links[peer] = link
        self._credits[peer] = HubCredit(self.window)
        self._grant(peer)
        return peer

    def drain(self, max_bytes: int) -> list[tuple[bytes, bytes]]:
        taken, size = [], 0
        while self.data and size < max_bytes:
            taken.append(self.data.popleft())
            size += len(taken[-1][1])
        return taken

    def release(self, peer: bytes, size: int) -> None:
        if peer in self._credits:
            self._credits[peer].consume(size)
            self._grant(peer)

    def messages(self) -> list[tuple[bytes, bytes]]:
        messages = list(self.control)
        self.control.clear()
        return messages

    def send(self, peer: bytes, message: bytes) -> None:
        if peer in self.links:
            self.links[peer].inbox.append(message)
        else:
            self.counters.add("peer_gone")

    def broadcast(self, message: bytes) -> None:
        for peer in self.links:
            self.send(peer, message)

    def wait(self, seconds: float) -> None:
        """Nothing can come while the one thread waits."""

    def close(self) -> None:
        self.links.clear()
        self._credits.clear()

    def _grant(self, peer: bytes) -> None:
        limit = self._credits[peer].due()
        if limit is not None:
            self.links[peer].credit.grant(limit, self.window)


class LoopbackLink(Link):
    def __init__(self, hub: LoopbackHub) -> None:
        self.counters = Counters()
        self.credit = LinkCredit(self.counters)
        self.inbox: deque[bytes] = deque(maxlen=MAX_CONTROL)
        self._hub, self._peer = hub, hub.welcome(self)

    def offer(self, packet: bytes) -> list[bytes]:
        return self.credit.offer(packet, self._put)

    def ready(self) -> bool:
        self.credit.flush(self._put)
        return self.credit.ready

    def send(self, message: bytes) -> None:
        self._hub.control.append((self._peer, message))

    def receive(self) -> list[bytes]:
        self.credit.flush(self._put)
        messages = list(self.inbox)
        self.inbox.clear()
        return messages

    def wait(self, seconds: float) -> None:
        """Nothing can come while the one thread waits."""

    def close(self) -> None:
        self._hub.links.pop(self._peer, None)

    def _put(self, packet: bytes) -> bool:
        self._hub.data.append((self._peer, packet))
        return True
