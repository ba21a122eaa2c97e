"""How much of Embree's bare rate remains when rays are made, hits are lit and samples written."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from wall.config.loading import loads
from wall.config.schema import HilbertSampling
from wall.data import SAMPLE, Float32
from wall.measure.kernels import bare_queries
from wall.measure.record import SEED, Row, compared
from wall.processes.plan import Plan, first_event, make_layout, make_plan
from wall.sampling.hilbert import HilbertSampler
from wall.sampling.ownership import block_order
from wall.tracing import embree, kernels
from wall.tracing.packet import SHADE, SHADOW
from wall.tracing.resident import make_resident
from wall.tracing.tracer import Tracer

SCENE = """\
version: 1
scene: {{source: {source}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [480, 270], size: [0.48, 0.27]}}}}
views: [{{camera: {camera}}}]
"""
CAMERAS = {"courtyard": "{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}", "forest": "auto"}


def plan_of(source: str) -> Plan:
    """One panel of 480x270 that shows a built-in scene."""
    return make_plan(make_layout(loads(SCENE.format(source=source, camera=CAMERAS[source]), path=Path("measure.yaml"))))


class Bench:
    """A scene ready to trace, and its rays recorded as packets. Mirrors are left out: they would add rays."""

    def __init__(self, source: str) -> None:
        self.plan = plan_of(source)
        layout = self.plan.layout
        self.rect = layout.regions[0].rect
        self.tracer = Tracer(make_resident(self.plan.scene), layout.wall.panels[0], self.plan.view.eye, coherent=True)
        self.tracer.take(first_event(self.plan, 0.0))
        raster = (block_order(self.rect, worker=0, workers=1) + 0.5).astype(np.float32)
        self.raster = raster[: len(raster) // 16 * 16]
        self.samples = np.zeros(len(self.raster), SAMPLE)
        self._record()

    def arguments(self, xy: Float32, *, suns: Any = "all", points: Any = "all") -> tuple[Any, ...]:
        arguments = list(self.tracer.arguments(xy, self.samples[: len(xy)]))
        arguments[-2] = None                                                     # mirrors
        arguments[-5] = arguments[-5] if isinstance(points, str) else points
        arguments[-4] = arguments[-4] if isinstance(suns, str) else suns
        return tuple(arguments)

    def _record(self) -> None:
        """Every primary packet, and the shadow packet of every light that some lane of it faces."""
        work, all_arguments = self.tracer._work, self.arguments(self.raster)
        points, suns = all_arguments[-5], all_arguments[-4]
        lights = [(None, suns[k : k + 1]) for k in range(0 if suns is None else len(suns))]
        lights += [(points[k : k + 1], None) for k in range(0 if points is None else len(points))]
        hits, shadows, lit = [], [], []
        for first in range(0, len(self.raster), 16):
            xy = self.raster[first : first + 16]
            for point, sun in lights or [(None, None)]:
                work.counts[:] = 0
                kernels.trace(*self.arguments(xy, suns=sun, points=point))
                if work.counts[SHADOW]:
                    shadows.append(work.packet[SHADE : SHADE + embree.RAY_FLOATS].copy())
                    shadows[-1][embree.T_FAR : embree.T_FAR + 16] = _reach(shadows[-1], point)
                    lit.append(work.lit.copy())
            hits.append(work.packet[: embree.RAY_HIT_FLOATS].copy())
        self._fresh_hits, self._fresh_shadows = np.array(hits), np.array(shadows)
        bits = self._fresh_hits.view(np.uint32)
        self._fresh_hits[:, embree.T_FAR : embree.T_FAR + 16] = np.inf
        bits[:, embree.GEOMETRY : embree.INSTANCE + 16] = embree.NO_HIT
        self._hits = embree.aligned(self._fresh_hits.shape, np.float32)
        self._shadows = embree.aligned(self._fresh_shadows.shape, np.float32)
        self._lit = embree.aligned((len(lit), 16), np.int32)
        self._lit[:] = lit
        self._valid = embree.aligned((16,), np.int32)
        self._valid[:] = -1

    def bare_rate(self) -> float:
        """Samples a second of the recorded primary and shadow rays alone."""
        self._hits[:], self._shadows[:] = self._fresh_hits, self._fresh_shadows
        began = time.perf_counter()
        bare_queries(
            self.tracer._scene, self._hits, self._valid, self._shadows, self._lit, self.tracer._work.arguments
        )
        return len(self.raster) / (time.perf_counter() - began)

    def traced_rate(self, batches: list[Float32]) -> float:
        """Samples a second of whole samples at these positions."""
        ready = [self.arguments(xy) for xy in batches]
        began = time.perf_counter()
        for arguments in ready:
            kernels.trace(*arguments)
        return sum(len(xy) for xy in batches) / (time.perf_counter() - began)

    def hilbert_batches(self) -> list[Float32]:
        """One sweep of the Hilbert sampler at its default settings."""
        defaults, event = HilbertSampling(), first_event(self.plan, 0.0)
        sampler = HilbertSampler(self.rect, batch=defaults.samples_per_batch, seed=SEED, chunk=defaults.chunk_pixels)
        batches = []
        while (targets := sampler.choose(event)) is not None:
            batches.append(targets.xy)
        return batches[: len(batches) // 2]


def _reach(shadow: Float32, point: Float32 | None) -> Float32 | float:
    """How far shadow rays go: Embree overwrote it for those that something stopped."""
    if point is None:
        return float("inf")
    origin = np.stack([shadow[k : k + 16] for k in (embree.ORIGIN_X, embree.ORIGIN_Y, embree.ORIGIN_Z)], axis=1)
    reach: Float32 = np.linalg.norm(point[0, :3] - origin, axis=1).astype(np.float32)
    return reach


def measure(rounds: int) -> list[Row]:
    """trace_framed and trace_hilbert: the courtyard decides, the forest is reported beside it."""
    rows: dict[str, dict[str, Row]] = {"trace_framed": {}, "trace_hilbert": {}}
    for source in CAMERAS:
        bench = Bench(source)
        hilbert = bench.hilbert_batches()
        bench.bare_rate(), bench.traced_rate([bench.raster]), bench.traced_rate(hilbert)
        turns = [_turn(bench, hilbert) for _ in range(rounds)]
        framed, curve, bare = ([turn[k] / 1e6 for turn in turns] for k in range(3))
        about = {"unit": "M samples/s", "note": f"{source}, 480x270, one core, against its rays alone in raster order"}
        rows["trace_framed"][source] = compared("trace_framed", framed, bare, at_least=0.75, **about)
        rows["trace_hilbert"][source] = compared("trace_hilbert", curve, bare, at_least=0.5, **about)
    found = []
    for by_scene in rows.values():
        by_scene["courtyard"].more["forest_ratio"] = by_scene["forest"].ratio
        found.append(by_scene["courtyard"])
    return found


def _turn(bench: Bench, hilbert: list[Float32]) -> tuple[float, float, float]:
    """One round: whole samples in raster and in Hilbert order, and the bare rays, one after the other."""
    return bench.traced_rate([bench.raster]), bench.traced_rate(hilbert), bench.bare_rate()
