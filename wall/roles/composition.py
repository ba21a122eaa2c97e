"""What one rank composes: the layers whose samples come here, the graph's nodes, and what sinks and other ranks get."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.compositing.executor import Changes, Executor, Regions, tiles_to_regions
from wall.config.graph import FrameSync, SkyNode
from wall.core.data import NO_EDITS, Batch, Event, Framelet, Rect, Region, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.display.base import PanelSamples
from wall.packets.control import parse_control, serialise
from wall.packets.framelets import FrameletPart
from wall.packets.samples import decode, is_samples
from wall.roles.edges import Number, Outlets, RemoteFramelet, needed_from_others, shows_only
from wall.roles.edit_history import EditHistory
from wall.roles.handed_samples import why_images
from wall.roles.instructions import Offer, Ready, Shares, shares_nothing
from wall.roles.layer import PanelCompositor
from wall.roles.lockstep import Lockstep
from wall.roles.node_settings import settings_of
from wall.roles.plan import HEAD, Plan
from wall.roles.present import PanelCrops
from wall.roles.sky import SkyLayer
from wall.roles.statistics import Due, check_statistics_image
from wall.roles.timewarp import Timewarp

MOST_APART_S = 60.0  # of a packet's time from the last refresh: more is no delay, but another clock
MOST_AHEAD = 1 << 14  # events that a packet may be newer than those that came here: two minutes at 120 a second
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
    """The layers and the nodes of one rank: `follow` events, `insert` packets, `refresh` the images, `send` them."""

    def __init__(
        self,
        plan: Plan,
        rank: int,
        ready: Ready = no_credit,
        run_all: RunAll = one_by_one,
        shares: Shares = shares_nothing,
    ) -> None:
        """`ready`: which ranks take framelets now; `run_all` refreshes several layers, perhaps a thread each."""
        graph = plan.layout.graph
        self.counters = Counter[str]()
        self._plan, self._rank, self._ready, self._run_all = plan, rank, ready, run_all
        self._shares = shares
        self.layers = {layer.index: PanelCompositor(plan, layer.index) for layer in graph.layers_on(rank)}
        handed = [panel for panel, why in enumerate(why_images(plan.layout)) if not why]
        self._handing = [layer for layer in self.layers.values() if layer.layer.panel in handed]
        self._source_of = {layer.index: graph.step(layer.node).index for layer in graph.layers}
        steps = [step for step in graph.steps if step.rank == rank]
        self._skies = {step.index: SkyLayer(plan, step) for step in steps if isinstance(step.node, SkyNode)}
        self.lockstep = Lockstep(graph, rank) if isinstance(graph.sync, FrameSync) else None
        self._nodes = self._make_nodes({index: layer.framelet for index, layer in self.layers.items()})
        self._compared: _Nodes | None = None  # while two samplers are compared
        self._refreshed: float | None = None  # when, seconds of the head's clock
        # of other ranks, the newest of each panel and sampler
        self._statistics_images: dict[tuple[int, bool], StatisticsImage] = {}
        self._statistics_due = Due()
        self._edits = EditHistory()
        self._followed = dict[int, Number]()  # by view: the newest event

    def _make_nodes(self, of_layers: Mapping[int, Framelet], *, compared: bool = False) -> _Nodes:
        """The rank's nodes, fresh; `of_layers`: the framelets of the layers that are shown."""
        sources = {step: sky.framelet for step, sky in self._skies.items()}
        sources |= {self._source_of[index]: framelet for index, framelet in of_layers.items()}
        outlets = Outlets(self._plan.layout.graph, self._rank, self._ready, compared=compared, shares=self._shares)
        return _Nodes(self._plan, self._rank, sources, outlets, self.lockstep)

    def begin_with(self, before: Composition) -> None:
        """Show what another one of the same panels shows, until samples come."""
        known = {(layer.panel.index, layer.layer.view): layer for layer in before.layers.values()}
        for layer in self.layers.values():
            if (old := known.get((layer.panel.index, layer.layer.view))) and old.panel.pixels == layer.panel.pixels:
                layer.begin_with(old)
        self._nodes.begin_with(before._nodes)
        before.close()

    def close(self) -> None:
        """End what nodes have under way."""
        for nodes in self._all_nodes():
            nodes.executor.close()

    def follow(self, event: Event) -> None:
        """Begin or end comparing two samplers, if `event` says so."""
        self._followed[event.view] = event.number
        early = self._edits.know(event.edits)
        for layer in self._of_view(event.view):
            layer.follow(event)
        if not event.compare:
            self._compared = None
        elif self._compared is None:
            seconds = {index: layer.compared for index, layer in self.layers.items()}
            framelets = {index: second.framelet for index, second in seconds.items() if second is not None}
            self._compared = self._make_nodes(framelets, compared=True)
        for batch in early:
            self._give(batch, self._layer_of(batch.rank, batch.panel, batch.rect))

    def _of_view(self, view: int) -> list[PanelCompositor]:
        """The layers that show a view."""
        return [layer for layer in self.layers.values() if layer.layer.view == view]

    @property
    def views(self) -> tuple[int, ...]:
        """The views of which there are layers here."""
        return tuple(sorted({layer.layer.view for layer in self.layers.values()}))

    def insert(self, packet: bytes, now: float = -math.inf) -> None:
        """Take one packet in that came at `now`.

        Raises RemoteProtocolError for one that no rank of this run can have sent.
        """
        if is_samples(packet):
            self.insert_batch(decode(packet))
            return
        message = parse_control(packet)
        if isinstance(message, StatisticsImage):
            self.keep(message)
        elif isinstance(message, FrameletPart):
            before = message.event is not None and message.event.camera_event < self._plan.since
            if not before and (nodes := self._nodes_of(message)) is not None:
                nodes.insert(message, now)
        else:
            raise RemoteProtocolError("neither samples, a framelet nor another compositor's statistics image")

    def insert_batch(self, batch: Batch) -> None:
        """Take samples in. Raises RemoteProtocolError for those that no rank of this run can have traced now."""
        if batch.camera_event < self._plan.since:  # of the configuration before
            self.counters["late"] += len(batch.samples)
            return
        layer = self._layer_of(batch.rank, batch.panel, batch.rect)
        camera_event, scene_event = self._followed.get(layer.layer.view, (self._plan.since, 0))
        if batch.camera_event > camera_event + MOST_AHEAD or batch.scene_event > scene_event + MOST_AHEAD:
            came = f"event {batch.camera_event}/{batch.scene_event}"
            raise RemoteProtocolError(f"rank {batch.rank}: {came}; wanted: about {camera_event}/{scene_event}")
        if self._refreshed is not None and abs(batch.base_time - self._refreshed) > MOST_APART_S:
            wanted = f"about {self._refreshed:.6g} s"
            raise RemoteProtocolError(f"rank {batch.rank}: from {batch.base_time:.6g} s; wanted: {wanted}")
        self._give(batch, layer)

    def _give(self, batch: Batch, layer: PanelCompositor) -> None:
        """Give samples to their layer, or keep them until their edits are known."""
        edits = self._edits.of(batch.edits.number)
        if edits is not None:
            layer.insert(batch if batch.edits is edits else replace(batch, edits=edits))
        elif not self._edits.waits(batch):
            self.counters["late"] += len(batch.samples)

    def _nodes_of(self, part: FrameletPart) -> _Nodes | None:
        return self._compared if part.compared else self._nodes

    def _layer_of(self, rank: int, panel: int, rect: Rect) -> PanelCompositor:
        """The layer of a renderer. Raises RemoteProtocolError for a rectangle outside the renderer's region."""
        layout = self._plan.layout
        regions: tuple[Region, ...] = ()
        if layout.strips is not None and rank >= layout.graph.compositors:  # any renderer may have any strip
            regions = layout.strips.panels
        elif rank in layout.renderers():
            regions = layout.regions_of(rank)
        region = next((region for region in regions if region.panel == panel), None)
        if region is None or not region.rect.contains(rect):
            wanted = " or ".join(map(str, regions)) or "of a renderer"
            raise RemoteProtocolError(f"rank {rank}: {rect} of panel {panel}; wanted: inside {wanted}")
        if region.layer not in self.layers:
            raise RemoteProtocolError(f"samples of panel {panel}, which is another compositor's")
        return self.layers[region.layer]

    def forget_tiles(self) -> None:
        """Regions have moved: forget what samplers told of their tiles."""
        for layer in self.layers.values():
            layer.reprojected.tiles_of.clear()

    def keep(self, image: StatisticsImage) -> None:
        """Keep a renderer's tiles for its layer, another compositor's image for the page."""
        if image.rank != HEAD:
            layer = self._layer_of(image.rank, image.panel, image.bounds)
            layer.reprojected.tiles_of[image.rank] = image
            return
        panels = self._plan.layout.wall.panels
        if self._rank != self._plan.layout.graph.page_rank or image.panel >= len(panels):
            raise RemoteProtocolError(f"statistics_image of panel {image.panel}, which is not needed here")
        check_statistics_image(image, panels[image.panel])
        self._statistics_images[image.panel, image.compared] = image

    def refresh(self, event: Event, now: float, *, force: bool = False) -> Changes:
        """Bring the view's layers and then the nodes of this rank up to date. Returns what changed, by step.

        In lock step nothing happens before the frame of `event` is there, or its time is up, unless `force`.
        """
        self._refreshed = now
        if self.lockstep is not None and not force:
            late = self.lockstep.take(event, self.layers, self._nodes.remote, now)
            if late is None:
                return {}
            for name in late:
                counted = len(self.counters) < MOST_NAMES or f"late {name}" in self.counters
                self.counters[f"late {name}" if counted else "late others"] += 1
        layers = self._of_view(event.view)
        on_gpu = any(layer.reprojected.on_gpu for layer in layers)  # such an image belongs to the thread that inserts
        run_all = one_by_one if on_gpu else self._run_all
        refreshed = run_all([partial(layer.refresh, event, now, force=force) for layer in layers])
        fresh = self._regions_of(zip(layers, refreshed, strict=True))
        fresh |= {step: sky.refresh(event, now) for step, sky in self._skies.items() if sky.view == event.view}
        if self._compared is not None:
            seconds = [
                (layer, layer.compared.refresh(now, event.tone)) for layer in layers if layer.compared is not None
            ]
            self._compared.step(self._regions_of(seconds), event, now, force=force)
        return self._nodes.step(fresh, event, now, force=force)

    def _all_nodes(self) -> list[_Nodes]:
        return [self._nodes] if self._compared is None else [self._nodes, self._compared]

    @property
    def due(self) -> float:
        """When an image of another rank that came is shown next, seconds of the head's clock; inf where none waits."""
        waiting = (remote.due for nodes in self._all_nodes() for remote in nodes.remote.values())
        return min(waiting, default=math.inf)

    def hasten(self, until: float) -> None:
        """Show images of other ranks as they come, until a time, seconds of the head's clock: an edit is among them."""
        for nodes in self._all_nodes():
            for remote in nodes.remote.values():
                remote.even_from = until

    def take_edited(self, view: int) -> bool:
        """Whether an edit came since this was asked last that the next refresh of a view shows."""
        edited = [layer for layer in self._of_view(view) if layer.edited]
        for layer in edited:
            layer.edited = False
        return bool(edited)

    def behind(self, view: int) -> bool:
        """Whether a slower layer of a view waits for its turn to show what came, or the newest event, or tiles come."""
        return any(layer.behind for layer in self._of_view(view)) or any(n.executor.waits for n in self._all_nodes())

    def _regions_of(self, dirty_tiles: Iterable[tuple[PanelCompositor, NDArray[np.bool_]]]) -> Changes:
        """What changed, by step, of the tiles of layers that changed."""
        return {
            self._source_of[layer.layer.index]: tiles_to_regions(dirty, TILE, layer.framelet.rect)
            for layer, dirty in dirty_tiles
            if dirty.any()
        }

    def say(self, statistics: Mapping[str, float]) -> None:
        """Tell the overlays of this rank how the run is doing."""
        self._nodes.executor.set_statistics(statistics)

    def send(self) -> Iterator[Offer]:
        """Offer other ranks what changed for them, as far as there is credit."""
        done = None if self.lockstep is None else self.lockstep.done
        for nodes in self._all_nodes():
            yield from nodes.outlets.send(nodes.executor.framelets, lambda view: done or self.newest_event(view))

    def lose(self, target: int, packet: bytes) -> None:
        """A packet to another rank was dropped: its pixels are sent again."""
        part = parse_control(packet)
        if isinstance(part, FrameletPart) and (nodes := self._nodes_of(part)) is not None:
            nodes.outlets.lose(target, part)

    def renew(self, target: int) -> None:
        """Another rank has begun anew: it gets all that it needs of this one again."""
        for nodes in self._all_nodes():
            nodes.outlets.renew(target)

    def statistics_images(self, now: float, *, comparing: bool) -> tuple[StatisticsImage, ...]:
        """Statistics images of every panel and sampler: made now for own panels, the newest that came of the others.

        Of several layers of a panel the first speaks for it. Insets are left out, and layers of fewer pixels.
        """
        whole = range(len(self._plan.layout.wall.panels))
        panels = [layer for layer in self.layers.values() if layer.panel.index in whole]
        first = {layer.panel.index: layer for layer in reversed(panels)}
        own = [image for panel in sorted(first) for image in first[panel].statistics_images(now)]
        return (*own, *(image for image in self._statistics_images.values() if comparing or not image.compared))

    def offer_statistics(self, now: float) -> Iterator[Offer]:
        """Offer the page this rank's statistics images, if they are due and there is credit."""
        page_rank = self._plan.layout.graph.page_rank
        if self._ready(page_rank) and self._statistics_due.now(now):
            for image in self.statistics_images(now, comparing=True):
                yield Offer(page_rank, serialise(image))

    def shown(self) -> list[PanelCrops]:
        """What every sink of this rank shows, in the order of the graph."""
        return self._nodes.shown

    def compared(self) -> list[PanelCrops]:
        """The second images, black until something came. None unless two samplers are compared."""
        return self._compared.shown if self._compared is not None else []

    def hand_samples(self, wanted: bool) -> None:
        """Begin or stop to hand samples of panels on."""
        for layer in self._handing:
            layer.hand_samples(wanted)

    def take_samples(self) -> tuple[PanelSamples, ...]:
        """Samples that came since they were last taken, of panels that show them and nothing else."""
        taken = [layer.handed.take() for layer in self._handing if layer.handed is not None]
        return tuple(samples for samples in taken if samples is not None)

    def newest_event(self, view: int = 0) -> Number:
        """The newest event of a view that has a sample in an image; one before the first where none has."""
        numbers = [(self._plan.since, -1), *(layer.newest_event for layer in self._of_view(view))]
        numbers += [remote.newest_event(view) for remote in self._nodes.remote.values()]
        return max(numbers)

    @property
    def idle(self) -> bool:
        """Whether every framelet that others need has been sent."""
        return self._nodes.outlets.idle

    def samples_shown(self) -> int:
        """Number of samples that the images of all layers show."""
        return sum(layer.samples_shown for layer in self.layers.values())

    def right_s(self, now: float) -> float:
        """Seconds from an input to images that are right, of the slowest layer; 0: not known."""
        return max((layer.right.seconds(now) for layer in self.layers.values()), default=0.0)

    def drops(self) -> Counter[str]:
        """What was dropped here, by name."""
        unread = sum(len(each.failures) for nodes in self._all_nodes() for each in nodes.executor.following)
        return sum((layer.counters for layer in self.layers.values()), self.counters + Counter(unread_tiles=unread))


class _Nodes:
    """The graph's nodes on a rank, working on one set of samples; on two while samplers are compared."""

    def __init__(
        self, plan: Plan, rank: int, sources: dict[int, Framelet], outlets: Outlets, lockstep: Lockstep | None
    ) -> None:
        """`sources`: framelets that this rank makes of samples and skies, by step."""
        graph, layout = plan.layout.graph, plan.layout
        period_s = 1.0 / max(view.refresh_hz for view in plan.views) if shows_only(graph, rank) else 0.0
        self.remote = {step.index: RemoteFramelet(step, period_s) for step in needed_from_others(graph, rank)}
        sources = sources | {step: remote.framelet for step, remote in self.remote.items()}
        reproject = Timewarp(plan) if lockstep is None else None
        self.executor = Executor(graph, rank, sources, layout.loaded.folder, reproject)
        self.outlets = outlets
        self.shown = [PanelCrops(graph, sink, layout.wall) for sink in graph.sinks_on(rank)]
        self._lockstep, self._scene = lockstep, plan.scene
        self._time, self._edits = 0.0, NO_EDITS

    def begin_with(self, before: _Nodes) -> None:
        known = {(old.step.node.id, old.step.rect): old.framelet for old in before.remote.values()}
        for remote in self.remote.values():
            if old := known.get((remote.step.node.id, remote.step.rect)):
                remote.begin_with(old)
        for shown, earlier in zip(self.shown, before.shown, strict=True):
            shown.begin_with(earlier)

    def insert(self, part: FrameletPart, now: float) -> None:
        if part.step not in self.remote:
            raise RemoteProtocolError(f"a framelet of step {part.step}, which is not needed here")
        self.remote[part.step].insert(part, now)

    def step(self, fresh: Changes, event: Event, now: float, *, force: bool) -> Changes:
        for remote in self.remote.values():
            remote.show(now, force=force)
        arrived: dict[int, Regions] = {step: remote.take_changes() for step, remote in self.remote.items()}
        if event.view == 0:  # which says what time it is
            self._time = event.scene_time
        if event.edits.number > self._edits.number:  # another view's event may lack the newest
            self._edits = event.edits
        values = self._scene.values(self._time, self._edits) if self.executor.following else {}
        changes = self.executor.step({**fresh, **arrived}, event, settings_of(values))
        for shown in self.shown:
            shown.take(changes, self.executor.framelets)
        # a frame's number is sent once: a frame made again sends only what changed
        self.outlets.add(changes, all_due=self._lockstep is not None and not self._lockstep.again)
        return changes
