"""Every configuration in configs/ is what it says, and comes back from its own dump."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from wall.compositing.build import build
from wall.config import json_schema
from wall.config.loading import dump, load, loads
from wall.geometry.cameras import View, resolve_view
from wall.geometry.expanding import wall_of
from wall.geometry.panels import NO_VIEW
from wall.geometry.viewports import with_views
from wall.operators.deep_zoom import DeepZoom

CONFIGS = Path(__file__).parents[3] / "configs"
SHIPPED = sorted(CONFIGS.rglob("*.yaml"))
# what launching each under mpirun takes: one head, remote compositors, renderers
RANKS = {
    "paths/cornell": 2,
    "paths/cornell_glass": 2,
    "paths/cornell_metal": 2,
    "paths/environment": 2,
    "paths/lamps": 2,
    "paths/materials": 2,
    "paths/progressive": 2,
    "balance": 3,
    "cave_corner": 4,
    "cut_away": 3,
    "deep_zoom": 2,
    "demo": 5,
    "drum": 2,
    "forest": 3,
    "galaxy": 2,
    "four_by_two_bezels": 9,
    "harmonic": 2,
    "graphs/compositor_a_panel": 5,
    "graphs/compositor_tree": 11,
    "graphs/hybrid": 5,
    "graphs/layers": 3,
    "graphs/lock_step": 5,
    "graphs/mixed_sinks": 3,
    "graphs/see_through": 3,
    "graphs/sort_last_direct_send": 4,
    "graphs/sort_last_tree": 6,
    "lorenz": 2,
    "measure/bounce": 5,
    "measure/cuts": 5,
    "measure/features": 2,
    "measure/jerky": 5,
    "measure/lamps": 5,
    "measure/light": 5,
    "measure/metal": 5,
    "measure/mirrors": 5,
    "measure/one_mover": 2,
    "measure/orbit": 5,
    "measure/shadows": 5,
    "measure/telephoto": 5,
    "measure/walk": 5,
    "museum": 3,
    "orbital": 2,
    "one_panel": 2,
    "scanning_display": 2,
    "sampler_adaptive": 2,
    "sampler_framed": 3,
    "sampler_frameless": 3,
    "sampler_hilbert": 3,
    "samples_in_page": 3,
    "tracked": 3,
    "two_by_two": 9,
    "two_compositors": 5,
    "two_panels": 3,
    "views/four_views": 2,
    "views/framed_frameless": 3,
    "views/integrators": 3,
    "views/map_inset": 3,
    "views/moments": 4,
    "views/side_by_side": 3,
    "walls/cylinder": 6,
    "walls/dome": 5,
    "walls/large": 90,
    "walls/mixed_densities": 4,
    "walls/projectors": 4,
    "walls/stereo": 5,
}


def shipped_name(path: Path) -> str:
    return path.relative_to(CONFIGS).with_suffix("").as_posix()


def test_every_shipped_configuration_is_listed_here() -> None:
    assert {shipped_name(path) for path in SHIPPED} == set(RANKS)


@pytest.mark.parametrize("path", SHIPPED, ids=shipped_name)
def test_shipped_configuration_comes_back_from_its_dump(path: Path) -> None:
    config = load(path).config

    assert loads(dump(config)).config == config


@pytest.mark.parametrize("path", SHIPPED, ids=shipped_name)
def test_shipped_configuration_resolves_to_regions_of_every_pixel(path: Path) -> None:
    loaded = load(path)
    wall = with_views(loaded, wall_of(loaded))
    graph = build(loaded, wall)

    count = range(len(loaded.config.views))
    views: dict[str, View] = {}
    for k in count:
        view = resolve_view(loaded, wall.of_view(k), (0.0, 0.0, 0.0), 6.0, view=k, leaders=views)
        views[view.id] = view

    assert graph.compositors + graph.renderers == RANKS[shipped_name(path)]
    wall = graph.with_panels_of_layers(wall)
    pixels = sum(math.prod(wall.traced[layer.traced].pixels) for layer in graph.layers)
    images = {(step.rect.x, step.rect.y) for step in graph.steps if isinstance(step.node, DeepZoom)}
    traced = {v.index for v in wall.viewports if v.view != NO_VIEW and v.screen not in images}
    assert {layer.panel for layer in graph.layers} == traced
    assert sum(region.rect.area for regions in graph.regions(wall) for region in regions) == pixels
    assert all(view.camera_at(1.5) == view.camera_at(1.5) for view in views.values())


@pytest.mark.parametrize("path", SHIPPED, ids=shipped_name)
def test_shipped_configuration_names_its_schema_and_says_what_it_shows(path: Path) -> None:
    first, second, third = path.read_text().splitlines()[:3]

    up = "../" * (len(path.relative_to(CONFIGS).parts) - 1)
    assert first == f"# yaml-language-server: $schema={up}{json_schema.FILE_NAME}"
    assert second == "#"
    assert third.startswith("# ")
    assert len(third) > 40


def test_shipped_schema_is_the_one_the_models_give() -> None:
    assert (CONFIGS / json_schema.FILE_NAME).read_text() == json_schema.schema_text()


def test_every_field_of_the_schema_is_described() -> None:
    definitions = json_schema.schema()["$defs"]
    silent = [
        f"{name}.{key}"
        for name, definition in definitions.items()
        for key, part in definition["properties"].items()
        if not part.get("description")
    ]

    assert silent == []
