"""What a click hits: the distance is that of the samples shown there, on every panel, and so is the object."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import write_config

from wall.config.loading import load, loads
from wall.core.data import Camera
from wall.core.errors import EditError
from wall.geometry.cameras import PanelView
from wall.geometry.lens import Lens
from wall.packets.control import Selection, WindowInput
from wall.roles.clicks import Clicks
from wall.roles.editing import Editor
from wall.roles.instructions import Broadcast, Send
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SKYWARD = Camera.of(np.array([0.0, 5.0, 0.0]), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]).T)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """Two panels of 64 x 48 pixels beside each other; the lens is one that direct light would not have."""
    made = make_plan(make_layout(load(write_config(tmp_path_factory.mktemp("focusing"), columns=2))))
    return replace(made, scene=replace(made.scene, lens=Lens(radius=0.1, focus=3.0)))


def test_the_distance_is_that_of_the_samples_there(plan: Plan) -> None:
    """Along the direction of view, to 1e-4: rays of the tracer are float32."""
    event, clicks = first_event(plan, 0.0), Clicks(plan)
    scene, wall = make_tracer_scene(plan.scene), plan.layout.wall
    xy = np.array([(x, y) for x in (0.5, 13.5, 40.5, 63.5) for y in (24.5, 36.5, 46.5)], np.float32)
    for panel in wall.panels:
        seen = PanelView(plan.view, panel)
        tracer = Tracer(scene, panel, seen.eye, coherent=False)
        tracer.set_event(seen(event))
        samples = tracer.trace(xy, 0.0)[0]
        depths = samples["depth"].astype(float)
        places = [((panel.screen[0] + x) / wall.width, (panel.screen[1] + y) / wall.height) for x, y in xy.tolist()]
        points = [panel.plane.point(panel.screen[0] + x, panel.screen[1] + y) - seen.eye for x, y in xy.tolist()]
        cosines = [-point[2] / np.linalg.norm(point) for point in points]
        wanted = np.where(np.isfinite(depths), depths, np.inf) * cosines
        assert np.isfinite(wanted).sum() >= 4
        np.testing.assert_allclose([clicks.distance([event], *place) for place in places], wanted, rtol=1e-4)
        names = ["", *(instance.name for instance in plan.scene.instances)]
        objects = [names[k] for k in samples["object_id"]]
        assert [clicks.object_at([event], *place) for place in places] == objects
        assert len(set(objects)) > 2


def test_the_sky_is_as_far_as_can_be_and_between_panels_there_is_nothing(plan: Plan) -> None:
    editor, event = Editor(plan), first_event(plan, 0.0)
    editor.focus([replace(event, camera=SKYWARD)], 0.2, 0.5)
    assert dict(editor.edits.values)["lens.focus"] == (1e12,)
    for x, y in ((0.5, 0.5), (1.5, 0.5), (0.2, -0.1)):
        with pytest.raises(EditError, match="no panel is there"):
            editor.focus([event], x, y)


def test_without_a_lens_there_is_nothing_to_focus(plan: Plan) -> None:
    bare = replace(plan, scene=replace(plan.scene, lens=None))
    with pytest.raises(EditError, match=r"lens\.focus.*no such parameter"):
        Editor(bare).focus([first_event(bare, 0.0)], 0.2, 0.5)


def test_a_click_is_an_edit_like_any_other(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True)
    list(manager.on_tick(0.0))
    clicks = [{"kind": "focus", "x": 0.35, "y": 0.9}, {"kind": "focus", "x": 0.5, "y": 0.5}]
    told = [*manager.on_message(WindowInput(rank=HEAD, commands=clicks), 1e-4), *manager.on_tick(1e-4)]
    (event,) = [i.message for i in told if isinstance(i, Broadcast)]
    ((name, (value,)),) = event.edits.values  # type: ignore[union-attr]
    assert name == "lens.focus"
    assert math.isclose(value, Clicks(plan).distance([first_event(plan, 0.0)], 0.35, 0.9))
    (state,) = [state for state in manager.editor.states(0.0) if state.name == name]
    assert state.value == (value,)
    assert manager.dropped()["refused_edit"] == 1  # the second one, between the panels


def test_a_hidden_object_is_clicked_through_and_what_is_selected_is_told_to_the_head(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True)
    list(manager.on_tick(0.0))
    click = {"kind": "select", "x": 0.35, "y": 0.9}

    def selected(now: float) -> list[str]:
        told = manager.on_message(WindowInput(rank=HEAD, commands=[click]), now)
        return [i.message.names[0] for i in told if isinstance(i, Send) and isinstance(i.message, Selection)]

    (name,) = selected(0.1)
    assert name in {instance.name for instance in plan.scene.instances}
    assert selected(0.2) == [], "it is selected already"
    manager.editor.set([(f"objects.{name}.visible", 0)])
    manager._edited = True
    list(manager.on_tick(0.3))
    (behind,) = selected(0.4)
    assert behind != name


def test_what_is_selected_in_a_view_is_in_those_linked_to_it_alone() -> None:
    """Without a word of it all views are linked to the first."""
    text = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3]}}
views:
  - {id: main}
  - {id: other, panels: [r0c1], selection: own}
  - {id: third, viewport: {left: 0, top: 0, width: 0.2, height: 0.2}, selection: {follow: other}}
  - {id: fourth, viewport: {left: 0.6, top: 0, width: 0.2, height: 0.2}}
"""
    plan = make_plan(make_layout(loads(text, path=Path("wall.yaml"))))
    events, clicks = [first_event(plan, 0.0, k) for k in range(4)], Clicks(plan)
    left, right = (clicks.object_at(events, x, 0.6) for x in (0.275, 0.725))
    assert left != right
    assert clicks.select([], events, 0.275, 0.6) == [left, "", "", left]
    assert clicks.select(["", "urn", "urn", ""], events, 0.275, 0.6) == [left, "urn", "urn", left]
    assert clicks.select(["urn", "", "", "urn"], events, 0.725, 0.6) == ["urn", right, right, "urn"]
