"""Where handles of an object stand on the wall: by the projection that images are made with, in every viewport."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Edits, Event
from wall.geometry.cameras import PanelView
from wall.geometry.frusta import project
from wall.roles.handles import HandlesMaker
from wall.roles.plan import Plan, make_layout, make_plan

TEXT = """\
version: 1
scene: {source: gallery}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3], bezel: 0.02}}
views:
  - {id: main, camera: {position: [2.4, 2.2, 3.6], target: [0, 0.7, 0], fov: 50}}
  - {id: map, viewport: {left: 0.6, top: 0.1, width: 0.2, height: 0.5},
     camera: {position: [0, 9, 0.1], target: [0, 0, 0], fov: 40}}
"""
NAME, PARAMETER = "knot", "objects.knot.offset"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


def events_of(plan: Plan, **values: tuple[float, ...]) -> dict[int, Event]:
    edits = Edits(1, tuple((f"objects.{NAME}.{what}", value) for what, value in values.items()))
    return {
        k: Event(
            view=k,
            camera_event=1,
            scene_event=1,
            scene_time=0.0,
            input_time=0.0,
            camera=view.camera_at(0.0),
            edits=edits,
        )
        for k, view in enumerate(plan.views)
    }


def test_points_along_the_axes_lie_where_images_have_them(plan: Plan) -> None:
    scene, offset = plan.scene, (0.3, 0.2, -0.1)
    events = events_of(plan, offset=offset)
    handles = HandlesMaker(plan, [NAME, NAME]).handles(events)
    assert handles is not None
    assert {(place.parameter, place.value) for place in handles.places} == {(PARAMETER, offset)}
    (row,) = (k for k, instance in enumerate(scene.instances) if instance.name == NAME)
    mesh = scene.meshes[scene.instances[row].mesh]
    corner = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0
    middle = (scene.instances[row].world_from_object @ [*corner, 1.0])[:3] + offset
    viewports = plan.layout.wall.viewports
    assert [place.view for place in handles.places] == [viewport.view for viewport in viewports]
    assert {place.view for place in handles.places} == {0, 1}
    for place, viewport in zip(handles.places, viewports, strict=True):
        seen = PanelView(plan.view_of(viewport), viewport)
        matrix = np.array(place.wall_from_object).reshape(3, 4)
        for away in np.vstack([np.zeros(3), np.eye(3), -0.5 * np.eye(3)]):
            (xy,), _ = project(viewport, seen.eye, seen(events[viewport.view]).camera, [middle + away])
            w, x, y = matrix @ [*away, 1.0]
            assert w > 0.0
            wanted = xy * np.array(viewport.span) / viewport.pixels + viewport.screen
            np.testing.assert_allclose((x / w, y / w), wanted, atol=1e-3)


def test_handles_are_the_same_object_until_they_change(plan: Plan) -> None:
    maker, events = HandlesMaker(plan, [NAME, NAME]), events_of(plan)
    first = maker.handles(events)
    assert maker.handles(dict(events)) is first
    moved = replace(events[0].camera, position=(2.5, 2.2, 3.6))
    assert maker.handles({**events, 0: replace(events[0], camera=moved)}) not in (first, None)


def test_what_is_not_there_has_no_handles(plan: Plan) -> None:
    assert HandlesMaker(plan, ["", ""]).handles(events_of(plan)) is None
    assert HandlesMaker(plan, ["nobody", ""]).handles(events_of(plan)) is None
    assert HandlesMaker(plan, [NAME, NAME]).handles({}) is None


def test_each_view_has_the_handles_of_what_is_selected_in_it(plan: Plan) -> None:
    handles = HandlesMaker(plan, ["nobody", NAME]).handles(events_of(plan))
    assert handles is not None
    assert {(place.view, place.parameter) for place in handles.places} == {(1, PARAMETER)}
