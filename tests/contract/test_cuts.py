"""A scene that is cut open while it is shown: images are those of a wall that began so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import Edits
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: gallery, cuts: [{{position: [0.1, 0.7, 0], normal: [0.3, 0.2, 1]}}]}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [2.4, 2.2, 3.6], target: [0, 0.7, 0], fov: 30}}}}]
sampling: {{method: {method}}}
"""
STATES: dict[str, dict[str, tuple[float, ...]]] = {
    "whole": {"cuts.0.enabled": (0.0,)},
    "cut": {},
    "deeper": {"cuts.0.position": (0.0, 0.5, -0.4)},
    "turned": {"cuts.0.normal": (-1.0, 0.4, 0.0), "cuts.0.enabled": (1.0,)},
}


def plan_of(method: str) -> Plan:
    return make_plan(make_layout(loads(TEXT.format(method=method), path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of("framed").scene)


def after(plan: Plan, scene: TracerScene, *states: str) -> NDArray[Any]:
    """(h, w, 3) the complete image after some states of edits, each of which was shown complete too."""
    single = SingleProcess(plan, scene)
    for number, name in enumerate(states, start=1):
        edits = Edits(number, tuple(sorted(STATES[name].items())))
        single.event = replace(single.event, scene_event=number, edits=edits)
        single.clock.advance(0.1)  # a refresh is due
        (image,) = single.until_complete()
    return image.rgb.astype(float)


def distance(one: NDArray[Any], other: NDArray[Any]) -> float:
    return float(np.sqrt(np.square(one - other).mean()))


def test_every_state_of_the_cuts_is_that_of_a_wall_that_began_so(
    tracer_scene: TracerScene, compiled_only: None
) -> None:
    """Whatever was shown before: every state after every other one."""
    plan = plan_of("framed")
    began = {name: after(plan, tracer_scene, name) for name in STATES}
    images = list(began.values())
    assert min(distance(a, b) for k, a in enumerate(images) for b in images[:k]) > 10.0
    for states in (("whole", "cut"), ("cut", "whole"), ("deeper", "turned", "cut"), ("cut", "deeper", "turned")):
        np.testing.assert_array_equal(after(plan, tracer_scene, *states), began[states[-1]])


def test_samples_of_what_is_cut_away_leave_no_ghost(tracer_scene: TracerScene, compiled_only: None) -> None:
    """Samples are kept and fall elsewhere in their pixels: as different as two runs of one scene are."""
    plan = plan_of("adaptive, samples_per_pixel: 2")
    assert distance(after(plan, tracer_scene, "whole", "cut"), after(plan, tracer_scene, "cut")) < 1.5
