"""What a loop adds to what its role says."""

from __future__ import annotations

from collections.abc import Iterator

from wall.packets.control import Heartbeat
from wall.roles.instructions import MANAGER, Input, Instruction, Send
from wall.roles.plan import HEAD
from wall.run.clock import HeadClock
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.transport.loopback import LoopbackHub, LoopbackLink


class Says:
    """A role that says one thing at every tick."""

    due = 0.0

    def __init__(self, instruction: Instruction) -> None:
        self._instruction = instruction

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        yield from ()

    def on_tick(self, now: float) -> Iterator[Instruction]:
        yield self._instruction


def test_memory_is_of_the_rank_whose_heartbeat_it_is_also_where_the_manager_passes_it_on() -> None:
    control, clock = LoopbackHub(credit_bytes=1 << 20), HeadClock()
    managing = Ports(MANAGER, clock, hub=control)
    head = Ports(HEAD, clock, hub=None, manager=LoopbackLink(control.endpoint))

    Loop(Says(Send(MANAGER, Heartbeat(rank=HEAD, time=0.0))), head, clock).turn()
    [own] = managing.receive()
    others = Heartbeat(rank=2, time=0.0, memory=5, peak_memory=7, dropped={"late": 3})
    Loop(Says(Send(HEAD, others)), managing, clock).turn()

    assert isinstance(own, Heartbeat)
    assert 1 << 20 < own.memory <= 1.1 * own.peak_memory
    assert list(head.receive()) == [others]
    head.close()
    managing.close()
