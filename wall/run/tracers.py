"""The workers of a renderer: one is stepped by the loop itself, several in a thread each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import chain, count
from threading import Lock
from time import thread_time

from wall.core.clock import Clock
from wall.core.data import Batch, Event, Region
from wall.core.errors import RunError, WallError
from wall.packets.samples import decode
from wall.roles.instructions import Restart, Trace, Traced
from wall.roles.plan import Plan
from wall.roles.renderer_image import OwnImage, RendererImage
from wall.roles.row_prediction import RowPrediction
from wall.roles.worker import Worker, make_samplers
from wall.tracing.tracer_scene import TracerScene

OnTraced = Callable[[int, Trace, bytes | Batch | None], None]  # number of the batch in the rank, and its result


class BatchError(RunError):
    """A batch could not be traced."""

    def __init__(self, text: str, number: int, event: Event) -> None:
        """`number`: of the batch in its rank."""
        super().__init__(text)
        self.replay = {"batch": number, "camera_event": event.camera_event, "scene_event": event.scene_event}


def threads_of(cores: float) -> int:
    """How many threads share the rays of a renderer whose process has so many cores."""
    return max(1, round(cores))


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
        traced: OnTraced | None = None,
        life: int = 0,
    ) -> None:
        """`threads`: False traces all in the caller's, in the same order every time.

        `image`: made of the samples by this rank itself. `traced` is told every batch, by the thread that has traced
        it. `life`: how often the rank was started before.
        """
        self._rank, self._traced, self._numbers, self._life = rank, traced, count(), life
        self._plan, self._regions, self._clock = plan, plan.layout.regions_of(rank), clock
        self._images = (None,) * len(self._regions) if image is None else image.images
        self._tracer_scene = tracer_scene
        self._sharing = threads_of(plan.cores) if threads else 1
        times = len({plan.views[k].timing for k in plan.layout.views_of(rank)})
        for series in plan.scene.series:  # of ranks in one process, who share them, the one with most times counts
            series.meshes.times = max(series.meshes.times, times)
        self._of_regions = [self._workers_of(*each) for each in zip(self._regions, self._images, strict=True)]
        self.workers = list(chain.from_iterable(self._of_regions))
        at_once = max(map(len, self._of_regions), default=plan.layout.sampling.threads)
        self._pool = ThreadPoolExecutor(at_once) if threads and at_once > 1 else None
        self._running: set[Future[Traced]] = set()

    def _workers_of(self, region: Region, shown: OwnImage | None) -> list[Worker]:
        samplers = make_samplers(self._plan, "", region, self._clock, shown=shown)
        scanned = self._plan.layout.panel(region).scan is not None
        rows = RowPrediction(self._plan, region, Lock()) if scanned else None
        return [
            Worker(
                self._plan, self._tracer_scene, self._rank, self._clock, samplers, k, region,
                rows=rows, tracing_threads=max(1, self._sharing // len(samplers)),
            )
            for k in range(len(samplers))
        ]  # fmt: skip

    def reassign(self, regions: tuple[Region, ...]) -> None:
        """Trace these regions from now on. Only while no thread is at work."""
        kept = dict(zip(self._regions, self._of_regions, strict=True))
        self._of_regions = [kept.get(region) or self._workers_of(region, None) for region in regions]
        self._regions, self._images = regions, (None,) * len(regions)
        self.workers = list(chain.from_iterable(self._of_regions))

    def start(self, trace: Trace) -> list[Traced]:
        """Trace now and give the answer, or let a thread begin; then `finished` gives it."""
        if self._pool is None:
            return [self._step(trace)]
        self._running.add(self._pool.submit(self._step, trace))
        return []

    def _step(self, trace: Trace) -> Traced:
        worker, began, number = self.workers[trace.worker], self._clock.now(), next(self._numbers)
        cpu_began = thread_time() + worker.cpu_beside_s
        for lost in trace.lost:
            worker.forget(decode(lost))
        try:
            traced = worker.keep(trace.event) if trace.keep else worker.step(trace.event)
        except WallError:
            raise
        except Exception as error:
            raise BatchError(self._failure(number, trace.event, error), number, trace.event) from error
        if self._traced is not None:
            self._traced(number, trace, traced)
        cpu = thread_time() + worker.cpu_beside_s - cpu_began
        measured = worker.measure_tiles() if trace.measure else None
        return Traced(
            trace.worker, trace.event, traced, worker.work, measured, max(0.0, self._clock.now() - began), cpu
        )

    def _failure(self, number: int, event: Event, error: Exception) -> str:
        """Where and when tracing failed, and how to do just that again."""
        batch = f"{number}@{self._life}" if self._life else f"{number}"  # as `wall replay` takes it
        return (
            f"rank {self._rank}, batch {batch}: {type(error).__name__}: {error}; camera event {event.camera_event}, "
            f"scene event {event.scene_event}, scene time {event.scene_time!r} s; a run with --record FOLDER can be "
            f"replayed up to it: wall replay FOLDER --rank {self._rank} --batch {batch}"
        )

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
