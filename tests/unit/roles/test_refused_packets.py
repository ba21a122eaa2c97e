"""What a compositor refuses: valid packets that no rank of the run can have sent. They are counted, and do no harm."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from flat_batches import flat, plan_of

from wall.core.data import Batch, Rect
from wall.packets.samples import encode
from wall.roles.compositor import MOST_APART_S, Compositor
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event
from wall.run.clock import ManualClock
from wall.transport.base import Hub
from wall.transport.factory import connect, open_hub
from wall.transport.loopback import LoopbackHub, LoopbackLink

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
    ],
    ids=str,
)
def test_what_no_rank_can_have_sent_is_counted_and_changes_nothing(plan: Plan, change: dict[str, object]) -> None:
    hub = LoopbackHub(credit_bytes=1 << 20)
    link = LoopbackLink(hub.endpoint)
    compositor, event = Compositor(plan, HEAD, hub, {}), first_event(plan, NOW)
    link.offer(encode(batch_of(plan)))
    assert compositor.take_in() == 1
    compositor.refresh(event, NOW)
    before = compositor.shown()[0].pictures()[0].rgb.copy()
    assert before.min() > 100

    link.offer(encode(replace(batch_of(plan), **change)))  # type: ignore[arg-type]
    assert compositor.take_in() == 1
    link.offer(encode(replace(batch_of(plan), sequence=3)))
    assert compositor.take_in() == 1
    compositor.refresh(replace(event, scene_event=1, scene_time=0.5), NOW + 0.1)

    assert compositor.counters.counts == {"bad_packet": 1}
    assert np.abs(compositor.shown()[0].pictures()[0].rgb.astype(int) - before).max() <= 1
    link.close()
    hub.close()


@pytest.mark.parametrize("kind", ["loopback", "zmq"])
def test_a_stray_control_message_at_a_data_hub_is_counted_and_its_owner_sleeps_again(plan: Plan, kind: str) -> None:
    hub = open_hub(kind, "127.0.0.1", credit_bytes=1 << 20)
    link = connect(hub.endpoint, rank=1)
    compositor = Compositor(plan, HEAD, hub, {})
    link.send(b"stray")
    assert comes_true(lambda: compositor.take_in() == 0 and bool(compositor.counters.counts))
    assert compositor.counters.counts == {"stray_message": 1}
    assert sleeps(hub)
    link.close()
    hub.close()


@pytest.mark.parametrize("kind", ["loopback", "zmq"])
def test_a_stray_packet_at_the_control_hub_is_counted_and_its_owner_sleeps_again(plan: Plan, kind: str) -> None:
    hub = open_hub(kind, "127.0.0.1", credit_bytes=1 << 20)
    link = connect(hub.endpoint, rank=1)
    manager = Manager(plan, hub, ManualClock(), list, still=True)
    link.offer(b"stray")

    def counted() -> bool:
        link.ready()  # a link works only while it is called
        manager._listen()
        return bool(manager.counters.counts)

    assert comes_true(counted)
    assert manager.counters.counts == {"stray_packet": 1}
    assert sleeps(hub)
    link.close()
    hub.close()


def comes_true(condition: Callable[[], bool]) -> bool:
    limit = time.monotonic() + 5.0
    while not condition():
        if time.monotonic() > limit:
            return False
    return True


def sleeps(hub: Hub) -> bool:
    """Whether its owner's wait lasts."""
    began = time.monotonic()
    hub.wait(0.1)
    return time.monotonic() - began > 0.05
