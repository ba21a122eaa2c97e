"""Who is in the run, where, in which incarnation: what the manager keeps, and what each rank knows.

A rank says Hello until the membership that the manager broadcasts lists it. Membership is absolute and repeated, so a
lost or late copy does no harm; compositors and renderers connect to each other by it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from wall.config.schema import TransportConfig
from wall.packets.control import Heartbeat, Hello, Membership
from wall.roles.instructions import MANAGER, Broadcast, Connect, Finish, Instruction, Send

GATHER_S = 0.05  # ranks that join within so long are told of together
REPEAT_S = 2.0  # membership is said again
HEAD_LOST_BEATS = 3.0  # times lost_after_s without a message of the manager, then a rank ends itself


class Register:
    """The manager's list of members."""

    def __init__(self) -> None:
        self.members: dict[int, Hello] = {}
        self._absent: frozenset[int] = frozenset()  # members that are not heard of any more
        self._due = math.inf  # when it is to be broadcast

    def take(self, hello: Hello, now: float) -> None:
        """Add a rank, or replace an earlier incarnation of it."""
        if self.members.get(hello.rank) != hello:
            self.members[hello.rank] = hello
            self._due = min(self._due, now + GATHER_S)

    def on_tick(self, now: float, absent: Iterable[int]) -> Iterator[Broadcast]:
        """Broadcast the membership if it changed or was not told for long. `absent`: ranks that died or are silent."""
        if (absent := frozenset(absent)) != self._absent:
            self._absent, self._due = absent, now
        if now >= self._due:
            self._due = now + REPEAT_S
            present = sorted(self.members.keys() - absent)
            yield Broadcast(Membership(members=tuple(self.members[rank] for rank in present)))


class Standing:
    """A rank's side: it makes itself known, gives signs of life, connects, and notices that the manager is gone."""

    def __init__(self, hello: Hello, targets: Iterable[int], transport: TransportConfig) -> None:
        """`targets`: the ranks that this one sends packets to."""
        self._hello, self._targets, self._transport = hello, frozenset(targets), transport
        self.members: dict[int, Hello] = {}
        self._connected: dict[int, Hello] = {}
        self._heard: float | None = None  # when the manager said something, or this rank began
        self._beat_due = -math.inf

    def hear(self, now: float) -> None:
        """Something came from the manager."""
        self._heard = now

    def take(self, membership: Membership) -> Iterator[Connect]:
        """Connect to targets that are new, or that began anew."""
        self.members = {member.rank: member for member in membership.members}
        for rank in sorted(self._targets & self.members.keys()):
            member = self.members[rank]
            if self._connected.get(rank) != member:  # one that was only silent keeps its link
                self._connected[rank] = member
                yield Connect(rank, member.endpoint)

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """End this rank where the manager has been silent for too long."""
        if self._heard is None:
            self._heard = now
        silence = now - self._heard
        if silence > HEAD_LOST_BEATS * self._transport.lost_after_s:
            yield Finish(f"rank {self._hello.rank}: nothing from the head for {silence:.1f} s; giving up")

    def beat_due(self, now: float) -> bool:
        """Whether the manager should hear of this rank."""
        return now >= self._beat_due

    def beat(self, heartbeat: Heartbeat, now: float) -> Iterator[Send]:
        """Send a heartbeat, and a Hello as long as the manager does not list this rank."""
        self._beat_due = now + self._transport.heartbeat_s
        if self.members.get(self._hello.rank) != self._hello:
            yield Send(MANAGER, self._hello)
        yield Send(MANAGER, heartbeat)
