"""The two ends of every connection: a Link (a rank) and a Hub (whom ranks talk to).

Data flows from link to hub and is paid for with credit: a link may have so many bytes under way, and gets them back
when the hub's owner has consumed a packet. So nothing queues up, and what is sent is the freshest there is. Control
messages are small, flow both ways and need no credit. Nothing here knows what the bytes mean.

Each end belongs to one thread.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter

from wall.core.errors import LocalProtocolError

QUEUED_PACKETS = 2  # that wait at a link for credit; the oldest gives way to a newer one
MAX_CONTROL = 1024  # control messages that wait unread at one end
MAX_MESSAGE_BYTES = 1 << 26  # a larger message is not one of ours


def checked(message: bytes) -> bytes:
    """The message itself. Raises LocalProtocolError where it is too large for any hub to take."""
    if len(message) > MAX_MESSAGE_BYTES:
        raise LocalProtocolError(f"a message of {len(message)} bytes; at most {MAX_MESSAGE_BYTES}")
    return message


class Link(ABC):
    """A rank's end. `counters` holds what was dropped: no_credit, control_overflow, ..."""

    counters: Counter[str]

    @abstractmethod
    def offer(self, packet: bytes) -> list[bytes]:
        """Send a data packet, or let it wait for credit. Never blocks.

        Returns packets that gave way to it, oldest first, so that their samples can be traced again. Raises
        LocalProtocolError above MAX_MESSAGE_BYTES.
        """

    @abstractmethod
    def ready(self) -> bool:
        """Whether a packet offered now would be sent at once, if it is no larger than the one before."""

    @abstractmethod
    def send(self, message: bytes) -> None:
        """Send a control message. Never blocks."""

    @abstractmethod
    def receive(self) -> list[bytes]:
        """Control messages that have come, oldest first."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Sleep until something comes or the time is over."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything, within a bounded time. May be called twice."""


class Hub(ABC):
    """The end that many links talk to. A peer is an opaque name of one link.

    Its owner takes data and control messages, also where only one kind is expected: `wait` does not sleep while one of
    them lies here.
    """

    counters: Counter[str]
    endpoint: str  # where links connect to

    @abstractmethod
    def drain(self, max_bytes: int) -> list[tuple[bytes, bytes]]:
        """Data packets that have come, (peer, packet), in turn between peers; about max_bytes at most."""

    @abstractmethod
    def release(self, peer: bytes, size: int) -> None:
        """A packet of `size` bytes has been consumed: its credit goes back."""

    @abstractmethod
    def messages(self) -> list[tuple[bytes, bytes]]:
        """Control messages that have come, (peer, message), oldest first."""

    @abstractmethod
    def send(self, peer: bytes, message: bytes) -> None:
        """Send a control message to one peer. Never blocks; a peer that is gone or full is counted."""

    @abstractmethod
    def broadcast(self, message: bytes) -> None:
        """Send a control message to everyone who has spoken."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Sleep until something comes or the time is over."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything, within a bounded time. May be called twice."""
