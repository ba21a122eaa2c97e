"""The progressive sampler's paths get as long as the newest event says, not as the configuration did."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import SAMPLE, Edits, Event
from wall.packets.control import Hello
from wall.roles.instructions import Instruction, Restart, Trace, Traced, Work
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.worker import make_samplers
from wall.sampling.base import Sampler
from wall.sampling.progressive import ProgressiveSampler

TEXT = """\
version: 1
scene: {source: courtyard, integrator: {method: path, depth: 2}}
wall: {grid: {columns: 1, rows: 1, pixels: [16, 16], size: [0.4, 0.4]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: progressive, threads: 1, first_stage: 1, samples_per_pixel: 64, rest_s: 0, first_depth: 1}
"""
RANK = 1


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


def edited(event: Event, depth: float) -> Event:
    edits = Edits(event.edits.number + 1, (("integrator.depth", (depth,)),))
    return replace(event, scene_event=event.scene_event + 1, edits=edits)


def asked_of(renderer: Renderer, event: Event, now: float) -> list[Instruction]:
    found = [*renderer.on_message(event, now), *renderer.on_tick(now)]
    return [instruction for instruction in found if isinstance(instruction, Restart | Trace)]


def longest(sampler: Sampler, event: Event) -> int:
    """Surfaces of the paths of its last stage."""
    assert isinstance(sampler, ProgressiveSampler)
    while (targets := sampler.choose(event)) is not None:
        samples = np.zeros(len(targets.xy), SAMPLE)
        samples["xy"] = targets.xy
        sampler.observe(samples, 0.0)
        sampler.resolve()
    return sampler.depth


def test_an_edited_depth_makes_the_samplers_anew(plan: Plan) -> None:
    hello = Hello(rank=RANK, host="a", endpoint="", incarnation=1)
    renderer, event = Renderer(plan, hello, lambda target: True), first_event(plan, 0.0)
    assert asked_of(renderer, event, 1.0) == [Trace(0, event)]
    deeper = edited(event, 5.0)
    assert asked_of(renderer, deeper, 2.0) == []  # while its worker traces
    list(renderer.on_message(Traced(0, event, b"", Work()), 3.0))
    assert asked_of(renderer, deeper, 3.0) == [Restart("progressive", "", 5), Trace(0, deeper)]


def test_of_other_samplers_an_edited_depth_makes_none_anew(plan: Plan) -> None:
    hello = Hello(rank=RANK, host="a", endpoint="", incarnation=1)
    renderer, event = Renderer(plan, hello, lambda target: True), replace(first_event(plan, 0.0), sampler="adaptive")
    assert asked_of(renderer, event, 1.0) == [Restart("adaptive", ""), Trace(0, event)]
    list(renderer.on_message(Traced(0, event, b"", Work()), 3.0))
    assert asked_of(renderer, edited(event, 5.0), 3.0) == [Trace(0, edited(event, 5.0))]


@pytest.mark.parametrize(("depth", "wanted"), [(None, 2), (1, 1), (5, 5)])
def test_stages_get_as_long_as_they_are_told(plan: Plan, depth: int | None, wanted: int) -> None:
    region = plan.layout.region(plan.layout.renderers()[0])
    (sampler,) = make_samplers(plan, "", region, ManualClock(1.0), depth=depth)
    assert longest(sampler, first_event(plan, 0.0)) == wanted
