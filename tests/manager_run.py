"""A manager without a run: it is told messages, and all that it says is kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wall.config.loading import loads
from wall.packets.control import Heartbeat, Hello, Message, Stop
from wall.roles.instructions import Broadcast, Finish, Input, Send
from wall.roles.manager import Manager
from wall.roles.plan import Plan, make_layout, make_plan

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 4}}]
"""
ELSEWHERE = """\
graph:
  compositors: 2
  nodes:
    - {id: samples, op: samples, panel: r0c0}
    - {id: panel, op: reconstruct, input: samples, on: compositor 1}
    - {id: window, op: sink, kind: window, input: panel}
"""


def plan_of(text: str) -> Plan:
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


class Run:
    """A manager, and all that it has said."""

    def __init__(self, plan: Plan, **options: Any) -> None:
        self.now, self.size, self.finished = 50.0, plan.layout.size, False
        self.manager = Manager(plan, self.now, **({"still": True} | options))
        self.sent: list[tuple[int | None, Message]] = []  # to which rank, None: to all

    def tell(self, *messages: Input, after: float = 0.0) -> list[tuple[int | None, Message]]:
        """Give it messages and a tick, after a time in which it listened. Returns what it says to that."""
        self.now += after
        self.manager.register._watched = self.now
        before = len(self.sent)
        for message in messages:
            self._keep(self.manager.on_message(message, self.now))
        self._keep(self.manager.on_tick(self.now))
        return self.sent[before:]

    def beats(self, *ranks: int, complete: bool = True, last: bool = False) -> list[Heartbeat]:
        """What ranks say of the newest event."""
        camera, scene = self.manager.directors[0].event.number
        return [
            Heartbeat(rank=k, time=0.0, complete=complete, camera_event=camera, scene_event=scene, last=last)
            for k in ranks
        ]

    def stopped(self) -> list[int | None]:
        """Who was told to stop."""
        return [to for to, message in self.sent if isinstance(message, Stop)]

    def _keep(self, instructions: Iterator[Any]) -> None:
        for instruction in instructions:
            self.finished |= isinstance(instruction, Finish)
            if isinstance(instruction, Send | Broadcast):
                self.sent.append((getattr(instruction, "to", None), instruction.message))


def hello(rank: int, *, incarnation: int = 1) -> Hello:
    return Hello(rank=rank, host=f"host{rank}", endpoint=f"tcp://host{rank}:1", incarnation=incarnation)
