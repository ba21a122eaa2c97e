"""Trackers' packets over real sockets: those of the configured address come, stamped; others are counted."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from manager_run import TEXT, plan_of

from wall.core.clock import ManualClock
from wall.core.errors import RunError
from wall.roles.instructions import TrackerPacket, TrackerStrangers
from wall.roles.plan import Plan
from wall.run.tracker_input import TrackerInput, Wanted

WAIT_S = 10.0  # no packet takes as long; the test fails then


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def plan_at(port: int) -> Plan:
    return plan_of(TEXT.replace("views: [{", f"views: [{{tracking: {{port: {port}}}, "))


def send(data: bytes, port: int, source: str = "127.0.0.1") -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.bind((source, 0))
        out.sendto(data, ("127.0.0.1", port))


def received(trackers: TrackerInput, count: int) -> list[TrackerPacket | TrackerStrangers]:
    found: list[TrackerPacket | TrackerStrangers] = []
    until = time.monotonic() + WAIT_S
    while len(found) < count and time.monotonic() < until:
        found += trackers.receive()
        time.sleep(0.005)
    return found


@pytest.fixture
def plans() -> list[Plan]:
    return [plan_at(free_port())]


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def trackers(plans: list[Plan], clock: ManualClock) -> Iterator[TrackerInput]:
    made = TrackerInput(lambda: plans[0], clock, say=lambda text: None)
    yield made
    made.close()


def port_of(plan: Plan) -> int:
    tracking = plan.layout.config.views[0].tracking
    assert tracking is not None
    return tracking.port


def test_packets_of_the_tracker_come_stamped_and_strangers_are_counted(
    trackers: TrackerInput, plans: list[Plan], clock: ManualClock
) -> None:
    port = port_of(plans[0])
    clock.advance(7.0)
    send(b"stranger", port, "127.0.0.2")
    send(b"tracker", port)

    assert set(received(trackers, 2)) == {TrackerPacket(port, "127.0.0.1", b"tracker", 7.0), TrackerStrangers(1)}


def test_another_configuration_has_another_port(trackers: TrackerInput, plans: list[Plan]) -> None:
    old, new = port_of(plans[0]), free_port()
    plans[0] = plan_at(new)
    assert not list(trackers.receive())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as freed:
        freed.bind(("127.0.0.1", old))

    send(b"tracker", new)

    [packet] = received(trackers, 1)
    assert isinstance(packet, TrackerPacket)
    assert packet.port == new


def test_a_port_that_is_taken_is_refused(plans: list[Plan], clock: ManualClock) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port_of(plans[0])))
        with pytest.raises(
            RunError, match=f"UDP port {port_of(plans[0])} of 127.0.0.1, for a tracker: Address already"
        ):
            TrackerInput(lambda: plans[0], clock, say=lambda text: None)


def test_only_where_a_tracker_is_elsewhere_can_others_reach_the_port() -> None:
    here = Wanted(7000, frozenset({"127.0.0.1"}))
    assert here.host == "127.0.0.1"
    assert replace(here, sources=frozenset({"127.0.0.1", "10.0.0.7"})).host == "0.0.0.0"
    assert replace(here, sources=frozenset({"fe80::1"})).host == "::"
