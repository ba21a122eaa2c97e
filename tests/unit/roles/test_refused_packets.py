"""What a compositor refuses: valid packets that no rank of the run can have sent. They are counted, and do no harm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_batches import flat, plan_of

from wall.core.data import Batch, Framelet, Rect
from wall.core.errors import RemoteProtocolError
from wall.packets.control import serialise
from wall.packets.framelets import FrameletPart
from wall.packets.samples import encode
from wall.roles.composition import MOST_AHEAD, MOST_APART_S, Composition
from wall.roles.compositor import Compositor
from wall.roles.instructions import Packet
from wall.roles.plan import HEAD, Plan, first_event
from wall.run.single_process import hello_of

NOW = 1000.0  # seconds of the head's clock


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of()


def batch_of(plan: Plan) -> Batch:
    """One grey sample a pixel, from the run's only renderer."""
    return replace(flat(0.5, first_event(plan, NOW), adaptive=True), base_time=NOW, relightable=True)


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
        {"camera_event": 2**32 - 1},
        {"scene_event": MOST_AHEAD + 1},
    ],
    ids=str,
)
def test_what_no_rank_can_have_sent_is_counted_and_changes_nothing(plan: Plan, change: dict[str, object]) -> None:
    compositor, event = Compositor(plan, hello_of(HEAD), lambda rank: False), first_event(plan, NOW)
    composition = compositor.composition
    for message in (event, Packet(encode(batch_of(plan)))):
        list(compositor.on_message(message, NOW))
    list(compositor.on_tick(NOW))
    before = composition.shown()[0].images()[0].rgb.copy()
    assert before.min() > 100

    for batch in (replace(batch_of(plan), **change), replace(batch_of(plan), sequence=3)):  # type: ignore[arg-type]
        list(compositor.on_message(Packet(encode(batch)), NOW))
    list(compositor.on_message(replace(event, scene_event=1, scene_time=0.5), NOW))
    list(compositor.on_tick(NOW + 0.1))

    assert composition.counters == {"bad_packet": 1}
    assert np.abs(composition.shown()[0].images()[0].rgb.astype(int) - before).max() <= 1


def test_a_framelet_that_is_not_needed_here_is_refused(plan: Plan) -> None:
    rect = Rect(x=0, y=0, width=4, height=4)
    part = FrameletPart.of(0, Framelet.blank(rect, frozenset({"colour"}), encoded=True), rect)
    with pytest.raises(RemoteProtocolError, match="step 0, which is not needed here"):
        Composition(plan, HEAD).insert(serialise(part))
