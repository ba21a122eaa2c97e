"""Which rank does what: rank 0 is the head, then come further compositors, then the renderers.

The plan is a pure function of the configuration, so every rank works it out alone and all agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wall.compositing.graph import Graph, build
from wall.config.loading import Loaded
from wall.config.schema import AnySampling, Config
from wall.data import Event, Region
from wall.errors import SceneError
from wall.geometry.cameras import View, resolve_view
from wall.geometry.panels import Panel, Wall, expand
from wall.geometry.prediction import Predictor
from wall.geometry.regions import regions
from wall.scene.build import Scene
from wall.scene.build import build as build_scene

HEAD = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What can be said before the scene is loaded: the wall, the graph, and how many ranks they need."""

    loaded: Loaded
    wall: Wall
    graph: Graph
    regions: tuple[Region, ...]  # of each renderer, in rank order

    @property
    def config(self) -> Config:
        return self.loaded.config

    @property
    def size(self) -> int:
        return self.graph.compositors + len(self.regions)

    @property
    def sampling(self) -> AnySampling:
        return self.config.sampling_of(0)

    def role(self, rank: int) -> str:
        if rank == HEAD:
            return "head"
        return "compositor" if rank < self.graph.compositors else "renderer"

    def region(self, rank: int) -> Region:
        return self.regions[rank - self.graph.compositors]

    def panel(self, rank: int) -> Panel:
        return self.wall.panels[self.region(rank).panel]

    def compositor_of(self, panel: int) -> int:
        """The rank that takes a panel's samples in."""
        return self.graph.compositor_of(panel)

    def panels_of(self, rank: int) -> tuple[int, ...]:
        return tuple(k for k in range(len(self.wall.panels)) if self.compositor_of(k) == rank)

    def renderers(self) -> range:
        return range(self.graph.compositors, self.size)

    def describe(self, rank: int) -> str:
        """What a rank has of the wall, for tables."""
        if self.role(rank) != "renderer":
            return ", ".join(self.wall.panels[k].id for k in self.panels_of(rank)) or "no panel"
        rect = self.region(rank).rect
        return f"{self.panel(rank).id} {rect.width}x{rect.height}+{rect.x}+{rect.y}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A layout with its scene and the view of it."""

    layout: Layout
    scene: Scene
    view: View


def make_layout(loaded: Loaded) -> Layout:
    """Everything that can be refused before a scene is loaded. Raises ConfigError."""
    wall = expand(loaded.config.wall)
    graph = build(loaded, wall)
    return Layout(loaded=loaded, wall=wall, graph=graph, regions=regions(graph, wall))


def make_plan(layout: Layout) -> Plan:
    """Load the scene and aim the view at it. Raises SceneError."""
    try:
        scene = build_scene(layout.config.scene, Path(layout.loaded.path).parent)
    except SceneError as error:
        raise layout.loaded.error(("scene", "source"), str(error)) from error
    return Plan(layout=layout, scene=scene, view=resolve_view(layout.loaded, layout.wall, scene.center, scene.radius))


def make_predictor(plan: Plan) -> Predictor:
    """What a compositor foresees its refreshes with."""
    return Predictor(plan.view.display_delay_s, on=plan.view.predicted)


def first_event(plan: Plan, now: float) -> Event:
    """What every run begins with: the view at time 0."""
    return Event(
        view=0,
        camera_event=0,
        scene_event=0,
        scene_time=0.0,
        input_time=now,
        camera=plan.view.camera_at(0.0),
        sampler=plan.layout.sampling.method,
    )
