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
wall: {{grid: {{columns: 1, rows: 1, pixels: [64, 48], size: [0.4, 0.3]}}}}
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


@pytest.mark.parametrize("method", ["framed", "adaptive"])
def test_what_is_cut_and_what_comes_back_leaves_no_ghost(
    tracer_scene: TracerScene, compiled_only: None, method: str
) -> None:
    """Whatever was shown before. Samples of `adaptive` fall elsewhere in their pixels."""
    plan = plan_of(method)
    began = {name: after(plan, tracer_scene, name) for name in STATES}
    images = list(began.values())
    assert min(np.abs(a - b).mean() for k, a in enumerate(images) for b in images[:k]) > 3.0
    for states in (("whole", "cut"), ("cut", "whole"), ("deeper", "turned", "cut"), ("cut", "deeper")):
        difference = np.sqrt(np.square(after(plan, tracer_scene, *states) - began[states[-1]]).mean())
        assert difference < (1.5 if method == "adaptive" else 1e-9), states
