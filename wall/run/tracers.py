"""The workers of a renderer: one is stepped by the loop itself, several in a thread each."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from wall.core.clock import Clock
from wall.core.data import Batch
from wall.packets.samples import decode, encode
from wall.roles.instructions import Restart, Trace, Traced
from wall.roles.plan import Plan
from wall.roles.renderer_image import RendererImage
from wall.roles.worker import Worker, make_samplers
from wall.tracing.tracer_scene import TracerScene


class Tracers:
    """Executes Trace and Restart for one rank."""

    def __init__(
        self,
        plan: Plan,
        tracer_scene: TracerScene,
        rank: int,
        clock: Clock,
        *,
        threads: bool = True,
        image: RendererImage | None = None,
    ) -> None:
        """`threads`: False steps all workers in the caller's. `image`: made of the samples by this rank itself."""
        self._plan, self._regions, self._clock = plan, plan.layout.regions_of(rank), clock
        self._images = [None] * len(self._regions) if image is None else image.images
        self._of_regions: list[list[Worker]] = []
        for region, shown in zip(self._regions, self._images, strict=True):
            samplers = make_samplers(plan, "", region, clock, shown=shown)
            own = [Worker(plan, tracer_scene, rank, clock, samplers, k, region) for k in range(len(samplers))]
            self._of_regions.append(own)
        self.workers = [worker for own in self._of_regions for worker in own]
        at_once = max(map(len, self._of_regions))
        self._pool = ThreadPoolExecutor(at_once) if threads and at_once > 1 else None
        self._running: set[Future[Traced]] = set()

    def start(self, trace: Trace) -> list[Traced]:
        """Trace now and give the answer, or let a thread begin; then `finished` gives it."""
        if self._pool is None:
            return [self._step(trace)]
        self._running.add(self._pool.submit(self._step, trace))
        return []

    def _step(self, trace: Trace) -> Traced:
        worker, began = self.workers[trace.worker], self._clock.now()
        for lost in trace.lost:
            worker.forget(decode(lost))
        traced = _kept(worker.trace(trace.event)) if trace.keep else worker.step(trace.event)
        measured = worker.measure_tiles() if trace.measure else None
        return Traced(trace.worker, trace.event, traced, worker.work, measured, max(0.0, self._clock.now() - began))

    def finished(self) -> Iterator[Traced]:
        """Answers of threads that are done."""
        for future in [future for future in self._running if future.done()]:
            self._running.discard(future)
            yield future.result()

    @property
    def running(self) -> bool:
        """Whether a thread is at work."""
        return bool(self._running)

    def wait(self, seconds: float) -> None:
        """Sleep until a thread is done, or the time is over."""
        wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)

    def restart(self, restart: Restart) -> None:
        """Make a region's samplers anew. Only while no thread is at work on it."""
        k = restart.region
        samplers = make_samplers(
            self._plan, restart.sampler, self._regions[k], self._clock,
            compare=restart.compare, shown=self._images[k], depth=restart.depth,
        )  # fmt: skip
        for worker, own in zip(self._of_regions[k], samplers, strict=True):
            worker.sampler = own

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown(wait=True)


def _kept(batch: Batch | None) -> Batch | None:
    """A batch that does not travel: rounded as one that does, so that pixels have the same bits either way.

    Only that of the adaptive sampler, whose images are rounded by nothing else, keeps its own values.
    """
    return batch if batch is None or batch.adaptive or not len(batch.samples) else decode(encode(batch))
