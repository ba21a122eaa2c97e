"""What a renderer decides: whose turn it is to be traced; what it tells the manager and its compositors.

Each worker traces batches of the newest event, one at a time, as long as its compositor has credit for the packets. A
rank with regions of several views spends its time on them by the views' weights: next is the region that has used the
least for its weight. One that rests leaves its share to the others, and saves nothing for later.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from wall.core.data import Event, Region
from wall.core.errors import RemoteProtocolError
from wall.packets.control import Assignment, Heartbeat, Hello, Membership, Stop
from wall.packets.joining import Leave
from wall.packets.json_body import MAX_ANSWERS
from wall.packets.samples import decode, is_samples
from wall.roles.edges import Sent, summed_number, target_ranks
from wall.roles.instructions import (
    MANAGER,
    Dropped,
    End,
    Finish,
    Input,
    Instruction,
    Offer,
    Ready,
    Reassign,
    Send,
    Trace,
    Traced,
    Work,
    total,
)
from wall.roles.membership import Standing
from wall.roles.plan import Plan
from wall.roles.region_renderer import LOOK_AGAIN_S, RegionRenderer
from wall.roles.renderer_image import RendererImage
from wall.roles.status import Rates

COST_UNIT = 1e12  # of a cost in heartbeats, whose numbers are whole
RATE_SPAN_S = 0.2  # rates are averages over at least so long


class Renderer:
    """A role: one rank's parts of the views, shared among some workers."""

    def __init__(self, plan: Plan, hello: Hello, ready: Ready, image: RendererImage | None = None) -> None:
        """`image`: made here of the samples, in place of packets to a compositor."""
        layout, self._plan, self._rank, self._ready, self.image = plan.layout, plan, hello.rank, ready, image
        self.due = -math.inf
        regions = layout.regions_of(hello.rank)
        images = image.images if image is not None else (None,) * len(regions)
        own = [RegionRenderer(plan, hello.rank, *each) for each in zip(regions, images, strict=True)]
        self._take_regions(own)
        self._threads = max((region.threads for region in own), default=layout.sampling.threads)  # that trace at once
        self._events: dict[int, Event] = {}  # by view: the newest
        self._assigned: tuple[int, tuple[Region, ...]] | None = None  # the newest assignment, not followed yet
        self._bad_messages = 0
        self._found_nothing = False  # a worker did, to trace, since the last heartbeat
        self._followed = 0  # number of the assignment whose regions these are
        self._past, self._past_seconds = Work(), 0.0  # done for regions before, and in what time
        targets = {layer.compositor for layer in layout.graph.layers} if layout.strips else {r.target for r in own}
        targets = targets if image is None else target_ranks(layout.graph, hello.rank) | {layout.graph.page_rank}
        self.standing = Standing(hello, targets, layout.config.transport)
        self._sent = Sent()
        self._rates = Rates(RATE_SPAN_S)
        self._began: float | None = None
        self._stopping = self._leaves = False  # the second: by itself, the run goes on

    @property
    def done(self) -> Work:
        """What all workers have done, also for regions that are others' now."""
        return total([self._past, *(work for region in self.regions for work in region.work.values())])

    def _take_regions(self, regions: list[RegionRenderer]) -> None:
        """Have these regions, and number their workers."""
        self.regions, first = regions, 0
        for number, region in enumerate(regions):
            first = region.place(number, first)
        self._region_of = [region for region in regions for _ in range(region.threads)]  # by worker

    @property
    def complete(self) -> bool:
        """Whether nothing is missing under the newest events."""
        return all(region.complete for region in self.regions)

    @property
    def hurries(self) -> bool:
        """See RendererImage."""
        return self.image is not None and self.image.hurries

    def waits(self, now: float) -> bool:
        """Whether a region has traced as many samples by now as its layer may have, or its image becomes finer."""
        finer = self.image is not None and not all(image.whole for image in self.image.images)
        return finer or any(region.waits(now) for region in self.regions)

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        """Take in the newest event, what a worker has traced, what was dropped, who is in the run."""
        if isinstance(message, Traced):
            region = self._region_of[message.worker]
            self._found_nothing |= message.result is None
            for packet in region.take(message, now):
                yield from self._sent.counted([Offer(region.target, packet)])
            yield from self._tell_completeness(now)
        elif isinstance(message, Dropped):
            self._lose(message)
        elif not isinstance(message, End):
            self.standing.hear(now)
        if isinstance(message, Event):
            before = self._events.setdefault(message.view, message)
            self._events[message.view] = max(before, message, key=lambda event: event.number)
            for region in self.regions:
                region.follow(message)
        elif isinstance(message, Membership):
            for connect in self.standing.take(message):
                yield connect
                if connect.anew:
                    self._renew(connect.rank)
        elif isinstance(message, Assignment):
            self._assign(message)
        elif isinstance(message, Stop | End):
            self._stopping, self._leaves = True, isinstance(message, End)

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """Give work to idle workers, and signs of life."""
        self._began = now if self._began is None else self._began
        yield from self.standing.on_tick(now)
        if self._stopping and not self._running:
            yield from self.standing.beat(self._heartbeat(now, last=True), now)
            if self._leaves:
                yield Send(MANAGER, Leave(rank=self._rank))
            yield Finish()
            return
        if self.standing.beat_due(now):
            yield from self.standing.beat(self._heartbeat(now), now)
        self.due = now + LOOK_AGAIN_S
        if self.image is not None:
            yield from self._show(self.image, now)
        if not self._stopping:
            yield from self._reassign(now)
            if self._assigned is None:  # else workers come to rest
                yield from self._give_work(now)
            self.due = min((region.due(now, self._ready) for region in self.regions), default=self.due)
        if self.image is not None:
            self.due = min(self.due, self.image.due)

    @property
    def _running(self) -> int:
        return sum(len(region.running) for region in self.regions)

    def _show(self, image: RendererImage, now: float) -> Iterator[Instruction]:
        """Bring the images that this rank makes up to date, and send what changed."""
        rounds = image.rounds
        yield from self._sent.counted(image.on_tick(now))
        if image.rounds > rounds:  # the manager waits for it
            yield from self.standing.beat(self._heartbeat(now), now)
        for region in self.regions:
            region.note_refreshes()
        yield from self._tell_completeness(now)

    def _renew(self, target: int) -> None:
        """A compositor has begun anew: it gets the images that are made here again; else what it shows is traced."""
        if self.image is not None:
            self.image.composition.renew(target)
            return
        for region in self.regions:
            if region.target == target:
                region.start_over()

    def _assign(self, assignment: Assignment) -> None:
        """Keep the newest assignment for the next tick; one that does not fit the wall is counted."""
        if assignment.number <= (self._followed if self._assigned is None else self._assigned[0]):
            return
        try:
            self._assigned = assignment.number, self._plan.layout.assigned(assignment.cuts).regions_of(self._rank)
        except RemoteProtocolError:
            self._bad_messages += 1

    def _reassign(self, now: float) -> Iterator[Instruction]:
        """Take up the newest assignment once no worker traces; regions that stay the same go on as they are."""
        if self._assigned is None or self._running:
            return
        (self._followed, regions), self._assigned = self._assigned, None
        kept = {each.region: each for each in self.regions}
        used = min((each.used for each in self.regions), default=0.0)
        for each in self.regions:
            if each.region not in regions:
                self._past = total([self._past, *each.work.values()])
                self._past_seconds += each.seconds
        own = [kept.get(region) or RegionRenderer(self._plan, self._rank, region) for region in regions]
        self._take_regions(own)
        for each in own:
            if each.event is None and (event := self._events.get(each.region.view)) is not None:
                each.follow(event)
                each.used = used
        yield Reassign(regions)
        yield from self.standing.beat(self._heartbeat(now), now)  # what was complete is not any more

    def _give_work(self, now: float) -> Iterator[Instruction]:
        free = self._threads - self._running
        rest = [region.idle or region.waits(now) for region in self.regions]
        least = min((region.used for region, rests in zip(self.regions, rest, strict=True) if not rests), default=0.0)
        for region, rests in zip(self.regions, rest, strict=True):
            if rests:
                region.used = max(region.used, least)
        for region in sorted(self.regions, key=lambda region: region.used):
            work = region.give_work(now, self._ready)
            while free > 0 and (instruction := next(work, None)) is not None:
                yield instruction
                if isinstance(instruction, Trace) and not region.rests(instruction.worker, now):
                    free -= 1

    def _tell_completeness(self, now: float) -> Iterator[Instruction]:
        news = [region.tell_completeness() for region in self.regions]
        if any(news):
            yield from self.standing.beat(self._heartbeat(now), now)

    def _lose(self, dropped: Dropped) -> None:
        if self.image is not None:
            self.image.composition.lose(dropped.to, dropped.packet)
        elif is_samples(dropped.packet):  # else tiles: the next ones replace them
            batch = decode(dropped.packet)
            for region in self.regions:
                if region.region.panel == batch.panel:
                    region.lose(batch, dropped.packet)

    def _of_views(self) -> tuple[dict[str, int], dict[str, int], dict[str, int]]:
        """By view: samples traced, microseconds spent, refreshes of images made here."""
        samples, time, refreshes = Counter[str](), Counter[str](), Counter[str]()
        if self._past.samples:  # regions move only where there is one view
            (view,) = self._plan.layout.config.views
            samples[view.id] += self._past.samples
            time[view.id] += round(1e6 * self._past_seconds)
        for region in self.regions:
            samples[region.view] += sum(work.samples for work in region.work.values())
            time[region.view] += round(1e6 * region.seconds)
            if region.image is not None:
                refreshes[region.view] += region.image.view.refreshes
        return dict(samples), dict(time), dict(refreshes)

    def _costs(self) -> dict[str, int]:
        """By layer: what its region costs; {} while one of them has not been measured."""
        if not all(region.cost for region in self.regions):
            return {}
        return {str(region.region.layer): round(COST_UNIT * region.cost) for region in self.regions}

    def _heartbeat(self, now: float, *, last: bool = False) -> Heartbeat:
        work = [each for region in self.regions for each in region.work.values()]
        done = self.done
        made = sum(region.image.view.refreshes for region in self.regions if region.image is not None)
        samples_per_s, bytes_per_s, compared_per_s, refreshes_per_s = self._rates.at(
            now, done.samples, self._sent.bytes, done.compared, made
        )
        events = [region.event for region in self.regions] or self._events.values()
        number, image = summed_number(events), self.image
        if image is not None and image.barrier:
            number = image.number
        shown = self.image.composition if self.image is not None else None
        dropped = shown.drops() if shown is not None else Counter[str]()
        dropped += Counter(not_finite=done.bad_samples, too_bright=done.too_bright, bad_message=self._bad_messages)
        samples_of, time_of, refreshes_of = self._of_views()
        works = any(region.has_work(now) for region in self.regions) and not self._found_nothing
        self._found_nothing = False
        return Heartbeat(
            rank=self._rank,
            time=now,
            samples_traced=done.samples,
            samples_shown=shown.samples_shown() if shown is not None else 0,
            secondary_rays=done.secondary_rays,
            samples_per_s=samples_per_s,
            compared_per_s=compared_per_s,
            bytes_per_s=bytes_per_s,
            refreshes_per_s=refreshes_per_s,
            packets=self._sent.packets,
            bytes=self._sent.bytes,
            seconds=now - (now if self._began is None else self._began),
            dropped=dict(dropped),
            samples_per_pixel=min((w.samples_per_pixel for w in work), default=0),
            square_error=sum(w.square_error for w in work) / max(len(work), 1),
            complete=self.complete,
            right_s=shown.right_s(now) if shown is not None else 0.0,
            oldest_sample_at=self.image.oldest_sample_at(now) if self.image is not None else -1.0,
            camera_event=number[0],
            scene_event=number[1],
            last=last,
            answers=[seconds for w in work for seconds in w.answers][:MAX_ANSWERS] if last else [],
            samples_of=samples_of,
            time_of=time_of,
            refreshes_of=refreshes_of,
            assignment=self._followed,
            configuration=self._plan.number,
            costs=self._costs(),
            updates_shown=image.updates.shown if image is not None else 0,
            updates_shared=image.updates.shared if image is not None else 0,
            works=works,
        )
