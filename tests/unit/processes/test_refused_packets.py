"""What a compositor refuses: valid packets that no rank of the run can have sent. They are counted, and do no harm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.data import SAMPLE, Batch, Rect
from wall.packets.samples import encode
from wall.processes.compositor import MOST_APART_S, Compositor
from wall.processes.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.transport.loopback import LoopbackHub, LoopbackLink

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 24], size: [0.4, 0.24]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: adaptive, samples_per_batch: 128}
"""
NOW = 1000.0  # seconds of the head's clock


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


def batch_of(plan: Plan) -> Batch:
    """One grey sample a pixel, from the run's only renderer."""
    event, rect = first_event(plan, NOW), Rect(x=0, y=0, width=40, height=24)
    samples = np.zeros(rect.area, SAMPLE)
    x, y = np.meshgrid(np.arange(rect.width) + 0.5, np.arange(rect.height) + 0.5)
    samples["xy"] = np.stack([x.ravel(), y.ravel()], 1)
    samples["radiance"], samples["depth"] = 0.5, np.inf
    return Batch(
        view=0, panel=0, rect=rect, rank=1, sequence=1, camera_event=event.camera_event, scene_event=event.scene_event,
        base_time=NOW, samples=samples, camera=event.camera, adaptive=True, relightable=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    "change",
    [
        {"rank": HEAD},
        {"rank": 7},
        {"rect": Rect(x=0, y=0, width=4096, height=24)},
        {"base_time": 1e300},
        {"base_time": -1e300},
        {"base_time": NOW + 2 * MOST_APART_S},
        {"base_time": NOW - 2 * MOST_APART_S},
    ],
    ids=str,
)
def test_what_no_rank_can_have_sent_is_counted_and_changes_nothing(plan: Plan, change: dict[str, object]) -> None:
    hub = LoopbackHub(credit_bytes=1 << 20)
    link = LoopbackLink(hub.endpoint)
    compositor, event = Compositor(plan, HEAD, hub), first_event(plan, NOW)
    link.offer(encode(batch_of(plan)))
    assert compositor.take_in() == 1
    compositor.refresh(event, NOW)
    before = compositor.pictures()[0].rgb.copy()
    assert before.min() > 100

    link.offer(encode(replace(batch_of(plan), **change)))  # type: ignore[arg-type]
    assert compositor.take_in() == 1
    link.offer(encode(replace(batch_of(plan), sequence=3)))
    assert compositor.take_in() == 1
    compositor.refresh(replace(event, scene_event=1, scene_time=0.5), NOW + 0.1)

    assert compositor.counters.counts == {"bad_packet": 1}
    assert np.abs(compositor.pictures()[0].rgb.astype(int) - before).max() <= 1
    link.close()
    hub.close()
