"""The two ends of every connection: a Link (a rank) and a Hub (whom ranks talk to).

Data flows from link to hub and is paid for with credit: a link may have so many bytes under way, and gets them back
when the hub's owner has consumed a packet. So nothing queues up, and what is sent is the freshest there is. Control
messages are small, flow both ways and need no credit. Nothing here knows what the bytes mean.

Each end belongs to one thread; another one may send by a link, see `send_beside`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque

from wall.core.errors import LocalProtocolError
from wall.transport.credit import HubCredit, LinkCredit

MAX_CONTROL = 1024  # control messages that wait unread at one end
MAX_CONTROL_BYTES = 1 << 21  # of a control message to a hub, and of all that wait there of one peer
MAX_MESSAGE_BYTES = 1 << 24  # a larger message is not one of ours; anybody who connects may send one as large
FIRST_CLIENT = 1 << 32  # processes beside the run have numbers from here on, ranks below
PAGE = 1 << 33  # the page, whose viewers ask through who serves it; no process beside the run has a number from here
GUEST, NOBODY = -2, -3  # whose key a peer has: that of processes beside the run; not known any more


def checked(message: bytes) -> bytes:
    """The message itself. Raises LocalProtocolError where it is too large for any hub to take."""
    if len(message) > MAX_MESSAGE_BYTES:
        raise LocalProtocolError(f"a message of {len(message)} bytes; at most {MAX_MESSAGE_BYTES}")
    return message


class Inbox:
    """Control messages of one peer that wait; the oldest give way where they are too many or too large."""

    def __init__(self) -> None:
        self.messages: deque[bytes] = deque()
        self._bytes = 0

    def keep(self, message: bytes, counters: Counter[str]) -> None:
        """Let one more wait."""
        self.messages.append(message)
        self._bytes += len(message)
        while len(self.messages) > MAX_CONTROL or self._bytes > MAX_CONTROL_BYTES:
            self._bytes -= len(self.messages.popleft())
            counters["control_overflow"] += 1


class Link(ABC):
    """A rank's end. `counters` holds what was dropped: no_credit, control_overflow, ..."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint  # of the hub
        self.counters = Counter[str]()
        self.credit = LinkCredit(self.counters)
        self.note = ""  # why memory is not shared with a hub of the same machine, once that is known

    def offer(self, packet: bytes) -> list[bytes]:
        """Send a data packet, or let it wait for credit. Never blocks.

        Returns packets that gave way to it, oldest first, so that their samples can be traced again. Raises
        LocalProtocolError above MAX_MESSAGE_BYTES.
        """
        self._pump()
        return self.credit.offer(checked(packet), self._put_data)

    def ready(self) -> bool:
        """Whether a packet offered now would be sent at once, if it is no larger than the one before."""
        self._pump()
        return self.credit.ready

    @abstractmethod
    def shares(self, size: int) -> bool:
        """Whether a packet of so many bytes goes through memory that both ends have: it need not be compressed."""

    @abstractmethod
    def send(self, message: bytes) -> None:
        """Send a control message. Never blocks."""

    def send_beside(self, message: bytes) -> None:
        """Send a control message; another thread than the link's may do so, also while the link is closed."""
        self.send(message)

    @abstractmethod
    def receive(self) -> list[bytes]:
        """Control messages that have come, oldest first."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Sleep until something comes or the time is over."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything, within a bounded time. May be called twice."""

    @abstractmethod
    def _pump(self) -> None:
        """Take in what came, send what waits."""

    @abstractmethod
    def _put_data(self, packet: bytes) -> bool:
        """Send a packet whose credit is there. Returns whether there was room for it."""


class Hub(ABC):
    """The end that many links talk to. A peer is an opaque name of one link.

    Its owner takes data and control messages, also where only one kind is expected: `wait` does not sleep while one of
    them lies here.
    """

    endpoint: str  # where links connect to

    def __init__(self, *, credit_bytes: int) -> None:
        self.counters = Counter[str]()
        self._window = credit_bytes
        self._credits: dict[bytes, HubCredit] = {}  # by peer
        self._data: deque[tuple[bytes, bytes]] = deque()

    def drain(self, max_bytes: int) -> list[tuple[bytes, bytes]]:
        """Data packets that have come, (peer, packet), in turn between peers; about max_bytes at most."""
        self._pump(max_bytes)
        taken, size = [], 0
        while self._data and size < max_bytes:
            taken.append(self._data.popleft())
            size += len(taken[-1][1])
        return taken

    def release(self, peer: bytes, size: int) -> None:
        """A packet of `size` bytes has been consumed: its credit goes back."""
        if (credit := self._credits.get(peer)) is not None:
            credit.consume(size)
            self._grant(peer, credit)

    def knows(self, peer: bytes) -> bool:
        """Whether a peer has spoken and not left since."""
        return peer in self._credits

    def proven(self, peer: bytes) -> int | None:
        """The rank by whose key a peer speaks, GUEST or NOBODY; None where there are no keys."""
        return None

    def disconnected(self) -> set[bytes]:
        """Peers whose connections have closed since this was asked last; of threads of one process there are none."""
        return set()

    def admit(self, rank: int, key: str) -> None:
        """From now on take new connections of a rank by this key, and by no other; without keys by none."""
        return

    def broadcast(self, message: bytes) -> None:
        """Send a control message to everyone who has spoken."""
        for peer in list(self._credits):
            self.send(peer, message)

    @abstractmethod
    def messages(self) -> list[tuple[bytes, bytes]]:
        """Control messages that have come, (peer, message), oldest first."""

    @abstractmethod
    def send(self, peer: bytes, message: bytes) -> None:
        """Send a control message to one peer. Never blocks; a peer that is gone or full is counted."""

    @abstractmethod
    def wait(self, seconds: float, link: Link | None = None) -> None:
        """Sleep until something comes, here or at `link`, or the time is over."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything, within a bounded time. May be called twice."""

    @abstractmethod
    def _pump(self, max_bytes: int) -> None:
        """Take in what came, until about so many bytes of data lie here."""

    def _grant(self, peer: bytes, credit: HubCredit) -> None:
        limit = credit.due()
        if limit is not None:
            self._send_grant(peer, limit)

    @abstractmethod
    def _send_grant(self, peer: bytes, limit: int) -> None:
        """Tell a peer how many bytes it may have sent in all."""
