"""`wall identify`: the patterns on real windows, and in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import called, start, wall
from x_servers import comes_true, screenshot, x_server

from wall.commands.identify import about
from wall.config.loading import load
from wall.display.patterns import pattern
from wall.display.png import BEZEL_RGB
from wall.roles.plan import make_layout

CONFIG = """\
version: 1
scene: {source: courtyard}
wall:
  grid:
    columns: 2
    rows: 1
    pixels: [160, 120]
    size: [0.4, 0.3]
    bezel: 0.01
    host: HOST
    display: DISPLAY
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
graph: {preset: sort-first, ranks_per_panel: 3}
"""


def config(folder: Path, *, host: str = "localhost", display: str = "':0'") -> Path:
    path = folder / "wall.yaml"
    path.write_text(CONFIG.replace("HOST", host).replace("DISPLAY", display))
    return path


def test_a_pattern_is_on_the_windows_until_time_is_up(tmp_path: Path) -> None:
    with x_server("400x150") as display:
        path = config(tmp_path, display=f"'{display}'")
        layout = make_layout(load(path))
        wanted = np.zeros((150, 400, 3), np.uint8)
        for panel in layout.wall.panels:  # as on the wall, in the middle of the screen
            x, y = panel.screen[0] + (400 - layout.wall.width) // 2, (150 - layout.wall.height) // 2
            wanted[y : y + 120, x : x + 160] = pattern("grid", panel, layout.wall)
        shown = start("identify", path, "--pattern", "grid", "--seconds", "60")
        try:
            assert comes_true(lambda: np.array_equal(screenshot(display), wanted))
        finally:
            shown.terminate()
            shown.communicate()
        assert comes_true(lambda: not screenshot(display).any())  # the windows went with the command


def test_files_are_the_panels_and_the_wall_around_them(tmp_path: Path) -> None:
    path, out = config(tmp_path), tmp_path / "out"
    done = wall("identify", path, "-o", out)
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(file.name for file in out.iterdir()) == ["panel-r0c0.png", "panel-r0c1.png", "wall.png"]
    layout = make_layout(load(path))
    entire = np.asarray(Image.open(out / "wall.png"))
    assert entire.shape == (layout.wall.height, layout.wall.width, 3)
    assert (entire[:, 160 : layout.wall.panels[1].screen[0]] == BEZEL_RGB).all()
    for panel in layout.wall.panels:
        image = np.asarray(Image.open(out / f"panel-{panel.id}.png"))
        np.testing.assert_array_equal(image, pattern("identify", panel, layout.wall, about(layout, panel)))
        np.testing.assert_array_equal(image, entire[:, panel.screen[0] : panel.screen[0] + 160])


def test_the_text_on_a_pattern_comes_from_the_configuration(tmp_path: Path) -> None:
    layout = make_layout(load(config(tmp_path, host="node7")))
    assert about(layout, layout.wall.panels[1]) == [
        ("host", "node7"),
        ("rendered by", "ranks 4-6"),
        ("put together by", "rank 0"),
        ("display", ":0"),
    ]


def test_panels_of_other_machines_are_not_shown(tmp_path: Path) -> None:
    done = called("identify", config(tmp_path, host="node7"), "--seconds", "1")
    assert done.returncode == 2
    assert "no panel hangs on" in done.stderr
    assert "run this on node7, or give -o" in " ".join(done.stderr.split())


def test_an_unknown_pattern_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    done = called("identify", config(tmp_path), "--pattern", "rings")
    assert done.returncode == 2
    assert "accepted: identify, grid, seam, gamma" in done.stderr


@pytest.mark.parametrize("name", ["cave_corner", "demo"])
def test_shipped_walls_can_be_identified(tmp_path: Path, name: str) -> None:
    path = Path(__file__).parents[3] / "configs" / f"{name}.yaml"
    done = called("identify", path, "--pattern", "seam", "-o", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "wall.png").stat().st_size > 10_000
