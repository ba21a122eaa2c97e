"""Which samplers are compiled before the first image: those that the run can come to."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.config.sampling import METHODS
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.warm_up import usable_samplers


def plan_of(graph: str) -> Plan:
    text = f"""\
version: 1
scene: {{source: cornell}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}}}
views: [{{id: main, panels: [r0c0], sampling: {{method: hilbert}}}}, {{id: other, panels: [r0c1]}}]
sampling: {{method: framed}}
graph: {graph}
"""
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.mark.parametrize(
    ("graph", "headless", "found"),
    [
        ("{preset: sort-first, sinks: [browser]}", False, set(METHODS)),
        ("{preset: sort-first, sinks: [browser]}", True, {"framed", "hilbert"}),
        ("{preset: sort-first, sinks: [png]}", False, {"framed", "hilbert"}),
    ],
)
def test_other_samplers_than_the_configured_are_for_viewers(graph: str, headless: bool, found: set[str]) -> None:
    methods = usable_samplers(plan_of(graph), headless=headless)
    assert set(methods) == found
    assert "adaptive" not in methods[:-1]
