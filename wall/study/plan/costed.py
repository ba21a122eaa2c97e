"""What the simulation replaces by costs: tracing, and what a compositor does to samples and pixels.

A batch takes the measured CPU time and gives a packet of the measured size; a refresh takes the time of the layer's
pixels and of the samples that came. Which event a packet was traced under is kept, its samples are not: all that the
roles decide by is there, and no pixel.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from wall.compositing.executor import Changes, merged
from wall.compositing.graph import Layer, Step
from wall.core.data import Event, Framelet, Rect, Region
from wall.packets.framelets import bands
from wall.roles.adaptive_renderer import SHARE_OF_TIME
from wall.roles.edges import NEVER, Number, Outlets, needed_from_others, shows_only
from wall.roles.instructions import Offer, Ready, Restart, Trace, Traced, Work
from wall.roles.plan import Plan
from wall.study.plan.network import Process
from wall.study.plan.rates import Rates


class SimulatedPacket(bytes):
    """So many bytes, and what they stand for."""

    rank: int  # of the renderer; -1: another compositor's framelet
    layer: int  # of the renderer's region
    step: int  # of a framelet
    samples: int
    event: Event
    traced_from: float  # seconds of the head's clock
    traced_until: float
    arrived: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """How the newest event came to a layer: seconds of the head's clock."""

    input: float  # Event.input_time
    traced_from: float
    traced_until: float
    arrived: float
    refreshed: float
    shown: float


class CostedTracers:
    """The tracers of a renderer, as Loop uses them: one batch at a time, in stages of CPU time."""

    running = False  # a loop never sleeps beside them: the simulation does not turn it meanwhile

    def __init__(self, process: Process, rates: Rates, rank: int, regions: Sequence[Region], interval_s: float) -> None:
        """`regions`: a worker each; `interval_s`: between refreshes of their own deep buffers at least."""
        self._process, self._rates, self._rank, self._interval_s = process, rates, rank, interval_s
        self._regions, self._due = regions, [float("-inf")] * len(regions)
        self._aimed: dict[int, Event] = {}  # by worker: the event that its tracer is aimed at
        self._trace: Trace | None = None
        self.answers: list[Traced] = []  # of batches that are done, not told yet
        self._samples = 0

    def start(self, trace: Trace) -> list[Traced]:
        """Begin a batch; `stages` then says what it takes."""
        self._trace = trace
        return []

    def stages(self) -> Iterator[float]:
        """CPU seconds of each stage of the batch that was begun, asked for when the one before is over."""
        trace, self._trace = self._trace, None
        if trace is None:
            return
        engine, rates = self._process.engine, self._rates
        began, region = engine.now, self._regions[trace.worker]
        if rates.replan_pixel_s and began >= self._due[trace.worker]:  # as AdaptiveRenderer.choose
            yield region.rect.area * rates.replan_pixel_s + rates.aim_s
            self._due[trace.worker] = began + max(self._interval_s, (engine.now - began) / SHARE_OF_TIME)
        elif trace.event is not self._aimed.get(trace.worker):
            yield rates.aim_s
        self._aimed[trace.worker] = trace.event
        traced_from = engine.now
        yield rates.batch_s
        self._samples += round(rates.batch_samples)
        packet = SimulatedPacket(rates.packet_bytes)
        packet.rank, packet.samples, packet.event = self._rank, round(rates.batch_samples), trace.event
        packet.layer = region.layer
        packet.traced_from, packet.traced_until = traced_from, engine.now
        work = Work(samples=self._samples)
        self.answers.append(Traced(trace.worker, trace.event, packet, work, None, engine.now - began))

    def finished(self) -> list[Traced]:
        """Batches that are done."""
        answers, self.answers = self.answers, []
        return answers

    def wait(self, seconds: float) -> None:
        """Never called: see `running`."""

    def restart(self, restart: Restart) -> None:
        """Samplers have no state here."""


class _Reprojected:
    """What a summary asks of a layer's reconstruction."""

    choice = None


class CostedLayer:
    """A layer of which only is known which event it shows."""

    reprojected = _Reprojected()

    def __init__(self, plan: Plan, layer: Layer) -> None:
        self.layer, self.panel = layer, plan.layout.wall.traced[layer.traced]
        self.pixels = self.panel.pixels[0] * self.panel.pixels[1]
        self.newest_event: Number = NEVER
        self.newest: SimulatedPacket | None = None  # that brought it, until it is shown
        self.came = self.samples_shown = 0  # samples, since the last refresh and in all
        self.refreshed: Number = NEVER

    def insert(self, packet: SimulatedPacket) -> None:
        """Take a packet's samples in."""
        self.came += packet.samples
        self.samples_shown += packet.samples
        if packet.event.number > self.newest_event:
            self.newest_event, self.newest = packet.event.number, packet

    def oldest_sample(self, now: float) -> float | None:
        """Not known."""
        return None


class CostedOutlets(Outlets):
    """Framelets to other ranks: sent as the real ones, their parts cut as the real ones, without pixels."""

    def __init__(self, plan: Plan, rank: int, ready: Ready, process: Process, rates: Rates) -> None:
        super().__init__(plan.layout.graph, rank, ready)
        self._process, self._rates = process, rates

    def _begin(self, key: tuple[int, int], framelet: Framelet, newest: Callable[[int], Number]) -> None:
        event, parts = framelet.event, deque[bytes]()
        assert event is not None
        camera, scene = newest(event.view)  # it shows what is expected, but has samples of that event
        event = replace(event, camera_event=camera, scene_event=scene)
        for region in merged(self._pending.pop(key)):
            for rect in bands(region, framelet.channels, encoded=framelet.encoded):
                self._process.charge(rect.area * self._rates.pack_pixel_s)
                part = SimulatedPacket(max(1, round(rect.area * self._rates.framelet_pixel_bytes)))
                part.rank, part.step, part.samples, part.event = -1, key[0], rect.area, event
                parts.append(part)
        self._under_way[key] = parts


class CostedComposition:
    """What a compositor asks of a Composition, without pixels."""

    lockstep = None

    def __init__(self, plan: Plan, rank: int, ready: Ready, process: Process, rates: Rates) -> None:
        graph = plan.layout.graph
        self.counters, self.trips = Counter[str](), list[Trip]()
        self._plan, self._process, self._rates = plan, process, rates
        self.layers = {layer.index: CostedLayer(plan, layer) for layer in graph.layers_on(rank)}
        self._source_of = {layer.index: graph.step(layer.node).index for layer in graph.layers_on(rank)}
        self._shows_only = shows_only(graph, rank)
        self._steps = [step for step in graph.steps if step.rank == rank]
        self._framelets = {step.index: _pixel_of(step) for step in self._steps}
        self._remote = {step.index: NEVER for step in needed_from_others(graph, rank)}
        self._arrived: Counter[int] = Counter()  # pixels of others' framelets since the last refresh
        self._outlets = CostedOutlets(plan, rank, ready, process, rates)

    @property
    def views(self) -> tuple[int, ...]:
        """The views of which there are layers here."""
        return tuple(sorted({layer.layer.view for layer in self.layers.values()}))

    @property
    def idle(self) -> bool:
        """Whether every framelet that others need has been sent."""
        return self._outlets.idle

    def follow(self, event: Event) -> None:
        """Nothing to begin."""

    @property
    def due(self) -> float:
        """Images of others are shown as they come: that the real ones wait to be shown evenly is not simulated."""
        return -math.inf if self._arrived and self._shows_only else math.inf

    def insert(self, packet: bytes, now: float) -> None:
        """Take a packet in."""
        assert isinstance(packet, SimulatedPacket)
        if packet.rank < 0:
            self._process.charge(packet.samples * self._rates.unpack_pixel_s)
            self._arrived[packet.step] += packet.samples
            self._remote[packet.step] = max(self._remote[packet.step], packet.event.number)
            return
        packet.arrived = self._process.now()
        self._process.charge(self._rates.insert_s)
        self.layers[packet.layer].insert(packet)

    def close(self) -> None:
        """Nothing is under way."""

    def hasten(self, until: float) -> None:
        """Nothing waits."""

    def take_edited(self, view: int) -> bool:
        """No edits are simulated."""
        return False

    def behind(self, view: int) -> bool:
        """Every layer shows what came at the next refresh."""
        return False

    def refresh(self, event: Event, now: float, *, force: bool = False) -> Changes:
        """Show what came, as of `event`. Returns what changed, by step."""
        changes: Changes = {}
        for layer in self.layers.values():
            if layer.layer.view != event.view or not layer.samples_shown:
                continue
            if layer.came == 0 and layer.refreshed == event.number:
                continue
            self._process.charge(layer.pixels * self._rates.refresh_pixel_s)
            layer.came, layer.refreshed = 0, event.number
            source = self._source_of[layer.layer.index]
            changes[source] = [self._plan.layout.graph.steps[source].rect]
            self._note(layer, now)
        for step in self._arrived:
            changes[step] = [self._plan.layout.graph.steps[step].rect]
        self._arrived.clear()
        for one in self._steps:
            if any(k in changes for k in one.inputs):
                changes[one.index] = [one.rect]
        for index in changes.keys() & self._framelets.keys():
            self._framelets[index].event = event
        self._outlets.add(changes)
        return changes

    def _note(self, layer: CostedLayer, now: float) -> None:
        if (packet := layer.newest) is not None:
            layer.newest = None
            self.trips.append(
                Trip(
                    input=packet.event.input_time, traced_from=packet.traced_from, traced_until=packet.traced_until,
                    arrived=packet.arrived, refreshed=now, shown=self._process.now(),
                )
            )  # fmt: skip

    def newest_event(self, view: int = 0) -> Number:
        """The newest event of a view that has a sample in an image."""
        numbers = [layer.newest_event for layer in self.layers.values() if layer.layer.view == view]
        return max([*numbers, *self._remote.values()], default=NEVER)

    def send(self) -> Iterator[Offer]:
        """Offer other ranks what changed for them, as far as there is credit."""
        return self._outlets.send(self._framelets, self.newest_event)

    def lose(self, target: int, packet: bytes) -> None:
        """A framelet gave way: the next one replaces it."""
        self.counters["framelet_dropped"] += 1

    def samples_shown(self) -> int:
        """Samples that came."""
        return sum(layer.samples_shown for layer in self.layers.values())

    def right_s(self, now: float) -> float:
        """Not known: no pixels are made."""
        return 0.0

    def drops(self) -> Counter[str]:
        """What was dropped here."""
        return self.counters

    def say(self, statistics: Mapping[str, float]) -> None:
        """Overlays have no pixels here."""

    def shown(self) -> list[object]:
        """No images."""
        return []

    def compared(self) -> list[object]:
        """No second images."""
        return []

    def hand_samples(self, wanted: bool) -> None:
        """No page asks for samples."""

    def take_samples(self) -> tuple[()]:
        """None are handed on."""
        return ()


def _pixel_of(step: Step) -> Framelet:
    """A framelet of a step that has one pixel: costed outlets ask for its event and channels."""
    rect = Rect(x=step.rect.x, y=step.rect.y, width=1, height=1)
    return Framelet.blank(rect, step.channels, encoded=step.encoded, order=step.order)
