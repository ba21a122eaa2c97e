"""A rank's ways to others: a link to the manager, a hub for those who send to it, links to those it sends to."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from wall.core.errors import LocalProtocolError, RemoteProtocolError, RunError
from wall.packets.control import (
    EditAnswer,
    EditRequest,
    Heartbeat,
    Hello,
    Membership,
    Message,
    Ping,
    Pong,
    Stop,
    maker_of,
    parse_control,
    serialise,
)  # fmt: skip
from wall.packets.joining import JoinRequest
from wall.packets.notes import Level, note_of
from wall.packets.samples import sender_of
from wall.roles.instructions import MANAGER, Disconnected, Input, Packet
from wall.roles.plan import HEAD
from wall.run.beater import Beater
from wall.run.clock import HeadClock
from wall.transport.base import FIRST_CLIENT, GUEST, MAX_CONTROL, PAGE, Hub, Link
from wall.transport.curve import Keys, is_key
from wall.transport.factory import connect
from wall.transport.probe import Probe

DRAIN_BYTES = 1 << 20  # taken in at once; more would delay a refresh
SYNCHRONISE_S = 30.0  # for the manager's first answer: its host may be slow to start
MAX_REASON = 1000  # characters of why an answer could not be sent
FORMER = 256  # links of ranks whose place others have: so many are remembered
REPLACED = "another process has taken the place of this rank"
FIRST_PING_S = 0.1  # between pings until one is answered
ASK_AFTER_S = 1.0  # without a word of the head: then it is asked whether it is there


class Ports:
    """Bytes to messages and back. Belongs to the thread of its loop; `clock` learns the head's time from `manager`."""

    def __init__(
        self, rank: int, clock: HeadClock, *, hub: Hub | None, manager: Link | None = None, ping_s: float | None = None,
        keys: Keys | None = None, heartbeat_s: float | None = None, asks: bool = True,
    ) -> None:  # fmt: skip
        """`manager`: None for the manager itself. `ping_s`: between pings, None where the head's clock is also ours.

        `keys`: for links to other ranks, see Keys. `heartbeat_s`: between signs of life that go on while the loop is
        held up; None: nobody waits for them. `asks`: whether the head is there, once it is silent; not where this
        process ends with its parent, which may put another head in its place.
        """
        self._rank, self._clock, self._hub, self._manager, self._ping_s = rank, clock, hub, manager, ping_s
        self._probe = Probe(manager.endpoint) if manager is not None and asks else None
        self._heard = time.monotonic()  # when the manager said something
        self._counters = Counter[str]()
        self._links: dict[int, Link] = {}
        self._peers: dict[int, bytes] = {}  # at the manager: which link is whose
        self._senders: dict[int, bytes] = {}  # of samples, by rank: its link
        self._makers: dict[int, bytes] = {}  # likewise, of framelets
        self._step_ranks: Sequence[int] | None = None  # by step: the rank that makes its framelets; None: not known
        self._incarnations: dict[int, int] = {}  # of ranks, as the manager says
        self._former: deque[bytes] = deque(maxlen=FORMER)  # links of processes that were ranks, and are not any more
        self._ping_due, self._keys = 0.0, keys
        self.answer_page: Callable[[EditAnswer], None] | None = None  # where the page is: of its viewers
        self.page_rank: int | None = None  # at the manager: another compositor that serves it
        self._beater: Beater | None = None
        if manager is not None and heartbeat_s is not None:
            self._beater = Beater(rank, manager, clock, heartbeat_s)
        self._backlog: deque[Message] = deque(maxlen=MAX_CONTROL)  # came before the head's time was known

    def synchronise(self) -> None:
        """Wait until the head's time is known. Raises RunError where nobody tells it."""
        if self._manager is None or self._ping_s is None:
            return
        limit = time.monotonic() + SYNCHRONISE_S
        while not self._clock.known:
            if time.monotonic() > limit:
                raise RunError(f"rank {self._rank}: no time from the head for {SYNCHRONISE_S:.0f} s; giving up")
            self._ping(self._manager, FIRST_PING_S)
            self._manager.wait(FIRST_PING_S)
            self._backlog.extend(self._of_manager(self._manager))

    def receive(self) -> Iterator[Input]:
        """What came, from the manager first. A packet's credit goes back when the next message is asked for.

        Raises RunError where the head's process has ended.
        """
        if self._manager is not None:
            if self._ping_s is not None:  # throughout: the clocks of two machines drift apart
                self._ping(self._manager, self._ping_s)
            while self._backlog:
                yield self._backlog.popleft()
            yield from self._of_manager(self._manager)
            self._check_head()
        if self._hub is not None:
            if self._manager is None and (gone := self._hub.disconnected()):
                ranks = [rank for rank, peer in self._peers.items() if peer in gone and rank < FIRST_CLIENT]
                yield from map(Disconnected, ranks)
            for peer, packet in self._hub.drain(DRAIN_BYTES):
                if self._is_of_its_rank(packet, peer, self._hub):
                    yield Packet(packet)
                self._hub.release(peer, len(packet))
            yield from self._of_ranks(self._hub)

    def expect(self, step_ranks: Sequence[int]) -> None:
        """From now on take framelets only from the ranks that make them, by step of the graph."""
        self._step_ranks = step_ranks
        self._makers.clear()  # who spoke under another graph

    def send(self, to: int, message: Message) -> None:
        """Send a message to the manager, or from it to a rank that has spoken."""
        if to == MANAGER and self._manager is not None:
            if self._beater is not None and isinstance(message, Heartbeat):
                self._beater.note(last=message.last)
            self._manager.send(serialise(message))
        elif to == PAGE and self.answer_page is not None:
            if isinstance(message, EditAnswer):
                self.answer_page(message)
        elif to == PAGE:
            if self._hub is not None and self.page_rank in self._peers:
                self._hub.send(self._peers[self.page_rank], self._answer(message))
        elif self._hub is not None and to in self._peers:
            if to < FIRST_CLIENT:
                self._hub.send(self._peers[to], serialise(message))
                return
            self._hub.send(self._peers.pop(to), self._answer(message))  # it asked once

    def broadcast(self, message: Message) -> None:
        """Send a message to every rank that has spoken."""
        if self._hub is not None:
            self._hub.broadcast(serialise(message))

    def offer(self, to: int, packet: bytes) -> list[bytes]:
        """Send a packet for credit. Returns those that gave way."""
        link = self._links.get(to)
        return link.offer(packet) if link is not None else [packet]

    def connect(self, rank: int, endpoint: str) -> None:
        """Open a link to a rank's hub, in place of an earlier one."""
        if (earlier := self._links.pop(rank, None)) is not None:
            earlier.close()
            self._counters += earlier.counters  # what was dropped stays counted
        self._links[rank] = connect(endpoint, rank=self._rank, keys=self._keys, to=rank)

    def admit(self, rank: int, key: str) -> None:
        """From now on a rank is who proves this key; the process that was it before is told to end."""
        self._part_with(self._peers.pop(rank, None))
        if key and self._hub is not None:
            self._hub.admit(rank, key)

    def _let_in(self, member: Hello) -> None:
        """Take connections of a rank by the key that it has by now."""
        if member.key and self._hub is not None:
            self._hub.admit(member.rank, member.key)

    def _part_with(self, peer: bytes | None) -> None:
        if peer is not None:
            self._former.append(peer)

    def ready(self, to: int) -> bool:
        """Whether a packet to a rank would be sent at once."""
        link = self._links.get(to)
        return link is not None and link.ready()

    def shares(self, to: int, size: int) -> bool:
        """Whether packets of so many bytes to a rank go through shared memory. Says once why they cannot."""
        link = self._links.get(to)
        if link is None or link.shares(size):
            return link is not None
        if link.note:
            self.note("warning", f"images for rank {to} are compressed and sent: {link.note}")
            link.note = ""
        return False

    def note(self, level: Level, text: str, replay: dict[str, int] | None = None) -> None:
        """Tell people something, by the manager: see Note."""
        self.send(MANAGER, note_of(self._rank, level, text, replay))

    def wait(self, seconds: float) -> None:
        """Sleep until something comes or the time is over. Without a hub: at one link alone, which has no credit."""
        if self._hub is not None:
            self._hub.wait(seconds, self._manager)
            return
        way = next((link for link in self._links.values() if not link.ready()), self._manager)
        assert way is not None
        way.wait(seconds)

    def drops(self) -> Counter[str]:
        """What was dropped on all ways, by name."""
        return sum((way.counters for way in self._ways()), Counter(self._counters))

    def credit(self) -> int:
        """Bytes that may be sent now over the link that has least left; -1: over none is anything sent."""
        return min((link.credit.left for link in self._links.values()), default=-1)

    def close(self) -> None:
        """Close all of them, within a bounded time each."""
        if self._beater is not None:
            self._beater.close()
        if self._probe is not None:
            self._probe.close()
        for way in self._ways():
            way.close()

    def _ways(self) -> list[Link | Hub]:
        """All that are open, in the order in which they are closed."""
        return [way for way in (*self._links.values(), self._manager, self._hub) if way is not None]

    def _ping(self, manager: Link, every: float) -> None:
        now = time.monotonic()
        if now >= self._ping_due:
            self._ping_due = now + every
            manager.send(serialise(Ping(sent=now)))

    def _check_head(self) -> None:
        """Silence is no end: the network may be cut, the head held up. Raises RunError where nobody listens there."""
        now = time.monotonic()
        if self._probe is not None and now - self._heard > ASK_AFTER_S and self._probe.refused(now):
            raise RunError(f"rank {self._rank}: the head has ended without a word")

    def _of_manager(self, manager: Link) -> Iterator[Message]:
        for data in manager.receive():
            self._heard = time.monotonic()
            message = self._parsed(data)
            if isinstance(message, Pong):
                self._clock.learn(message.sent, message.head_time)
            elif isinstance(message, Hello):  # of a process that comes soon
                self._let_in(message)
            elif isinstance(message, EditAnswer):
                if self.answer_page is not None:
                    self.answer_page(message)
            elif message is not None:
                if isinstance(message, Membership):
                    self._let_begin_anew(message)
                yield message

    def _let_begin_anew(self, membership: Membership) -> None:
        """Ranks that were started again, or whose place another process has taken, speak by other links."""
        for member in membership.members:
            if self._incarnations.get(member.rank, member.incarnation) != member.incarnation:
                for peers in (self._senders, self._makers):
                    self._part_with(peers.pop(member.rank, None))
            self._let_in(member)
            self._incarnations[member.rank] = member.incarnation

    def _of_ranks(self, hub: Hub) -> Iterator[Message]:
        """Control messages at our hub: the manager's business; elsewhere they are strays."""
        for peer, data in hub.messages():
            if self._manager is not None:
                self._counters["stray_message"] += 1
                continue
            message = self._parsed(data)
            if isinstance(message, Ping):
                hub.send(peer, serialise(Pong(sent=message.sent, head_time=self._clock.now())))
            elif message is not None:
                who = _sender(message)
                if who == PAGE and self.page_rank is not None and isinstance(message, EditRequest):
                    who = self.page_rank  # viewers ask through it
                if who is None or who == MANAGER:
                    ours = hub.proven(peer) in (None, HEAD)
                    self._counters["stranger"] += not ours
                else:
                    ours = self._is_bound(self._peers, who, peer, hub)
                if ours:
                    yield message

    def _is_of_its_rank(self, packet: bytes, peer: bytes, hub: Hub) -> bool:
        """Whether a packet came from the rank that it names: that has traced its samples, or makes its framelet."""
        peers, rank = self._senders, sender_of(packet)
        if rank is None and self._step_ranks is not None:
            peers, rank = self._makers, maker_of(packet, self._step_ranks)
        return rank is None or self._is_bound(peers, rank, peer, hub)

    def _is_bound(self, peers: dict[int, bytes], rank: int, peer: bytes, hub: Hub) -> bool:
        """Whether a rank, or a process beside the run, speaks by this link.

        With keys it is the one whose key that is. Without, a rank's is the first by which it spoke, as long as that is
        open.
        """
        if peer in self._former:
            self._counters["stranger"] += 1
            if self._manager is None:
                hub.send(peer, serialise(Stop(reason=REPLACED)))
            return False
        holder, known = hub.proven(peer), peers.get(rank)
        if holder is not None:
            ours = holder == (rank if rank < FIRST_CLIENT else GUEST)
        else:
            ours = rank >= FIRST_CLIENT or known in (None, peer) or not hub.knows(known)
        if rank >= PAGE:  # its viewers come by no link
            ours = False
        if ours:
            peers[rank] = peer
        else:
            self._counters["stranger"] += 1
        return ours

    def _answer(self, message: Message) -> bytes:
        """An answer to a process beside the run, or why it has none: what it asked for must not end the run."""
        try:
            return serialise(message)
        except LocalProtocolError as error:
            self._counters["answer_without_format"] += 1
            if not isinstance(message, EditAnswer):
                raise
            why = f"edit {message.edit} holds, but the answer cannot be sent: {error}"[:MAX_REASON]
            return serialise(replace(message, refused=why, parameters=[]))

    def _parsed(self, data: bytes) -> Message | None:
        try:
            message = parse_control(data)
            if isinstance(message, JoinRequest) and message.public and not is_key(message.public):
                raise RemoteProtocolError("a JoinRequest with a key that is none")
            return message
        except RemoteProtocolError:
            self._counters["bad_message"] += 1
            return None


def _sender(message: Message) -> int | None:
    """Where an answer goes: a rank, or the number of a process beside the run; None where nobody waits for one."""
    if isinstance(message, EditRequest | JoinRequest):
        return message.client if message.client >= FIRST_CLIENT else None
    return getattr(message, "rank", MANAGER)
