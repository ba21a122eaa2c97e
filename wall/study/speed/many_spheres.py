"""What millions of spheres cost beside the forest: time and memory to build, samples a second of one core.

`python -m wall.study.speed.many_spheres 1000000 10000000` prints a line for the forest and two for each number of
points: seconds of CPU to make the scene and its trees, MB of memory that they keep, samples/s, and that rate over the
forest's. Points fill a cube, or are the built-in galaxy's, in colours by a colour map, under one directional light, as
in the forest; every pixel has one sample in a sweep.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.color_maps import ColorMap
from wall.core.data import Camera, Float64
from wall.geometry.cameras import look_at
from wall.roles.plan import first_event
from wall.sampling.ownership import block_order
from wall.scene.build import Scene, assemble
from wall.scene.builtin.forest import forest
from wall.scene.data.samples import galaxy
from wall.scene.lights import directional_light
from wall.scene.model import Instance, Material, Source
from wall.scene.points import sphere_points
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

PIXELS = (960, 540)
SWEEPS = 5  # of all pixels; the fastest counts
OF_FOREST = look_at((20.0, 13.0, 30.0), (0.0, 2.0, 0.0), (0.0, 1.0, 0.0))  # as in configs/forest.yaml
OF_GALAXY = look_at((0.0, 0.5, 0.9), (0.0, 0.0, 0.1), (0.0, 1.0, 0.0))
OF_CUBE = look_at((1.0, 1.5, 2.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
EDGE = 2.0  # of the cube
FILLED = 0.3  # radius of a sphere in the cube over the edge of its share of it
RADIUS = 0.8  # of a sphere, times the root of their number: they cover as much of the disc however many they are
PAGE = os.sysconf("SC_PAGE_SIZE")


class Cost(NamedTuple):
    """Of one scene."""

    build_s: float
    memory_mb: float
    rate: float  # samples/s
    covered: float  # share of the pixels that show something


def galaxy_of(count: int) -> Scene:
    """A galaxy of so many stars: crowded in its middle, with gaps that many rays go through."""
    columns = galaxy(count)
    radii = columns["size"] * (RADIUS / math.sqrt(count))
    spheres = np.stack([columns["x"], columns["y"], columns["z"], radii], axis=1).astype(np.float64)
    return _scene(spheres, columns["speed"])


def cube_of(count: int) -> Scene:
    """So many points at random in a cube, as particles of a simulation."""
    chance = np.random.default_rng(1)
    spheres = np.empty((count, 4))
    spheres[:, :3] = chance.uniform(-EDGE / 2, EDGE / 2, (count, 3))
    spheres[:, 3] = FILLED * EDGE / count ** (1 / 3)
    return _scene(spheres, spheres[:, 1])


def _scene(spheres: Float64, values: NDArray[Any]) -> Scene:
    mesh = sphere_points(spheres, material=0, colors=ColorMap().colors(values.astype(np.float64)))
    placed = Instance(name="points", mesh=0, world_from_object=np.eye(4))
    light = directional_light((-0.62, 0.50, 0.45), (1.10, 0.88, 0.60))
    return assemble(Source(meshes=(mesh,), materials=(Material(name="points"),), instances=(placed,), lights=(light,)))


def cost(make: Callable[[], Scene], camera: Camera) -> Cost:
    """Of the scene that `make` gives."""
    plan = plan_of("forest", PIXELS)
    before, began = _memory(), time.process_time()
    tracer_scene = make_tracer_scene(make())
    built = time.process_time() - began
    kept = _memory() - before
    tracer = Tracer(tracer_scene, plan.layout.wall.panels[0], plan.view.eye, coherent=True)
    tracer.set_event(replace(first_event(plan, 0.0), camera=camera))
    xy = (block_order(plan.layout.regions[0][0].rect, worker=0, workers=1) + 0.5).astype(np.float32)
    least, covered = np.inf, 0.0
    for _ in range(SWEEPS):
        began = time.thread_time()
        samples, _ = tracer.trace(xy)
        least = min(least, time.thread_time() - began)
        covered = float((samples["object_id"] > 0).mean())
    return Cost(built, kept / 1e6, len(xy) / least, covered)


def _memory() -> int:
    """Bytes of this process that are in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def main() -> None:
    """Print a table for the numbers of points that the command line names."""
    print(f"{'scene':>20} {'build s':>8} {'MB':>7} {'covered':>8} {'samples/s':>11} {'of the forest':>14}", flush=True)
    of_forest = cost(lambda: assemble(forest()), OF_FOREST)
    _print("forest", of_forest, of_forest)
    for count in map(int, sys.argv[1:]):
        _print(f"cube, {count:,}", cost(partial(cube_of, count), OF_CUBE), of_forest)
        _print(f"galaxy, {count:,}", cost(partial(galaxy_of, count), OF_GALAXY), of_forest)


def _print(name: str, found: Cost, forest: Cost) -> None:
    print(
        f"{name:>20} {found.build_s:8.1f} {found.memory_mb:7.0f} {found.covered:8.0%} {found.rate:11,.0f} "
        f"{found.rate / forest.rate:14.2f}",
        flush=True,
    )


if __name__ == "__main__":
    main()
