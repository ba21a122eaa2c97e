"""`--view` of offline commands: one view by itself, as large as its place on the wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wall.commands.one_view import plan_of_view
from wall.commands.render import render
from wall.commands.screenshot import Shot, screenshot
from wall.config.loading import loads
from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.core.tone_mapping import Tone
from wall.display.image_file import display_values
from wall.roles.plan import Plan, make_layout, make_plan

CAMERA = "camera: {position: [6, 4.5, 10], target: [0, 0.6, 0], fov: 40}"
PATH = "integrator: {method: path, depth: 2}"
TWO = f"""
  - {{id: main, camera: {{position: [0, 20, 0.1], target: [0, 0, 0], fov: 40}}}}
  - {{id: corner, viewport: {{left: 0.25, top: 0.1, width: 0.5, height: 0.4}}, {CAMERA}, {PATH}, exposure: 1}}
"""


def text_of(views: str, grid: str = "columns: 2, rows: 1, pixels: [40, 30], size: [0.4, 0.3], bezel: 0.02") -> str:
    return f"version: 1\nscene: {{source: courtyard}}\nwall: {{grid: {{{grid}}}}}\nviews:{views}"


def plan_for(text: str) -> Plan:
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


def rendered(plan: Plan) -> Float32:
    image = render(plan, spp=2, seed=3, at=0.0)
    assert image is not None
    return image


def test_an_inset_across_a_bezel_is_the_image_of_a_panel_in_its_place(compiled_only: None) -> None:
    """A viewport of half of 82 x 30 pixels is 41 x 12 of them, with all that the bezel hides. Positions are rounded
    otherwise there, so that a ray in some thousand meets another surface."""
    seen = plan_of_view(plan_for(text_of(TWO)), "corner")
    image = rendered(seen)
    one = text_of(f"\n  - {{{CAMERA}, {PATH}}}\n", "columns: 1, rows: 1, pixels: [42, 12], size: [0.42, 0.12]")
    wanted = rendered(plan_for(one))
    assert image.shape == wanted.shape == (12, 42, 3)
    alike = np.isclose(image, wanted, rtol=1e-2, atol=1e-4).all(axis=-1)
    assert alike.mean() > 0.98
    assert image.std() > 0.02


def test_a_screenshot_of_a_view_has_its_pixels_and_its_exposure(tmp_path: Path, compiled_only: None) -> None:
    loaded = loads(text_of(TWO), path=Path("wall.yaml"))
    shot = Shot(spp=2, seed=3, view="corner")
    (written,) = screenshot(loaded, tmp_path / "corner.png", shot, lambda done, total: None)
    assert (written.width, written.height) == (42, 12)
    wanted = display_values(rendered(plan_of_view(plan_for(text_of(TWO)), "corner")), tone=Tone(1.0))
    np.testing.assert_array_equal(np.asarray(Image.open(written.path)), wanted)


@pytest.mark.parametrize("panels", [False, True])
def test_a_screenshot_without_it_has_all_views_in_their_places(
    tmp_path: Path, panels: bool, compiled_only: None
) -> None:
    """Here an inset of 42 x 12 pixels across the bezel, at (21, 3), over another view; each with its own exposure."""
    loaded, seen = loads(text_of(TWO), path=Path("wall.yaml")), {}
    for name in ("main", "corner"):
        (one,) = screenshot(loaded, tmp_path / f"{name}.png", Shot(spp=2, seed=3, view=name), lambda done, total: None)
        seen[name] = np.asarray(Image.open(one.path))
    wanted = seen["main"].copy()
    wanted[3:15, 21:63] = seen["corner"]
    if panels:
        wanted = np.hstack([wanted[:, :40], wanted[:, 44:]])
    files = screenshot(loaded, tmp_path / "all.png", Shot(spp=2, seed=3, panels=panels), lambda done, total: None)
    found = np.hstack([np.asarray(Image.open(file.path)) for file in files])
    assert found.shape == wanted.shape
    if not panels:
        np.testing.assert_array_equal(found[15:], wanted[15:])
    assert np.abs(found.astype(int) - wanted).mean() < 8.0
    swapped = np.where(np.arange(wanted.shape[1])[:, None] < 20, wanted, wanted[::-1])
    assert np.abs(found.astype(int) - swapped).mean() > 16.0


def test_a_view_with_all_panels_is_what_it_is_without_the_option(compiled_only: None) -> None:
    plan = plan_for(text_of(TWO))
    np.testing.assert_array_equal(rendered(plan_of_view(plan, "main")), rendered(plan))


def test_a_view_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match=r"--view cornr: wall.yaml has no such view; accepted: main, corner"):
        plan_of_view(plan_for(text_of(TWO)), "cornr")
