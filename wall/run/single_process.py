"""The whole chain in one process: the reading path, where a debugger starts, the truth that distributed runs match.

Roles, loops, packets and images are those of a run; packets are handed over, not sent, the clock is turned by hand.
"""

from __future__ import annotations

from wall.core.clock import ManualClock
from wall.display.base import PanelImage
from wall.packets.control import Hello
from wall.roles.compositor import Compositor
from wall.roles.instructions import Packet
from wall.roles.layer import PanelCompositor
from wall.roles.plan import HEAD, Plan, first_event, on_one_machine, on_one_rank
from wall.roles.renderer import Renderer
from wall.roles.renderer_image import image_at
from wall.roles.worker import Worker
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

    def __init__(self, plan: Plan, scene: TracerScene, *, at_renderers: bool = True) -> None:
        """`at_renderers`: False lets all samples travel to the compositor, as between machines."""
        plan, self._wire = on_one_machine(plan) if at_renderers else plan, Wire()
        self.clock, self.event = ManualClock(), first_event(plan, now=0.0)
        self.other_events = [first_event(plan, now=0.0, view=view) for view in range(1, len(plan.views))]
        self.workers, self._renderers, self.layers = list[Worker](), list[Loop](), dict[int, PanelCompositor]()
        self._roles = list[Renderer]()
        for rank in plan.layout.renderers():
            image = image_at(plan, rank, lambda _: True, self.clock)
            tracers = Tracers(plan, scene, rank, self.clock, threads=False, image=image)
            renderer = Renderer(plan, hello_of(rank), ready=lambda _: True, image=image)
            self._roles.append(renderer)
            self._renderers.append(Loop(renderer, self._wire, self.clock, tracers=tracers))
            self.workers += tracers.workers
            self.layers |= image.composition.layers if image is not None else {}
        compositor = Compositor(on_one_rank(plan), hello_of(HEAD), ready=lambda _: True)
        self.composition = compositor.composition
        layers = plan.layout.graph.layers
        self._refresh_s = max(1.0 / (layer.refresh_hz or plan.views[layer.view].refresh_hz) for layer in layers)
        self.layers |= self.composition.layers
        self._compositor = Loop(compositor, self._wire, self.clock, sinks=[None] * len(self.composition.shown()))

    def step(self) -> int:
        """One batch of every worker, shown if a refresh is due. Returns samples traced; 0: it is complete, or waits."""
        traced = self._traced()
        for loop in (self._compositor, *self._renderers):
            for event in (self.event, *self.other_events):
                loop.tell(event)  # Renderer.on_message
        self._turn()
        self.clock.advance(BATCH_SECONDS)
        return self._traced() - traced

    def _traced(self) -> int:
        return sum(role.done.samples for role in self._roles)

    def _turn(self) -> None:
        for loop in self._renderers:
            loop.turn()  # Renderer.on_tick: Trace -> Worker.trace -> Traced -> its own image, or Offer
        packets, self._wire.packets = self._wire.packets, []
        for packet in packets:
            self._compositor.tell(Packet(packet))  # Compositor.on_message: an image, or samples for the rank's layer
        self._compositor.turn()  # Compositor.on_tick: layers, then the graph's nodes, then Show

    def until_complete(self) -> list[PanelImage]:
        """Step under the present event until every renderer has nothing left to do."""
        waits = traced = True
        while waits or traced:
            waits = any(role.waits(self.clock.now()) for role in self._roles)
            traced = self.step() > 0
        self.clock.advance(self._refresh_s)
        self._turn()
        return list(self.composition.shown()[0].images())


def hello_of(rank: int) -> Hello:
    """What a rank says of itself."""
    return Hello(rank=rank, host="", endpoint="", incarnation=0)
