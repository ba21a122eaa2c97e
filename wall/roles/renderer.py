"""The renderer: always the newest event, one batch at a time, sent at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from wall.core.data import Counters, Event
from wall.packets.control import Heartbeat, serialise
from wall.packets.samples import decode, is_samples
from wall.roles.plan import Plan
from wall.roles.statistics import Due, tiles_of
from wall.roles.worker import Worker, make_samplers
from wall.run.control import Control
from wall.run.usage import peak_memory
from wall.sampling.tiles import Measured
from wall.tracing.tracer_scene import TracerScene
from wall.transport.base import Link

IDLE_WAIT_S = 0.05  # a complete view looks for a new event this often, if none wakes it


class Renderer:
    def __init__(self, plan: Plan, tracer_scene: TracerScene, rank: int, control: Control, outbox: Link) -> None:
        self._plan, self._rank, self._control, self._outbox = plan, rank, control, outbox
        self._sampling, self._region = plan.layout.sampling, plan.layout.region(rank)
        self._methods: tuple[str, str] = (self._sampling.method, "")  # the second is compared with the first
        self._samplers = make_samplers(plan, "", self._region, control.clock)
        self._workers = [
            Worker(plan, tracer_scene, rank, control.clock, self._samplers, k) for k in range(len(self._samplers))
        ]
        self._pool = ThreadPoolExecutor(len(self._workers)) if len(self._workers) > 1 else None
        self._running: dict[Future[bytes | None], Worker] = {}
        self._tiles: dict[int, Measured] = {}  # newest of each worker, while a viewer shows them
        self._tiles_due = [Due() for _ in self._workers]
        self._counters = Counters()
        self._packets = self._bytes = 0
        self._complete = False
        self._began, self._last = time.monotonic(), (time.monotonic(), 0, 0, 0)
        self._rates = (0.0, 0.0, 0.0)  # samples, bytes, samples of the second sampler; a second, lately

    def run(self) -> None:
        """Until the head says stop."""
        control, outbox = self._control, self._outbox
        while not control.stopped:
            event = control.newest()
            self._report()
            if event is None or not outbox.ready():
                outbox.wait(0.002)
                continue
            self._follow_sampler(event)
            found = False
            for packet in self._step(event):
                found = True
                self._offer(packet)
            idle = not found and not self._running
            if idle != self._complete:
                self._complete = idle
                self._report(now=True)
            if idle:
                control.wait(IDLE_WAIT_S)
        self._drain()
        control.beat(self._heartbeat(last=True))

    def _step(self, event: Event) -> Iterator[bytes]:
        """Packets that are ready: of the one worker, or of those threads that finished first."""
        if self._pool is None:
            yield from self._ready(self._workers[0], self._workers[0].step(event), event)
            return
        for worker in self._workers:
            if worker not in self._running.values():
                self._running[self._pool.submit(worker.step, event)] = worker
        done, _ = wait(self._running, return_when=FIRST_COMPLETED)
        for future in done:
            yield from self._ready(self._running.pop(future), future.result(), event)

    def _ready(self, worker: Worker, packet: bytes | None, event: Event) -> Iterator[bytes]:
        """The samples of a worker that is between two steps, if it has any."""
        self._send_tiles(worker, event)
        if packet is not None:
            yield packet

    def _send_tiles(self, worker: Worker, event: Event) -> None:
        """Send the samplers' tiles a few times a second while a viewer shows them; samples do not wait for them."""
        if not event.statistics:
            self._tiles.clear()
        elif self._outbox.ready() and self._tiles_due[worker.worker].now(self._control.clock.now()):
            measured = worker.measure_tiles()
            if measured is not None:
                self._tiles[worker.worker] = measured
            if self._tiles and worker is self._workers[-1]:
                self._offer(serialise(tiles_of(self._rank, self._region.panel, self._tiles.values())))

    def _offer(self, packet: bytes) -> None:
        self._packets += 1
        self._bytes += len(packet)
        for dropped in self._outbox.offer(packet):
            if not is_samples(dropped):
                continue  # tiles: the next ones replace them
            batch = decode(dropped)
            self._workers[batch.sequence % len(self._workers)].forget(batch)

    def _follow_sampler(self, event: Event) -> None:
        """The viewer chose another sampler, or two: start over with it."""
        wanted = (event.sampler or self._methods[0], event.compare)
        if wanted != self._methods:
            self._drain()
            self._methods = wanted
            self._tiles.clear()
            self._samplers[:] = make_samplers(
                self._plan, wanted[0], self._region, self._control.clock, compare=wanted[1]
            )

    def _drain(self) -> None:
        for future in list(self._running):
            packet = future.result()
            if packet is not None:
                self._offer(packet)
        self._running.clear()

    def _report(self, *, now: bool = False) -> None:
        if now or self._control.beat_due():
            self._control.beat(self._heartbeat(last=False))

    def _heartbeat(self, *, last: bool) -> Heartbeat:
        traced = sum(worker.samples_traced for worker in self._workers)
        compared = sum(worker.samples_compared for worker in self._workers)
        now, (then, *before) = time.monotonic(), self._last
        span = max(now - then, 1e-3)
        if span > 0.2:
            self._last = (now, traced, self._bytes, compared)
            traced_then, bytes_then, compared_then = before
            self._rates = (
                (traced - traced_then) / span, (self._bytes - bytes_then) / span, (compared - compared_then) / span
            )  # fmt: skip
        samples_per_s, bytes_per_s, compared_per_s = self._rates
        bad = sum(worker.bad_samples for worker in self._workers)
        dropped = Counters(dict(self._counters.counts))
        dropped.merge(self._outbox.counters.counts)
        dropped.merge(self._control.counters.counts)
        dropped.add("not_finite", bad)
        event = self._control.event
        return Heartbeat(
            rank=self._rank,
            time=self._control.clock.now(),
            samples_traced=traced,
            secondary_rays=sum(worker.secondary_rays for worker in self._workers),
            samples_per_s=samples_per_s,
            compared_per_s=compared_per_s,
            bytes_per_s=bytes_per_s,
            packets=self._packets,
            bytes=self._bytes,
            seconds=now - self._began,
            peak_memory=peak_memory(),
            dropped=dropped.counts,
            complete=self._complete,
            camera_event=event.camera_event if event else -1,
            scene_event=event.scene_event if event else -1,
            last=last,
        )

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True)
