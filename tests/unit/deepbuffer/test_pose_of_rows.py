"""An image whose rows are seen in turn: poses from its first row to its last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import instance, quad, scene_of

from wall.config.screens import GridConfig, WallConfig
from wall.core.data import Camera, Event, Rect
from wall.deepbuffer.pose import Pose
from wall.deepbuffer.pose_tracker import PoseTracker
from wall.geometry.cameras import look_at
from wall.geometry.expanding import expand
from wall.geometry.moving import MovingEvent
from wall.geometry.twist import moved

SCAN_S, ROWS = 0.016, 48
PANEL = expand(
    WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(64, ROWS), size=(0.4, 0.3), row_time=SCAN_S / ROWS))
).panels[0]
EYE, SCENE = np.array([0.0, 0.0, 0.4]), scene_of([quad(1.0, 1.0)], [instance(0)])
TWIST = (0.1, 1.5, -0.2, 0.3, 0.0, -2.0)
STILL = Event(
    view=0,
    camera_event=3,
    scene_event=0,
    scene_time=0.0,
    input_time=0.0,
    camera=look_at((0, 0, 4), (0, 0, 0), (0, 1, 0)),
)


def moving(number: int = -2, twist: tuple[float, ...] = TWIST) -> MovingEvent:
    values = {name: getattr(STILL, name) for name in Event.__dataclass_fields__}
    return MovingEvent(**(values | {"camera_event": number}), twist=twist, scene_rate=0.0)


def tracker(rect: Rect | None = None) -> PoseTracker:
    return PoseTracker(PANEL, EYE, SCENE, rect, lit=False)


def table(camera: Camera, rect: Rect) -> np.ndarray:
    return Pose.of(PANEL, EYE, camera, SCENE.at(0.0).world_from_object, rect=rect).panel_from_object


@pytest.mark.parametrize("rect", [Rect(x=0, y=0, width=64, height=48), Rect(x=8, y=12, width=16, height=24)])
def test_the_tables_are_those_of_the_image_s_own_first_and_last_row(rect: Rect) -> None:
    poses, twist = tracker(rect), np.array(TWIST)
    poses.show(moving())

    assert poses.pose is not None
    assert poses.rows is not None
    first, last = (moved(STILL.camera, y * SCAN_S / ROWS * twist) for y in (rect.y, rect.bottom))
    assert np.array_equal(poses.pose.panel_from_object, table(first, rect))
    assert np.array_equal(poses.rows.last, table(last, rect))
    assert poses.rows.scan.tolist() == pytest.approx([0.0, 0.0, 1.0 / rect.height])


def test_a_camera_that_only_goes_on_otherwise_moves_every_object() -> None:
    poses = tracker()
    poses.show(moving())
    poses.show(moving(-3, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))

    assert poses.camera_moved
    assert poses.moved().all()
    poses.show(moving(-4, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))
    assert not poses.camera_moved
    assert not poses.moved().any()


def test_a_panel_whose_rows_are_seen_at_once_has_no_second_table() -> None:
    at_once = replace(PANEL, scan=None)
    poses = PoseTracker(at_once, EYE, SCENE, None, lit=False)
    poses.show(STILL)

    assert poses.rows is None
