"""`wall screenshot`: the pixels of `wall render`, in files of any size, without holding them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray
from PIL import Image

from wall.commands import offline
from wall.commands.render import render
from wall.commands.screenshot import Shot, Written, screenshot
from wall.config.loading import load
from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.display.image_file import display_values
from wall.display.png import BEZEL_RGB
from wall.display.strip_file import STRIP_ROWS
from wall.roles.plan import make_layout, make_plan

FLAT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 2, pixels: [40, 36], size: [0.40, 0.36], bezel: 0.02}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
"""
CORNER = """\
version: 1
scene: {source: courtyard}
wall:
  panels:
    - id: left
      pixels: [30, 75]
      corners: {lower_left: [-0.8, -0.6, 0.3], lower_right: [-0.5, -0.6, 0], upper_left: [-0.8, 0.15, 0.3]}
    - id: front
      pixels: [100, 75]
      corners: {lower_left: [-0.5, -0.6, 0], lower_right: [0.5, -0.6, 0], upper_left: [-0.5, 0.15, 0]}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, eye: [0, 0, 1.2]}]
"""


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    path = tmp_path / "flat.yaml"
    path.write_text(FLAT)
    return path


@pytest.fixture
def corner(tmp_path: Path) -> Path:
    path = tmp_path / "corner.yaml"
    path.write_text(CORNER)
    return path


def quiet(done: int, total: int) -> None:
    assert 0 <= done <= total


def shoot(config: Path, name: str, **changes: Any) -> list[Written]:
    return screenshot(load(config), config.parent / name, Shot(**{"spp": 2, "seed": 3, "at": 0.5} | changes), quiet)


def rendered(config: Path, size: tuple[int, int] | None = None) -> Float32:
    image = render(make_plan(make_layout(load(config))), spp=2, seed=3, size=size, at=0.5, progress=quiet)
    assert image is not None
    return image


def read(path: Path) -> NDArray[Any]:
    if path.suffix == ".exr":
        return np.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels)
    return np.asarray(Image.open(path))


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".exr"])
def test_a_screenshot_has_the_pixels_of_wall_render(flat: Path, suffix: str, compiled_only: None) -> None:
    [one] = shoot(flat, f"wall{suffix}", size=(130, 2 * STRIP_ROWS + 9))
    image = rendered(flat, (130, 2 * STRIP_ROWS + 9))
    assert (one.width, one.height) == (130, 2 * STRIP_ROWS + 9)
    np.testing.assert_array_equal(read(one.path), image if suffix == ".exr" else display_values(image))
    assert image.std() > 0.01


def test_panels_at_angles_have_their_positions_in_the_virtual_screen(corner: Path, compiled_only: None) -> None:
    [one] = shoot(corner, "wall.exr")
    np.testing.assert_array_equal(read(one.path), rendered(corner))


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_coarse_panel_seen_from_an_eye_of_its_own_fills_its_place(
    tmp_path: Path, scale: float, compiled_only: None
) -> None:
    """As densely as the finest: the same image as of a panel that has those pixels itself."""
    corners = "corners: {lower_left: [-0.4, 0, 0], lower_right: [0, 0, 0], upper_left: [-0.4, 0.3, 0]}"
    fine = "corners: {lower_left: [0, 0, 0], lower_right: [0.4, 0, 0], upper_left: [0, 0.3, 0]}, eye: [0.2, 0.1, 1]"
    head, last = FLAT.partition("wall:")[0], FLAT.splitlines()[-1]
    images = []
    for pixels in ("[20, 15]", "[80, 60]"):
        config = tmp_path / f"{pixels[1:3]}.yaml"
        wall = f"wall: {{panels: [{{id: a, pixels: {pixels}, {corners}}}, {{id: b, pixels: [80, 60], {fine}}}]}}"
        config.write_text(f"{head}{wall}\n{last}\n")
        images.append(read(shoot(config, f"{pixels[1:3]}.exr", scale=scale)[0].path))
    np.testing.assert_array_equal(*images)
    assert images[0][:, : round(80 * scale)].std() > 0.01


FACES = """\
version: 1
scene: {source: courtyard}
wall:
  panels:
    - {id: left, pixels: [30, 60], corners: {lower_left: [-0.8, -0.6, 0.3], lower_right: [-0.5, -0.6, 0], upper_left: [-0.8, 0, 0.3]}}
    - {id: front, pixels: [40, 60], corners: {lower_left: [-0.5, -0.6, 0], lower_right: [-0.1, -0.6, 0], upper_left: [-0.5, 0, 0]}}
    - {id: right, pixels: [40, 60], corners: {lower_left: [0, -0.6, 0], lower_right: [0.4, -0.6, 0], upper_left: [0, 0, 0]}}
views:
  - {id: one, panels: [left], eye: [0, 0, 1.2]}
  - {id: two, panels: [front, right], eye: [0, 0, 1.2]}
"""  # noqa: E501


def test_bezels_of_several_views_are_where_their_panels_end(tmp_path: Path, compiled_only: None) -> None:
    config = tmp_path / "faces.yaml"
    config.write_text(FACES)
    [one] = shoot(config, "wall.png", bezels=True)
    dark = (read(one.path) == BEZEL_RGB).all(axis=(0, 2))
    assert np.flatnonzero(dark).tolist() == list(range(70, 80))  # between front and right, which have one plane


def test_a_view_on_a_coarse_panel_fills_its_place(tmp_path: Path, compiled_only: None) -> None:
    """The bezels are where they are drawn as finely: its area, not one four times as wide."""
    config = tmp_path / "faces.yaml"
    images = []
    for pixels in ("[40, 60]", "[10, 15]"):
        text = FACES.replace("id: front, pixels: [40, 60]", f"id: front, pixels: {pixels}")
        config.write_text(text.replace("[front, right]", "[front]").replace("panels: [left]", "panels: [left, right]"))
        images.append(read(shoot(config, "wall.exr")[0].path)[:, 30:70])
    np.testing.assert_allclose(*images, atol=1e-5)


def test_scale_gives_the_same_view_in_more_pixels(corner: Path, compiled_only: None) -> None:
    """Each pixel's area is four of the larger image's; their means differ by the noise of edges, not by a shift."""
    small, large = (read(shoot(corner, f"{s}.exr", scale=s, spp=16)[0].path) for s in (1.0, 2.0))
    assert large.shape == (2 * small.shape[0], 2 * small.shape[1], 3)
    halved = large.reshape(small.shape[0], 2, small.shape[1], 2, 3).mean(axis=(1, 3))
    assert np.abs(halved - small).mean() < 0.02
    shifted = np.abs(halved[:, 1:] - small[:, :-1]).mean()
    assert np.abs(halved - small).mean() < shifted / 3


def test_tiles_change_nothing_before_the_first_cut_and_go_on_after_it(
    flat: Path, monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    [one] = shoot(flat, "whole.exr", size=(96, 80), spp=64)
    monkeypatch.setattr(offline, "LARGEST_TILE_PIXELS", 32)
    [cut] = shoot(flat, "cut.exr", size=(96, 80), spp=64)
    whole, parts = read(one.path), read(cut.path)
    np.testing.assert_array_equal(parts[:32, :32], whole[:32, :32])
    others = np.abs(parts - whole)[32:, 32:]
    assert 0 < others.mean() < 0.005  # other samples of the same light
    assert len(offline.tiles_of(offline.panels_of(make_layout(load(flat)), (96, 80)), seed=3)) == 9
    whole = render(make_plan(make_layout(load(flat))), spp=64, seed=3, size=(96, 80), at=0.5, progress=quiet)
    np.testing.assert_array_equal(parts, whole)


def test_each_panel_can_have_a_file_of_its_own(corner: Path, compiled_only: None) -> None:
    written = shoot(corner, "shot.exr", panels=True)
    assert [(w.path.name, w.width, w.height) for w in written] == [
        ("shot-left.exr", 30, 75),
        ("shot-front.exr", 100, 75),
    ]
    image = rendered(corner)
    for one, x in zip(written, (0, 30), strict=True):
        # The panel alone has the same rays but for the rounding of its corner's place.
        np.testing.assert_allclose(read(one.path).mean(), image[:, x : x + one.width].mean(), rtol=1e-3)


def test_panels_at_angles_are_all_rendered_at_a_size_of_their_shape(corner: Path, compiled_only: None) -> None:
    whole = display_values(rendered(corner)).astype(float).mean()
    for size in ((65, 38), (91, 52), (127, 73)):
        [one] = shoot(corner, f"{size[0]}.png", size=size)
        image = read(one.path).astype(float)
        assert (one.width, one.height) == size
        assert image.mean() == pytest.approx(whole, rel=0.05)
        assert image.min(axis=(1, 2)).max() > 0
        assert image.mean(axis=(0, 2)).min() > 0.3 * whole, "no column between two panels is left out"


def test_bezels_are_dark_where_they_are_asked_for(flat: Path, compiled_only: None) -> None:
    [one] = shoot(flat, "wall.png", bezels=True)
    plain = display_values(rendered(flat))
    lit = np.zeros(plain.shape[:2], bool)
    for panel in make_layout(load(flat)).wall.panels:
        (x, y), (w, h) = panel.screen, panel.pixels
        lit[y : y + h, x : x + w] = True
    image = read(one.path)
    np.testing.assert_array_equal(image[lit], plain[lit])
    assert (image[~lit] == BEZEL_RGB).all()
    assert (~lit).any()


@pytest.mark.parametrize(
    ("name", "changes", "why"),
    [
        ("wall.jpg", {}, "cannot write '.jpg'"),
        ("none/wall.png", {}, "there is no folder"),
        ("wall.png", {"size": (40, 30)}, "stand at angles, .* 130x75; wanted: .* such as 40x23"),
        ("wall.png", {"size": (40, 30), "panels": True}, "wanted --scale"),
    ],
)
def test_invalid_options_are_refused_before_anything_is_rendered(
    corner: Path, name: str, changes: dict[str, Any], why: str
) -> None:
    with pytest.raises(ConfigError, match=why):
        shoot(corner, name, **changes)


def test_an_image_wider_than_any_tile_is_rendered_whole(flat: Path, compiled_only: None) -> None:
    shoot(flat, "large.png", size=(12000, 100), spp=1)
    image = read(flat.with_name("large.png")).astype(float)
    assert image.shape == (100, 12000, 3)
    assert image.std() > 10
    beside = np.abs(np.diff(image, axis=1)).mean(axis=(0, 2))
    assert beside[8191] < 3 * np.median(beside) + 3  # nothing marks where tiles meet
