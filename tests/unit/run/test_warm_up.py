"""Which samplers are compiled before the first image: those that the run can come to; and what is said meanwhile."""

from __future__ import annotations

from pathlib import Path

import numba
import pytest

from wall.config.loading import loads
from wall.config.sampling import METHODS
from wall.roles.plan import Layout, Plan, make_layout, make_plan
from wall.run.launch import prepare
from wall.run.warm_up import usable_samplers, warm_up
from wall.tracing.tracer_scene import make_tracer_scene


def layout_of(graph: str, *, up: str = "[0, 1, 0]") -> Layout:
    text = f"""\
version: 1
scene: {{source: cornell}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}}}
views: [{{id: main, panels: [r0c0], sampling: {{method: hilbert}}, camera: {{up: {up}}}}},
  {{id: other, panels: [r0c1]}}]
sampling: {{method: framed}}
graph: {graph}
"""
    return make_layout(loads(text, path=Path("wall.yaml")))


def plan_of(graph: str) -> Plan:
    return make_plan(layout_of(graph))


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


def test_kernels_are_said_to_be_compiled_from_the_first_that_the_cache_lacks(
    monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    plan = plan_of("{preset: sort-first, sinks: [png]}")
    scene, said = make_tracer_scene(plan.scene), list[str]()
    warm_up(plan, scene, said.append)  # whatever the cache has
    said.clear()
    warm_up(plan, scene, said.append)
    loaded = [f"loading kernels ({stage})" for stage in ("framed", "hilbert", "compositing")]
    assert said == loaded
    monkeypatch.setattr("wall.run.warm_up.changed_tiles", numba.njit(lambda one, other: one.size + other.size))
    said.clear()
    warm_up(plan, scene, said.append)
    assert said == [*loaded, "compiling kernels (compositing)"], "of hundreds one is missing"


def test_a_start_says_what_is_odd_about_the_wall(compiled_only: None) -> None:
    said = list[str]()
    prepare(layout_of("{preset: sort-first, sinks: [png]}", up="[0, 0, 1]"), said.append, headless=True)
    assert any(line.startswith("note: ") and "views[0].camera.up" in line for line in said)
