"""A wall for two eyes, from rays to images: each eye's panel shows what that eye sees, at rest and after a move."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from srgb import display

from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import STILL, Float32
from wall.geometry.cameras import look_at, seen_from
from wall.roles.plan import Plan, aimed, first_event, make_layout
from wall.run.single_process import SingleProcess
from wall.scene.build import Scene
from wall.tracing.tracer_scene import make_tracer_scene

RMSE = 0.01  # display values; see test_adaptive; measured 0.0044
MOVED = (0.03125, -0.015625, -0.0625)  # metres
ROUNDED = 0.002  # display values: float64 sums in another order move a sample by 1e-13 pixels, and few edges
OTHER_EYE = 5.0  # times the error, at least, against what the other eye sees; measured 10
CONFIG = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 1, rows: 1, {shown}}}}}
views: [{{camera: {{position: [0, 2.2, 5], target: [0, 0.6, 0]}}, refresh_hz: 30, eye_separation: 0.065, scale: 12}}]
sampling: {{method: {method}, threads: 1, samples_per_batch: 256}}
graph: {{preset: sort-first, sinks: [png]}}
"""


def plan_of(folder: Path, scene: Scene, method: str, *, eyes: int = 2) -> Plan:
    path = folder / "wall.yaml"
    shown = "pixels: [40, 15], size: [0.48, 0.36], stereo: side_by_side"
    path.write_text(CONFIG.format(method=method, shown=shown if eyes == 2 else "pixels: [20, 15], size: [0.48, 0.36]"))
    layout = make_layout(load(path))
    return aimed(layout, scene)


def references(plan: Plan) -> list[Float32]:
    """Of the left and the right eye: they lie beside each other in the virtual screen."""
    both = render(plan, spp=64, seed=7, at=0.0)
    assert both is not None
    assert both.shape == (15, 40, 3)
    return [display(both[:, :20]), display(both[:, 20:])]


def error(one: Float32, other: Float32) -> float:
    return float(np.sqrt(((one - other) ** 2).mean()))


def assert_shown(chain: SingleProcess, expected: list[Float32]) -> None:
    left, right = (image.rgb.astype(np.float32) / 255.0 for image in chain.until_complete())
    for own, reference, other in ((left, expected[0], expected[1]), (right, expected[1], expected[0])):
        assert error(own, reference) < RMSE
        assert error(own, other) > OTHER_EYE * error(own, reference)


def test_each_eye_is_shown_what_it_sees_also_after_camera_and_viewer_moved(tmp_path: Path, tiny_scene: Scene) -> None:
    plan = plan_of(tmp_path, tiny_scene, "adaptive")
    chain = SingleProcess(plan, make_tracer_scene(tiny_scene))
    assert_shown(chain, references(plan))

    camera = look_at((0.7, 2.0, 4.8), (0.0, 0.6, 0.0), (0.0, 1.0, 0.0)).tracked(MOVED, plan.view.scale)
    moved = replace(plan, views=(replace(plan.view, still=camera),))
    chain.event = replace(first_event(moved, chain.clock.now()), camera_event=1)
    chain.clock.advance(1.0)  # samplers look at their images at every refresh, not at every event
    assert_shown(chain, references(moved))


@pytest.mark.parametrize("method", ["adaptive", "framed", "frameless", "hilbert"])
def test_left_eye_s_image_is_that_of_a_wall_for_one_eye_that_stands_there(
    tmp_path: Path, tiny_scene: Scene, method: str
) -> None:
    plan, tracer_scene = plan_of(tmp_path, tiny_scene, method), make_tracer_scene(tiny_scene)
    left, right = SingleProcess(plan, tracer_scene).until_complete()
    view, panel = plan.view, plan.layout.wall.panels[0]
    still = seen_from(first_event(plan, 0.0), view.offset(panel)).camera
    mono = plan_of(tmp_path, tiny_scene, method, eyes=1)

    (alone,) = SingleProcess(
        replace(mono, views=(replace(view, eye=view.eye_of(panel), still=still),)), tracer_scene
    ).until_complete()

    np.testing.assert_array_equal(left.rgb, alone.rgb)
    assert (right.rgb != alone.rgb).any()


def test_a_tracked_viewer_s_image_is_that_of_a_wall_whose_eye_stands_there(tmp_path: Path, tiny_scene: Scene) -> None:
    """Both eyes: the wall's frustum is that from the new eye, and the world is seen from there."""
    plan, tracer_scene = plan_of(tmp_path, tiny_scene, "frameless"), make_tracer_scene(tiny_scene)
    there = replace(plan.view, still=plan.view.still.tracked(MOVED, plan.view.scale))
    still = replace(there.still, eye=STILL.eye)
    configured = replace(plan, views=(replace(plan.view, eye=plan.view.eye + MOVED, still=still),))

    tracked = SingleProcess(replace(plan, views=(there,)), tracer_scene).until_complete()
    fixed = SingleProcess(configured, tracer_scene).until_complete()

    for one, other in zip(tracked, fixed, strict=True):
        assert error(one.rgb / 255.0, other.rgb / 255.0) < ROUNDED
    unmoved = SingleProcess(plan, tracer_scene).until_complete()
    assert error(tracked[0].rgb / 255.0, unmoved[0].rgb / 255.0) > 10 * ROUNDED
