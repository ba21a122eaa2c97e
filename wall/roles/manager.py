"""What the manager decides: it numbers events, tells everyone, hears how they are, and ends the run.

A run ends in steps, each of them bounded in time: the view is held until it has all its samples; everyone but the
head's compositor stops and sends its last heartbeat; then the head's compositor shows what came.
"""

from __future__ import annotations

import enum
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from wall.core.data import Event
from wall.core.errors import EditError, RemoteProtocolError
from wall.display.window import ALL_CLOSED
from wall.geometry.steering import parse
from wall.packets.control import EditRequest, Heartbeat, Hello, Prepared, Selection, Statistics, Stop, WindowInput
from wall.packets.joining import JoinRequest, Leave
from wall.packets.notes import REFUSED, Note, note_of
from wall.roles.balance import Balancer
from wall.roles.commands import Commands, commands_of
from wall.roles.director import Director
from wall.roles.edges import summed_number
from wall.roles.editing import Editor
from wall.roles.instructions import (
    Broadcast,
    Changed,
    Died,
    Disconnected,
    End,
    Finish,
    Input,
    Instruction,
    Invitation,
    Packet,
    PlanMade,
    Send,
    TrackerPacket,
    TrackerStrangers,
)
from wall.roles.joining import Joining, grown
from wall.roles.membership import Register, SignOfLife
from wall.roles.plan import HEAD, Plan, window_ranks
from wall.roles.reloading import Asked, Reloading
from wall.roles.updates import EditsTaken

NO_RENDERER = "no renderer is left"
EVENTS_A_REFRESH = 2  # frameless samples gain from inputs between refreshes; more only costs updates
SETTLED_S = 0.4  # a complete image that has not changed for this long is final
BEATS_APART = 0.9  # of heartbeat_s: what comes between two heartbeats is news for the manager, and not for the table
REPEAT_S = 0.5  # events are said again, at the latest
HOLD_S = 0.5  # at the end the last view is held for so long at most, to get all its samples
BYE_WAIT_S = 0.8  # for the ranks' last heartbeats
LAST_S = 3.0  # for that of the head's compositor


class Phase(enum.Enum):
    """How far the end of a run has come."""

    RUNNING = enum.auto()
    HOLDING = enum.auto()  # the view stands still
    STOPPING = enum.auto()  # everyone but the head's compositor was told to stop
    LAST = enum.auto()  # so was that


class Manager:
    """A role: events to everyone, signs of life and inputs from everyone."""

    def __init__(
        self, plan: Plan, now: float, *, still: bool, seconds: float | None = None, until_complete: bool = False,
        key: str = "", fixed: str = "",
    ) -> None:  # fmt: skip
        """`still`: begin paused; `seconds`: when the run ends; `until_complete`: or when all is traced and shown.

        `key`: see Editor; `fixed`: see Reloading.
        """
        layout = plan.layout
        self.due = now
        self.heartbeats: dict[int, Heartbeat] = {}  # the newest of each rank
        self._told_due: dict[int, float] = {}  # by rank: from then on reporters are told of the next one
        self.escape = ""  # where Escape was pressed
        self.page_server: Hello | None = None  # another compositor that serves the page
        self.ended = ""  # why the run ends, once it does
        self.counters, self.configurations = Counter[str](), 1  # that the run has had
        self._seconds, self._until_complete = seconds, until_complete
        self.directors: list[Director] = []
        self.reloading = Reloading(plan, fixed=fixed)
        self.register, self.joining = Register(layout.size, now), Joining(fixed)
        self.editor, self._edited = Editor(plan, key=key), False  # whether an event is to tell of it
        self._closed: frozenset[int] = frozenset()  # ranks that have no window left
        self.taken, self.commands = EditsTaken(), Commands()
        self._update_due, self._repeat_due = now, now
        self._input_due = now  # when what comes in is told of at once again
        self._released = (-1, -1)  # in lock step: the newest event whose frame everybody is done with
        self._phase, self._limit, self.began = Phase.RUNNING, math.inf, now
        self._complete_since: float | None = None
        self._take(plan, now)
        if still:
            for director in self.directors:
                director.pause()

    def _take(self, plan: Plan, now: float) -> None:
        """Be the manager of this plan."""
        self.balancer: Balancer | None = None
        self._grow(plan)
        before, first = {director.name: director for director in self.directors}, next(iter(self.directors), None)
        self.directors = []
        for number, view in enumerate(plan.views):
            self.directors.append(Director(plan, now, number, self.directors, before.get(view.id, first)))
        self._window_ranks, self._reporters = window_ranks(plan.layout), frozenset({HEAD, plan.layout.graph.page_rank})
        if plan.layout.strips is not None:
            self.balancer = Balancer(self._layout, now)
        self._tick_s = 1.0 / (max(view.refresh_hz for view in plan.views) * EVENTS_A_REFRESH)

    def _grow(self, plan: Plan) -> None:
        """Know of places beyond the configuration's."""
        self._layout = grown(plan.layout, self.joining.extra)
        self.plan = plan if self._layout is plan.layout else replace(plan, layout=self._layout)
        self.reloading.grow(self.plan)
        if self.balancer is not None:
            self.balancer.grow(self._layout)

    def _adopt(self, plan: Plan, now: float) -> Iterator[Instruction]:
        """Go on with another plan, which all ranks have adopted."""
        self.counters = self.dropped() - self.editor.counters
        self.heartbeats = {rank: beat for rank, beat in self.heartbeats.items() if beat.configuration == plan.number}
        self.configurations += 1
        self.commands, self._complete_since, self._released = Commands(), None, (-1, -1)
        self._take(replace(plan, since=self.since), now)
        kept = {int(number) for director in self.directors for number in director.kept.bookmarks}
        self.commands.selection = Selection(bookmarks=sorted(kept))
        yield from self._report(self.commands.selection)
        self.editor.adopt(self.plan)
        self._edited, self._repeat_due = True, now
        yield from self.reloading.answer(self.editor.count)

    @property
    def since(self) -> int:
        """The first camera event of a configuration that follows this one."""
        return 1 + max(director.event.camera_event for director in self.directors)

    @property
    def newest_plan(self) -> Plan:
        """What a rank has to know that starts now: also while others go over to it."""
        coming = self.reloading.coming
        return self.plan if coming is None else replace(coming, since=self.since)

    @property
    def lost(self) -> Mapping[int, str]:
        """Ranks that died or are silent: how."""
        return self.register.lost

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        """Take in messages of ranks, input of users, news of the launcher."""
        selection = self.commands.selection
        try:
            if isinstance(message, Hello | SignOfLife | Note | Prepared):
                self._check_rank(message.rank)
            if isinstance(message, Hello):
                self.joining.check(message)
                if self.register.take(message, now):
                    self._succeed(message.rank, now)
                for director in () if self.reloading.adopting else self.directors:  # who joins late gets the state
                    yield Send(message.rank, director.event)
                if self.balancer is not None:
                    yield Send(message.rank, self.balancer.assignment)
                if message.rank in self._reporters and self.commands.selection != Selection():
                    yield Send(message.rank, self.commands.selection)
                self.page_server = message if message.page and message.rank in self._reporters else self.page_server
                if self._phase in (Phase.STOPPING, Phase.LAST) and message.rank != HEAD:
                    yield Send(message.rank, Stop(reason=self.ended))
            elif isinstance(message, SignOfLife):
                known = self.register.hear(message, self.heartbeats.get(message.rank), now)
                if known is not None:
                    self.heartbeats[message.rank] = known
                    if known.last or now >= self._told_due.get(message.rank, -math.inf):
                        self._told_due[message.rank] = now + BEATS_APART * self._layout.config.transport.heartbeat_s
                        yield from self._report(known)
            elif isinstance(message, WindowInput):
                yield from self._take_input(message, now)
            elif isinstance(message, Note):
                self.register.news.append(message)
            elif isinstance(message, Statistics):
                yield Broadcast(message)
            elif isinstance(message, EditRequest) and self.reloading.takes(message, self.editor):
                yield from self.reloading.load(message, self.editor, now)
            elif isinstance(message, Changed):
                yield from self.reloading.save(Asked(text=message.text, path=message.path), now)
            elif isinstance(message, PlanMade):
                yield from self.reloading.made(message, now)
            elif isinstance(message, Prepared):
                yield from self.reloading.prepared(message)
            elif isinstance(message, JoinRequest):
                busy = self.reloading.busy
                yield from self.joining.answer(message, self.editor, self.plan, self.register, busy=busy, now=now)
                self._grow(self.plan)
            elif isinstance(message, Invitation):
                self.joining.invitation = message
            elif isinstance(message, Leave | Disconnected):
                (self.register.leave if isinstance(message, Leave) else self.register.disconnect)(message.rank, now)
            elif isinstance(message, EditRequest):
                steer = partial(self.commands.take_asked, plan=self.plan, directors=self.directors, now=now)
                yield Send(message.client, self.editor.answer(message, self._shown_event.scene_time, now, steer))
                self._edited = True
            elif isinstance(message, Died):
                self.register.bury(message, now)
                if message.again:
                    self.reloading.forget(message.rank)
            elif isinstance(message, End):
                self.ended = self.ended or message.reason
            elif isinstance(message, TrackerPacket):
                self.counters.update(filter(None, [director.tracker.take(message) for director in self.directors]))
            elif isinstance(message, TrackerStrangers):
                self.counters["tracker_stranger"] += message.count
            elif isinstance(message, Packet):
                self.counters["stray_packet"] += 1
        except RemoteProtocolError:
            self.counters["bad_message"] += 1
        except EditError as error:
            self.reloading.said = str(error)
        if self.commands.selection != selection:
            yield from self._report(self.commands.selection)
        self.due = now

    def _report(self, message: Heartbeat | Selection | Note) -> Iterator[Send]:
        """To those who tell how the run is doing: the head's compositor, and the one that serves the page."""
        return (Send(rank, message) for rank in sorted(self._reporters))

    def _succeed(self, rank: int, now: float) -> None:
        """Another process is that rank now."""
        self.counters += Counter(last.dropped if (last := self.heartbeats.pop(rank, None)) else {})
        self.reloading.forget(rank)
        if self.balancer is not None and self.register.came(rank):
            self.balancer.hasten(now)

    def _check_rank(self, rank: int) -> None:
        if not 0 <= rank < self._layout.size:
            raise RemoteProtocolError(f"rank {rank}; wanted: 0 to {self._layout.size - 1}")

    def _take_input(self, message: WindowInput, now: float) -> Iterator[Instruction]:
        """Take in steering and ends of the run. Raises RemoteProtocolError for a rank that has no windows."""
        if message.rank not in self._window_ranks | self._reporters:
            raise RemoteProtocolError(f"rank {message.rank} has no windows; wanted: {sorted(self._window_ranks)}")
        self.escape = self.escape or message.escape
        self._closed |= {message.rank} if message.closed else set()
        for command in message.commands:
            try:
                parsed = parse(command)
                if parsed.kind == "undo" and self.reloading.can_undo and not self.editor.can_undo:
                    yield from self.reloading.undo(now)
                else:
                    self._edited |= self.commands.take(parsed, self.editor, self.directors, now)
            except RemoteProtocolError:
                self.counters["bad_command"] += 1
            except EditError as error:
                self.counters["refused_edit"] += 1
                self.register.news.append(note_of(HEAD, "warning", f"{REFUSED}{error}"))

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """Publish events, notice lost ranks, end the run in its steps."""
        said, self.reloading.said = self.reloading.said, ""
        for note in self.register.tell(said):
            yield from self._report(note)
        if self._phase is Phase.RUNNING:
            self.register.watch(now, self._layout.config.transport)  # regions of the silent only grow old
            self.ended = self.ended or self._why_over(now)
            if self.ended:  # the view is frozen, so that the last image shows one moment with every sample
                self._phase, self._limit = Phase.HOLDING, now if self.ended == NO_RENDERER else now + HOLD_S
        if self._phase in (Phase.RUNNING, Phase.HOLDING):
            yield from self.register.on_tick(now)
            excused = {rank for rank in self.lost if self.register.excused(rank)}
            yield from self.reloading.on_tick(now, self.since, excused)
            if (plan := self.reloading.adopted(self.heartbeats, now, self.lost)) is not None:
                yield from self._adopt(plan, now)
            if not self.reloading.adopting:
                yield from self._publish(now)
        if self._phase is Phase.RUNNING and self.balancer is not None:
            numbers = tuple(event.number for event in self.events)
            if (assignment := self.balancer.on_tick(self.heartbeats, self.lost, numbers, now)) is not None:
                yield Broadcast(assignment)
        if self._phase is Phase.HOLDING and (now >= self._limit or self._all_complete(others=True)):
            self._phase, self._limit = Phase.STOPPING, now + BYE_WAIT_S
            for rank in range(1, self._layout.size):
                yield Send(rank, Stop(reason=self.ended))
        if self._phase is Phase.STOPPING and (now >= self._limit or self._said_last(range(1, self._layout.size))):
            self._phase, self._limit = Phase.LAST, now + LAST_S
            yield Send(HEAD, Stop(reason=self.ended))
        if self._phase is Phase.LAST and (now >= self._limit or self._said_last((HEAD,))):
            yield Finish()
        publishes = self._phase in (Phase.RUNNING, Phase.HOLDING)
        self.due = min(self._update_due, self._limit) if publishes else self._limit
        if self._phase is Phase.RUNNING and self._came and now < self._input_due:
            self.due = min(self.due, self._input_due)

    def _publish(self, now: float) -> Iterator[Instruction]:
        """Tell everyone of new events, or of the newest again: a sign of life, and one may have been lost."""
        self._release()
        running = self._phase is Phase.RUNNING
        came = self._came and now >= self._input_due
        wanted = running and (now >= self._update_due or came) and not self._waits()
        if wanted and self._came:  # what follows at once shares the next update
            self._input_due = now + self._tick_s
        self._edited = self._edited and not wanted
        commands = self.commands.taken() if wanted or not running else []
        editor, before = self.editor, self._shown_event.scene_event
        for director in self.directors:
            if wanted:
                own = commands_of(director, commands, self.directors)
                news = director.update(own, now, editor.edits, editor.picture)
            else:
                news = not running and director.hold()
            if news or now >= self._repeat_due:
                yield Broadcast(director.event)
                if director is self.directors[-1]:
                    if now >= self._repeat_due and self.balancer is not None:
                        yield Broadcast(self.balancer.assignment)
                    self._repeat_due = now + min(REPEAT_S, self._layout.config.transport.lost_after_s / 2)
        if wanted:
            self.taken.update(editor.count, changed=self._shown_event.scene_event > before)
        if now >= self._update_due:
            self._update_due = max(self._update_due + self._tick_s, now)

    @property
    def _came(self) -> bool:
        """Whether something came in that no event tells of."""
        return bool(self.commands.waiting) or self._edited

    @property
    def events(self) -> list[Event]:
        """The newest of every view."""
        return [director.event for director in self.directors]

    @property
    def _shown_event(self) -> Event:
        """The event of the first view, which says what time it is."""
        return self.directors[0].event

    def _waits(self) -> bool:
        """In lock step: whether a frame is still under way; with a barrier, whether a view is still to be shown."""
        if self._layout.config.barrier:
            ranks = [rank for rank in self._layout.renderers() if rank not in self.lost]
            return not all(self._shows_newest(rank) for rank in ranks)
        return self._layout.graph.sync != "none" and self._released < self._shown_event.number

    def _shows_newest(self, rank: int) -> bool:
        """Whether a renderer has said that it has the newest events; with a barrier, that it shows them."""
        beat = self.heartbeats.get(rank)
        number = summed_number(self.directors[view].event for view in self._layout.views_of(rank))
        return beat is not None and (beat.camera_event, beat.scene_event) == number

    def _release(self) -> None:
        """In lock step: once every compositor is done with a frame, the next may begin."""
        number = self._shown_event.number
        beats = (self.heartbeats.get(k) for k in range(self._layout.graph.compositors) if k not in self.lost)
        if all(beat is not None and (beat.camera_event, beat.scene_event) >= number for beat in beats):
            self._released = number

    def _why_over(self, now: float) -> str:
        """Why the run is to end, "" as long as it is not."""
        if self.register.silence(self._layout.renderers(), now) >= self._layout.config.transport.longest_silence_s:
            return NO_RENDERER
        if self.escape:
            return self.escape
        if self._closed and not self._window_ranks - self._closed - self.lost.keys():
            return ALL_CLOSED
        if self._seconds is not None and now - self.began >= self._seconds:
            return "time is up"
        return "complete" if self._until_complete and self._settled(now) else ""

    def _settled(self, now: float) -> bool:
        """Whether all has been traced and shown for a while."""
        if not self._all_complete():
            self._complete_since = None
        elif self._complete_since is None:
            self._complete_since = now
        return self._complete_since is not None and now - self._complete_since >= SETTLED_S

    def _all_complete(self, *, others: bool = False) -> bool:
        """Whether every living rank says that nothing is left to do under the newest events. `others`: but the head."""
        for rank in range(int(others), self._layout.size):
            beat = self.heartbeats.get(rank)
            complete = beat is not None and beat.complete and self._shows_newest(rank)
            complete &= beat is not None and beat.configuration == self.plan.number
            if beat is not None and self.balancer is not None and self._layout.role(rank) == "renderer":
                complete &= beat.assignment == self.balancer.assignment.number
            if not complete and not self.register.excused(rank):
                return False
        return True

    def _said_last(self, ranks: range | tuple[int, ...]) -> bool:
        living = (self.heartbeats.get(rank) for rank in ranks if rank not in self.lost)
        return all(beat is not None and beat.last for beat in living)

    def dropped(self) -> Counter[str]:
        """What was dropped anywhere, by name. Other threads may ask."""
        beats = self.heartbeats.copy().values()
        return sum((Counter(beat.dropped) for beat in beats), self.counters.copy() + self.editor.counters.copy())
