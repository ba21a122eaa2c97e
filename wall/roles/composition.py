"""What one rank composes: the layers whose samples come here, the graph's nodes, and what sinks and other ranks get."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.compositing.executor import Changes, Executor, Regions, tiles_to_regions
from wall.config.graph import FrameSync, SkyNode
from wall.core.data import Event, Framelet, Rect, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.geometry.panels import Panel
from wall.packets.control import parse_control
from wall.packets.framelets import FrameletPart
from wall.packets.samples import decode, is_samples
from wall.roles.edges import NEVER, Number, Outlets, RemoteFramelet, checked_step, needed_from_others
from wall.roles.instructions import Offer, Ready
from wall.roles.layer import PanelCompositor
from wall.roles.lockstep import Lockstep
from wall.roles.plan import HEAD, Plan
from wall.roles.present import PanelCrops
from wall.roles.sky import SkyLayer
from wall.roles.timewarp import Timewarp

MOST_APART_S = 60.0  # of a packet's time from the last refresh: more is no delay, but another clock
MOST_NAMES = 32  # of late inputs that are counted each by itself: a heartbeat holds 64 counts
Refresh: TypeAlias = Callable[[], NDArray[np.bool_]]
RunAll: TypeAlias = Callable[[Sequence[Refresh]], Sequence[NDArray[np.bool_]]]


def one_by_one(refreshes: Sequence[Refresh]) -> list[NDArray[np.bool_]]:
    """Run refreshes in this thread."""
    return [refresh() for refresh in refreshes]


def no_credit(rank: int) -> bool:
    """Sends nothing: for a rank alone."""
    return False


class Composition:
    """The layers and the nodes of one rank: `follow` events, `insert` packets, `refresh` the pictures, `send` them."""

    def __init__(self, plan: Plan, rank: int, ready: Ready = no_credit, run_all: RunAll = one_by_one) -> None:
        """`ready`: which ranks take framelets now; `run_all` refreshes several layers, perhaps a thread each."""
        graph = plan.layout.graph
        self.counters = Counter[str]()
        self._plan, self._rank, self._ready, self._run_all = plan, rank, ready, run_all
        self.layers = {layer.index: PanelCompositor(plan, layer.index) for layer in graph.layers_on(rank)}
        self._source_of = {layer.index: graph.step(layer.node).index for layer in graph.layers}
        steps = [step for step in graph.steps if step.rank == rank]
        self._skies = {step.index: SkyLayer(plan, step) for step in steps if isinstance(step.node, SkyNode)}
        self.lockstep = Lockstep(graph, rank) if isinstance(graph.sync, FrameSync) else None
        self._pictures = _Pictures(self, compared=False)
        self._compared: _Pictures | None = None  # while two samplers are compared
        self._refreshed: float | None = None  # when, seconds of the head's clock
        self._statistics_images: dict[
            tuple[int, bool], StatisticsImage
        ] = {}  # of other ranks, the newest of each panel and sampler

    def follow(self, event: Event) -> None:
        """Begin or end comparing two samplers, if `event` says so."""
        for layer in self.layers.values():
            layer.follow(event)
        if not event.compare:
            self._compared = None
        elif self._compared is None:
            self._compared = _Pictures(self, compared=True)

    def insert(self, packet: bytes) -> None:
        """Take one packet in. Raises RemoteProtocolError for one that no rank of this run can have sent."""
        if is_samples(packet):
            batch = decode(packet)
            layer = self._layer_of(batch.rank, batch.panel, batch.rect)
            if self._refreshed is not None and abs(batch.base_time - self._refreshed) > MOST_APART_S:
                wanted = f"about {self._refreshed:.6g} s"
                raise RemoteProtocolError(f"rank {batch.rank}: from {batch.base_time:.6g} s; wanted: {wanted}")
            layer.insert(batch)
            return
        message = parse_control(packet)
        if isinstance(message, StatisticsImage):
            self._keep(message)
        elif isinstance(message, FrameletPart):
            pictures = self._compared if message.compared else self._pictures
            if pictures is not None:
                pictures.insert(message)
        else:
            raise RemoteProtocolError(
                "neither samples, a framelet nor a statistics_image of another compositor's panel"
            )

    def _layer_of(self, rank: int, panel: int, rect: Rect) -> PanelCompositor:
        """The layer of a renderer. Raises RemoteProtocolError for a rectangle outside the renderer's region."""
        layout = self._plan.layout
        region = layout.region(rank) if rank in layout.renderers() else None
        if region is None or region.panel != panel or not region.rect.contains(rect):
            raise RemoteProtocolError(f"rank {rank}: {rect} of panel {panel}; wanted: inside {region}")
        if region.layer not in self.layers:
            raise RemoteProtocolError(f"samples of panel {panel}, which is another compositor's")
        return self.layers[region.layer]

    def _keep(self, statistics_image: StatisticsImage) -> None:
        """Keep a renderer's tiles for its layer, another compositor's image for the head."""
        if statistics_image.rank != HEAD:
            layer = self._layer_of(statistics_image.rank, statistics_image.panel, statistics_image.bounds)
            layer.reprojected.tiles_of[statistics_image.rank] = statistics_image
            return
        panels = self._plan.layout.wall.panels
        if self._rank != HEAD or statistics_image.panel >= len(panels):
            raise RemoteProtocolError(f"statistics_image of panel {statistics_image.panel}, which is not needed here")
        check_statistics_image(statistics_image, panels[statistics_image.panel])
        self._statistics_images[statistics_image.panel, statistics_image.compared] = statistics_image

    def refresh(self, event: Event, now: float, *, force: bool = False) -> Changes:
        """Bring the layers and then the nodes of this rank up to date. Returns what changed, by step.

        In lock step nothing happens before the frame of `event` is there, or its time is up, unless `force`.
        """
        self._refreshed = now
        late: tuple[str, ...] = ()
        if self.lockstep is not None and not force:
            done = self.lockstep.take(event, self.layers, self._pictures.remote, now)
            if done is None:
                return {}
            late = done
        for name in late:
            counted = len(self.counters) < MOST_NAMES or f"late {name}" in self.counters
            self.counters[f"late {name}" if counted else "late others"] += 1
        layers = list(self.layers.values())
        on_gpu = any(layer.reprojected.on_gpu for layer in layers)  # such an image belongs to the thread that inserts
        refreshed = (one_by_one if on_gpu else self._run_all)([partial(layer.refresh, event, now) for layer in layers])
        fresh: Changes = {}
        for layer, dirty in zip(self.layers.values(), refreshed, strict=True):
            if dirty.any():
                fresh[self._source_of[layer.layer.index]] = tiles_to_regions(dirty, TILE, layer.framelet.rect)
        for step, sky in self._skies.items():
            fresh[step] = sky.refresh(event, now)
        if self._compared is not None:
            self._compared.step(self._compared_changes(now), event)
        return self._pictures.step(fresh, event)

    def _compared_changes(self, now: float) -> Changes:
        found: Changes = {}
        for layer in self.layers.values():
            if layer.compared is not None:
                dirty = layer.compared.refresh(now)
                found[self._source_of[layer.layer.index]] = (
                    tiles_to_regions(dirty, TILE, layer.framelet.rect) if dirty.any() else []
                )
        return found

    def say(self, statistics: Mapping[str, float]) -> None:
        """Tell the overlays of this rank how the run is doing."""
        self._pictures.executor.set_statistics(statistics)

    def send(self) -> Iterator[Offer]:
        """Offer other ranks what changed for them, as far as there is credit."""
        for pictures in (self._pictures, self._compared):
            if pictures is not None:
                yield from pictures.send()

    def lose(self, target: int, packet: bytes) -> None:
        """A packet to another rank was dropped: its pixels are sent again."""
        part = parse_control(packet)
        if isinstance(part, FrameletPart):
            pictures = self._compared if part.compared else self._pictures
            if pictures is not None:
                pictures.outlets.lose(target, part)

    def statistics_images(self, now: float, *, comparing: bool) -> tuple[StatisticsImage, ...]:
        """Statistics images of every panel and sampler: made now for own panels, the newest that came of the others.

        Of several layers of a panel the first speaks for it.
        """
        first = {layer.panel.index: layer for layer in reversed(self.layers.values())}
        own = [statistics_image for panel in sorted(first) for statistics_image in first[panel].statistics_images(now)]
        return (
            *own,
            *(
                statistics_image
                for (_, second), statistics_image in self._statistics_images.items()
                if comparing or not second
            ),
        )

    def shown(self) -> list[PanelCrops]:
        """What every sink of this rank shows, in the order of the graph."""
        return self._pictures.shown

    def compared(self) -> list[PanelCrops]:
        """The second pictures, black until something came. None unless two samplers are compared."""
        return self._compared.shown if self._compared is not None else []

    @property
    def newest_event(self) -> Number:
        """The newest event that has a sample in an image."""
        numbers = [layer.newest_event for layer in self.layers.values()]
        numbers += [remote.newest_event for remote in self._pictures.remote.values()]
        return max(numbers, default=NEVER)

    @property
    def idle(self) -> bool:
        """Whether every framelet that others need has been sent."""
        return self._pictures.outlets.idle

    def samples_shown(self) -> int:
        """Number of samples that the images of all layers show."""
        return sum(layer.samples_shown for layer in self.layers.values())

    def drops(self) -> Counter[str]:
        """What was dropped here, by name."""
        return sum((layer.counters for layer in self.layers.values()), Counter(self.counters))

    def pictures_of(self, *, compared: bool) -> tuple[dict[int, Framelet], dict[int, RemoteFramelet]]:
        """Fresh: framelets of the sources of this rank by step, and those that come from elsewhere."""
        graph = self._plan.layout.graph
        remote = {step.index: RemoteFramelet(step) for step in needed_from_others(graph, self._rank)}
        sources: dict[int, Framelet] = {step: sky.framelet for step, sky in self._skies.items()}
        for index, layer in self.layers.items():
            second = layer.compared
            if not compared or second is not None:
                sources[self._source_of[index]] = second.image.framelet if compared and second else layer.framelet
        return sources | {step: far.framelet for step, far in remote.items()}, remote

    def executor_of(self, sources: Mapping[int, Framelet]) -> Executor:
        """Returns the executor of this rank's graph steps, which read the framelets `sources` by node."""
        graph, folder = self._plan.layout.graph, self._plan.layout.loaded.folder
        reproject = Timewarp(self._plan) if self.lockstep is None else None
        return Executor(graph, self._rank, sources, folder, reproject)

    def outlets_of(self, *, compared: bool) -> Outlets:
        """Returns the outlets through which framelets leave this rank; `compared`: those of the second sampler."""
        return Outlets(self._plan.layout.graph, self._rank, self._ready, compared=compared)

    def shown_of(self) -> list[PanelCrops]:
        """Returns the panel crops of each sink on this rank."""
        layout = self._plan.layout
        return [PanelCrops(layout.graph, sink, layout.wall) for sink in layout.graph.sinks_on(self._rank)]


class _Pictures:
    """What the nodes of a rank make of one set of samples; of two while samplers are compared."""

    def __init__(self, owner: Composition, *, compared: bool) -> None:
        self._owner = owner
        sources, self.remote = owner.pictures_of(compared=compared)
        self.executor = owner.executor_of(sources)
        self.outlets = owner.outlets_of(compared=compared)
        self.shown = owner.shown_of()

    def insert(self, part: FrameletPart) -> None:
        checked_step(part, self.remote).insert(part)

    def step(self, fresh: Changes, event: Event) -> Changes:
        arrived: dict[int, Regions] = {step: remote.take_changes() for step, remote in self.remote.items()}
        changes = self.executor.step({**fresh, **arrived}, event)
        for shown in self.shown:
            shown.take(changes, self.executor.framelets)
        lockstep = self._owner.lockstep  # a frame's number is sent once: a frame made again sends only what changed
        self.outlets.add(changes, all_due=lockstep is not None and not lockstep.again)
        return changes

    def send(self) -> Iterator[Offer]:
        number = self._owner.newest_event
        if self._owner.lockstep is not None:
            number = self._owner.lockstep.done
        return self.outlets.send(self.executor.framelets, number)


def check_statistics_image(statistics_image: StatisticsImage, panel: Panel) -> None:
    """Raise RemoteProtocolError for a statistics image whose tiles are not this panel's."""
    width, height = panel.pixels
    if statistics_image.age.shape != (-(-height // TILE), -(-width // TILE)):
        raise RemoteProtocolError(
            f"statistics_image of {statistics_image.age.shape} tiles, panel {panel.id} has {width}x{height}"
        )
    if not Rect(x=0, y=0, width=width, height=height).contains(statistics_image.bounds):
        raise RemoteProtocolError(f"statistics_image: a tile reaches outside panel {panel.id} of {width}x{height}")
