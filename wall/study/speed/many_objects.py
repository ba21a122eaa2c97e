"""What an event costs a thread that traces, by what moved: boxes in a cube of 100 m, all instances of one mesh.

`python -m wall.study.speed.many_objects 10 1000 100000` prints, for each number of boxes, milliseconds of CPU until the
next ray: where nothing moved, one box, or the camera. The least of several events each, the scene's poses included.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from wall.config.loading import load
from wall.core.data import Edits, Event
from wall.roles.plan import first_event, make_layout, make_plan
from wall.scene.build import Scene, assemble
from wall.scene.builtin.shapes import box, placed
from wall.scene.model import Instance, Material, Source
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 100.0  # of the cube, m
EVENTS = 9  # of each kind
CONFIG = Path("configs/one_panel.yaml")  # its panel, its eye, its camera


def boxes(count: int) -> Scene:
    """So many boxes of 20 cm, at random in the cube."""
    places = np.random.default_rng(1).uniform(-EDGE / 2, EDGE / 2, (count, 3)).tolist()
    instances = [Instance(name=f"box{k}", mesh=0, world_from_object=placed(*place)) for k, place in enumerate(places)]
    return assemble(
        Source(
            meshes=(box(0.2, 0.2, 0.2).shaded(0),), materials=(Material(name="grey"),), textures=(),
            instances=tuple(instances), lights=None, sky=None,
        )
    )  # fmt: skip


def still(event: Event, number: int) -> Event:
    """Nothing but its time is new."""
    return replace(event, scene_event=number, scene_time=0.1 * number)


def one_box(event: Event, number: int) -> Event:
    """The first box is elsewhere."""
    return replace(event, edits=Edits(number, (("objects.box0.offset", (0.01 * number, 0.0, 0.0)),)))


def camera(event: Event, number: int) -> Event:
    """The camera is elsewhere."""
    x, y, z = event.camera.position
    return replace(event, camera=replace(event.camera, position=(x + 0.01 * number, y, z)))


def costs(count: int) -> list[float]:
    """CPU time of an event of each kind, s."""
    plan = make_plan(make_layout(load(CONFIG)))
    tracer = Tracer(make_tracer_scene(boxes(count)), plan.layout.wall.panels[0], plan.view.eye, coherent=True)
    event = first_event(plan, 0.0)
    return [_least(tracer, event, kind) for kind in (still, one_box, camera)]


def _least(tracer: Tracer, event: Event, kind: Callable[[Event, int], Event]) -> float:
    found = []
    tracer.set_event(event)
    for number in range(1, EVENTS + 1):
        following = kind(event, number)
        began = time.thread_time()
        tracer.set_event(following)
        found.append(time.thread_time() - began)
    return min(found)


def main() -> None:
    """Print a table for the numbers of boxes that the command line names."""
    print(f"{'boxes':>8} {'nothing':>9} {'one box':>9} {'camera':>9}  ms an event")
    for count in map(int, sys.argv[1:]):
        print(f"{count:8,} " + " ".join(f"{1e3 * cost:9.3f}" for cost in costs(count)))


if __name__ == "__main__":
    main()
