"""One thread's share of a renderer, and its hot path: choose, trace, observe, encode."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace

import numpy as np

from wall.config.sampling import AdaptiveSampling, FramedSampling, HilbertSampling, ProgressiveSampling, switched
from wall.core.clock import Clock
from wall.core.data import Batch, Event, Float32, Region, Samples
from wall.geometry.cameras import PanelView
from wall.packets.samples import TOO_BRIGHT, Codec, decode, encode
from wall.roles.adaptive_renderer import AdaptiveRenderer, bands
from wall.roles.instructions import Work
from wall.roles.plan import Plan
from wall.roles.renderer_image import OwnImage
from wall.roles.row_prediction import Parts, RowPrediction
from wall.sampling.base import Sampler, Targets
from wall.sampling.framed import FrameCounter, FramedSampler
from wall.sampling.frameless import FramelessSampler
from wall.sampling.hilbert import HilbertSampler
from wall.sampling.progressive import ProgressiveSampler, Schedule
from wall.sampling.split import SplitSampler
from wall.sampling.tiles import Measured
from wall.tracing.tracer import Traced, Tracer
from wall.tracing.tracer_scene import TracerScene

MOST_ANSWERS = 64  # that are remembered
NOWHERE: Float32 = np.empty((0, 2), np.float32)


class Worker:
    """Traces its own pixels of one region. `step(newest)` gives the next packet, or None when nothing is missing."""

    def __init__(
        self,
        plan: Plan,
        tracer_scene: TracerScene,
        rank: int,
        clock: Clock,
        samplers: list[Sampler],
        worker: int,
        region: Region | None = None,
        *,
        rows: RowPrediction | None = None,
        tracing_threads: int = 1,
    ) -> None:
        """`samplers`: of all workers of the region; `worker`: which one this is; `region`: None: the rank's first.

        `rows`: of the region, where its display shows one row after the other. `tracing_threads`: that share a batch.
        """
        layout, region = plan.layout, region or plan.layout.region(rank)
        self.sampler = samplers[worker]
        self.work = Work()
        self._region, self._rank, self._clock = region, rank, clock
        self._codec = Codec[layout.config.transport.codec.upper()]
        share = layout.layer(region).range
        seen = plan.scene.objects_in(share) if share is not None else None
        panel = layout.panel(region)
        self._panel_view = PanelView(plan.view_of(panel), panel)
        tracer_scene = tracer_scene.under(plan.scene_of(panel.view))
        eye, coherent = self._panel_view.eye, self.sampler.coherent
        self._tracer = Tracer(tracer_scene, panel, eye, coherent=coherent, seen=seen, threads=tracing_threads)
        self._relightable, self._noisy = tracer_scene.needs.relighting, tracer_scene.needs.paths
        self._depths, self._objects = layout.graph.fields_of(layout.layer(region))
        self._cut_off = Counter[str]()
        self._placed: Event | None = None
        self._answered: tuple[int, int] | None = None  # number of the newest event that was traced
        self._answers: tuple[float, ...] = ()
        self._sequence, self._workers = worker, len(samplers)
        self._lost: deque[Batch] = deque()
        self._rows = rows
        self._foreseen: tuple[int, int] | None = None  # number of the event under which rays went where it was expected

    @property
    def cpu_beside_s(self) -> float:
        """CPU seconds so far of threads that traced for it beside its own."""
        return self._tracer.cpu_beside_s

    def step(self, newest: Event) -> bytes | None:
        """Traces and encodes one batch at the newest event; returns the packet, or None without targets.

        The packet is empty where nothing is to be shown yet.
        """
        batch = self.trace(newest)
        if batch is None:
            return None
        return self._encoded(batch, self._codec) if len(batch.samples) else b""

    def keep(self, newest: Event) -> Batch | None:
        """Traces one batch that does not travel: rounded as one that does, so pixels have the same bits either way.

        Only that of the adaptive sampler, whose images are rounded by nothing else, keeps its own values.
        """
        batch = self.trace(newest)
        if batch is None or batch.adaptive or not len(batch.samples):
            return batch
        return decode(self._encoded(batch, Codec.NONE))

    def _encoded(self, batch: Batch, codec: Codec) -> bytes:
        packet = encode(batch, codec, self._cut_off)
        self.work = replace(self.work, too_bright=self._cut_off[TOO_BRIGHT])
        return packet

    def trace(self, newest: Event) -> Batch | None:
        """Traces one batch at the newest event; returns None without targets."""
        while self._lost:
            lost = self._lost.popleft()
            _of_kind(self.sampler, lost.adaptive).forget(lost.samples, lost.base_time)
        chosen_for = self._choose(newest)
        if chosen_for is None:
            return None
        targets, parts = chosen_for
        event = self._panel_view(parts[len(parts) // 2][0])
        self._tracer_at(self._panel_view(parts[0][0]), self.sampler.coherent)
        began = self._clock.now()
        self._answer(event, began)
        samples, cost = self._trace(parts, targets)
        step = max(0.0, self._clock.now() - began) / max(len(targets.xy), 1)
        samples["time"] = np.arange(len(samples), dtype=np.float32) * np.float32(step)
        self.sampler.observe(samples, began)
        chosen = _chosen(self.sampler)
        if isinstance(chosen, ProgressiveSampler):
            samples = chosen.resolve()
        second = isinstance(self.sampler, SplitSampler) and self.sampler.turn
        self.work = Work(
            samples=self.work.samples + cost.primary,
            compared=self.work.compared + cost.primary * second,
            secondary_rays=self.work.secondary_rays + cost.shadow + cost.secondary,
            bad_samples=self.work.bad_samples + cost.bad,
            too_bright=self.work.too_bright,
            samples_per_pixel=chosen.samples_shown if isinstance(chosen, ProgressiveSampler) else 0,
            square_error=chosen.square_error if isinstance(chosen, ProgressiveSampler) else 0.0,
            answers=self._answers,
            demand=self._demand(chosen),
        )
        self._sequence += self._workers
        return Batch(
            view=event.view,
            panel=self._region.panel,
            rect=self._region.rect,
            rank=self._rank,
            sequence=self._sequence,
            camera_event=event.camera_event,
            scene_event=event.scene_event,
            base_time=began,
            samples=samples,
            frame=targets.frame,
            frame_samples=targets.frame_samples,
            skipped=cost.bad,
            blend=targets.blend,
            camera=event.camera,
            scene_time=event.scene_time,
            adaptive=isinstance(chosen, AdaptiveRenderer),
            depths=self._depths or isinstance(chosen, AdaptiveRenderer),
            objects=self._objects or isinstance(chosen, AdaptiveRenderer),
            foreseen=self._foreseen == event.number and not isinstance(chosen, AdaptiveRenderer),
            relightable=self._relightable,
            noisy=self._noisy,
            edits=event.edits,
        )

    def _choose(self, newest: Event) -> tuple[Targets, Parts] | None:
        """The next targets, and what is traced under which event; None where nothing is missing.

        A sampler that was done under an event as it was expected starts over once that has come to rest; until then
        its batches are empty.
        """
        targets, rows = self.sampler.choose(newest), self._rows
        if rows is None or (targets is not None and isinstance(_chosen(self.sampler), AdaptiveRenderer)):
            return None if targets is None else (targets, [(targets.event, targets.xy)])
        now = self._clock.now()
        if targets is None:
            if self._foreseen != newest.number:
                return None
            if rows.rests(newest, now):
                self._start_over()
            return Targets(xy=NOWHERE, event=newest), [(newest, NOWHERE)]
        one_image = not isinstance(_chosen(self.sampler), FramelessSampler)
        parts = rows.parts(targets, newest, now, one_image=one_image)
        if parts[0][0] is not targets.event:
            self._foreseen = targets.event.number
        elif self._foreseen == targets.event.number and not isinstance(_chosen(self.sampler), FramedSampler):
            self._start_over()
            return self._choose(newest)
        else:
            self._foreseen = None  # the next frame is whole, and of the event itself
        return targets, parts

    def _start_over(self) -> None:
        self._foreseen = None
        _of_kind(self.sampler, adaptive=False).restart()

    def _trace(self, parts: Parts, targets: Targets) -> tuple[Samples, Traced]:
        """Trace each part under its event."""
        traced = []
        for event, xy in parts:
            tracer = self._tracer_at(self._panel_view(event), self.sampler.coherent)
            traced.append(tracer.trace(xy, targets.footprint, targets.number, targets.depth))
        if len(traced) == 1:
            return traced[0]
        samples, costs = zip(*traced, strict=True)
        return np.concatenate(samples), Traced(
            primary=sum(cost.primary for cost in costs), shadow=sum(cost.shadow for cost in costs),
            secondary=sum(cost.secondary for cost in costs), bad=sum(cost.bad for cost in costs),
        )  # fmt: skip

    def _demand(self, sampler: Sampler) -> float:
        if isinstance(sampler, AdaptiveRenderer):
            return sampler.demand
        return self._region.rect.area / self._workers

    def _answer(self, event: Event, now: float) -> None:
        """Note how long the input of an event waited for its first ray; not the first, which the start delayed."""
        if self._answered is not None and event.number != self._answered:
            self._answers = (*self._answers[1 - MOST_ANSWERS :], max(0.0, now - event.input_time))
        self._answered = event.number

    def measure_tiles(self) -> Measured | None:
        """What the adaptive sampler knows of its tiles, None where there is none. Only between two steps."""
        sampler = _of_kind(self.sampler, adaptive=True)
        return sampler.measure() if isinstance(sampler, AdaptiveRenderer) else None

    def _tracer_at(self, event: Event, coherent: bool) -> Tracer:
        self._tracer.expect(coherent=coherent)
        if self._placed is not event:
            self._tracer.set_event(event)
            self._placed = event
        return self._tracer

    def forget(self, batch: Batch) -> None:
        """A packet of ours was dropped before it was sent. May be called while another thread runs `step`."""
        self._lost.append(batch)


def _chosen(sampler: Sampler) -> Sampler:
    """Whose the newest batch is."""
    return sampler.sides[sampler.turn] if isinstance(sampler, SplitSampler) else sampler


def _of_kind(sampler: Sampler, adaptive: bool) -> Sampler:
    """Whose a batch was; of the two that are compared exactly one is adaptive."""
    if not isinstance(sampler, SplitSampler):
        return sampler
    first, second = sampler.sides
    return first if isinstance(first, AdaptiveRenderer) == adaptive else second


def make_samplers(
    plan: Plan,
    method: str,
    region: Region,
    clock: Clock,
    *,
    compare: str = "",
    shown: OwnImage | None = None,
    depth: int | None = None,
) -> list[Sampler]:
    """One sampler a thread for a region; `method` (from the viewer) overrides the configured one unless empty.

    `compare`: another method that gets half of the rays, unless empty; `shown`: see AdaptiveRenderer; `depth`: most
    surfaces of the progressive sampler's paths, None: those of the scene as configured.
    """
    if compare:
        both = (make_samplers(plan, each, region, clock, shown=shown, depth=depth) for each in (method, compare))
        return [SplitSampler(first, second) for first, second in zip(*both, strict=True)]
    sampling = plan.layout.sampling_of(region.view)
    if method:
        sampling = switched(sampling, method)
    if isinstance(sampling, AdaptiveSampling):
        own = bands(region.rect, sampling.threads)
        return [AdaptiveRenderer(plan, sampling, region, band, clock, shown) for band in own]
    workers, batch, seed = sampling.threads, sampling.samples_per_batch, sampling.seed
    if isinstance(sampling, FramedSampling):
        counter = FrameCounter(workers)
        return [FramedSampler(region.rect, counter, batch=batch, worker=k, workers=workers) for k in range(workers)]
    if isinstance(sampling, ProgressiveSampling):
        longest = depth or plan.scene_of(region.view).path_depth or 0
        schedule = Schedule(
            first_stage=sampling.first_stage,
            samples_per_pixel=sampling.samples_per_pixel,
            rest_s=sampling.rest_s,
            target_hz=sampling.target_hz,
            first_depth=min(sampling.first_depth, longest),
            depth=longest,
        )
        return [
            ProgressiveSampler(region.rect, clock.now, schedule, batch=batch, seed=seed, worker=k, workers=workers)
            for k in range(workers)
        ]
    if isinstance(sampling, HilbertSampling):
        return [
            HilbertSampler(
                region.rect,
                batch=batch,
                seed=seed,
                chunk=sampling.chunk_pixels,
                blend=sampling.blend,
                camera_update_percent=sampling.camera_update_percent,
                worker=k,
                workers=workers,
            )
            for k in range(workers)
        ]
    return [FramelessSampler(region.rect, batch=batch, seed=seed, worker=k, workers=workers) for k in range(workers)]
