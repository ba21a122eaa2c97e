"""An image is made for the middle of the time that it is seen, wherever it is made."""

from __future__ import annotations

from dataclasses import replace

import pytest

from wall.config.loading import load
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.view import EARLY_APART_S, ON_ITS_WAY_S, FollowedView

HZ, SPEED = 50.0, 2.0  # refreshes a second; world units a second
DELAY_S, INPUT_S = 0.02, 0.01
CONFIG = f"""\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [32, 16], size: [0.32, 0.16]}}}}
views: [{{camera: {{position: [0, 1, 9], target: [0, 1, 0], fov: 40}}, refresh_hz: {HZ}, display_delay_s: {DELAY_S}}}]
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    path = tmp_path_factory.mktemp("view") / "wall.yaml"
    path.write_text(CONFIG)
    return make_plan(make_layout(load(path)))


@pytest.mark.parametrize("making", [None, 0.015])
def test_a_view_in_motion_is_foreseen_for_the_middle_of_the_time_it_is_seen(plan: Plan, making: float | None) -> None:
    """The display's delay begins with a refresh of the head: with this one, or when an image made here is ready."""
    view, first = FollowedView(plan, 0), first_event(plan, 0.0)
    x, y, z = first.camera.position
    for k in range(60):
        now = k * INPUT_S
        camera = replace(first.camera, position=(x + SPEED * now, y, z))
        view.take(replace(first, camera_event=k + 1, input_time=now, camera=camera))
        if k % 2 == 1:
            expected = view.begin_refresh(now)
            if making is not None:
                view.made(making)

    ahead = (expected.camera.position[0] - x) / SPEED - now
    until_shown = 0.0 if making is None else making + ON_ITS_WAY_S
    assert ahead == pytest.approx(until_shown + DELAY_S + 0.5 / HZ, abs=1e-3)
    rays = view.at_next_refresh(now + 0.005)
    later = max(view.due - now, 0.005)  # the next refresh, due or overdue
    assert (rays.camera.position[0] - expected.camera.position[0]) / SPEED == pytest.approx(later, abs=1e-3)


def test_an_edit_brings_the_next_refresh_forward_but_a_stream_of_them_keeps_the_rate(plan: Plan) -> None:
    view, period = FollowedView(plan, 0), 1.0 / HZ
    view.take(first_event(plan, 0.0))
    for now in (1.0, 1.0, 1.0 + period):
        view.begin_refresh(now)
    view.soonest = 1.004 + period  # that refresh took so long
    view.hasten()
    assert view.due == view.soonest
    view.begin_refresh(1.005 + period)
    assert view.due == pytest.approx(1.005 + 2 * period)
    refreshes = []
    for k in range(1000):  # edits, a millisecond apart
        view.hasten()
        if (now := 1.005 + period + 1e-3 * k) >= view.due:
            view.begin_refresh(now)
            refreshes.append(now)
    assert HZ <= len(refreshes) <= HZ + 1.0 / EARLY_APART_S
