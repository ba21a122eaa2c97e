"""Paths of five surfaces on one core: against Embree alone asked the same, and against Mitsuba 3 on the same scenes.

The Cornell box, and the same room with a knot of half a million triangles in place of its boxes; all is diffuse.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from wall.config.loading import loads
from wall.core.data import Float32
from wall.core.errors import RunError
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.sampling.ownership import block_order
from wall.scene.build import assemble
from wall.scene.builtin.cornell import cornell
from wall.scene.builtin.shapes import placed, torus_knot
from wall.scene.model import Instance
from wall.study.speed.kernels.embree_rate import bare_recording
from wall.study.speed.record import SEED, Row, compared
from wall.tracing import embree
from wall.tracing.kernels.values import Recording
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

DEPTH = 5
PIXELS = 256
SCENE = """\
version: 1
scene: {source: cornell}
wall: {grid: {columns: 1, rows: 1, pixels: [256, 256], size: [0.256, 0.256]}}
views: [{camera: {position: [2.78, 2.73, -8], target: [2.78, 2.73, 0], fov: 39.3}}]
"""
SCENES = {"": "the Cornell box", "_model": "a knot of half a million triangles in that room"}  # by the metric's ending
STEPS, SIDES = 5000, 50  # of the knot
BATCH = 4096  # paths, as a renderer's largest
BLOCK = 128  # packets that are asked at a time for the limit: 200 KB, which stay in the cache
EMBREE_BAR = 0.4


def path_plan(ending: str) -> Plan:
    """One panel that shows a scene of SCENES."""
    plan = make_plan(make_layout(loads(SCENE, path=Path("measure.yaml"))))
    room = cornell()
    if ending:
        shape = torus_knot(2, 3, radius=1.15, thickness=0.32, steps=STEPS, sides=SIDES)
        kept = [k for k, mesh in enumerate(room.meshes) if "box" not in mesh.name]
        meshes = (*(room.meshes[k] for k in kept), replace(shape, name="knot").shaded(0))
        knot = Instance(name="knot", mesh=len(kept), world_from_object=placed(2.78, 2.2, 2.8))
        instances = [replace(room.instances[k], mesh=new) for new, k in enumerate(kept)]
        room = replace(room, meshes=meshes, instances=(*instances, knot))
    return replace(plan, scene=assemble(replace(room, path_depth=DEPTH)))


class PathBench:
    """The tracer of `wall` on a scene of paths, and a position in every pixel for each sample."""

    def __init__(self, plan: Plan) -> None:
        layout = plan.layout
        self.plan = plan
        self.tracer = Tracer(
            make_tracer_scene(plan.scene), layout.wall.panels[0], plan.view.eye, coherent=False
        )  # fmt: skip
        self.tracer.set_event(first_event(plan, 0.0))
        self._corners = block_order(layout.regions[0][0].rect, worker=0, workers=1).astype(np.float32)
        self._chance = np.random.default_rng(SEED)

    def rate(self, spp: int) -> float:
        """Paths a second of so many samples a pixel, with the sum that their image is made of."""
        total = np.zeros((len(self._corners), 3), np.float32)
        began = time.process_time()
        for number in range(spp):
            xy = self._places()  # as the peer's sampler draws its own
            for first in range(0, len(xy), BATCH):
                samples, _ = self.tracer.trace(xy[first : first + BATCH], 0.0, number)
                total[first : first + len(samples)] += samples["radiance"]
        return spp * len(self._corners) / (time.process_time() - began)

    def mean(self, spp: int) -> float:
        """Of their radiances."""
        batches = [self.tracer.trace(self._places(), 0.0, number)[0]["radiance"] for number in range(spp)]
        return float(np.mean(batches, dtype=np.float64))

    def recorded(self) -> tuple[Recording, int]:
        """All that Embree is asked for one sample a pixel, and the number of rays. Raises RunError if some is lost."""
        trees, xy = self.tracer.instances.trees, self._places()
        room = 24 * len(xy) // embree.PACKET
        record = Recording(
            packets=embree.aligned((room, embree.RAY_HIT_FLOATS), np.uint32),
            valid=embree.aligned((room, embree.PACKET), np.int32), shadow=np.zeros(room, np.bool_),
            flags=np.zeros(room, np.uint32), asked=np.zeros(1, np.int64),
        )  # fmt: skip
        self.tracer.instances.trees, rays = trees._replace(recording=record), 0
        for first in range(0, len(xy), BATCH):
            _, cost = self.tracer.trace(xy[first : first + BATCH], 0.0, 0)
            rays += cost.primary + cost.shadow + cost.secondary
        self.tracer.instances.trees, n = trees, int(record.asked[0])
        if n > room or rays != np.count_nonzero(record.valid[:n]):
            raise RunError(f"measuring: {n} packets with {rays} rays were traced, which the room for {room} lacks")
        short = (record.packets[:n], record.valid[:n], record.shadow[:n], record.flags[:n])
        return Recording(*short, asked=record.asked), rays

    def bare_rate(self, record: Recording) -> float:
        """Paths a second of what Embree was asked alone, its packets in the cache as the tracer's are."""
        packets = embree.aligned((BLOCK, embree.RAY_HIT_FLOATS), np.uint32)
        valid = embree.aligned((BLOCK, embree.PACKET), np.int32)
        trees, arguments, taken = self.tracer.instances.trees, self.tracer.works[0].arguments, 0.0
        floats, flags = packets.view(np.float32), arguments[0]
        for first in range(0, len(record.packets), BLOCK):
            part = slice(first, first + BLOCK)
            n = len(record.packets[part])
            packets[:n], valid[:n] = record.packets[part], record.valid[part]
            given = floats[:n], valid[:n], record.shadow[part], record.flags[part]
            began = time.process_time()
            bare_recording(trees.at_rest, *given, arguments)
            taken += time.process_time() - began
        arguments[0] = flags
        return len(self._corners) / taken

    def _places(self) -> Float32:
        """(n, 2), anywhere in each pixel."""
        return self._corners + self._chance.random(self._corners.shape, np.float32)


def measure(rounds: int) -> list[Row]:
    """path_embree, path_embree_model: paths a second over those of Embree alone, asked the same."""
    found = []
    for ending, words in SCENES.items():
        bench = PathBench(path_plan(ending))
        record, rays = bench.recorded()
        bench.rate(1), bench.bare_rate(record)
        turns = [(bench.rate(1) / 1e6, bench.bare_rate(record) / 1e6) for _ in range(rounds)]
        ours, bare = (list(column) for column in zip(*turns, strict=True))
        each = rays / (PIXELS * PIXELS)
        note = f"{words} ({bench.plan.scene.triangles} triangles), depth {DEPTH}, {each:.1f} rays a path, one core"
        found.append(
            compared(f"path_embree{ending}", ours, bare, unit="M paths/s", at_least=EMBREE_BAR, note=note, rays=each)
        )
    return found
