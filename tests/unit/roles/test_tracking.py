"""Trackers' packets at the manager: the eye of their view moves, in events that everyone is told of."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manager_run import TEXT, Run, plan_of

from wall.core.data import Event
from wall.packets.control import parse_control, serialise
from wall.packets.osc import message_of
from wall.roles.instructions import TrackerPacket, TrackerStrangers
from wall.roles.plan import Plan

TRACKED = TEXT.replace("views: [{", "views: [{tracking: {port: 7001}, scale: 3, ")
TOLD = (0.25, -0.125, 0.5)


@pytest.fixture(scope="module")
def tracked() -> Plan:
    return plan_of(TRACKED)


def told(
    plan: Plan, *, port: int = 7001, source: str = "127.0.0.1", time: float = 50.0, **changes: Any
) -> TrackerPacket:
    position = tuple((plan.view.eye + changes.get("away", TOLD)).tolist())
    data = changes.get("data", message_of("/head", (position[0], position[1], position[2])))
    return TrackerPacket(port, source, data, time)


def test_a_told_eye_is_a_numbered_event_of_a_camera_that_is_where_the_eye_is(tracked: Plan) -> None:
    run = Run(tracked)
    run.tell()
    first = run.manager.events[0]
    events = [message for _, message in run.tell(told(tracked, time=50.2), after=0.2) if isinstance(message, Event)]

    camera = events[-1].camera
    assert events[-1].camera_event == first.camera_event + 1
    np.testing.assert_allclose(camera.eye, TOLD, atol=1e-6)
    moved = camera.origin() - first.camera.origin()
    np.testing.assert_allclose(camera.rotation().T @ moved, 3 * np.array(camera.eye), atol=1e-9)
    assert parse_control(serialise(events[-1])) == events[-1], "exactly as told"
    assert camera.tracked((0.0, 0.0, 0.0), 3.0).position == pytest.approx(first.camera.position)


@pytest.mark.parametrize(
    ("changes", "counted"),
    [
        ({"source": "127.0.0.2"}, {}),
        ({"port": 7002}, {}),
        ({"data": b"\xff\xff"}, {"tracker_bad_packet": 1}),
        ({"data": message_of("/head", (float("nan"), 0.0, 0.0))}, {"tracker_bad_packet": 1}),
        ({"data": message_of("/hand", (0.0, 0.0, 1.0))}, {}),
    ],
)
def test_packets_that_are_not_of_the_view_s_tracker_move_nothing(
    tracked: Plan, changes: dict[str, Any], counted: dict[str, int]
) -> None:
    run = Run(tracked)
    run.tell(told(tracked, **changes))
    run.tell(after=0.1)

    assert run.manager.events[0].camera.eye == (0.0, 0.0, 0.0)
    assert dict(run.manager.dropped()) == counted


def test_strangers_are_counted(tracked: Plan) -> None:
    run = Run(tracked)
    run.tell(TrackerStrangers(3))
    assert run.manager.dropped()["tracker_stranger"] == 3


def test_a_wall_without_tracking_takes_no_notice(plan: Plan) -> None:
    run = Run(plan)
    run.tell(told(plan))
    run.tell(after=0.1)

    assert run.manager.events[0].camera.eye == (0.0, 0.0, 0.0)


def test_each_view_has_its_own_tracker_also_one_that_follows_a_camera() -> None:
    """Two viewers before halves of one wall, in one world: the second's camera is the first's."""
    views = """views:
  - {id: one, viewport: {left: 0, top: 0, width: 0.5, height: 1}, tracking: {address: /one, port: 7001}, scale: 2}
  - id: two
    viewport: {left: 0.5, top: 0, width: 0.5, height: 1}
    camera: {follow: one}
    tracking: {address: /two, port: 7001}
    scale: 2
"""
    plan = plan_of(TEXT[: TEXT.index("views:")] + views)
    run = Run(plan)
    rest = [view.eye for view in plan.views]
    position = tuple((rest[0] + (0.125, 0.0, 0.0)).tolist())
    run.tell(TrackerPacket(7001, "127.0.0.1", message_of("/one", (position[0], position[1], position[2])), 50.0))
    run.tell(after=0.1)

    one, two = (event.camera for event in run.manager.events)
    np.testing.assert_allclose(one.eye, (0.125, 0.0, 0.0), atol=1e-6)
    assert two.eye == (0.0, 0.0, 0.0)
    assert two.position == pytest.approx(one.tracked((0.0, 0.0, 0.0), 2.0).position)
