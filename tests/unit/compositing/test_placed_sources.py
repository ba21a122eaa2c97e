"""Sources that nobody renders: where they lie in the wall."""

from __future__ import annotations

import pytest

from wall.compositing.build import build
from wall.config.loading import loads
from wall.core.data import Rect
from wall.geometry.expanding import expand

WALL = """\
version: 1
scene: {source: x}
wall: {grid: {columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}
views: [{camera: auto}]
graph:
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: f, op: reconstruct, input: s}
    - SOURCE
    - {id: w, op: tile, inputs: [f, k]}
    - {id: out, op: sink, kind: png, input: w}
"""


@pytest.mark.parametrize(
    "source",
    [
        "{id: k, op: constant, panel: r0c1, colour: [1, 0, 0]}",
        "{id: k, op: constant, area: [8, 0, 8, 6], colour: [1, 0, 0]}",
        "{id: k, op: image, panel: r0c1, file: logo.png}",
    ],
)
def test_a_source_covers_the_panel_or_the_area_that_it_names(source: str) -> None:
    loaded = loads(WALL.replace("SOURCE", source), name="a.yaml")
    graph = build(loaded, expand(loaded.config.wall))
    rects = {step.node.id: step.rect for step in graph.steps}
    assert rects["k"] == Rect(x=8, y=0, width=8, height=6)
    assert rects["w"] == Rect(x=0, y=0, width=16, height=6)
