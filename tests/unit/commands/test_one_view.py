"""`--view` of offline commands: one view by itself, as large as its place on the wall."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from wall import cli
from wall.commands.frames import Quality, rendered_frames
from wall.commands.offline import OfflineRenderer, event_at
from wall.commands.one_view import plan_of_view, plans_of_views
from wall.commands.render import render
from wall.commands.screenshot import Shot, screenshot
from wall.config.loading import load, loads
from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.core.tone_mapping import Tone
from wall.display.image_file import display_values
from wall.roles.plan import Plan, make_layout, make_plan
from wall.tracing.tracer_scene import make_tracer_scene

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


def test_wall_render_has_all_views_as_a_screenshot_has(tmp_path: Path, compiled_only: None) -> None:
    config, files = tmp_path / "wall.yaml", [tmp_path / "rendered.png", tmp_path / "shot.png"]
    config.write_text(text_of(TWO), encoding="utf-8")
    done = CliRunner().invoke(cli.app, ["render", str(config), "--spp", "2", "--seed", "3", "-o", str(files[0])])
    assert done.exit_code == 0, done.output
    screenshot(load(config), files[1], Shot(spp=2, seed=3), lambda done, total: None)
    image, shot = (np.asarray(Image.open(file)) for file in files)
    np.testing.assert_array_equal(image, shot)
    size = ["--size", "60x60"]
    refused = CliRunner().invoke(cli.app, ["render", str(config), *size, "--spp", "1", "-o", str(files[0])])
    assert "these panels show several views" in str(refused.exception)


def test_frames_have_all_views_and_what_stands_still_is_rendered_once(
    monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    """Of two views one follows a path; the other, whose time stands still, has the same bits and was made once."""
    path = ", path: {type: orbit, period_s: 5}}\n  - {id: corner, time: {paused: true}"
    plan, made = plan_for(text_of(TWO.replace("}\n  - {id: corner", path))), Counter[str]()
    bands = OfflineRenderer.bands

    def counted(renderer: OfflineRenderer, *more: Any, **options: Any) -> Any:
        made[renderer._plan.layout.config.views[0].id] += 1
        return bands(renderer, *more, **options)

    monkeypatch.setattr(OfflineRenderer, "bands", counted)
    moments = [[event_at(own, at) for own in plans_of_views(plan)] for at in (0.0, 1.0)]
    found = rendered_frames(plan, make_tracer_scene(plan.scene), moments, Quality(spp=2, seed=3))
    (first, display), (second, _) = found
    assert made == {"main": 2, "corner": 1}
    np.testing.assert_array_equal(first, rendered(plan))
    np.testing.assert_array_equal(first[3:15, 21:63], second[3:15, 21:63])
    assert (first[15:] != second[15:]).mean() > 0.2
    codes = display(first)
    np.testing.assert_array_equal(codes[15:], display_values(first[15:]))
    np.testing.assert_array_equal(codes[3:15, 21:63], display_values(first[3:15, 21:63], tone=Tone(1.0)))


def test_a_view_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match=r"--view cornr: wall.yaml has no such view; accepted: main, corner"):
        plan_of_view(plan_for(text_of(TWO)), "cornr")
