"""A view that begins black is noted, and no other one."""

from __future__ import annotations

import pytest

from wall.config.loading import loads
from wall.roles.plan import make_layout, make_plan
from wall.run.first_look import dark_views
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {{source: cornell}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [32, 32], size: [0.3, 0.3]}}}}
views: [{{id: room, camera: {camera}}}]
"""


@pytest.mark.parametrize(
    ("camera", "dark"),
    [("auto", True), ("{position: [2.78, 2.73, -8], target: [2.78, 2.73, 0]}", False)],
    ids=["outside, behind the back wall", "before the open side"],
)
def test_a_camera_outside_of_a_closed_room_is_noted(camera: str, dark: bool) -> None:
    plan = make_plan(make_layout(loads(TEXT.format(camera=camera))))
    notes = dark_views(plan, make_tracer_scene(plan.scene))
    assert [note[:24] for note in notes] == ["view room begins black, "] * dark
