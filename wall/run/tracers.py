"""The workers of a renderer: one is stepped by the loop itself, several in a thread each."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from wall.core.clock import Clock
from wall.core.data import Batch
from wall.packets.samples import decode, encode
from wall.roles.instructions import Trace, Traced
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
        self._plan, self._region, self._clock = plan, plan.layout.region(rank), clock
        self._image = image
        samplers = make_samplers(plan, "", self._region, clock, shown=image)
        self.workers = [Worker(plan, tracer_scene, rank, clock, samplers, k) for k in range(len(samplers))]
        self._pool = ThreadPoolExecutor(len(self.workers)) if threads and len(self.workers) > 1 else None
        self._running: set[Future[Traced]] = set()

    def start(self, trace: Trace) -> list[Traced]:
        """Trace now and give the answer, or let a thread begin; then `finished` gives it."""
        if self._pool is None:
            return [self._step(trace)]
        self._running.add(self._pool.submit(self._step, trace))
        return []

    def _step(self, trace: Trace) -> Traced:
        worker = self.workers[trace.worker]
        for lost in trace.lost:
            worker.forget(decode(lost))
        traced = _kept(worker.trace(trace.event)) if trace.keep else worker.step(trace.event)
        measured = worker.measure_tiles() if trace.measure else None
        return Traced(trace.worker, trace.event, traced, worker.work, measured)

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

    def restart(self, sampler: str, compare: str, depth: int | None = None) -> None:
        """Make all samplers anew; `depth` as in make_samplers. Only while no thread is at work."""
        samplers = make_samplers(
            self._plan, sampler, self._region, self._clock, compare=compare, shown=self._image, depth=depth
        )
        for worker, own in zip(self.workers, samplers, strict=True):
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
