"""A configuration is changed by paths: objects, views, panels; what is wrong is refused with a reason."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose

from wall.config.loading import loads
from wall.config.schema import Config
from wall.core.errors import EditError
from wall.geometry.expanding import expand
from wall.roles.config_edits import edited

TEXT = """\
version: 1
scene: {source: courtyard, lights: [{type: point, position: [0, 4, 0], intensity: [9, 9, 9]}]}
wall: {grid: {columns: 2, rows: 1, pixels: [48, 32], size: [0.4, 0.3]}}
views:
  - {id: main, camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}
  - {id: map, camera: {position: [0, 20, 0], target: [0, 0, 0]}, panels: [r0c1]}
graph: {preset: sort-first, sinks: [png]}
"""


@pytest.fixture
def config() -> Config:
    return loads(TEXT).config


def changed(config: Config, *changes: str) -> Config:
    return loads(edited(config, changes)).config


def test_without_a_change_it_is_the_same_configuration(config: Config) -> None:
    assert changed(config) == config


def test_another_kind_brings_its_own_defaults_and_keeps_what_was_written(config: Config) -> None:
    framed = changed(config, "sampling.method=framed").sampling
    assert (framed.method, framed.samples_per_batch) == ("framed", 4096)
    text = TEXT + "sampling: {method: adaptive, seed: 7, samples_per_batch: 1024}\n"
    hilbert = changed(loads(text).config, "sampling.method=hilbert").sampling
    assert (hilbert.method, hilbert.seed, hilbert.samples_per_batch) == ("hilbert", 7, 1024)
    together = changed(config, "sampling.samples_per_batch=1024", "sampling.method=framed").sampling
    assert (together.method, together.samples_per_batch) == ("framed", 1024)
    later = changed(changed(config, "views.main.refresh_hz=25"), "sampling.method=framed")
    assert later.sampling.method == "framed", "after another change all keys are in the text"
    own = changed(config, "views.main.sampling={method: adaptive}", "views.main.sampling.method=framed")
    assert own.views[0].sampling is not None
    assert own.views[0].sampling.method == "framed"


def test_models_come_and_go(config: Config) -> None:
    two = changed(config, "scene.source+=bunny.glb")
    assert two.scene.source == ("courtyard", "bunny.glb")
    assert changed(two, "scene.source -= bunny.glb").scene.source == ("courtyard",)
    assert changed(config, "scene.source=gallery").scene.source == "gallery"


def test_views_come_and_go_and_are_told_by_their_ids(config: Config) -> None:
    inset = "views+={id: inset, camera: {follow: main}, viewport: {left: 0.7, top: 0.7, width: 0.2, height: 0.2}}"
    three = changed(config, inset)
    assert [view.id for view in three.views] == ["main", "map", "inset"]
    assert [view.id for view in changed(three, "views-=map").views] == ["main", "inset"]
    assert changed(config, "views.map.refresh_hz=5", "views.0.weight=2").views[1].refresh_hz == 5
    usual = loads(TEXT.replace(", refresh_hz: 30", "")).config
    assert changed(config, "views[0].refresh_hz=null") == usual


def test_an_id_may_look_like_a_number(config: Config) -> None:
    three = changed(config, "views+={id: '7', camera: auto, viewport: {left: 0, top: 0, width: 0.2, height: 0.2}}")
    assert [view.id for view in changed(three, "views-=7").views] == ["main", "map"]


def test_lists_and_mappings_that_are_not_there_are_made(config: Config) -> None:
    lit = changed(config, "scene.cuts+={position: [0, 1, 0], normal: [0, 1, 0]}", "scene.integrator.method=path")
    assert len(lit.scene.cuts) == 1
    assert lit.scene.integrator.method == "path"


def test_a_panel_of_a_grid_is_calibrated_alone_and_the_others_stay(config: Config) -> None:
    moved = changed(config, "wall.panels.r0c1.rotation=180")
    panels, before = expand(moved.wall).panels, expand(config.wall).panels
    assert [panel.id for panel in panels] == ["r0c0", "r0c1"]
    assert [panel.config.rotation for panel in panels] == [0, 180]
    assert_allclose([panel.screen for panel in panels], [panel.screen for panel in before])
    with pytest.raises(EditError, match=r"wall\.grid\.columns=3: this wall has no grid: its panels are written one by"):
        edited(moved, ["wall.grid.columns=3"])
    grid = "wall.grid={columns: 3, rows: 1, pixels: [48, 32], size: [0.4, 0.3]}"
    assert len(expand(changed(moved, "wall.panels=null", grid, "views.map.panels=[r0c2]").wall).panels) == 3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("views", "is no change; wanted: PATH=VALUE"),
        ("=3", "is no change; wanted: PATH=VALUE"),
        ("views-=inset", "inset is not in it; there are: main, map"),
        ("views.inset.weight=2", "there is no inset; there are: main, map"),
        ("scene.ground.deep=1", "False is no list or mapping"),
        ("scene.fog-=1", "there is no fog; there are: source, "),
        ("scene.source=[a", "wanted: a value as in YAML"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(config: Config, change: str, reason: str) -> None:
    with pytest.raises(EditError) as refused:
        edited(config, ["exposure=1", change])
    assert str(refused.value).startswith(f"{change}: ")
    assert reason in str(refused.value)
