"""A run of a wall in simulated time: the real roles, loops, ports and credit; tracing and pixels as measured costs.

Real: Manager, Renderer and Compositor (wall/roles), their Loop (wall/run/loop.py), Ports and messages as bytes
(wall/run/ports.py, wall/packets/control.py), hubs, links and credit (wall/transport), membership and heartbeats, the
graph with its placement, and which framelets go where (wall/compositing, wall/roles/edges.py). Costs: see costed.py for
tracing and pixels, network.py for sockets and lines, engine.py for cores. All machines have the head's time.

A turn's messages leave while its CPU time is spent, at full speed; what else wants the core delays the next turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, cast

from wall.core.errors import ConfigError
from wall.packets.control import Hello
from wall.roles.compositor import Compositor
from wall.roles.instructions import MANAGER
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan
from wall.roles.renderer import Renderer
from wall.roles.status import summary_of
from wall.run.head import INPUT_POLL_S
from wall.run.loop import Loop
from wall.run.ranks import EVENT_POLL_S, RENDERER_NICE
from wall.run.usage import nothing_used
from wall.study.plan.costed import CostedComposition, CostedTracers, Trip
from wall.study.plan.engine import SLICE_S, Engine, Task
from wall.study.plan.network import Costs, Machine, Network, Process, SimulatedHub, SimulatedPorts
from wall.study.plan.rates import Rates

LONGEST_WAIT_S = 0.05  # of a renderer's loop
POLL_S = 0.02  # of a renderer without credit, instead of CREDIT_POLL_S, where nobody wants its core
STEP_S = 0.1  # between two reports of how far it is
ENDING_S = 8.0  # that a run may take to end


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """Where a run is simulated. `one_machine`: all ranks share it; else compositors have one each."""

    cores: int  # of a machine
    one_machine: bool = False
    renderers_a_machine: int = 1
    link_bytes_per_s: float = 1.25e9
    link_s: float = 50e-6
    seconds: float = 2.0
    warm_up_s: float = 0.5  # of them, of which nothing is counted
    others_weight: float = 0.0  # of something else on each core of the first machine; a rank has 1024, nice ones 335


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a simulated run, between the warm-up and the end."""

    ranks: int
    renderers: int
    compositors: int
    seconds: float
    samples_per_s: float
    packets_per_s: float
    bytes_per_s: float
    refreshes_per_s: float  # of a compositor that has layers or windows, mean
    events_per_s: float  # that the manager published
    latency_ms: tuple[float, float, float]  # p50, p95, p99 over all compositors that show something
    trips: tuple[Trip, ...]
    busiest_in_bytes_per_s: float  # of a machine's line
    busiest_out_bytes_per_s: float
    head_cores: float  # that the manager uses
    compositor_cores: float  # of the busiest compositor
    lost: int  # ranks that the manager held for lost
    dropped: dict[str, int]
    took_s: float  # to simulate


class Node(Process):
    """A role with its loop, turned in simulated time."""

    def __init__(self, engine: Engine, machine: Machine, costs: Costs, *, nice: int, turn_s: float) -> None:
        super().__init__(engine, machine, costs)
        self.task, self._turn_s = Task(nice), turn_s
        self.arrived = self._arrived
        self._waiting, self._timer, self.turns = False, 0, 0
        self.loop: Loop
        self.ports: SimulatedPorts
        self._tracers: CostedTracers | None = None
        self._stages: Iterator[float] = iter(())
        self._longest_wait_s = LONGEST_WAIT_S
        self.poll_s = 0.0  # between two looks for credit at least

    def begin(
        self, loop: Loop, ports: SimulatedPorts, *, tracers: CostedTracers | None = None, longest_wait_s: float
    ) -> None:
        """Turn for the first time, now."""
        self.loop, self.ports, self._tracers, self._longest_wait_s = loop, ports, tracers, longest_wait_s
        self.engine.at(self.engine.now, self._turn)

    def _turn(self) -> None:
        self._waiting = False
        self.charged, self.turns = 0.0, self.turns + 1
        self.loop.turn()
        if self._tracers is not None:
            self._stages = self._tracers.stages()
        seconds, self.charged = self.charged + self._turn_s, 0.0
        self.machine.cores.submit(self.task, seconds, self._worked)

    def _worked(self) -> None:
        """A stage of CPU time is over: go on with the next, turn again, or sleep, as Loop.run does."""
        stage = next(self._stages, None)
        if stage is not None:
            self.machine.cores.submit(self.task, stage, self._worked)
            return
        if self.loop.finished:
            return
        wait_s = min(max(0.0, self.loop.role.due - self.engine.now), self._longest_wait_s)
        if wait_s > 0.0 and self.ports.hub is None and self.ports.watched is not self.ports.way:
            wait_s = max(wait_s, self.poll_s)  # it waits for credit, whose grant wakes it
        answers = self._tracers is not None and self._tracers.answers
        if answers or wait_s <= 0.0 or self.ports.watched.waits:
            self._turn()
            return
        self._waiting, self._timer = True, self._timer + 1
        self.engine.at(self.engine.now + wait_s, self._time_over, self._timer)

    def _time_over(self, timer: int) -> None:
        if self._waiting and timer == self._timer:
            self._turn()

    def _arrived(self, way: object) -> None:
        if self._waiting and way is self.ports.watched:
            self._turn()


class _Others:
    """Something else that always wants a core, and shares it with what is simulated by its weight."""

    def __init__(self, machine: Machine, weight: float) -> None:
        self._cores, self.task = machine.cores, Task()
        self.task.weight = weight

    def go_on(self) -> None:
        """Work for another slice."""
        self._cores.submit(self.task, SLICE_S, self.go_on)


class Simulation:
    """All ranks of a plan in one process."""

    def __init__(self, plan: Plan, rates: Rates, setting: Setting) -> None:
        """Raises ConfigError for what is not simulated: several threads a rank, lock step, balance."""
        config = plan.layout.loaded
        if plan.layout.sampling.threads > 1:
            raise config.error(("sampling", "threads"), "a simulated rank has one", "threads: 1, and more ranks")
        if plan.layout.graph.sync != "none":
            raise ConfigError(f"{config.path}: lock step is not simulated; wanted: sync: none")
        if plan.layout.graph.balanced:
            raise ConfigError(f"{config.path}: borders that move are not simulated; wanted: balance: false")
        self._plan, self._rates, self._setting = plan, rates, setting
        self._engine = Engine()
        self._network = Network(self._engine, bytes_per_s=setting.link_bytes_per_s, latency_s=setting.link_s)
        self._costs = Costs(
            message_s=rates.message_s, event_send_s=rates.event_send_s, event_s=rates.event_s, packet_s=rates.packet_s
        )
        self._machines = list(self._make_machines())
        self._compositors: list[Compositor] = []
        self.nodes: list[Node] = []
        others = range(setting.cores if setting.others_weight > 0.0 else 0)
        self._others = [_Others(self._machines[HEAD], setting.others_weight) for _ in others]
        for other in self._others:
            other.go_on()
        self._make_manager()
        for rank in range(plan.layout.graph.compositors):
            self._make_compositor(rank)
        for rank in plan.layout.renderers():
            self._make_renderer(rank)

    def _make_machines(self) -> Iterator[Machine]:
        """One of every rank, in order."""
        setting, layout, count = self._setting, self._plan.layout, 0
        first = Machine(self._engine, "machine 0", setting.cores)
        current = first
        for rank in range(layout.size):
            alone = (
                layout.role(rank) != "renderer" or (rank - layout.graph.compositors) % setting.renderers_a_machine == 0
            )
            if rank and alone and not setting.one_machine:
                count += 1
                current = Machine(self._engine, f"machine {count}", setting.cores)
            yield current

    def _node(self, rank: int, *, nice: int = 0) -> Node:
        machine = self._machines[max(rank, HEAD)]
        node = Node(self._engine, machine, self._costs, nice=nice, turn_s=self._rates.turn_s)
        self.nodes.append(node)
        return node

    def _make_manager(self) -> None:
        node, transport = self._node(MANAGER), self._plan.layout.config.transport
        hub = SimulatedHub(self._network, node, credit_bytes=transport.credit_bytes)
        ports = SimulatedPorts(self._network, node, MANAGER, hub=hub, manager=None)
        self.manager, self._address = Manager(self._plan, 0.0, still=False, seconds=self._setting.seconds), hub.endpoint
        node.begin(Loop(self.manager, ports, node, used=nothing_used), ports, longest_wait_s=INPUT_POLL_S)

    def _make_compositor(self, rank: int) -> None:
        node, transport = self._node(rank), self._plan.layout.config.transport
        hub = SimulatedHub(self._network, node, credit_bytes=transport.credit_bytes)
        ports = SimulatedPorts(self._network, node, rank, hub=hub, manager=self._address)
        composition = CostedComposition(self._plan, rank, ports.ready, node, self._rates)
        compositor = Compositor(self._plan, _hello(rank, hub.endpoint), ports.ready, composition=cast(Any, composition))
        self._compositors.append(compositor)
        node.begin(Loop(compositor, ports, node, used=nothing_used), ports, longest_wait_s=EVENT_POLL_S)

    def _make_renderer(self, rank: int) -> None:
        plan, nice = self._plan, RENDERER_NICE if self._setting.one_machine else 0
        node = self._node(rank, nice=nice)
        ports = SimulatedPorts(self._network, node, rank, hub=None, manager=self._address)
        node.poll_s = 0.0 if self._setting.one_machine else POLL_S
        regions = plan.layout.regions_of(rank)
        tracers = CostedTracers(node, self._rates, rank, regions, 1.0 / plan.view.refresh_hz)
        renderer = Renderer(plan, _hello(rank, ""), ports.ready)
        loop = Loop(renderer, ports, node, tracers=cast(Any, tracers), used=nothing_used)
        node.begin(loop, ports, tracers=tracers, longest_wait_s=LONGEST_WAIT_S)

    def run(self, say: Callable[[float], None] = lambda seconds: None) -> Outcome:
        """Run to the end. `say` is told the simulated time, now and then."""
        began, setting = time.perf_counter(), self._setting
        self._until(setting.warm_up_s, say)
        before = self._counts()
        self._until(setting.seconds, say)
        after = self._counts()
        return self._outcome(before, after, setting.seconds - setting.warm_up_s, time.perf_counter() - began)

    def finish(self) -> dict[str, Any]:
        """End the run as a run ends. Returns its summary, as `wall run` writes it."""
        while not self.nodes[0].loop.finished and self._engine.now < self._setting.seconds + ENDING_S:
            self._until(self._engine.now + STEP_S, lambda seconds: None)
        seconds = self._engine.now
        return summary_of(
            self.manager, self._compositors[HEAD], now=seconds, seconds=seconds, ended="interrupted",
            cores=(self.nodes[0].task.used + self.nodes[1].task.used) / seconds,
        )  # fmt: skip

    @property
    def others_cores(self) -> float:
        """Cores that something else has used so far, in the mean."""
        return sum(other.task.used for other in self._others) / max(self._engine.now, 1e-9)

    def _until(self, seconds: float, say: Callable[[float], None]) -> None:
        while self._engine.now < seconds:
            step = min(self._engine.now + STEP_S, seconds)
            self._engine.run(step)
            self._engine.now = step
            say(step)

    def _counts(self) -> dict[str, Any]:
        renderers = [node.loop.role for node in self.nodes if isinstance(node.loop.role, Renderer)]
        beats = [role._heartbeat(self._engine.now) for role in renderers]
        return {
            "samples": sum(beat.samples_traced for beat in beats),
            "packets": sum(beat.packets for beat in beats),
            "bytes": sum(beat.bytes for beat in beats),
            "refreshes": [sum(view.refreshes for view in role._views) for role in self._compositors],
            "latencies": [len(role.latency.seconds) for role in self._compositors],
            "trips": [len(_costed(role).trips) for role in self._compositors],
            "events": sum(max(event.number) for event in self.manager.events),
            "in": [machine.received for machine in self._machines],
            "out": [machine.sent for machine in self._machines],
            "used": [node.task.used for node in self.nodes],
        }

    def _outcome(self, before: dict[str, Any], after: dict[str, Any], seconds: float, took_s: float) -> Outcome:
        import numpy as np

        def rate(name: str) -> float:
            return float(after[name] - before[name]) / seconds

        def rates(name: str) -> list[float]:
            return [(new - old) / seconds for old, new in zip(before[name], after[name], strict=True)]

        latencies = [
            s for k, role in enumerate(self._compositors) for s in list(role.latency.seconds)[before["latencies"][k] :]
        ]
        trips = [trip for k, role in enumerate(self._compositors) for trip in _costed(role).trips[before["trips"][k] :]]
        p50, p95, p99 = (float(x) * 1e3 for x in np.percentile(latencies or [float("nan")], [50, 95, 99]))
        layout, used = self._plan.layout, rates("used")
        shows = [k for k, role in enumerate(self._compositors) if _costed(role).layers]
        return Outcome(
            ranks=layout.size, renderers=len(layout.regions), compositors=layout.graph.compositors, seconds=seconds,
            samples_per_s=rate("samples"), packets_per_s=rate("packets"), bytes_per_s=rate("bytes"),
            refreshes_per_s=float(np.mean([rates("refreshes")[k] for k in shows])), events_per_s=rate("events"),
            latency_ms=(p50, p95, p99), trips=tuple(trips),
            busiest_in_bytes_per_s=max(rates("in")), busiest_out_bytes_per_s=max(rates("out")), head_cores=used[0],
            compositor_cores=max(used[1 : 1 + layout.graph.compositors]), lost=len(self.manager.lost),
            dropped=dict(self.manager.dropped()), took_s=took_s,
        )  # fmt: skip


def _costed(role: Compositor) -> CostedComposition:
    return cast(CostedComposition, role.composition)


def _hello(rank: int, endpoint: str) -> Hello:
    return Hello(rank=rank, host="", endpoint=endpoint, incarnation=1)
