"""`wall expand`: the wall is spelled out, and nothing else of the file changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from wall import cli
from wall.commands import terminal
from wall.config.loading import load, loads
from wall.config.rewriting import with_wall
from wall.core.errors import ConfigError
from wall.geometry.expanding import expand, expanded_config, wall_of
from wall.geometry.panels import Wall

CONFIGS = Path(__file__).parents[3] / "configs"
SHIPPED = sorted(CONFIGS.rglob("*.yaml"))
ROUNDING = 1e-10  # of what a pixel spans; corners are written with 14 digits
SHORT = """\
# what it is
version: 1
wall:
  # a grid of television sets
  grid: {columns: 3, rows: 2, pixels: [40, 30], size: [0.4, 0.3], bezel: 0.013, stereo: side_by_side, rotation: 0}

# the scene
scene: {source: courtyard}
views: [{id: main}]  # one
"""


def same_rays(one: Wall, other: Wall) -> None:
    """Each pixel of both walls is at the same place, to rounding of a pixel."""
    assert (one.width, one.height) == (other.width, other.height)
    for a, b in zip(one.panels, other.panels, strict=True):
        assert (a.id, a.screen, a.pixels, a.shift) == (b.id, b.screen, b.pixels, b.shift)
        np.testing.assert_allclose(b.corners, a.corners, rtol=0, atol=ROUNDING * min(a.pitch))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_configuration_spelled_out_has_the_same_rays(path: Path) -> None:
    loaded = load(path)

    text = with_wall(loaded, expanded_config(loaded.config.wall))

    again = loads(text)
    assert again.config.wall.grid is None
    assert again.config.views == loaded.config.views
    assert again.config.graph == loaded.config.graph
    same_rays(wall_of(again), wall_of(loaded))
    assert text.splitlines()[:5] == path.read_text().splitlines()[:5]


def test_comments_beside_the_wall_stay(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(SHORT)
    loaded = load(tmp_path / "a.yaml")

    text = with_wall(loaded, expanded_config(loaded.config.wall))

    assert text.startswith("# what it is\nversion: 1\nwall:\n  panels:\n")
    assert text.endswith("\n\n# the scene\nscene: {source: courtyard}\nviews: [{id: main}]  # one\n")
    same_rays(expand(loads(text).config.wall), expand(loaded.config.wall))


def test_file_in_one_line_is_written_anew(tmp_path: Path) -> None:
    grid = "{columns: 2, rows: 1, pixels: [4, 3], size: [0.4, 0.3]}"
    (tmp_path / "a.yaml").write_text(f"{{version: 1, wall: {{grid: {grid}}}, scene: {{source: x}}, views: [{{}}]}}")
    loaded = load(tmp_path / "a.yaml")

    again = loads(with_wall(loaded, expanded_config(loaded.config.wall))).config

    assert again == loaded.config.model_copy(update={"wall": expanded_config(loaded.config.wall)})


def test_file_that_changed_meanwhile_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(SHORT)
    loaded = load(tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text(SHORT.replace("courtyard", "forest"))

    with pytest.raises(ConfigError, match="has changed since it was loaded"):
        with_wall(loaded, loaded.config.wall)


def test_command_writes_what_loads_and_says_where_it_cannot(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(SHORT)
    written = tmp_path / "b.yaml"

    done = CliRunner().invoke(cli.app, ["expand", str(tmp_path / "a.yaml"), "-o", str(written)])
    failed = CliRunner().invoke(cli.app, ["expand", str(tmp_path / "a.yaml"), "-o", str(tmp_path / "no" / "b.yaml")])

    assert done.exit_code == 0
    assert [panel.id for panel in expand(load(written).config.wall).panels][:3] == [
        "r0c0.left",
        "r0c0.right",
        "r0c1.left",
    ]
    assert failed.exit_code == terminal.FAILED
