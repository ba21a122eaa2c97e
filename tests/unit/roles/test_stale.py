"""Where the wall is stale: what the ranks that are not heard of have of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.config.loading import load, loads
from wall.roles.plan import Layout, make_layout
from wall.roles.stale import stale_places

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [40, 20], size: [0.4, 0.2], bezel: 0.05}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
graph: {preset: sort-first, ranks_per_panel: 2, compositors: 2}
"""


@pytest.fixture(scope="module")
def layout() -> Layout:
    return make_layout(loads(TEXT, path=Path("wall.yaml")))


def test_of_a_renderer_its_regions_are_stale_and_of_a_compositor_its_panels(layout: Layout) -> None:
    first, second = (panel.screen[0] for panel in layout.wall.panels)
    own = {rank: layout.regions_of(rank)[0].rect for rank in layout.renderers()}
    for rank, left in ((2, first), (3, first), (4, second), (5, second)):
        rect = own[rank]
        assert stale_places(layout, [rank]) == ((left + rect.x, rect.y, rect.width, rect.height),)
    assert sum(width * height for _, _, width, height in stale_places(layout, own)) == 2 * 40 * 20
    elsewhere = [p.screen[0] for p in layout.wall.panels for x in layout.graph.layers_on(1) if x.panel == p.index]
    assert stale_places(layout, [1]) == tuple((left, 0.0, 40.0, 20.0) for left in elsewhere)
    assert elsewhere
    assert stale_places(layout, []) == ()


def test_a_coarse_layer_is_marked_where_it_is_shown() -> None:
    layout = make_layout(load(Path("configs/graphs/layers.yaml")))
    coarse = [rank for rank in layout.renderers() if layout.layer(layout.region(rank)).scale < 1.0]
    panel = layout.wall.panels[0]
    assert layout.region(coarse[0]).rect.width < panel.pixels[0]
    assert stale_places(layout, coarse[:1]) == ((*panel.screen, *panel.pixels),)
