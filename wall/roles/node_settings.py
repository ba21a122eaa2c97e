"""Settings of the graph's nodes as parameters, `nodes.ID.KEY`: edited, undone and animated as those of scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from wall.compositing.executor import Settings
from wall.compositing.graph import Graph
from wall.config.schema import Config
from wall.core.errors import ConfigError
from wall.display.base import ZoomedPlace
from wall.operators.base import Operator
from wall.operators.deep_zoom import DeepZoom
from wall.roles.tone import configured_tone
from wall.scene.build import Scene
from wall.scene.parameters import Numbers, Parameter, parameters_of_views

if TYPE_CHECKING:  # which takes its parameters from here
    from wall.roles.plan import Layout

NODES = "nodes."


def all_parameters(scenes: Sequence[Scene], graph: Graph, config: Config) -> dict[str, Parameter]:
    """Those of a scene as its views show it, see parameters_of_views, and of the graph's nodes."""
    found = parameters_of_views(scenes, tone=configured_tone(config.views[0]))
    return found | {each.name: each for each in _of_nodes(graph)}


def _of_nodes(graph: Graph) -> Iterator[Parameter]:
    for step in graph.steps:
        for key, low, high, unit in step.node.SETTINGS if isinstance(step.node, Operator) else ():
            default = (float(getattr(step.node, key)),)
            name = f"{NODES}{step.node.id}.{key}"
            yield Parameter(name=name, kind="number", low=low, high=high, unit=unit, default=default)


def one_gesture(name: str) -> str:
    """What is changed together by one drag of a pointer: all settings of a node, else the parameter itself."""
    return name.rpartition(".")[0] if name.startswith(NODES) else name


def settings_of(values: Mapping[str, Numbers]) -> Settings:
    """Settings by node, of parameters that are not as configured."""
    found: dict[str, dict[str, float]] = {}
    for name, numbers in values.items():
        if name.startswith(NODES):
            node, _, key = name.removeprefix(NODES).rpartition(".")
            found.setdefault(node, {})[key] = numbers[0]
    return found


def zoomed_places(layout: Layout) -> list[ZoomedPlace]:
    """Where nodes show parts of very large images; without those whose file cannot be read here."""
    found = []
    for step in layout.graph.steps:
        if isinstance(step.node, DeepZoom):
            with suppress(ConfigError):
                width, height = step.node.fit(layout.loaded.folder)
                r = step.rect
                found.append(
                    ZoomedPlace(node=step.node.id, x=r.x, y=r.y, width=r.width, height=r.height, fit=(width, height))
                )
    return found
