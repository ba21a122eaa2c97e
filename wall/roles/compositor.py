"""What a compositor decides, at the head and elsewhere: when to refresh, what to show, what to tell the others.

It follows the manager's events, inserts packets as they come, refreshes its views at their rates, and gives images to
its sinks and framelets to other compositors.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import asdict, replace

from wall.config.graph import SinkNode
from wall.core.data import Edits, Event, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.core.tone_mapping import Tone
from wall.display.base import ParameterState, Status, WallImage
from wall.operators.overlay import Overlay
from wall.packets.control import (
    Assignment,
    EditRequest,
    Heartbeat,
    Hello,
    Membership,
    Selection,
    Statistics,
    Stop,
    WindowInput,
)
from wall.packets.notes import REFUSED, Note
from wall.roles.composition import Composition, RunAll, one_by_one
from wall.roles.edges import Number, Sent, needed_from_others, shows_only, summed_number, target_ranks
from wall.roles.editing import shown_parameters, states_of
from wall.roles.handles import HandlesMaker
from wall.roles.instructions import (
    MANAGER,
    Dropped,
    Finish,
    Input,
    Instruction,
    Packet,
    Presented,
    Ready,
    Send,
    Shares,
    Show,
    Tell,
    shares_nothing,
)
from wall.roles.membership import Standing
from wall.roles.plan import HEAD, Plan
from wall.roles.stale import marked_places
from wall.roles.statistics import Due
from wall.roles.status import AWAY_FROM_HEAD, Latency, Rates, statistics_of, status_of, steered, totals_of
from wall.roles.view import EARLY_APART_S, FollowedView

STATUS_PERIOD_S = 0.25  # how often the table of ranks is made anew
RATE_SPAN_S = 1.0  # refreshes a second are an average over at least so long
SHOWN_NOTES = 4  # on the page, the newest
REFUSAL_SHOWN_S = 6.0
BETWEEN_ARRIVALS_S = 0.004  # images of others are shown as they are due, but no more often than this
RESTS_S = 0.1  # see Compositor._tell_completeness
LAST_S = 2.0  # at the end packets that are on their way are taken in for so long at most


class Compositor:
    """A role: the layers, nodes and sinks of one rank. The head's also shows how the run is doing."""

    def __init__(
        self,
        plan: Plan,
        hello: Hello,
        ready: Ready,
        run_all: RunAll = one_by_one,
        shares: Shares = shares_nothing,
        composition: Composition | None = None,
    ) -> None:
        """`composition`: in place of its own, where no pixels are made."""
        graph, self._plan, self._rank, self._ready = plan.layout.graph, plan, hello.rank, ready
        self._size = plan.layout.size  # ranks that are there before anything can be shown
        self.due = -math.inf
        self.composition = composition or Composition(plan, hello.rank, ready, run_all, shares)
        self.latency, self._refresh_rate, self._own_rate = Latency(), Rates(RATE_SPAN_S), Rates(RATE_SPAN_S)
        self.refreshes = 0.0  # of the whole wall: an image that comes alone counts as its share
        self._views = [FollowedView(plan, index) for index in range(len(plan.views))]
        self._reports = hello.rank in (HEAD, graph.page_rank)  # it tells how all ranks are
        targets = (target_ranks(graph, hello.rank) | {graph.page_rank}) - {hello.rank}
        self.standing = Standing(hello, targets, plan.layout.config.transport)
        self._sees_samples = bool(graph.layers_on(HEAD) or needed_from_others(graph, HEAD))
        self._overlays_elsewhere = any(isinstance(s.node, Overlay) and s.rank != HEAD for s in graph.steps)
        self._beats: dict[int, Heartbeat] = {}  # where it reports: the newest of every rank
        self._ending: WindowInput | None = None  # the newest by which a user ends the run at this rank's windows
        self._parameters = shown_parameters(plan) if self._reports else {}
        self._states: tuple[tuple[float, Edits, Tone], tuple[ParameterState, ...]] | None = None
        self._handles: HandlesMaker | None = None  # of what is selected
        self._selection = Selection()
        self._notes: deque[tuple[float, str]] = deque(maxlen=SHOWN_NOTES)  # when they came
        self._shown: dict[int, Event] = {}  # by view: the event of its newest image
        self._status: Status = AWAY_FROM_HEAD
        self._status_due = -math.inf
        self._statistics_images: tuple[StatisticsImage, ...] = ()
        self._statistics_due = Due()
        self._sent = Sent()
        self._known: dict[int, Hello] = {}  # what ranks that have been in the run last said of themselves
        self._came_ranks: frozenset[int] = frozenset()  # these ranks
        self._gone: frozenset[int] = frozenset()  # of those: that were not heard of since the status was last made
        self._came = False  # packets, since the last tick
        self._others = {step.index for step in needed_from_others(graph, hello.rank)}
        self._shows_only = shows_only(graph, hello.rank)
        self._shown_at = -math.inf  # when a refresh was last
        self._complete, self._rests_since = False, math.inf  # what the manager was told; complete since then
        self._began: float | None = None
        self.run_began: float | None = None  # the run, seconds of the head's clock; None: with this compositor
        files = (step.node for step in graph.sinks_on(hello.rank) if isinstance(step.node, SinkNode))
        self._shows_last = hello.rank == HEAD or any(node.kind != "window" for node in files)
        self._stop_at: float | None = None  # when this rank ends at the latest

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        """Take in a packet, an event, what another rank says."""
        if isinstance(message, Packet):
            self._came = True
            try:
                self.composition.insert(message.data, now)
            except RemoteProtocolError:
                self.composition.counters["bad_packet"] += 1
        elif isinstance(message, Dropped):
            self.composition.lose(message.to, message.packet)
        elif isinstance(message, Presented):
            self.composition.hand_samples(message.wants_samples)
            for view in self._views:
                self.latency.shown(self.composition.newest_event(view.index), now, view.index)
        elif isinstance(message, WindowInput):
            self._ending = message if message.escape or message.closed else None
            yield Send(MANAGER, message)
        elif isinstance(message, EditRequest):
            yield Send(MANAGER, message)
        else:
            self.standing.hear(now)
            yield from self._hear(message, now)

    def _hear(self, message: Input, now: float) -> Iterator[Instruction]:
        """Take in a message of the manager."""
        if isinstance(message, Event):
            self._follow(message, now)
        elif isinstance(message, Membership):
            before = self.standing.members.keys()
            for connect in self.standing.take(message):
                yield connect
                if connect.anew:
                    self.composition.renew(connect.rank)
            self._known |= self.standing.members
            self._came_ranks |= self.standing.members.keys()
            self._gone |= self._came_ranks - self.standing.members.keys()
            if self._reports and self.standing.members.keys() != before and self._views[0].event is not None:
                yield from self._make_status(self._views[0].event, now)
                yield Tell(self._status)  # what is stale is marked before the next image is made
            if not self._reports:
                absent = self._came_ranks - self.standing.members.keys()
                self._status = replace(AWAY_FROM_HEAD, stale=marked_places(self._plan.layout, absent))
            self._status_due = now
        elif isinstance(message, Heartbeat):
            self._beats[message.rank] = message
        elif isinstance(message, Selection) and len(message.names) in (0, len(self._plan.views)):  # of this plan
            self._parameters, self._states = shown_parameters(self._plan, message.names), None
            self._handles = HandlesMaker(self._plan, message.names) if any(message.names) else None
            self._selection, self._status_due = message, now
        elif isinstance(message, Note):
            self._notes.append((now, message.said.strip()))
            self._status_due = now
        elif isinstance(message, Statistics):
            self.composition.say(asdict(message))
        elif isinstance(message, Assignment):
            self._assign(message)
        elif isinstance(message, Stop) and self._stop_at is None:
            self._stop_at = now + LAST_S if self._shows_last else now

    def _assign(self, assignment: Assignment) -> None:
        """Know where the regions are: for the table of ranks, and for what samplers tell of their tiles."""
        try:
            layout = self._plan.layout.assigned(assignment.cuts)
        except RemoteProtocolError:
            self.composition.counters["bad_message"] += 1
            return
        if layout.regions != self._plan.layout.regions:
            self._plan = replace(self._plan, layout=layout)
            self.composition.forget_tiles()

    def _follow(self, event: Event, now: float) -> None:
        for view in self._views:
            before = view.event
            news = before is None or event.number > before.number
            if view.take(event):
                self.composition.follow(event)
                if before is not None and event.edits.number != before.edits.number:
                    self.composition.hasten(now + EARLY_APART_S)
                if news and len(self._came_ranks) >= self._size:  # before, no rank could show it
                    self.latency.published(event)

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """Refresh what is due, send what others need, give signs of life."""
        self._began = now if self._began is None else self._began
        self.run_began = now if self.run_began is None else self.run_began
        came, self._came = self._came, False
        yield from self.standing.on_tick(now)
        if self._stop_at is not None and (not came or now >= self._stop_at):
            yield from self._finish(now)
            return
        for view in self._views:
            if self.composition.take_edited(view.index):
                view.hasten()
            if view.event is not None and now >= view.due:
                yield from self._refresh(view, view.event, view.begin_refresh(now), now)
            elif view.event is not None and now >= self._arrivals_due:
                yield from self._refresh(view, view.event, view.event, now)
        yield from self._sent.counted(self.composition.send())
        yield from self._tell_completeness(now)
        self.due = min(self._arrivals_due, *(view.due for view in self._views))
        if self._stop_at is not None:
            self.due = now

    def _tell_completeness(self, now: float) -> Iterator[Instruction]:
        """Beat when that is due, and once this rank is complete, or is not any more.

        One that only shows what others make is either with each of their images: it is complete after RESTS_S of rest.
        """
        complete = self._is_complete()
        self._rests_since = min(self._rests_since, now) if complete else math.inf
        settled = not self._shows_only or now - self._rests_since >= RESTS_S
        news = complete != self._complete and settled
        if news or self.standing.beat_due(now):
            self._complete = complete and settled
            yield from self._beat(now)

    @property
    def _arrivals_due(self) -> float:
        """When images of others that came are shown, whatever else is due."""
        return max(self.composition.due, self._shown_at + BETWEEN_ARRIVALS_S)

    def _refresh(
        self, view: FollowedView, event: Event, expected: Event, now: float, *, force: bool = False
    ) -> Iterator[Instruction]:
        """Show the samples as `expected` when this refresh is seen; all else is as of `event`."""
        composition, self._shown_at = self.composition, now
        changes = composition.refresh(expected, now, force=force)
        self._shown[view.index] = expected
        changed = bool(changes)
        if changed or self.refreshes == 0:
            came = changes.keys() & self._others
            self.refreshes += len(came) / len(self._others) if came and self._shows_only else 1.0
        view.ahead = expected.number != event.number
        view.quiet = not changed and not view.ahead and not composition.behind(view.index)
        if event.statistics:
            yield from self._make_statistics_images(event, now)
        else:
            self._statistics_images = ()
        if self._reports and now >= self._status_due:
            yield from self._make_status(self._views[0].event or event, now)
            self._gone = self._came_ranks - self.standing.members.keys()
        yield Show(self._images(event, now), self._status)
        if composition.lockstep is not None and composition.lockstep.news():
            yield from self._beat(now)

    def _make_statistics_images(self, event: Event, now: float) -> Iterator[Instruction]:
        """Make statistics images for the page, if they are due."""
        if self._rank != self._plan.layout.graph.page_rank:
            yield from self._sent.counted(self.composition.offer_statistics(now))
        elif self._statistics_due.now(now):
            self._statistics_images = self.composition.statistics_images(now, comparing=bool(event.compare))

    def _make_status(self, event: Event, now: float) -> Iterator[Instruction]:
        self._status_due = now + STATUS_PERIOD_S
        if self._rank != HEAD and (head := self._beats.get(HEAD)) is not None:  # which may have begun before
            began = head.time - head.seconds
            self.run_began = began if self.run_began is None else min(began, self.run_began)
        (refreshes_per_s,) = self._refresh_rate.at(now, self.refreshes)
        oldest = {index: layer.oldest_sample(now) for index, layer in self.composition.layers.items()}
        for layer in self._plan.layout.graph.layers:
            beat = self._beats.get(layer.compositor)
            if layer.at_renderer and beat is not None and beat.oldest_sample_at >= 0.0:
                oldest[layer.index] = max(0.0, now - beat.oldest_sample_at)
        status = status_of(
            self._plan, event, self._beats, self.standing.members, self.latency,
            now=now, seconds=now - (now if self.run_began is None else self.run_began),
            refreshes_per_s=refreshes_per_s, oldest=oldest, gone=self._gone,
        )  # fmt: skip
        status = steered(status, self._states_under(event), [view.event for view in self._views], self._selection)
        ranks = range(self._plan.layout.size)
        totals = tuple(totals_of(self._beats.get(k), self._known.get(k), now) for k in ranks)
        notes = [said for at, said in self._notes if now < at + REFUSAL_SHOWN_S or not said.startswith(REFUSED)]
        self._status = replace(status, totals=totals, refreshes=self.refreshes, notes=tuple(dict.fromkeys(notes)))
        statistics = statistics_of(self._status)
        self.composition.say(asdict(statistics))
        if self._overlays_elsewhere and self._rank == HEAD:
            yield Send(MANAGER, statistics)

    def _states_under(self, event: Event) -> tuple[ParameterState, ...]:
        """Every parameter as it is: the same object while none changes."""
        time = event.scene_time if self._plan.scene.parameter_tracks else 0.0
        if self._states is None or self._states[0] != (time, event.edits, event.tone):
            states = states_of(self._plan, self._parameters, time, event.edits, event.tone)
            self._states = (time, event.edits, event.tone), states
        return self._states[1]

    def _images(self, event: Event, now: float) -> tuple[WallImage, ...]:
        """What each sink shows, in the order of the graph."""
        compared, samples = self.composition.compared(), self.composition.take_samples()
        handles = self._handles.handles(self._shown) if self._handles is not None else None
        return tuple(
            WallImage(
                width=crops.size[0],
                height=crops.size[1],
                panels=crops.images(),
                time=now,
                camera_event=event.camera_event,
                scene_event=event.scene_event,
                scene_time=event.scene_time,
                compared=compared[k].images() if compared else (),
                statistics_images=self._statistics_images,
                handles=handles,
                samples=samples,
            )
            for k, crops in enumerate(self.composition.shown())
        )

    def _is_complete(self) -> bool:
        """Whether nothing is left to do under the newest event; at the head: all of it is shown, and rests."""
        if self._rank == HEAD and self._sees_samples:
            known = [view for view in self._views if view.event is not None]
            shown = (self.composition.newest_event(v.index) == v.event.number for v in known if v.event is not None)
            return all(view.quiet for view in known) and any(shown)  # a view in which nothing changed says nothing
        waits = any(view.ahead or self.composition.behind(view.index) for view in self._views)
        return not waits and self.composition.idle and self.composition.due == math.inf

    def _number(self) -> Number:
        """See summed_number."""
        return summed_number(view.event for view in self._views)

    def _beat(self, now: float) -> Iterator[Instruction]:
        yield from self.standing.beat(self._heartbeat(now), now)
        if self._ending is not None:
            yield Send(MANAGER, self._ending)

    def _heartbeat(self, now: float, *, last: bool = False) -> Heartbeat:
        composition = self.composition
        (made_per_s,) = self._own_rate.at(now, sum(view.refreshes for view in self._views))
        number = composition.lockstep.done if composition.lockstep is not None else self._number()
        return Heartbeat(
            rank=self._rank,
            time=now,
            samples_shown=composition.samples_shown(),
            refreshes_per_s=made_per_s,
            packets=self._sent.packets,
            bytes=self._sent.bytes,
            seconds=now - (now if self._began is None else self._began),
            dropped=dict(composition.drops()),
            right_s=composition.right_s(now),
            complete=self._complete,
            camera_event=number[0],
            scene_event=number[1],
            last=last,
            configuration=self._plan.number,
            refreshes_of={self._plan.views[k].id: self._views[k].refreshes for k in composition.views},
        )

    def _finish(self, now: float) -> Iterator[Instruction]:
        """Show all that came as of the newest event, where images are kept; then send the last heartbeat."""
        if self._shows_last:
            for view in self._views:
                if view.event is not None:
                    yield from self._refresh(view, view.event, view.event, now, force=True)
        self.composition.close()
        yield from self.standing.beat(self._heartbeat(now, last=True), now)
        yield Finish()
