"""Objects that are moved and hidden while a wall runs: images are those of a scene that began so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import Edits
from wall.roles.editing import Editor, editable, shown_parameters
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: gallery}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [48, 36], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [2.4, 2.2, 3.6], target: [0, 0.7, 0], fov: 30}}}}]
sampling: {{method: {method}}}
"""
NAME = "knot"  # an object of the gallery, which covers many pixels
FAR = 1e5  # world units: out of sight, and its shadow too


def plan_of(method: str) -> Plan:
    return make_plan(make_layout(loads(TEXT.format(method=method), path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of("framed").scene)


def images_of(plan: Plan, scene: TracerScene, *edits: dict[str, tuple[float, ...]]) -> list[NDArray[np.uint8]]:
    """The complete images of one wall, before some states of edits and after each of them."""
    single = SingleProcess(plan, scene)
    images = [single.until_complete()[0].rgb.copy()]
    for number, values in enumerate(edits, start=1):
        single.event = replace(single.event, scene_event=number, edits=Edits(number, tuple(sorted(values.items()))))
        single.clock.advance(0.1)  # a refresh is due
        images.append(single.until_complete()[0].rgb.copy())
    return images


def distance(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    return float(np.sqrt(np.square(one.astype(float) - other).mean()))


@pytest.mark.parametrize("method", ["framed", "adaptive"])
def test_what_is_hidden_or_moved_away_is_not_there_and_comes_back(
    tracer_scene: TracerScene, compiled_only: None, method: str
) -> None:
    """Hidden and moved out of sight are the same scene; what is undone gives the first image again."""
    plan = plan_of(method)
    offset, visible = f"objects.{NAME}.offset", f"objects.{NAME}.visible"
    first, hidden, again = images_of(plan, tracer_scene, {visible: (0.0,)}, {})
    assert distance(first, hidden) > 20.0
    if method == "adaptive":  # samples fall elsewhere in their pixels
        assert distance(again, first) < 1.0
        return
    _, away, moved = images_of(plan, tracer_scene, {offset: (0.0, -FAR, 0.0)}, {offset: (0.5, 0.0, 0.0)})
    assert min(distance(first, moved), distance(moved, hidden)) > 20.0
    assert np.array_equal(hidden, away)
    assert np.array_equal(again, first)


def test_what_moved_leaves_no_ghost_and_no_shadow(tracer_scene: TracerScene, compiled_only: None) -> None:
    """The image is that of a wall that began with the edit, though nothing else moves: no ray looks for change."""
    plan = plan_of("adaptive")
    offset, rotation = (0.5, 0.2, 0.0), (30.0, -50.0, 120.0)
    for values in (
        {f"objects.{NAME}.offset": offset, f"objects.{NAME}.rotation": rotation},
        {f"objects.{NAME}.offset": offset, f"objects.{NAME}.scale": (0.6,)},
        {f"objects.{NAME}.scale": (1.7,)},
        {f"objects.{NAME}.visible": (0.0,)},
    ):
        began = SingleProcess(plan, tracer_scene)
        began.event = replace(began.event, scene_event=1, edits=Edits(1, tuple(values.items())))
        (wanted,) = began.until_complete()
        assert distance(images_of(plan, tracer_scene, values)[-1], wanted.rgb) < 1.5


def test_objects_of_a_name_are_one_parameter_and_pages_are_spared_them() -> None:
    plan = plan_of("framed")
    names = {instance.name for instance in plan.scene.instances}
    found = [name for name in editable(plan) if name.startswith("objects.")]
    assert len(found) == 4 * len(names)
    assert not any(name.startswith("objects.") for name in shown_parameters(plan))
    own = [f"objects.{NAME}.{what}" for what in ("offset", "rotation", "scale", "visible")]
    assert list(shown_parameters(plan, [NAME, NAME, ""]))[:4] == own
    editor = Editor(plan)
    editor.set([(f"objects.{NAME}.visible", 0)])
    editor.undo()
    assert editor.edits.values == ()
