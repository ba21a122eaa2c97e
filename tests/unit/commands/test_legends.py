"""Legends over rendered images: those of the graph, at their places, whatever the image's size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner

from wall import cli
from wall.commands.film import replay_film
from wall.commands.frames import Quality
from wall.commands.legends import legends_of, wanted_legends
from wall.config.loading import load, loads
from wall.core.errors import ConfigError
from wall.display.film import read_film
from wall.display.image_file import write_image
from wall.roles.plan import make_layout
from wall.run import launch

PLAIN = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [160, 120], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
"""
TEXT = PLAIN + """\
graph:
  nodes:
    - {id: traced, op: samples, panel: r0c0}
    - {id: drawn, op: reconstruct, input: traced}
    - {id: told, op: legend, input: drawn, color_map: {range: [0, 9]}, area: [8, 16, 40, 80], size: 8}
    - {id: file, op: sink, kind: png, input: told}
"""
LIGHT = 0.5


def drawn(size: tuple[int, int] | None, shape: tuple[int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which pixels of a plain image legends change."""
    image = np.full((*shape, 3), LIGHT, np.float32)
    wanted_legends(make_layout(loads(TEXT)), size).draw(image)
    return np.asarray((image != LIGHT).any(axis=2))


def test_a_legend_covers_its_area_scaled_with_the_image_and_in_its_middle() -> None:
    for size, shape, (left, top, right, bottom) in (
        (None, (120, 160), (8, 16, 48, 96)),
        ((320, 240), (240, 320), (16, 32, 96, 192)),
        ((240, 120), (120, 240), (48, 16, 88, 96)),  # wider than the wall: 40 more on either side
    ):
        covered = drawn(size, shape)
        assert covered[top:bottom, left:right].mean() > 0.99
        assert not np.delete(np.delete(covered, np.s_[top:bottom], 0), np.s_[left:right], 1).any()
        assert covered.sum() <= (bottom - top) * (right - left)


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(ConfigError, match="has no legend; wanted: a graph with a node of op: legend"):
        wanted_legends(make_layout(loads(PLAIN)), None)
    why = "text of legend told would be 4 pixels high in 80x60, less than 6"
    with pytest.raises(ConfigError, match=f"^--legend: {why}; wanted: a larger --size"):
        wanted_legends(make_layout(loads(TEXT)), (80, 60))
    left, small = legends_of(make_layout(loads(TEXT)), (80, 60))
    assert left.drawn == ()
    assert small == [why]


def test_render_draws_it_over_display_values_and_leaves_light_as_it_was(tmp_path: Path, compiled_only: None) -> None:
    config, plain, with_legend = tmp_path / "wall.yaml", tmp_path / "plain.png", tmp_path / "legend.png"
    config.write_text(TEXT)
    for name, options in ((plain, []), (with_legend, ["--legend"])):
        done = CliRunner().invoke(cli.app, ["render", str(config), "--spp", "1", "-o", str(name), *options])
        assert done.exit_code == 0, done.output
    changed = (np.array(Image.open(plain)) != np.array(Image.open(with_legend))).any(axis=2)
    assert changed[16:96, 8:48].mean() > 0.9
    assert changed.sum() <= 80 * 40

    light = np.full((120, 160, 3), LIGHT, np.float32)
    write_image(tmp_path / "light.npy", light, over=wanted_legends(make_layout(loads(TEXT)), None).draw)
    assert (np.load(tmp_path / "light.npy") != LIGHT).any()
    assert (light == LIGHT).all()


def test_the_film_of_a_run_has_the_legends_that_its_wall_showed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], compiled_only: None
) -> None:
    """But not that of one view, which is not where it is on the wall. One frame: 160 x 120 pixels, through H.264."""
    config, events, seen = tmp_path / "wall.yaml", tmp_path / "run.events", list[NDArray[np.uint8]]()
    config.write_text(TEXT + "transport: {kind: loopback}\n")
    options = launch.Options(out=tmp_path / "out", headless=True, seconds=0.2, record=events)
    outcome = launch.run(load(config), options, say=print, opened=print)
    assert outcome is not None
    assert outcome.failed == ""
    for name, view in (("all.mp4", None), ("main.mp4", "main")):
        film = tmp_path / name
        assert replay_film(events, film, Quality(spp=1, seed=1), rate=0.1, view=view, total=print, done=print) == 1
        seen += read_film(film)
    small = Quality(spp=1, seed=1, size=(80, 60))
    replay_film(events, tmp_path / "small.mp4", small, rate=0.1, view=None, total=print, done=print)
    said = " ".join(capsys.readouterr().err.split())
    assert "legend told would be 4 pixels high in 80x60, less than 6, and is left out" in said
    changed = (np.abs(seen[0].astype(int) - seen[1]) > 40).any(axis=2)
    assert changed[16:96, 8:48].mean() > 0.7
    assert changed.sum() <= 84 * 44
