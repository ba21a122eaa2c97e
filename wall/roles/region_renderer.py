"""One region of a renderer: which of its workers traces when, under which event.

A worker that finds nothing missing rests until there is another event, or its packets are lost, or it looks again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from wall.core.data import Batch, Event, Region
from wall.packets.control import serialise
from wall.roles.edges import NEVER, Number
from wall.roles.instructions import Ready, Restart, Trace, Traced, Work
from wall.roles.plan import Plan
from wall.roles.renderer_image import OwnImage
from wall.roles.statistics import Due, tiles_of
from wall.sampling.tiles import Measured

LOOK_AGAIN_S = 0.05  # a resting worker looks this often whether something is missing: samples grow old
CREDIT_POLL_S = 0.002  # how often a renderer without credit looks for some
COST_S = 0.5  # a cost is of batches of so long
NEWEST_COST = 0.25  # share of the newest in the mean of costs, once there are so many
LEAST_S = 1e-6  # that a batch counts as, however short it was
PROGRESSIVE = "progressive"  # the sampler whose stages depend on how long paths get


class RegionRenderer:
    """A region's workers, and the time that they have used."""

    def __init__(self, plan: Plan, rank: int, region: Region, image: OwnImage | None = None) -> None:
        """`image`: made here of the samples. Works once `place` has said which workers it has."""
        self.region = region
        view, sampling = plan.layout.config.views[self.region.view], plan.layout.sampling_of(self.region.view)
        self.view: str = view.id
        self.event: Event | None = None  # the newest
        self.complete = False  # nothing is missing under the newest event
        self.target = plan.layout.layer(self.region).compositor
        self.threads, self.image = sampling.threads, image
        self.used = 0.0  # seconds spent on it, over its view's weight, and those that others used while it rested
        self.seconds = 0.0  # spent on it
        self.work: dict[int, Work] = {}
        self.running: set[int] = set()  # workers that trace
        self._rank, self._number, self._weight = rank, 0, view.weight
        self._workers = range(0)
        self._configured: str = sampling.method
        self._scene = plan.scene_of(self.region.view)
        depth = self._scene.path_depth if self._configured == PROGRESSIVE else None
        self._samplers: tuple[str, str, int | None] = (self._configured, "", depth)  # the second is compared
        self._starts_over = False
        self._resting: dict[int, tuple[Number, float]] = {}  # under which event, and when it looks again
        self._lost: dict[int, list[bytes]] = {}  # by worker: packets that were dropped
        self._tiles: dict[int, Measured] = {}  # the newest of each worker's sampler, while a viewer shows them
        self._tiles_due = {worker: Due() for worker in range(self.threads)}
        self._refreshing_s = 0.0
        self._measured = (0, 0.0, 0.0)  # since the last cost: batches, seconds that they took, demand for each
        self._samples_then, self._cost_due = -1, -math.inf
        images_hz = plan.layout.layer(region).samples_hz
        self._most_per_s = math.inf if images_hz is None else images_hz * region.rect.area  # samples
        self._waits_until = -math.inf  # since it has traced as many as it may
        self.cost, self._costs = 0.0, 0  # of a sweep, see Balancer, 0: not measured yet; how often it was measured

    def place(self, number: int, first: int) -> int:
        """Be region `number` of the rank, with workers from `first` on. Only while they are idle.

        Returns the worker behind its last.
        """
        by = first - self._workers.start
        self.work = {worker + by: work for worker, work in self.work.items()}
        self._resting = {worker + by: rest for worker, rest in self._resting.items()}
        self._lost = {worker + by: lost for worker, lost in self._lost.items()}
        self._tiles = {worker + by: tiles for worker, tiles in self._tiles.items()}
        self._tiles_due = {worker + by: due for worker, due in self._tiles_due.items()}
        self._number, self._workers = number, range(first, first + self.threads)
        return first + self.threads

    def follow(self, event: Event) -> None:
        """Take an event of the region's view, unless a newer one came before."""
        if event.view != self.region.view or (self.event is not None and event.number < self.event.number):
            return
        self.event = event
        if self.image is not None:
            self.image.follow(event)
        self.complete = self.complete and self._all_rest()

    def give_work(self, now: float, ready: Ready) -> Iterator[Trace | Restart]:
        """Let idle workers trace, one after the other, as far as the caller goes on."""
        event = self.event
        if event is None:
            return
        wanted = self._wanted(event)
        # another sampler, or two, or stages of other paths, or samples that were lost: all workers start over
        if wanted != self._samplers or self._starts_over:
            if self.running:
                return
            self._samplers, self._starts_over = wanted, False
            self._resting.clear()
            self._lost.clear()  # packets of samplers that are gone
            self._tiles.clear()
            yield Restart(*wanted, region=self._number)
        if not event.statistics:
            self._tiles.clear()
        for worker in self._workers:
            if not self.has_credit(ready) or self.waits(now):
                return
            if worker in self.running or self.rests(worker, now):
                continue
            self.running.add(worker)
            measure = event.statistics and self._tiles_due[worker].now(now)
            lost, keep = tuple(self._lost.pop(worker, ())), self.image is not None
            yield Trace(worker, event, lost=lost, keep=keep, measure=measure)

    def start_over(self) -> None:
        """Trace everything again: who had the samples has none of them any more."""
        self._starts_over, self.complete = True, False
        self._resting.clear()

    def waits(self, now: float) -> bool:
        """Whether it has traced as many samples by now as its layer may have."""
        return now < self._waits_until

    def has_work(self, now: float) -> bool:
        """Whether something is there to trace now, for all that is known."""
        return (not self._all_rest() or bool(self._lost)) and not self.waits(now)

    def has_credit(self, ready: Ready) -> bool:
        """Whether what is traced would be sent at once."""
        return self.image is not None or ready(self.target)

    def due(self, now: float, ready: Ready) -> float:
        """When a worker has something to do next, seconds of the head's clock."""
        if self.event is None:
            return now + LOOK_AGAIN_S
        idle = [worker for worker in self._workers if worker not in self.running]
        again = min((self._resting.get(worker, (NEVER, now))[1] for worker in idle), default=now + LOOK_AGAIN_S)
        again = max(again, self._waits_until)
        return max(again, now + CREDIT_POLL_S) if not self.has_credit(ready) else again

    def _wanted(self, event: Event) -> tuple[str, str, int | None]:
        """The event's sampler, the one compared with it, and the most surfaces of progressive paths, else None."""
        methods = (event.sampler or self._configured, event.compare)
        if PROGRESSIVE not in methods:
            return *methods, None
        return *methods, self._scene.shading(event.scene_time, event.edits).path_depth

    def rests(self, worker: int, now: float) -> bool:
        """Whether a worker has found that nothing is missing, and need not look again yet."""
        number, again = self._resting.get(worker, (NEVER, now))
        return self.event is not None and number == self.event.number and now < again and worker not in self._lost

    @property
    def idle(self) -> bool:
        """Whether nothing is there to trace, for all that is known."""
        return not self.running and self._all_rest() and not self._lost

    def _all_rest(self) -> bool:
        return self.event is not None and all(
            self._resting.get(worker, (NEVER, 0.0))[0] == self.event.number for worker in self._workers
        )

    def take(self, traced: Traced, now: float) -> Iterator[bytes]:
        """Take in what a worker has traced, or let it rest. Yields the packets that are to be sent."""
        self.running.discard(traced.worker)
        samples = traced.work.samples - self.work.get(traced.worker, Work()).samples
        self._waits_until = max(self._waits_until, now - traced.seconds) + samples / self._most_per_s
        self.work[traced.worker] = traced.work
        self._spend(max(traced.seconds, LEAST_S))
        if traced.result is not None:
            self._measure_cost(max(traced.cpu_s, LEAST_S), now)
        if traced.measured is not None:
            self._tiles[traced.worker] = traced.measured
        if traced.measured is not None and traced.worker == self._workers[-1]:
            tiles = tiles_of(self._rank, self.region.panel, self._tiles.values())
            if self.image is not None:
                self.image.keep(tiles)
            else:
                yield serialise(tiles)
        if traced.result is None:
            self._resting[traced.worker] = (traced.event.number, now + LOOK_AGAIN_S)
            return
        self._resting.pop(traced.worker, None)
        if self.image is not None and isinstance(traced.result, Batch):
            if len(traced.result.samples):
                self.image.insert(traced.result)
        elif isinstance(traced.result, bytes) and traced.result:
            yield traced.result

    def _measure_cost(self, seconds: float, now: float) -> None:
        """Update `cost` every COST_S: CPU seconds a sample, times what the sampler has to do; not when it starts."""
        work = self.work.values()
        batches, spent, demand = self._measured
        self._measured = batches + 1, spent + seconds, demand + sum(each.demand for each in work)
        if self._cost_due == -math.inf:
            self._cost_due = now + COST_S
        samples = sum(each.samples for each in work)
        if now >= self._cost_due and samples > self._samples_then:
            batches, spent, demand = self._measured
            newest = demand / batches * spent / (samples - self._samples_then)
            if self._samples_then >= 0:
                self._costs += 1
                self.cost += (newest - self.cost) * max(1.0 / self._costs, NEWEST_COST)
            self._measured, self._samples_then, self._cost_due = (0, 0.0, 0.0), samples, now + COST_S

    def note_refreshes(self) -> None:
        """Count the time that its own image has taken since the last call."""
        if self.image is not None:
            self._spend(self.image.refreshing_s - self._refreshing_s)
            self._refreshing_s = self.image.refreshing_s

    def _spend(self, seconds: float) -> None:
        self.seconds += seconds
        self.used += seconds / self._weight

    def lose(self, batch: Batch, packet: bytes) -> None:
        """A packet of samples was dropped: its worker is to trace them again, unless the region has moved since."""
        if batch.rect != self.region.rect:
            return
        self._lost.setdefault(self._workers[batch.sequence % self.threads], []).append(packet)
        self.complete = False

    def tell_completeness(self) -> bool:
        """See whether nothing is missing now. Returns whether that is news."""
        was, all_sent = self.complete, self.image is None or self.image.complete
        self.complete = self._all_rest() and not self._lost and all_sent
        return was != self.complete
