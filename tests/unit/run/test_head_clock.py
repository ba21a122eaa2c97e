"""A rank on another host works only once it knows the head's time."""

from __future__ import annotations

import time
from pathlib import Path

from wall.config.loading import loads
from wall.packets.control import Ping, Pong, parse_control, serialise
from wall.roles.plan import first_event, make_layout, make_plan
from wall.run.control import Control
from wall.transport.loopback import LoopbackHub, LoopbackLink

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 24], size: [0.4, 0.24]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: adaptive}
"""
AHEAD_S = -1e5  # the head's machine started later


def test_no_event_before_the_heads_time_is_known() -> None:
    plan = make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))
    for same_clock in (False, True):
        hub = LoopbackHub(credit_bytes=1 << 16)
        control = Control(LoopbackLink(hub.endpoint), plan, 1, same_clock=same_clock)
        (peer, _hello), event = hub.messages()[0], first_event(plan, 5.0)
        hub.send(peer, serialise(event))
        assert (control.newest() is None) == (not same_clock)
        if same_clock:
            continue
        control._link.send(serialise(Ping(sent=time.monotonic())))
        (ping,) = (m for m in (parse_control(data) for _, data in hub.messages()) if isinstance(m, Ping))
        hub.send(peer, serialise(Pong(sent=ping.sent, head_time=ping.sent + AHEAD_S)))
        newest = control.newest()
        assert newest is not None
        assert newest.number == event.number
        assert abs(control.clock.now() - (time.monotonic() + AHEAD_S)) < 1.0
