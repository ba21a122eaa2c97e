"""Graphs for tests: a wall of two small panels, nodes as YAML, the graph or what is refused of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.compositing.build import build
from wall.compositing.graph import Graph
from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.geometry.expanding import wall_of

WALL = "wall: {grid: {columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}"  # r0c0 at x 0, r0c1 at x 8
ABOVE = """\
version: 1
scene: {source: courtyard}
"""
BELOW = """\
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}VIEW}]
"""


def text_of(graph: str, *, wall: str = WALL, more: str = "", view: str = "") -> str:
    return f"{ABOVE}{wall}\n{BELOW.replace('VIEW', ', ' * bool(view) + view)}{more}{graph}"


def nodes(*lines: str, head: str = "") -> str:
    """`graph:` with a node on each line. The first stands on line 7 of the file, later by what stands in `head`."""
    return "graph:\n" + head + "  nodes:\n" + "".join(f"    - {{{line}}}\n" for line in lines)


def built(graph: str, *, wall: str = WALL, more: str = "", view: str = "") -> Graph:
    loaded = loads(text_of(graph, wall=wall, more=more, view=view), name="a.yaml", path=Path("a.yaml"))
    return build(loaded, wall_of(loaded))


def refusals(graph: str, *, wall: str = WALL, more: str = "") -> list[str]:
    """What is wrong with a graph, a line each."""
    with pytest.raises(ConfigError) as caught:
        built(graph, wall=wall, more=more)
    return str(caught.value).splitlines()


PANEL0 = ("id: s0, op: samples, panel: r0c0", "id: p0, op: reconstruct, input: s0")
PANEL1 = ("id: s1, op: samples, panel: r0c1", "id: p1, op: reconstruct, input: s1")
CLEAR0 = (
    "id: sa, op: samples, panel: r0c0",
    "id: a, op: reconstruct, input: sa, background: transparent",
)
CLEAR1 = (
    "id: sb, op: samples, panel: r0c0",
    "id: b, op: reconstruct, input: sb, background: transparent",
)
WHOLE = (*PANEL0, *PANEL1, "id: w, op: tile, inputs: [p0, p1]", "id: png, op: sink, kind: png, input: w")
