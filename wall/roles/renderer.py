"""What a renderer decides: which worker traces when, under which event; what it tells the manager and its compositor.

Each worker traces batches of the newest event, one at a time, as long as its compositor has credit for the packets. A
worker that finds nothing missing rests until there is another event, or its packets are lost, or it looks again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from wall.core.data import Batch, Event
from wall.packets.control import MAX_ANSWERS, Heartbeat, Hello, Membership, Stop, serialise
from wall.packets.samples import decode, is_samples
from wall.roles.edges import NEVER, Number, Sent, target_ranks
from wall.roles.instructions import (
    Dropped,
    Finish,
    Input,
    Instruction,
    Offer,
    Ready,
    Restart,
    Trace,
    Traced,
    Work,
)
from wall.roles.membership import Standing
from wall.roles.plan import HEAD, Plan
from wall.roles.renderer_image import RendererImage
from wall.roles.statistics import Due, tiles_of
from wall.roles.status import Rates
from wall.sampling.tiles import Measured

LOOK_AGAIN_S = 0.05  # a resting worker looks this often whether something is missing: samples grow old
CREDIT_POLL_S = 0.002  # how often a renderer without credit looks for some
PROGRESSIVE = "progressive"  # the sampler whose stages depend on how long paths get
RATE_SPAN_S = 0.2  # rates are averages over at least so long


class Renderer:
    """A role: one rank's part of a view, shared among some workers."""

    def __init__(self, plan: Plan, hello: Hello, ready: Ready, image: RendererImage | None = None) -> None:
        """`image`: made here of the samples, in place of packets to a compositor."""
        layout, self._rank, self._ready, self._image = plan.layout, hello.rank, ready, image
        self.due = -math.inf
        self.event: Event | None = None  # the newest
        self.complete = False  # nothing is missing under the newest event
        self._target, self._workers = layout.target_of(hello.rank), layout.sampling.threads
        self._configured: str = layout.sampling.method
        self._scene = plan.scene
        depth = plan.scene.path_depth if self._configured == PROGRESSIVE else None
        self._samplers: tuple[str, str, int | None] = (self._configured, "", depth)  # the second is compared
        targets = {self._target} if image is None else target_ranks(layout.graph, hello.rank) | {HEAD}
        self._standing = Standing(hello, targets, layout.config.transport)
        self._running: set[int] = set()  # workers that trace
        self._resting: dict[int, tuple[Number, float]] = {}  # under which event, and when it looks again
        self._lost: dict[int, list[bytes]] = {}  # by worker: packets that were dropped
        self._work: dict[int, Work] = {}
        self._panel = layout.region(hello.rank).panel
        self._tiles: dict[int, Measured] = {}  # the newest of each worker's sampler, while a viewer shows them
        self._tiles_due = [Due() for _ in range(self._workers)]
        self._sent = Sent()
        self._rates = Rates(RATE_SPAN_S)
        self._began: float | None = None
        self._stopping = False

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        """Take in the newest event, what a worker has traced, what was dropped, who is in the run."""
        if isinstance(message, Traced):
            yield from self._take(message, now)
        elif isinstance(message, Dropped):
            self._lose(message)
        else:
            self._standing.hear(now)
        if isinstance(message, Event) and (self.event is None or message.number >= self.event.number):
            self.event = message
            if self._image is not None:
                self._image.follow(message)
            self.complete = self.complete and self._all_rest()
        elif isinstance(message, Membership):
            yield from self._standing.take(message)
        elif isinstance(message, Stop):
            self._stopping = True

    def on_tick(self, now: float) -> Iterator[Instruction]:
        """Give work to idle workers, and signs of life."""
        self._began = now if self._began is None else self._began
        yield from self._standing.on_tick(now)
        if self._stopping and not self._running:
            yield from self._standing.beat(self._heartbeat(now, last=True), now)
            yield Finish()
            return
        if self._standing.beat_due(now):
            yield from self._standing.beat(self._heartbeat(now), now)
        self.due = now + LOOK_AGAIN_S
        if self._image is not None:
            yield from self._show(self._image, now)
        if self.event is not None and not self._stopping:
            yield from self._give_work(self.event, now)
        if self._image is not None:
            self.due = min(self.due, self._image.due)

    def _show(self, image: RendererImage, now: float) -> Iterator[Instruction]:
        """Bring the image that this rank makes up to date, and send what changed."""
        yield from self._sent.counted(image.on_tick(now))
        yield from self._tell_completeness(now)

    def _give_work(self, event: Event, now: float) -> Iterator[Instruction]:
        wanted = self._wanted(event)
        if wanted != self._samplers:  # another sampler, or two, or stages of other paths: all workers start over
            if self._running:
                return
            self._samplers = wanted
            self._resting.clear()
            self._lost.clear()  # packets of samplers that are gone
            self._tiles.clear()
            yield Restart(*wanted)
        if not event.statistics:
            self._tiles.clear()
        for worker in range(self._workers):
            if worker in self._running or self._rests(worker, event, now):
                continue
            if self._image is None and not self._ready(self._target):
                self.due = now + CREDIT_POLL_S
                return
            self._running.add(worker)
            measure = event.statistics and self._tiles_due[worker].now(now)
            lost, keep = tuple(self._lost.pop(worker, ())), self._image is not None
            yield Trace(worker, event, lost=lost, keep=keep, measure=measure)
        idle = [worker for worker in range(self._workers) if worker not in self._running]
        self.due = min((self._resting.get(worker, (NEVER, now))[1] for worker in idle), default=self.due)

    def _wanted(self, event: Event) -> tuple[str, str, int | None]:
        """The event's sampler, the one compared with it, and the most surfaces of progressive paths, else None."""
        methods = (event.sampler or self._configured, event.compare)
        if PROGRESSIVE not in methods:
            return *methods, None
        return *methods, self._scene.shading(event.scene_time, event.edits).path_depth

    def _rests(self, worker: int, event: Event, now: float) -> bool:
        number, again = self._resting.get(worker, (NEVER, now))
        return number == event.number and now < again and worker not in self._lost

    def _all_rest(self) -> bool:
        return self.event is not None and all(
            self._resting.get(worker, (NEVER, 0.0))[0] == self.event.number for worker in range(self._workers)
        )

    def _take(self, traced: Traced, now: float) -> Iterator[Instruction]:
        """Pass a worker's packet on, or let the worker rest. Says at once whether the view has become complete."""
        self._running.discard(traced.worker)
        self._work[traced.worker] = traced.work
        if traced.measured is not None:
            self._tiles[traced.worker] = traced.measured
        if traced.measured is not None and traced.worker == self._workers - 1:
            tiles = tiles_of(self._rank, self._panel, self._tiles.values())
            if self._image is not None:
                self._image.composition.keep(tiles)
            else:
                yield from self._offer(serialise(tiles))
        if traced.result is None:
            self._resting[traced.worker] = (traced.event.number, now + LOOK_AGAIN_S)
        else:
            self._resting.pop(traced.worker, None)
            if self._image is not None and isinstance(traced.result, Batch):
                if len(traced.result.samples):
                    self._image.insert(traced.result)
            elif isinstance(traced.result, bytes) and traced.result:
                yield from self._offer(traced.result)
        yield from self._tell_completeness(now)

    def _tell_completeness(self, now: float) -> Iterator[Instruction]:
        complete = self._all_rest() and not self._lost and (self._image is None or self._image.complete)
        if complete != self.complete:
            self.complete = complete
            yield from self._standing.beat(self._heartbeat(now), now)

    def _offer(self, packet: bytes) -> Iterator[Offer]:
        yield from self._sent.counted([Offer(self._target, packet)])

    def _lose(self, dropped: Dropped) -> None:
        if self._image is not None:
            self._image.composition.lose(dropped.to, dropped.packet)
        elif is_samples(dropped.packet):  # else tiles: the next ones replace them
            worker = decode(dropped.packet).sequence % self._workers
            self._lost.setdefault(worker, []).append(dropped.packet)
            self.complete = False

    def _heartbeat(self, now: float, *, last: bool = False) -> Heartbeat:
        work = self._work.values()
        samples, compared = sum(w.samples for w in work), sum(w.compared for w in work)
        bad = sum(w.bad_samples for w in work)
        samples_per_s, bytes_per_s, compared_per_s = self._rates.at(now, samples, self._sent.bytes, compared)
        number = self.event.number if self.event else NEVER
        shown = self._image.composition if self._image is not None else None
        dropped = shown.drops() if shown is not None else Counter[str]()
        dropped += Counter(not_finite=bad)
        return Heartbeat(
            rank=self._rank,
            time=now,
            samples_traced=samples,
            samples_shown=shown.samples_shown() if shown is not None else 0,
            secondary_rays=sum(w.secondary_rays for w in work),
            samples_per_s=samples_per_s,
            compared_per_s=compared_per_s,
            bytes_per_s=bytes_per_s,
            packets=self._sent.packets,
            bytes=self._sent.bytes,
            seconds=now - (now if self._began is None else self._began),
            dropped=dict(dropped),
            samples_per_pixel=min((w.samples_per_pixel for w in work), default=0),
            square_error=sum(w.square_error for w in work) / max(len(work), 1),
            complete=self.complete,
            oldest_sample_at=self._image.oldest_sample_at(now) if self._image is not None else -1.0,
            camera_event=number[0],
            scene_event=number[1],
            last=last,
            answers=[seconds for w in work for seconds in w.answers][:MAX_ANSWERS] if last else [],
        )
