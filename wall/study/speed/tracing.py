"""How much of Embree's bare rate remains when rays are made, hits are lit and samples written."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from wall.config.loading import loads
from wall.config.sampling import HilbertSampling
from wall.core.data import SAMPLE, Event, Float32
from wall.core.errors import RunError
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.sampling.hilbert import HilbertSampler
from wall.sampling.ownership import block_order
from wall.study.speed.kernels.embree_rate import bare_queries
from wall.study.speed.record import SEED, Row, compared
from wall.tracing import embree
from wall.tracing.kernels import trace as kernels
from wall.tracing.kernels.lights import aim_directional, aim_point
from wall.tracing.kernels.rows import SHADOW_PACKET
from wall.tracing.kernels.values import SHADOW_RAYS, Lights, Workspace
from wall.tracing.tracer import Arguments, Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SCENE = """\
version: 1
scene: {{source: {source}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{width}, {height}], size: [0.48, 0.27]}}}}
views: [{{camera: {camera}}}]
"""
CAMERAS = {"courtyard": "{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}", "forest": "auto"}

BLOCK = 128  # packets that are traced at a time for the limit: with their shadow packets, 400 KB of cache
T_FAR = slice(embree.T_FAR, embree.T_FAR + embree.PACKET)
INSTANCE = slice(embree.INSTANCE, embree.INSTANCE + embree.PACKET)


def plan_of(source: str, pixels: tuple[int, int] = (480, 270)) -> Plan:
    """One panel of so many pixels, 16 : 9, that shows a built-in scene."""
    text = SCENE.format(source=source, camera=CAMERAS[source], width=pixels[0], height=pixels[1])
    return make_plan(make_layout(loads(text, path=Path("measure.yaml"))))


class Bench:
    """A scene ready to trace, and its rays recorded as packets. Mirrors are left out: they would add rays."""

    def __init__(self, source: str, chosen: tuple[Float32, Event] | None = None) -> None:
        """`chosen`: positions (n, 2) and the event they are traced under, instead of every pixel in raster order."""
        self.plan = plan_of(source)
        layout = self.plan.layout
        self.rect = layout.regions[0][0].rect
        tracer_scene, panel = make_tracer_scene(self.plan.scene), layout.wall.panels[0]
        self.tracer = Tracer(tracer_scene, panel, self.plan.view.eye, coherent=chosen is None)
        raster = (block_order(self.rect, worker=0, workers=1) + 0.5).astype(np.float32)
        raster, event = chosen or (raster, first_event(self.plan, 0.0))
        self.tracer.set_event(event)
        self.raster = raster[: len(raster) // 16 * 16]
        self.samples = np.zeros(len(self.raster), SAMPLE)
        self._record()

    def arguments(self, xy: Float32) -> Arguments:
        """The arguments of kernels.trace for positions (n, 2), without mirrors."""
        arguments = self.tracer.arguments(xy, self.samples[: len(xy)])
        return arguments._replace(materials=arguments.materials._replace(mirrors=None))

    def _record(self) -> None:
        """Every primary packet, and the shadow packet of every light that some lane of it faces."""
        work, given = self.tracer.works[0], self.arguments(self.raster)
        every, rounded = given.lights, given.materials.scattering.rounded
        dark = every._replace(directional=None, points=None)
        lights = [
            dark._replace(directional=row[None]) for row in (() if every.directional is None else every.directional)
        ]
        lights += [dark._replace(points=row[None]) for row in (() if every.points is None else every.points)]
        hits, shadows, lit, stopped, ends = [], [], [], [], []
        for first in range(0, len(self.raster), embree.PACKET):
            xy = self.raster[first : first + embree.PACKET]
            for light in lights or [dark]:
                work.counts[:] = 0
                kernels.trace(*self.arguments(xy)._replace(lights=light))
                if work.counts[SHADOW_RAYS]:
                    lit.append(work.shadow_valid.copy())
                    stopped.append(work.packet[SHADOW_PACKET + embree.T_FAR :][: embree.PACKET] < 0.0)
                    _aim_again(light, rounded, work)
                    shadows.append(work.packet[SHADOW_PACKET : SHADOW_PACKET + embree.RAY_FLOATS].copy())
            hits.append(work.packet[: embree.RAY_HIT_FLOATS].copy())
            ends.append(len(shadows))
        self.hits, self.shadows = np.array(hits), np.array(shadows).reshape(-1, embree.RAY_FLOATS)
        self.lit = np.array(lit, np.int32).reshape(-1, embree.PACKET)
        self.found = self.hits.view(np.uint32)[:, INSTANCE].copy()
        self.stopped, self._ends = np.array(stopped, bool).reshape(-1, embree.PACKET), np.array(ends)
        self.hits[:, T_FAR] = np.inf
        self.hits.view(np.uint32)[:, embree.GEOMETRY : INSTANCE.stop] = embree.NO_HIT
        self._block_hits = embree.aligned((BLOCK, embree.RAY_HIT_FLOATS), np.float32)
        self._block_shadows = embree.aligned((BLOCK * max(1, len(lights)), embree.RAY_FLOATS), np.float32)
        self._block_lit = embree.aligned((len(self._block_shadows), embree.PACKET), np.int32)
        self._valid = embree.aligned((embree.PACKET,), np.int32)
        self._valid[:] = -1

    def check(self) -> None:
        """Trace the recorded rays. Raises RunError unless they hit, and are stopped by, what tracing found."""
        for first in range(0, len(self.hits), BLOCK):
            self._bare_block(first)
            packets, shadows = self._of_block(first)
            hit = self._block_hits.view(np.uint32)[: packets.stop - packets.start, INSTANCE]
            stopped = self._block_shadows[: shadows.stop - shadows.start, T_FAR] < 0.0
            astray = int((hit != self.found[packets]).sum())
            astray += int(((stopped != self.stopped[shadows]) & (self.lit[shadows] != 0)).sum())
            if astray:
                raise RunError(
                    f"measuring: {astray} of the rays of packets {packets.start} to {packets.stop - 1} that were "
                    "recorded as the limit found something else than tracing did; wanted the same rays"
                )

    def bare_rate(self) -> float:
        """Samples a second of the recorded primary and shadow rays alone, their packets in the cache as a tracer's."""
        return len(self.raster) / sum(self._bare_block(first) for first in range(0, len(self.hits), BLOCK))

    def _bare_block(self, first: int) -> float:
        """Seconds that the recorded rays of one block of packets take; getting them into the cache is not counted."""
        packets, shadows = self._of_block(first)
        n, m = packets.stop - packets.start, shadows.stop - shadows.start
        self._block_hits[:n], self._block_shadows[:m] = self.hits[packets], self.shadows[shadows]
        self._block_lit[:m] = self.lit[shadows]
        ends, arguments = self._ends[packets] - shadows.start, self.tracer.works[0].arguments
        block = self._block_hits[:n], self._valid, self._block_shadows[:m], self._block_lit[:m]
        began = time.thread_time()
        bare_queries(self.tracer.instances.trees.at_rest, *block, ends, arguments)
        return time.thread_time() - began

    def _of_block(self, first: int) -> tuple[slice, slice]:
        """The block's packets, and their shadow packets."""
        last = min(first + BLOCK, len(self.hits))
        return slice(first, last), slice(int(self._ends[first - 1]) if first else 0, int(self._ends[last - 1]))

    def traced_rate(self, batches: list[Float32]) -> float:
        """Samples a second of whole samples at these positions."""
        ready = [self.arguments(xy) for xy in batches]
        began = time.thread_time()
        for arguments in ready:
            kernels.trace(*arguments)
        return sum(len(xy) for xy in batches) / (time.thread_time() - began)

    def hilbert_batches(self) -> list[Float32]:
        """One sweep of the Hilbert sampler at its default settings."""
        defaults, event = HilbertSampling(), first_event(self.plan, 0.0)
        sampler = HilbertSampler(self.rect, batch=defaults.samples_per_batch, seed=SEED, chunk=defaults.chunk_pixels)
        batches = []
        while (targets := sampler.choose(event)) is not None:
            batches.append(targets.xy)
        return batches[: len(batches) // 2]


def _aim_again(light: Lights, rounded: bool | None, work: Workspace) -> None:
    """Aim the shadow packet at the only light as tracing did: Embree overwrote how far its rays go."""
    if light.directional is not None:
        aim_directional(light.directional[0], rounded, work)
    elif light.points is not None:
        aim_point(light.points[0], rounded, work)


def measure(rounds: int) -> list[Row]:
    """trace_framed and trace_hilbert: the courtyard decides, the forest is reported beside it."""
    rows: dict[str, dict[str, Row]] = {"trace_framed": {}, "trace_hilbert": {}}
    for source in CAMERAS:
        bench = Bench(source)
        bench.check()
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
