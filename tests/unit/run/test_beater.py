"""Signs of life while a loop is held up: they say since when, and end with the loop's last word."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from wall.packets.control import Alive, Heartbeat, parse_control
from wall.roles.instructions import MANAGER
from wall.run.clock import HeadClock
from wall.run.ports import Ports
from wall.transport.base import Hub
from wall.transport.curve import Keys
from wall.transport.factory import connect, open_hub

HEARTBEAT_S = 0.02
ROUNDING_S = 1e-6  # of differences of a clock that may have run for years
PATIENCE_S = 10.0


@pytest.fixture(params=["loopback", "zmq", "zmq with keys"])
def ends(request: pytest.FixtureRequest) -> Iterator[tuple[Ports, Hub]]:
    keys = Keys.of_all(2) if request.param == "zmq with keys" else [None, None]
    hub = open_hub(request.param.split()[0], "127.0.0.1", credit_bytes=1 << 20, keys=keys[0])
    manager = connect(hub.endpoint, rank=1, keys=keys[1])
    ports = Ports(1, HeadClock(), hub=None, manager=manager, keys=keys[1], heartbeat_s=HEARTBEAT_S)
    yield ports, hub
    ports.close()
    ports.close()
    assert "beater" not in [thread.name for thread in threading.enumerate()]
    hub.close()


def came(hub: Hub, count: int) -> list[object]:
    """The next messages that come at a hub, so many at least."""
    limit, found = time.monotonic() + PATIENCE_S, list[object]()
    while len(found) < count:
        assert time.monotonic() < limit, found
        found += [parse_control(data) for _, data in hub.messages()]
        hub.wait(0.01)
    return found


def test_a_loop_that_is_held_up_is_said_to_be_until_it_speaks_and_not_after_its_last_word(
    ends: tuple[Ports, Hub],
) -> None:
    ports, hub = ends
    beat = Heartbeat(rank=1, time=0.0)
    ports.send(MANAGER, beat)
    first, *held = came(hub, 5)  # this thread, which is the loop's, turns no loop meanwhile
    assert first == beat
    assert all(isinstance(each, Alive) and each.rank == 1 for each in held)
    busy = [each.busy_s for each in held if isinstance(each, Alive)]
    assert busy == sorted(busy)
    assert busy[0] >= 1.5 * HEARTBEAT_S - ROUNDING_S
    assert busy[-1] >= 4 * HEARTBEAT_S
    assert all(abs(each.time - time.monotonic()) < PATIENCE_S for each in held if isinstance(each, Alive))

    last = Heartbeat(rank=1, time=1.0, last=True)
    ports.send(MANAGER, last)
    *_, newest = came(hub, 1)
    while newest != last:  # what was on its way before it
        *_, newest = came(hub, 1)
    hub.wait(5 * HEARTBEAT_S)
    assert hub.messages() == []


def test_a_loop_that_speaks_in_time_has_nobody_speak_for_it() -> None:
    hub = open_hub("loopback", "127.0.0.1", credit_bytes=1)
    ports = Ports(1, HeadClock(), hub=None, manager=connect(hub.endpoint, rank=1), heartbeat_s=60.0)
    for k in range(3):
        ports.send(MANAGER, Heartbeat(rank=1, time=float(k)))
    assert all(isinstance(each, Heartbeat) for each in came(hub, 3))
    ports.close()  # at once: the thread sleeps for a minute and a half
    hub.close()
