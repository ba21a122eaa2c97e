"""`sync: frame`: nothing is shown before all of a frame is there, or its time is up; then late parts stay as before.

A frame is an event. The manager publishes the next one when every compositor that shows
something is done with this one.
"""

from __future__ import annotations

from collections.abc import Mapping

from wall.compositing.graph import Graph
from wall.config.graph import FrameSync
from wall.core.data import Event
from wall.roles.edges import NEVER, Number, RemoteFramelet
from wall.roles.layer import PanelCompositor

PATIENCE = 3  # frames in a row that an input may miss; then no frame waits for it until it brings one in time


class Lockstep:
    """Of one compositor: which frame is done."""

    def __init__(self, graph: Graph, rank: int) -> None:
        assert isinstance(graph.sync, FrameSync)
        self._graph = graph
        self.timeout_s = graph.sync.timeout_s * depth_of(graph, rank)  # a compositor behind others waits longer
        self._began: tuple[Number, float] | None = None  # of the frame that is waited for
        self.done: Number = NEVER
        self._told: Number = NEVER
        self.again = False  # whether the last that was made had been done before, without late parts
        self._misses: dict[str, int] = {}  # frames in a row that each late input has missed
        self._missing: tuple[str, ...] = ()  # of the frame that is done: what was late

    def take(
        self, event: Event, layers: Mapping[int, PanelCompositor], remote: Mapping[int, RemoteFramelet], now: float
    ) -> tuple[str, ...] | None:
        """Whether the frame of `event` may be made now: None if not; else the names of inputs that are late.

        A frame that was done without its late parts is made again when they come, unless the next has begun.
        """
        late = [layer.layer.node for layer in layers.values() if not layer.has_frame(event.number)]
        late += [far.step.node.id for far in remote.values() if far.newest_event() < event.number]
        if event.number == self.done:
            more = any(far.changed and far.newest_event() == self.done for far in remote.values())
            came = more or len(late) < len(self._missing)
            self._missing = tuple(late) if came else self._missing
            self.again = True
            return () if came else None
        if self._began is None or self._began[0] != event.number:
            self._began = (event.number, now)
        waited_for = [name for name in late if self._misses.get(name, 0) < PATIENCE]
        if waited_for and now - self._began[1] < self.timeout_s:
            return None
        self._misses = {name: self._misses.get(name, 0) + 1 for name in late}
        self.again, self.done, self._missing = False, event.number, tuple(late)
        return self._missing

    def news(self) -> bool:
        """Whether a frame was done since the last call."""
        was, self._told = self._told, self.done
        return was != self.done


def depth_of(graph: Graph, rank: int) -> int:
    """How many compositors follow each other up to this one: 1 where it needs no other's framelets."""
    crossed: list[int] = []  # edges between compositors before each step
    for step in graph.steps:
        before = [crossed[k] + (graph.steps[k].rank != step.rank) for k in step.inputs]
        crossed.append(max(before, default=0))
    return 1 + max((crossed[step.index] for step in graph.steps if step.rank == rank), default=0)
