"""Who is in the run, where, in which incarnation: what the manager keeps, and what each rank knows.

A rank says Hello until the membership that the manager broadcasts lists it. Membership is absolute and repeated, so a
lost or late copy does no harm; compositors and renderers connect to each other by it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TypeAlias

from wall.config.schema import TransportConfig
from wall.packets.control import Alive, Heartbeat, Hello, Membership
from wall.packets.notes import Note, note_of
from wall.roles.instructions import MANAGER, Broadcast, Connect, Died, Finish, Instruction, Send
from wall.roles.plan import HEAD

GATHER_S = 0.05  # ranks that join within so long are told of together
REPEAT_S = 2.0  # membership is said again
USUAL = 3.0  # times as long as usual a rank may take for something new before it is marked
PAUSE_S = 0.5  # the manager never waits so long by itself: what it did not listen to then is no silence
NOT_YET = "has not come yet"  # how a place is lost that is new
MOST_NOTES = 256  # that wait to be told; of more the newest
HEAD_LOST_S = 60.0  # without a message of the manager, at the least; then a rank ends itself
HEAD_LOST_BEATS = 3.0  # likewise, times lost_after_s
SignOfLife: TypeAlias = Heartbeat | Alive


def head_lost_s(transport: TransportConfig) -> float:
    """For how long the manager may say nothing; where its process has ended ranks end before."""
    return max(HEAD_LOST_S, HEAD_LOST_BEATS * transport.lost_after_s)


class Register:
    """The manager's list of ranks: which are in the run, which are lost, and which took the place of dead ones."""

    def __init__(self, size: int, now: float) -> None:
        self.members: dict[int, Hello] = {}
        self.lost: dict[int, str] = {}  # ranks that died or are silent: how
        self.silences: dict[int, float] = {}  # the longest that a rank was silent, beyond lost_after_s
        self.busy: dict[int, float] = {}  # the longest that the loop of one that lived was held up, seconds
        self.restarts: dict[int, list[str]] = {}  # by rank: how those died in whose place another came
        self.news: list[Note] = []  # to be told
        self._notes: deque[Note] = deque(maxlen=MOST_NOTES)  # for the head's process
        self._died: set[int] = set()  # of the lost ones: those whose process has ended
        self._size = size  # of the configuration
        self._promised: set[int] = set()  # places that were given away, and not taken up yet
        self._here: set[int] = set()  # ranks that have joined
        self._coming: set[int] = set()  # of those: those that were started again
        self._heard, self._began = dict.fromkeys(range(1, size), now), now  # by rank: when it gave a sign of life
        self._disconnected: dict[int, float] = {}  # by rank that is not heard of since: when its connection closed
        self._advanced: dict[int, float] = {}  # by rank: when it last had traced more, or nothing was to be traced
        self._usual_s: dict[int, float] = {}  # by rank: between its two newest advances
        self._stuck: set[int] = set()  # ranks that were told of, since that is long ago
        self._absent: dict[int, float] = {}  # ranks that are not heard of any more, or stuck: since when
        self._marked_s: dict[int, float] = {}  # by rank: for how long that was so before
        self._due = math.inf  # when the list is to be broadcast
        self._watched = now

    def give_away(self, rank: int) -> None:
        """Another process is to have the place of a lost rank, or a new one; until it says Hello that is nobody's."""
        self.lost.setdefault(rank, NOT_YET)
        self._died.add(rank)
        self._promised.add(rank)
        self._here.discard(rank)

    def leave(self, rank: int, now: float) -> None:
        """A rank that has joined has said that it ends."""
        if rank in self._here:
            self._here.discard(rank)
            del self._heard[rank]
            self.lost[rank] = f"left after {now - self._began:.1f} s"
            self._died.add(rank)
            self.news.append(note_of(rank, "warning", "leaves"))

    def disconnect(self, rank: int, now: float) -> None:
        """A rank's connection has closed: it is absent, until it says something that is newer."""
        self._disconnected[rank] = now

    def came(self, rank: int) -> bool:
        """Whether a rank is a process that has joined, and has not left."""
        return rank in self._here

    def promised(self, rank: int) -> bool:
        """Whether a place was given to a process that has not said Hello yet."""
        return rank in self._promised

    def died(self, rank: int) -> bool:
        """Whether nobody is to be expected in a place: its process has ended."""
        return rank in self._died

    def missed(self, heartbeats: Mapping[int, Heartbeat]) -> dict[int, str]:
        """Ranks of the configuration that are lost: how. Other threads may ask.

        One that was only silent is not, if its newest heartbeat says that it ended in order.
        """
        ended = {rank for rank, beat in heartbeats.items() if beat.last}
        lost = ((rank, how) for rank, how in self.lost.copy().items() if rank < self._size)
        return {rank: how for rank, how in lost if not (how.startswith("silent") and rank in ended)}

    def take(self, hello: Hello, now: float) -> bool:
        """Add a rank, or replace an earlier incarnation of it. Returns whether it takes the place of one that died."""
        before = self.members.get(hello.rank)
        returns = hello.rank in self._died and (before is None or hello.incarnation != before.incarnation)
        if returns:
            self._died.discard(hello.rank)
            self._coming.discard(hello.rank)
            how, self._heard[hello.rank] = self.lost.pop(hello.rank), now
            self._advanced.pop(hello.rank, None)
            self._disconnected.pop(hello.rank, None)
            if hello.rank < self._size:
                self.restarts.setdefault(hello.rank, []).append(how)
            if hello.rank in self._promised:
                self._promised.discard(hello.rank)
                self._here.add(hello.rank)
                self.news.append(note_of(hello.rank, "warning", f"a process on {hello.host} has joined as this rank"))
            else:
                self.news.append(note_of(hello.rank, "warning", f"{how} and was started again"))
        if before is None and hello.rank in self._absent:
            self._absent[hello.rank] = now  # its part was not marked before it was known
        if before is None:
            self.news.append(note_of(hello.rank, "info", f"takes part, on {hello.host}"))
        if before != hello:
            self.members[hello.rank] = hello
            self._due = min(self._due, now + GATHER_S)
        return returns

    def hear(self, sign: SignOfLife, before: Heartbeat | None, now: float) -> Heartbeat | None:
        """A rank gave a sign of life. Returns what it says by now; `before`: what it said before, if that is known."""
        self._heard[sign.rank] = now
        if sign.time > self._disconnected.get(sign.rank, -math.inf):  # what it said before may come after
            self._disconnected.pop(sign.rank, None)
        if isinstance(sign, Heartbeat):
            if before is None or not sign.works or sign.samples_traced != before.samples_traced:
                self._usual_s[sign.rank] = now - self._advanced.get(sign.rank, now)
                self._advanced[sign.rank] = now
            return sign
        self.busy[sign.rank] = max(self.busy.get(sign.rank, 0.0), sign.busy_s)
        return None if before is None else replace(before, time=max(before.time, sign.time), busy_s=sign.busy_s)

    def bury(self, death: Died, now: float) -> None:
        """A rank's process has ended; one that is started again is missed until it says Hello."""
        if death.rank not in self._died:
            self.news.append(note_of(death.rank, "info", f"died ({death.how})"))
            self.lost[death.rank] = f"died ({death.how}) after {now - self._began:.1f} s"
        if not death.again:
            self.news.append(note_of(death.rank, "warning", f"{self.lost[death.rank]}; it is not started again now"))
        self._died.add(death.rank)
        if death.again:
            self._heard[death.rank] = now  # until it is there again it is given as long as at the start
        self._coming = self._coming | {death.rank} if death.again else self._coming - {death.rank}

    def watch(self, now: float, transport: TransportConfig) -> None:
        """Notice ranks that fell silent, or speak again; after a pause of the manager their messages still wait."""
        pause, self._watched = now - self._watched, now
        if pause > PAUSE_S:
            for times in (self._heard, self._advanced):
                times.update({rank: min(time + pause, now) for rank, time in times.items()})
        late, marked_after_s = set[int](), transport.marked_after_s
        for rank, heard in self._heard.items():
            silence, stuck_s = now - heard, now - self._advanced.get(rank, heard)
            patience_s = USUAL * self._usual_s.get(rank, 0.0)  # batches may take longer than ranks may be silent
            stuck = stuck_s > max(transport.lost_after_s, marked_after_s, patience_s)
            if silence > marked_after_s or stuck or rank in self._disconnected:
                late.add(rank)
            self._tell_stuck(rank, stuck_s if stuck and silence <= marked_after_s else 0.0)
            if silence > transport.lost_after_s:
                self.silences[rank] = max(self.silences.get(rank, 0.0), silence)
                if rank not in self.lost:
                    self.lost[rank] = f"silent for {silence:.1f} s"
                    self.news.append(note_of(rank, "warning", self.lost[rank]))
            elif self.lost.get(rank, "").startswith("silent"):
                del self.lost[rank]  # it was only late
                self.news.append(note_of(rank, "warning", "is heard again"))
        self._see_absent(late | self.lost.keys(), now)

    def _tell_stuck(self, rank: int, stuck_s: float) -> None:
        """Tell of a rank that lives and has made nothing new for so long; 0: it is not so."""
        if stuck_s and rank not in self._stuck and rank not in self.lost:
            self._stuck.add(rank)
            self.news.append(note_of(rank, "warning", f"lives, but has made nothing new for {stuck_s:.1f} s"))
        elif not stuck_s:
            self._stuck.discard(rank)

    def _see_absent(self, absent: set[int], now: float) -> None:
        """Know who is not heard of; the membership tells it at once."""
        if absent == self._absent.keys():
            return
        self._due = now
        for rank in {rank for rank in self._absent.keys() - absent if rank < self._size}:
            self._marked_s[rank] = self._marked_s.get(rank, 0.0) + now - self._absent[rank]
        self._absent = {rank: self._absent.get(rank, now) for rank in sorted(absent)}

    def marked_s(self, now: float) -> dict[int, float]:
        """By rank: for how many seconds its part of the wall was marked, up to now. Other threads may ask."""
        absent = self._absent
        times = {rank: now - since for rank, since in absent.items() if rank in self.members and rank < self._size}
        return {k: self._marked_s.get(k, 0.0) + times.get(k, 0.0) for k in sorted({*self._marked_s, *times})}

    def silence(self, ranks: Iterable[int], now: float) -> float:
        """For how long none of these was heard of, seconds; infinite where all have died for good."""
        there = set(ranks) - (self._died - self._coming)
        return min((now - self._heard[rank] for rank in there), default=math.inf)

    def tell(self, said: str) -> Iterator[Note]:
        """Hand on what is to be told, and what is `said` of the run: to the head's process; yields what pages show."""
        news, self.news = self.news, []
        for note in [*news, note_of(HEAD, "warning", said)] if said else news:
            self._notes.append(note)
            if note.level != "info":
                yield note

    def take_notes(self) -> list[Note]:
        """What was told since this was asked last. Another thread may ask."""
        return [self._notes.popleft() for _ in range(len(self._notes))]

    def excused(self, rank: int) -> bool:
        """Whether nothing is to be expected of a rank."""
        return rank in self.lost and rank not in self._coming

    def on_tick(self, now: float) -> Iterator[Broadcast]:
        """Broadcast the membership if it changed or was not told for long."""
        if now >= self._due:
            self._due = now + REPEAT_S
            present = sorted(self.members.keys() - self._absent.keys())
            yield Broadcast(Membership(members=tuple(self.members[rank].without_page() for rank in present)))


class Standing:
    """A rank's side: it makes itself known, gives signs of life, connects, and notices that the manager is gone."""

    def __init__(self, hello: Hello, targets: Iterable[int], transport: TransportConfig) -> None:
        """`targets`: the ranks that this one sends packets to."""
        self._hello, self._targets, self._transport = hello, frozenset(targets), transport
        self.members: dict[int, Hello] = {}
        self._connected: dict[int, Hello] = {}  # with whom, as they were then
        self._connected_before: dict[int, Hello] = {}  # likewise: roles of this process before this one
        self._heard: float | None = None  # when the manager said something, or this rank began
        self._alone = False  # at the last tick it had said nothing for too long
        self._beat_due = -math.inf

    def succeed(self, before: Standing) -> None:
        """Another role of this process has connected to ranks: who begins anew since then lacks what that had sent."""
        self._connected_before = {**before._connected_before, **before._connected}

    def hear(self, now: float) -> None:
        """Something came from the manager."""
        self._heard = now

    def take(self, membership: Membership) -> Iterator[Connect]:
        """Connect to targets that are new, or that began anew and need all that they had once more."""
        self.members = {member.rank: member for member in membership.members}
        for rank in sorted(self._targets & self.members.keys()):
            member = self.members[rank]
            if self._connected.get(rank) != member:  # one that was only silent keeps its link
                known = self._connected.get(rank, self._connected_before.get(rank, member))
                self._connected[rank] = member
                yield Connect(rank, member.endpoint, anew=known != member)

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """End this rank where the manager has been silent for too long."""
        if self._heard is None:
            self._heard = now
        silence = now - self._heard
        alone, self._alone = self._alone, silence > head_lost_s(self._transport)
        if alone and self._alone:  # twice: after a pause of this rank its messages still wait to be taken in
            yield Finish(f"rank {self._hello.rank}: nothing from the head for {silence:.1f} s; giving up")

    def beat_due(self, now: float) -> bool:
        """Whether the manager should hear of this rank."""
        return now >= self._beat_due

    def beat(self, heartbeat: Heartbeat, now: float) -> Iterator[Send]:
        """Send a heartbeat, and a Hello as long as the manager does not list this rank."""
        self._beat_due = now + self._transport.heartbeat_s
        if self.members.get(self._hello.rank) != self._hello.without_page():
            yield Send(MANAGER, self._hello)
        yield Send(MANAGER, heartbeat)
