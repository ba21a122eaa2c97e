"""The whole chain in one process: the reading path, where a debugger starts, the truth that distributed runs match.

The same roles, loops, packets and images as in a run; packets are handed over instead of sent, the clock is turned by
hand.
"""

from __future__ import annotations

from wall.core.clock import ManualClock
from wall.display.base import PanelImage
from wall.packets.control import Hello
from wall.packets.samples import decode
from wall.roles.compositor import Compositor
from wall.roles.instructions import Packet
from wall.roles.plan import HEAD, Plan, first_event, on_one_rank
from wall.roles.renderer import Renderer
from wall.run.clock import HeadClock
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.run.tracers import Tracers
from wall.tracing.tracer_scene import TracerScene

BATCH_SECONDS = 1e-3  # what a batch takes on the hand-turned clock


class Wire(Ports):
    """Keeps the packets that are offered. What a role says besides is for a manager, and there is none."""

    def __init__(self) -> None:
        super().__init__(HEAD, HeadClock(), hub=None)
        self.packets: list[bytes] = []

    def offer(self, to: int, packet: bytes) -> list[bytes]:
        """Keep a packet. Returns those that gave way: none."""
        self.packets.append(packet)
        return []


class SingleProcess:
    """Every renderer and the compositor of a plan, each in its loop, turned one after the other under `event`."""

    def __init__(self, plan: Plan, scene: TracerScene) -> None:
        layout, self._wire = plan.layout, Wire()
        self.clock, self.event = ManualClock(), first_event(plan, now=0.0)
        tracers = [Tracers(plan, scene, rank, self.clock, threads=False) for rank in layout.renderers()]
        self.workers = [worker for each in tracers for worker in each.workers]
        roles = [Renderer(plan, hello_of(rank), ready=lambda _: True) for rank in layout.renderers()]
        self._renderers = [Loop(r, self._wire, self.clock, tracers=t) for r, t in zip(roles, tracers, strict=True)]
        compositor = Compositor(on_one_rank(plan), hello_of(HEAD), ready=lambda _: True)
        self.composition, self._refresh_s = compositor.composition, 1.0 / plan.view.refresh_hz
        self._compositor = Loop(compositor, self._wire, self.clock, sinks=[None] * len(self.composition.shown()))

    def step(self) -> int:
        """One batch of every worker, shown if a refresh is due. Returns samples traced; 0: the image is complete."""
        for loop in (self._compositor, *self._renderers):
            loop.tell(self.event)  # Renderer.on_message
        for loop in self._renderers:
            loop.turn()  # Renderer.on_tick: Trace -> Worker.step -> Traced -> Offer
        packets, self._wire.packets = self._wire.packets, []
        for packet in packets:
            self._compositor.tell(Packet(packet))  # Compositor.on_message: decode, to the layer of its rank
        self._compositor.turn()  # Compositor.on_tick: layers, then the graph's nodes, then Show
        self.clock.advance(BATCH_SECONDS)
        return sum(decode(packet).samples.size for packet in packets)

    def until_complete(self) -> list[PanelImage]:
        """Step under the present event until every renderer has nothing left to do."""
        while self.step():
            pass
        self.clock.advance(self._refresh_s)
        self._compositor.tell(self.event)
        self._compositor.turn()
        return list(self.composition.shown()[0].images())


def hello_of(rank: int) -> Hello:
    """What a rank says of itself."""
    return Hello(rank=rank, host="", endpoint="", incarnation=0)
