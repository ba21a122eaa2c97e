"""A rank that adopts another configuration: what was shown stays until samples come, and none of before comes in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.packets.samples import decode, encode
from wall.roles.composition import Composition
from wall.roles.plan import HEAD, first_event, make_layout, make_plan, on_one_machine, on_one_rank
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import make_tracer_scene

CONFIG = """\
version: 1
scene: {{source: courtyard, animation: []}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}, refresh_hz: 30}}]
sampling: {{method: {method}, samples_per_batch: 256}}
"""


@pytest.mark.parametrize("method", ["frameless", "adaptive"])
@pytest.mark.parametrize("at_renderers", [False, True])
def test_what_was_shown_stays_until_samples_of_the_new_configuration_come(method: str, at_renderers: bool) -> None:
    plan = make_plan(make_layout(loads(CONFIG.format(method=method), path=Path("wall.yaml"))))
    before = SingleProcess(plan, make_tracer_scene(plan.scene), at_renderers=at_renderers)
    for _ in range(60):
        before.step()
    shown = [panel.rgb for panel in before.composition.shown()[0].images()]
    assert all(image.any() for image in shown)
    following = replace(plan, number=1, since=7)

    after = Composition(on_one_rank(on_one_machine(following) if at_renderers else following), HEAD)
    after.begin_with(before.composition)
    event = first_event(following, before.clock.now())
    after.follow(event)
    for _ in range(2):
        after.refresh(event, before.clock.now())
        for image, panel in zip(shown, after.shown()[0].images(), strict=True):
            assert np.array_equal(image, panel.rgb)

    if at_renderers:
        return  # samples do not travel
    packet = packet_of(before)
    samples = len(decode(packet).samples)
    after.insert(packet)
    assert after.counters["late"] == samples > 0
    assert not after.refresh(event, before.clock.now() + 0.1)
    after.insert(encode(replace(decode(packet), camera_event=event.camera_event)))
    assert after.counters["late"] == samples, "one of its own events is no late one"
    assert after.newest_event() >= event.number


def packet_of(process: SingleProcess) -> bytes:
    """Samples of a worker, as they travel."""
    worker = process.workers[0]
    batch = worker.trace(replace(process.event, scene_event=1))
    assert batch is not None
    return encode(batch)
