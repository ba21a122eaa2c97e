"""Which rank does what: rank 0 is the head, then come remote compositors, then the renderers.

The plan is a pure function of the configuration, so every rank works it out alone and all agree.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wall.compositing.build import build
from wall.compositing.checks import notes_of_hosts
from wall.compositing.graph import Graph, Layer
from wall.compositing.placement import AT_RENDERER
from wall.config.graph import NodeGraph, SinkNode
from wall.config.loading import Loaded
from wall.config.sampling import AdaptiveSampling, AnySampling
from wall.config.schema import Config
from wall.config.views import ViewConfig
from wall.core.data import Event, Region
from wall.core.errors import ConfigError, RemoteProtocolError, SceneError
from wall.geometry.cameras import View, resolve_view
from wall.geometry.checks import check_wall
from wall.geometry.expanding import wall_of
from wall.geometry.lens import Lens
from wall.geometry.panels import Panel, Wall
from wall.geometry.prediction import Predictor
from wall.geometry.strips import Strips
from wall.geometry.viewports import with_views
from wall.operators.base import Operator
from wall.roles.node_settings import all_parameters
from wall.roles.tone import tone_at
from wall.scene.build import Scene, integrated
from wall.scene.build import build as build_scene
from wall.scene.of_views import Way, shown_by
from wall.scene.parameters import with_checked_tracks

HEAD = 0
ROUNDED = 1.001  # rates and row times that people wrote down are not exact


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What can be said before the scene is loaded: the wall, the graph, and how many ranks they need."""

    loaded: Loaded
    wall: Wall
    graph: Graph
    regions: tuple[tuple[Region, ...], ...]  # of each renderer, in rank order: one of each layer that it renders
    notes: tuple[str, ...] = ()  # of the wall, for `wall check`
    strips: Strips | None = None  # what regions that move are cut of; None where they do not
    extra: int = 0  # renderers beyond the configuration's, the last: they have joined, and render what cuts give them

    @property
    def config(self) -> Config:
        """The loaded configuration."""
        return self.loaded.config

    def assigned(self, cuts: Sequence[int]) -> Layout:
        """The same layout with other strips. Raises RemoteProtocolError for cuts that do not fit."""
        own = len(self.regions) - self.extra
        if self.strips is None or len(cuts) <= own:
            raise RemoteProtocolError(f"{len(cuts)} cuts for {own} renderers, or for regions that are fixed")
        return replace(self, regions=self.strips.regions(cuts), extra=len(cuts) - 1 - own)

    @property
    def size(self) -> int:
        """Number of ranks: compositors and renderers."""
        return self.graph.compositors + len(self.regions)

    @property
    def sampling(self) -> AnySampling:
        """How the first view is sampled."""
        return self.sampling_of(0)

    def sampling_of(self, view: int) -> AnySampling:
        """How a view is sampled."""
        return self.config.sampling_of(view)

    def role(self, rank: int) -> str:
        """Returns "head", "compositor" or "renderer"."""
        if rank == HEAD:
            return "head"
        return "compositor" if rank < self.graph.compositors else "renderer"

    def layer(self, region: Region) -> Layer:
        """What a region is a part of."""
        return self.graph.layers[region.layer]

    def regions_of(self, rank: int) -> tuple[Region, ...]:
        """Returns the regions that a renderer samples, one of each layer that it renders; none of one beyond cuts."""
        return next(iter(self.regions[rank - self.graph.compositors :]), ())

    def area_of(self, rank: int) -> int:
        """Returns the pixels that a renderer rank samples, in all of its regions."""
        return sum(region.rect.area for region in self.regions_of(rank))

    def region(self, rank: int) -> Region:
        """Returns the first region that a renderer rank samples."""
        return self.regions_of(rank)[0]

    def panel(self, region: Region) -> Panel:
        """Returns the panel, inset, or panel of a single layer in which a region lies."""
        return self.wall.traced[region.panel]

    def views_of(self, rank: int) -> tuple[int, ...]:
        """The views that a rank follows: a compositor all of them."""
        if self.role(rank) != "renderer" or self.strips is not None:
            return tuple(range(len(self.config.views)))
        return tuple(sorted({region.view for region in self.regions_of(rank)}))

    def renderers(self) -> range:
        """The ranks that are renderers."""
        return range(self.graph.compositors, self.size)

    def describe(self, rank: int) -> str:
        """What a rank has of the wall, for tables."""
        if self.role(rank) != "renderer":
            return self._describe_compositor(rank)
        return "; ".join(map(self._describe_region, self.regions_of(rank)))

    def _describe_region(self, region: Region) -> str:
        rect = region.rect
        return f"{self.panel(region).id} {rect.width}x{rect.height}+{rect.x}+{rect.y}{self.layer(region).objects}"

    def _describe_compositor(self, rank: int) -> str:
        panels = dict.fromkeys(self.wall.viewports[layer.panel].id for layer in self.graph.layers_on(rank))
        done = [step.node.id for step in self.graph.steps if step.rank == rank and isinstance(step.node, Operator)]
        words = [", ".join(panels)] if panels else []
        if done and not self.graph.plain:
            words.append("nodes " + ", ".join(done))
        return "; ".join(words) or "no panel"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A layout with its scene and the views of it."""

    layout: Layout
    scene: Scene  # as the first view shows it
    views: tuple[View, ...]
    number: int = 0  # of the configuration: how many the run was asked to adopt before
    since: int = 0  # its first camera event
    other_scenes: tuple[Scene | None, ...] = ()  # the scene as views after the first show it; None: as the first
    cores: float = 1.0  # of its machine that each process of the run may keep busy

    def scene_of(self, view: int) -> Scene:
        """The scene as a view shows it: with that view's integrator and lens."""
        return (self.other_scenes[view - 1] if 0 < view <= len(self.other_scenes) else None) or self.scene

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scene as each view shows it; the same object for views that show it alike."""
        return tuple(self.scene_of(view) for view in range(len(self.views)))

    def view_of(self, panel: Panel) -> View:
        """The view that a panel or inset shows."""
        return self.views[panel.view]

    @property
    def view(self) -> View:
        """The first view, for what needs a scene and a camera but no wall of views."""
        return self.views[0]


def make_layout(loaded: Loaded) -> Layout:
    """Everything that can be refused before a scene is loaded. Raises ConfigError."""
    wall = with_views(loaded, wall_of(loaded))
    noticed, graph = check_wall(loaded, wall), build(loaded, wall)
    wall, notes = graph.with_panels_of_layers(wall), (*noticed, *notes_of_hosts(loaded, graph, wall))
    strips = graph.strips(wall) if graph.balanced else None
    layout = Layout(loaded=loaded, wall=wall, graph=graph, regions=graph.regions(wall), notes=notes, strips=strips)
    _check_asked_of_renderers(layout)
    _check_barrier(layout)
    _check_scanned(layout)
    return layout


def _check_barrier(layout: Layout) -> None:
    """Refuse a barrier where views are not all refreshed by one renderer. Raises ConfigError."""
    if not layout.config.barrier:
        return
    if len(layout.regions) > 1:
        raise layout.loaded.error(("barrier",), f"{len(layout.regions)} renderers", "a wall of one")
    for layer in layout.graph.layers:
        if why := why_not_at_renderer(layout, layer):
            raise layout.loaded.error(("barrier",), f"its renderer cannot make all images: {why}", "false")


def _check_scanned(layout: Layout) -> None:
    """Refuse rows with a moment each where nothing foresees that moment. Raises ConfigError."""
    config, loaded = layout.config, layout.loaded
    for k, view in enumerate(config.views):
        panel = layout.wall.scanned(k)
        if panel is None:
            continue
        most = 1.0 / (panel.config.refresh_hz or view.refresh_hz)
        if (seconds := panel.scan_s) > most * ROUNDED:
            said = f"all rows of panel {panel.id} take {seconds:.4g} s by its row_time, and a refresh has {most:.4g} s"
            raise loaded.error(("wall",), said, f"row_time of at most {panel.config.row_time * most / seconds:.3g}")
        said = f"panel {panel.id} has a row_time, and rows are made for a moment that is predicted"
        if view.prediction == "none":
            raise loaded.error(("views", k, "prediction"), said, "velocity, or no row_time")
        if layout.graph.sync != "none":
            raise loaded.error(("graph", "sync"), f"{said}; in lock step nothing is", "none, or no row_time")
        if config.reconstruction_of(k) == "gpu":
            said = f"panel {panel.id} has a row_time, and on a GPU all rows of an image show one moment"
            at = ("reconstruction",) if view.reconstruction is None else ("views", k, "reconstruction")
            raise loaded.error(at, said, "cpu, auto, or no row_time")


def _check_asked_of_renderers(layout: Layout) -> None:
    """Refuse `on: renderer` where that cannot be. Raises ConfigError."""
    config = layout.config.graph
    indices = {node.id: k for k, node in enumerate(config.nodes)} if isinstance(config, NodeGraph) else {}
    for layer in layout.graph.layers:
        if layout.graph.step(layer.node).node.on == AT_RENDERER and (why := why_not_at_renderer(layout, layer)):
            path = ("graph", "nodes", indices[layer.node], "on")
            raise layout.loaded.error(path, f"its renderer cannot make this image: {why}", "no `on`, or a compositor")


def check_files(layout: Layout) -> None:
    """Read the files that nodes name. Raises ConfigError at the node that cannot have its own."""
    graph = layout.config.graph
    indices = {node.id: k for k, node in enumerate(graph.nodes)} if isinstance(graph, NodeGraph) else {}
    for step in layout.graph.steps:
        node = step.node
        if isinstance(node, Operator):
            try:
                node.prepare(layout.loaded.folder, [layout.graph.steps[k].rect for k in step.inputs])
            except ConfigError as error:
                path = ("graph", "nodes", indices[node.id]) if node.id in indices else ("graph",)
                raise layout.loaded.error(path, str(error)) from error


def make_plan(layout: Layout) -> Plan:
    """Load the scene and aim the views at it. Raises ConfigError."""
    return aimed(layout, load_scene(layout))


def load_scene(layout: Layout) -> Scene:
    """The scene as its source and `scene:` have it, whatever views show it. Raises ConfigError."""
    try:
        scene = build_scene(layout.config.scene, Path(layout.loaded.path).parent)
    except SceneError as error:
        raise layout.loaded.error(("scene", "source"), str(error)) from error
    try:
        return with_checked_tracks(scene, all_parameters(_scenes(layout, scene), layout.graph, layout.config))
    except SceneError as error:
        raise layout.loaded.error(("scene", "animation"), str(error)) from error


def _scenes(layout: Layout, scene: Scene) -> tuple[Scene, ...]:
    """A scene as each view shows it; the same object for views that show it alike."""
    found: dict[Way, Scene] = {}
    ways = [_way(view, scene) for view in layout.config.views]
    return tuple(found.setdefault(way, shown_by(scene, way)) for way in ways)


def _way(view: ViewConfig, scene: Scene) -> Way:
    """How a view shows a scene that has an integrator of its own."""
    depth, occlusion = scene.path_depth, scene.occlusion
    if view.integrator is not None:
        depth, occlusion = integrated(view.integrator)
    lens = None if view.lens is None else Lens(radius=view.lens.aperture / 2, focus=view.lens.focus)
    return Way(depth, occlusion, lens)


def aimed(layout: Layout, scene: Scene) -> Plan:
    """Aim a layout's views at a scene. Raises ConfigError."""
    scenes = _scenes(layout, scene)
    for k, shown in enumerate(scenes):
        if shown.lens is not None and shown.path_depth is None:
            own = layout.config.views[k].integrator is not None
            wanted = f"{'' if own else 'scene.'}integrator: {{method: path}}, or no lens"
            raise layout.loaded.error(("views", k, "lens"), "direct light has no lens", wanted)
    _check_reconstruction(layout, scenes)
    views: dict[str, View] = {}
    for k in range(len(scenes)):
        view = resolve_view(
            layout.loaded, layout.wall.of_view(k), scene.center, scene.radius,
            view=k, cameras=scene.cameras, leaders=views,
        )  # fmt: skip
        views[view.id] = view
    others = tuple(None if shown is scenes[0] else shown for shown in scenes[1:])
    return Plan(layout=layout, scene=scenes[0], views=tuple(views.values()), other_scenes=others)


def _check_reconstruction(layout: Layout, scenes: Sequence[Scene]) -> None:
    """Refuse a GPU that is asked for where the noise of paths is to be filtered. Raises ConfigError."""
    config = layout.config
    for layer in layout.graph.layers:
        view, on_gpu = config.views[layer.view], config.reconstruction_of(layer.view) == "gpu"
        reprojects = layer.reprojects or isinstance(layout.sampling_of(layer.view), AdaptiveSampling)
        if on_gpu and reprojects and scenes[layer.view].path_depth is not None:
            where = ("reconstruction",) if view.reconstruction is None else ("views", layer.view, "reconstruction")
            why = f"view {view.id} has paths, whose noise is filtered on the CPU alone"
            raise layout.loaded.error(where, why, "auto, cpu, or integrator: {method: direct}")


def on_one_rank(plan: Plan) -> Plan:
    """The same plan with every node on the head, but for what renderers reconstruct: images are the same anywhere."""
    graph = plan.layout.graph
    others = {layer.index: HEAD for layer in graph.layers if not layer.at_renderer}
    at_renderers = {layer.node for layer in graph.layers if layer.at_renderer}
    steps = tuple(step if step.node.id in at_renderers else replace(step, rank=HEAD) for step in graph.steps)
    graph = replace(graph, steps=steps).reconstructed_at(others)
    return replace(plan, layout=replace(plan.layout, graph=graph))


def why_not_at_renderer(layout: Layout, layer: Layer) -> str:
    """Why samples of a layer travel to its compositor even on one machine; "" where its renderer makes its image."""
    if layout.graph.balanced:
        return "borders between renderers move"
    if len(layer.ranks) > 1:
        return f"{len(layer.ranks)} ranks render it"
    if layout.graph.sync != "none":
        return "its frames are shown in lock step"
    if (threads := layout.sampling_of(layer.view).threads) > 1:
        return f"{threads} threads render it"
    if beyond := layout.graph.beyond_bytes(layer):
        return f"the graph needs {' and '.join(beyond)}"
    if layout.config.reconstruction_of(layer.view) == "gpu":
        return "the compositor's GPU reconstructs"
    if layout.config.output.browser.samples:
        return "the page gets samples"
    asked = layout.graph.step(layer.node).node.on
    if asked not in (None, AT_RENDERER):
        return f"`on: {asked}` asks for it"
    return ""


def reconstructed_at_renderers(layout: Layout, machines: Sequence[str]) -> Layout:
    """Let renderers make the images that are shown on their machines: their deep buffers hold the samples already.

    `machines`: of every rank.
    """
    makers = [
        layer
        for layer in layout.graph.layers
        if not why_not_at_renderer(layout, layer)
        and (
            machines[layer.ranks[0]] == machines[layer.compositor]
            or layout.graph.step(layer.node).node.on == AT_RENDERER
        )
    ]
    others = {rank for layer in layout.graph.layers if layer not in makers for rank in layer.ranks}
    if layout.config.barrier and others:
        raise layout.loaded.error(("barrier",), "the renderer and the compositor are on two machines", "one machine")
    rank_of = {layer.index: layer.ranks[0] for layer in makers if layer.ranks[0] not in others}  # all of a rank or none
    return replace(layout, graph=layout.graph.reconstructed_at(rank_of))


def on_one_machine(plan: Plan) -> Plan:
    """The plan of a run on one machine."""
    return replace(plan, layout=reconstructed_at_renderers(plan.layout, [""] * plan.layout.size))


def make_predictor(plan: Plan, view: int) -> Predictor:
    """What a compositor foresees the refreshes of a view with."""
    shown, scanned = plan.views[view], plan.layout.wall.scanned(view)
    predicted = shown.predicted and plan.layout.graph.sync == "none"
    return Predictor(shown.display_delay_s, on=predicted, moving=scanned is not None, scale=shown.scale)


def first_event(plan: Plan, now: float, view: int = 0) -> Event:
    """What every run begins with: a view at its first moment."""
    time = plan.views[view].time_after(0.0) if plan.scene.animated else 0.0
    tone = tone_at(plan, time, view=view)
    return Event(
        view=view,
        camera_event=plan.since,
        scene_event=0,
        scene_time=time,
        input_time=now,
        camera=plan.views[view].camera_after(0.0),
        sampler=plan.layout.sampling_of(view).method,
        exposure=tone.stops,
        tone_mapping=tone.mapping,
    )


def window_panels(layout: Layout, ranks: Container[int]) -> list[Panel]:
    """The panels that have a window at some ranks."""
    return [
        layout.wall.panels[k]
        for step in layout.graph.steps
        if step.rank in ranks and isinstance(step.node, SinkNode) and step.node.kind == "window"
        for k in step.panels
    ]


def window_ranks(layout: Layout) -> frozenset[int]:
    """The ranks that have windows, unless the run is headless."""
    return frozenset(rank for rank in range(layout.graph.compositors) if window_panels(layout, (rank,)))
