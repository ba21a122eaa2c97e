"""A wall with a very large image beside 3D: its place is a parameter, and the last image waits for its tiles."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from PIL import Image

from wall.commands.tiles import cut_up
from wall.config.loading import load
from wall.core.data import Edits
from wall.core.errors import ConfigError, EditError
from wall.roles.editing import Editor, editable
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.scene.parameters import named
from wall.tracing.tracer_scene import make_tracer_scene

CONFIG = """\
version: 1
scene: {source: spheres, animation: [ANIMATION]}
wall: {grid: {columns: 2, rows: 1, pixels: [48, 32], size: [0.48, 0.32]}}
views: [{id: main, panels: [r0c0]}, {id: image, panels: [r0c1]}]
graph:
  nodes:
    - {id: samples, op: samples, panel: r0c0}
    - {id: shown, op: reconstruct, input: samples}
    - {id: photo, op: deep_zoom, panel: r0c1, file: photo.dzi, zoom: ZOOM}
    - {id: wall, op: tile, inputs: [shown, photo]}
    - {id: files, op: sink, kind: png, input: wall}
"""
TRACK = "{type: parameter, name: nodes.photo.zoom, keyframes: [{time: 0, value: 3}, {time: 9, value: 3}]}"


def finished(single: SingleProcess, number: int, **values: float) -> NDArray[np.uint8]:
    """The final image of the panel that shows the photo, under some edits of it."""
    edits = Edits(number, tuple((f"nodes.photo.{key}", (value,)) for key, value in sorted(values.items())))
    single.event = replace(single.event, scene_event=number, edits=edits)
    single.until_complete()
    limit = time.monotonic() + 20.0
    while single.composition.behind(0):
        assert time.monotonic() < limit
        time.sleep(0.001)
        single.clock.advance(0.1)
        single._turn()
    return list(single.composition.shown()[0].images())[1].rgb


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("deep_zoom")
    codes = np.random.default_rng(2).integers(0, 256, (640, 960, 3), np.uint8)
    Image.fromarray(codes).save(made / "photo.png")
    cut_up(made / "photo.png", made / "photo.dzi", "jpg", lambda done, total: None)
    return made


def planned(folder: Path, *, zoom: float = 0.0, animation: str = "") -> Plan:
    path = folder / "wall.yaml"
    path.write_text(CONFIG.replace("ZOOM", f"{zoom:g}").replace("ANIMATION", animation))
    return make_plan(make_layout(load(path)))


def test_an_edit_or_keyframes_show_what_a_configuration_shows_with_every_tile_of_it(folder: Path) -> None:
    plan = planned(folder)
    running = SingleProcess(plan, make_tracer_scene(plan.scene))
    other = planned(folder, zoom=3.0)
    configured = SingleProcess(other, make_tracer_scene(other.scene))
    moved = planned(folder, animation=TRACK)
    animated = SingleProcess(moved, make_tracer_scene(moved.scene))
    before, edited, wanted = finished(running, 0), finished(running, 1, zoom=3.0), finished(configured, 0)
    assert (edited != before).any()
    assert_array_equal(edited, wanted)
    assert_array_equal(finished(animated, 0), wanted)
    assert wanted.std() > 10.0


def test_its_place_is_a_parameter_with_a_range(folder: Path) -> None:
    parameters = editable(planned(folder, zoom=2.0))
    zoom = named(parameters, "nodes.photo.zoom")
    assert (zoom.default, zoom.unit) == ((2.0,), "doublings")
    assert {"nodes.photo.x", "nodes.photo.y"} <= parameters.keys()
    with pytest.raises(EditError, match=r"nodes\.photo\.zoom = 99: want a number from -8 to 26 doublings"):
        zoom.checked(99)


def test_a_file_that_is_not_there_is_refused_at_the_start(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    with pytest.raises(ConfigError, match=r"photo\.dzi: there is no such file"):
        SingleProcess(plan, make_tracer_scene(plan.scene))


def test_one_gesture_is_undone_at_once(folder: Path) -> None:
    """A wheel changes zoom, x and y many times a second."""
    editor = Editor(planned(folder), key="")
    for k in range(10):
        for name in ("zoom", "x", "y"):
            editor.set([(f"nodes.photo.{name}", [0.1 * k])], now=1.0 + 0.05 * k)
    editor.set([("exposure", [1.0])], now=1.6)
    editor.undo()
    assert dict(editor.edits.values).keys() == {"nodes.photo.zoom", "nodes.photo.x", "nodes.photo.y"}
    editor.undo()
    assert editor.edits.values == ()


def test_in_lock_step_there_is_none(folder: Path) -> None:
    text = (
        CONFIG.replace("ANIMATION", "").replace("columns: 2", "columns: 1").replace(", {id: image, panels: [r0c1]}", "")
    )
    text = text.replace("input: samples}", "input: samples, background: transparent, order: 1}")
    text = text.replace("panel: r0c1, file: photo.dzi, zoom: ZOOM", "area: [0, 0, 9, 9], order: 0, file: photo.dzi")
    text = text.replace("op: tile, inputs: [shown, photo]", "op: over, inputs: [photo, shown]")
    path = folder / "lock.yaml"
    path.write_text(text)
    make_layout(load(path))
    path.write_text(text.replace("graph:\n", "graph:\n  sync: {mode: frame}\n") + "sampling: {method: framed}\n")
    with pytest.raises(ConfigError, match="is read while the wall runs"):
        make_layout(load(path))
