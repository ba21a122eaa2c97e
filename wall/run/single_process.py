"""The whole chain in one process: the reading path, where a debugger starts, the truth that distributed runs match.

Same stages, same packets, same pictures; an in-process loop instead of sockets, a clock turned by hand.
"""

from __future__ import annotations

from wall.core.data import Event
from wall.display.base import PanelPicture
from wall.packets.samples import decode
from wall.roles.compositor import Compositor
from wall.roles.plan import HEAD, Plan, first_event, make_predictor, on_one_rank
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import ManualClock
from wall.tracing.tracer_scene import TracerScene
from wall.transport.loopback import LoopbackHub

BATCH_SECONDS = 1e-3  # what a batch takes on the hand-turned clock


class SingleProcess:
    """Every renderer and every compositor of a plan, stepped in turn."""

    def __init__(self, plan: Plan, tracer_scene: TracerScene) -> None:
        self.plan, self.clock = plan, ManualClock()
        self.event: Event = first_event(plan, now=0.0)
        self._predictor = make_predictor(plan)
        layout = plan.layout
        self._methods = (self.event.sampler, "")  # the second is compared with the first
        self.workers: list[Worker] = []
        for rank in layout.renderers():
            samplers = make_samplers(plan, "", layout.region(rank), self.clock)
            self.workers += [Worker(plan, tracer_scene, rank, self.clock, samplers, k) for k in range(len(samplers))]
        self.compositor = Compositor(on_one_rank(plan), HEAD, LoopbackHub(credit_bytes=0), {})

    def step(self) -> int:
        """One batch of every worker, shown. Returns how many samples were traced; 0: the picture is complete."""
        traced = 0
        self._follow_event()
        for worker in self.workers:
            packet = worker.step(self.event)
            if packet is None:
                continue
            self.compositor.insert(packet)  # decode, to the layer of its rank, into the deep buffer
            traced += decode(packet).samples.size
        self.clock.advance(BATCH_SECONDS)
        return traced

    def until_complete(self) -> list[PanelPicture]:
        """Step under the present event until every renderer has nothing left to do."""
        due = self.clock.now()
        while self.step():  # refreshed as in a run: only samples of an event that is shown count as at rest
            if self.clock.now() >= due:
                due = self.clock.now() + 1.0 / self.plan.view.refresh_hz
                self._refresh()
        self._refresh()
        return list(self.compositor.shown()[0].pictures())

    def _follow_event(self) -> None:
        """Panels learn whether two samplers are compared; workers start over when the event names other samplers."""
        self.compositor.follow(self.event)
        wanted = (self.event.sampler or self._methods[0], self.event.compare)
        if wanted == self._methods:
            return
        self._methods = wanted
        layout, per_rank = self.plan.layout, {id(worker.samplers): worker for worker in self.workers}
        for rank, worker in zip(layout.renderers(), per_rank.values(), strict=True):
            worker.samplers[:] = make_samplers(self.plan, wanted[0], layout.region(rank), self.clock, compare=wanted[1])

    def _refresh(self) -> None:
        now = self.clock.now()
        self._predictor.take(self.event)
        event = self._predictor.at(now)  # the event itself as long as nothing moves
        self.compositor.refresh(event, now)  # layers, then the graph's nodes, then what sinks show
