"""Framelets brought to another moment: every pixel lands where its surface is projected then, to half a pixel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.config.loading import loads
from wall.core.data import Event, Float64, Framelet, Rect
from wall.geometry.frusta import project, ray_frame
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.timewarp import Timewarp
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [48, 36], size: [0.4, 0.3], bezel: 0.01}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
"""
PANEL = 1  # not at the frame's corner
HALF_PIXEL = 0.5 + 2e-3  # float32 tables
CRACK = 1.5  # pixels: what nothing reached shows what its neighbour does


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def old(plan: Plan) -> Framelet:
    """What the panel shows at first; its colours are x, y of each pixel, and 1."""
    panel, event = plan.layout.wall.panels[PANEL], first_event(plan, 0.0)
    (width, height), (left, top) = panel.pixels, panel.screen
    tracer = Tracer(make_tracer_scene(plan.scene), panel, plan.view.eye, coherent=True)
    tracer.set_event(event)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    samples = tracer.trace(np.stack([x.ravel(), y.ravel()], 1).astype(np.float32))[0]
    rect = Rect(x=left, y=top, width=width, height=height)
    framelet = Framelet.blank(rect, frozenset({"colour", "depth", "alpha", "object_id"}))
    framelet.colour[..., 0], framelet.colour[..., 1], framelet.colour[..., 2] = x, y, 1.0
    framelet.channel("depth")[...] = samples["depth"].reshape(height, width)
    framelet.channel("object_id")[...] = samples["object_id"].reshape(height, width)
    framelet.channel("alpha")[...] = framelet.channel("object_id") != 0
    framelet.event = event
    return framelet


def later(plan: Plan, event: Event) -> Event:
    """The camera has moved a little and turned, the animation has gone on."""
    a = 0.01
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]) @ event.camera.rotation()
    position = tuple(float(v) for v in event.camera.origin() + np.array([0.05, -0.03, 0.04]))
    camera = replace(event.camera, position=position, world_from_wall=tuple(turn.ravel().tolist()))
    return replace(event, camera=camera, camera_event=1, scene_event=1, scene_time=0.2)


def surfaces(plan: Plan, old: Framelet, event: Event) -> Float64:
    """(h, w, 3) where each pixel's point of the old image is in the world under `event`, by its object."""
    assert old.event is not None
    panel = plan.layout.wall.panels[PANEL]
    frame = ray_frame(panel, plan.view.eye, old.event.camera)
    x, y = (old.colour[..., k] + panel.screen[k] for k in range(2))
    rays = frame[0] + x[..., None] * frame[1] + y[..., None] * frame[2]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    points = old.event.camera.origin() + rays * np.float64(old.channel("depth"))[..., None]
    before, after = (plan.scene.at(t).world_from_object for t in (old.event.scene_time, event.scene_time))
    for k in range(len(plan.scene.instances)):
        mine = old.channel("object_id") == k + 1
        step = after[k] @ np.linalg.inv(before[k])
        points[mine] = points[mine] @ step[:3, :3].T + step[:3, 3]
    return points


def test_the_same_moment_is_the_same_framelet(plan: Plan, old: Framelet) -> None:
    assert old.event is not None
    same = Timewarp(plan)(old, old.event, PANEL)
    for name in ("colour", "alpha", "object_id"):
        np.testing.assert_array_equal(same.channel(name), old.channel(name), err_msg=name)
    assert_allclose(same.channel("depth"), old.channel("depth"), rtol=1e-5)


def test_every_pixel_lands_where_its_surface_is_projected(plan: Plan, old: Framelet) -> None:
    assert old.event is not None
    event = later(plan, old.event)
    moved = Timewarp(plan)(old, event, PANEL)
    assert moved.event is event

    there = (moved.channel("object_id") != 0) & (moved.colour[..., 2] == 1.0)
    assert there.mean() > 0.15
    i, j = np.nonzero(there)
    sx, sy = (np.floor(moved.colour[..., k][there]).astype(int) for k in range(2))  # whose pixel it was
    points = surfaces(plan, old, event)[sy, sx]
    xy, _ = project(plan.layout.wall.panels[PANEL], plan.view.eye, event.camera, points)
    off = np.abs(xy - np.stack([j + 0.5, i + 0.5], 1)).max(axis=1)
    assert off.max() <= CRACK
    assert (off <= HALF_PIXEL).mean() > 0.9

    whole = off <= HALF_PIXEL
    wanted = np.linalg.norm(points - event.camera.origin(), axis=1)
    assert_allclose(moved.channel("depth")[there][whole], wanted[whole], rtol=0.02)  # of the pixel's centre
    np.testing.assert_array_equal(moved.channel("object_id")[there], old.channel("object_id")[sy, sx])


def test_things_that_move_go_with_their_object_while_the_camera_stands(plan: Plan, old: Framelet) -> None:
    assert old.event is not None
    event = replace(old.event, scene_event=1, scene_time=0.2)
    moved = Timewarp(plan)(old, event, PANEL)
    before, after = (plan.scene.at(t).world_from_object for t in (0.0, 0.2))
    moves = np.array([False, *(np.abs(after - before).max(axis=(1, 2)) > 1e-6)])
    seen = moves[old.channel("object_id")]
    assert seen.any(), "something in sight must move for this test to say anything"
    stood = ~moves[old.channel("object_id")] & ~moves[moved.channel("object_id")]
    stood &= moved.colour[..., 2] == 1.0
    np.testing.assert_array_equal(moved.colour[stood], old.colour[stood], err_msg="what stands stays, pixel for pixel")


def test_where_nothing_of_the_old_image_is_seen_there_is_nothing(plan: Plan, old: Framelet) -> None:
    assert old.event is not None
    around = np.diag([-1.0, 1.0, -1.0]) @ old.event.camera.rotation()
    event = replace(old.event, camera=replace(old.event.camera, world_from_wall=tuple(around.ravel().tolist())))
    gone = Timewarp(plan)(old, event, PANEL)
    assert not gone.colour.any()
    assert not gone.channel("alpha").any()
    assert np.isinf(gone.channel("depth")).all()
