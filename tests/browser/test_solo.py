"""A browser as the display of one panel: its image alone, with the panel's own gain, gamma and table."""

from __future__ import annotations

import os
from contextlib import closing
from io import BytesIO

import numpy as np
import pytest
from page_input import eventually
from PIL import Image

from wall.config.displays import ColourConfig
from wall.config.screens import CornersConfig, PanelConfig, WallConfig
from wall.core.colour import srgb_decoded, srgb_encoded
from wall.display.base import PanelImage, Status, WallImage
from wall.display.browser import Browser
from wall.display.page_files import table_of
from wall.display.tiles import updated
from wall.geometry.expanding import expand
from wall.operators.lut import read_lut

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 120, 70
COLOUR = {"gain": (0.8, 0.9, 1.1), "gamma": 1.2}
MOST_OFF = 0.6  # 8-bit codes: rounding, and that the page works with floats of its own
STATUS = Status(
    seconds=1.0, paused=False, sampler="framed", samplers=("framed",), ranks=(), latency_ms=(0.0, 0.0, 0.0),
    latencies_ms=(), refreshes_per_s=30.0, view_samplers=("framed",),
)  # fmt: skip


def panel(name, left, colour, rotation=0):
    size = (0.12, 0.07)
    corners = CornersConfig(
        lower_left=(left, 0.0, 0.0), lower_right=(left + size[0], 0.0, 0.0), upper_left=(left, size[1], 0.0)
    )
    return PanelConfig(id=name, pixels=(WIDTH, HEIGHT), corners=corners, colour=colour, rotation=rotation)


def written_table(path, nodes=5):
    """A table that is no linear function, and mixes channels."""
    blue, green, red = np.mgrid[:nodes, :nodes, :nodes] / (nodes - 1)
    table = np.stack([red**1.4, 0.8 * green + 0.2 * red * blue, np.sqrt(blue)], -1).reshape(-1, 3)
    path.write_text(f"LUT_3D_SIZE {nodes}\n" + "\n".join(" ".join(f"{x:.6f}" for x in row) for row in table))


# by rotation: from a screenshot of the display, as it is mounted turned clockwise, to what is seen of it
SEEN = {
    90: lambda shown: np.rot90(shown, -1),
    180: lambda shown: np.rot90(shown, 2),
    270: np.rot90,
}


@pytest.mark.parametrize(("lut", "rotation"), [(None, 90), ("panel.cube", 180), (None, 270)])
def test_the_page_of_one_panel_shows_it_as_its_display_needs_it(chromium, tmp_path, lut, rotation):
    written_table(tmp_path / "panel.cube")
    colour = ColourConfig(**COLOUR, lut=lut)
    wall = expand(WallConfig(panels=[panel("a", 0.0, None), panel("b", 0.13, colour, rotation)]))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    rgb = np.stack([2 * x, 3 * y, 255 - x - y], -1).astype(np.uint8)
    images = [
        updated(PanelImage(id=p.id, rgb=np.zeros_like(rgb), screen=p.screen, version=0), rgb, 1) for p in wall.panels
    ]
    light = srgb_decoded(rgb.astype(np.float32) / 255)
    shown = srgb_encoded(np.float32(COLOUR["gain"]) * light ** np.float32(COLOUR["gamma"]))
    expected = 255 * (np.clip(read_lut(tmp_path / lut)(shown), 0, 1) if lut else shown)
    with closing(Browser("127.0.0.1", 0, wall)) as browser:
        browser.lay_out(wall, ["main"], (), folder=tmp_path)
        size = (WIDTH, HEIGHT) if rotation == 180 else (HEIGHT, WIDTH)
        page = chromium.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
        page.goto(browser.address + "#b")
        shows = {"width": wall.width, "height": wall.height, "panels": tuple(images)}
        browser.show(WallImage(**shows, time=0.0, camera_event=0, scene_event=0), STATUS)
        page.wait_for_selector(".own canvas + canvas")

        def off():
            shown = np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB"), np.float64)
            return np.abs(SEEN[rotation](shown) - expected).max()

        eventually(page, lambda: off() <= MOST_OFF, "every pixel, with the panel's own colours, once its tiles rest")
        page.close()


def test_a_page_says_that_its_table_is_missing_until_a_layout_comes_that_has_one(chromium, tmp_path):
    wall = expand(WallConfig(panels=[panel("a", 0.0, ColourConfig(**COLOUR, lut="panel.cube"))]))
    written_table(tmp_path / "panel.cube")
    with closing(Browser("127.0.0.1", 0, wall)) as browser:
        browser.lay_out(wall, ["main"], (), folder=tmp_path / "nowhere")
        page = chromium.new_page(viewport={"width": 400, "height": 200})
        page.goto(browser.address + "#a")
        page.wait_for_selector(".uncorrected")
        said = page.evaluate("() => document.elementFromPoint(200, 30).innerText")  # nothing lies over it
        assert said == "The colours are not those of this display: the table cannot be read."
        browser.lay_out(wall, ["main", "map"], (), folder=tmp_path)
        page.wait_for_selector(".own canvas + canvas")
        assert page.locator(".uncorrected").count() == 0
        page.close()


def test_a_table_s_file_is_read_once_until_it_changes(tmp_path):
    wall = expand(WallConfig(panels=[panel("a", 0.0, ColourConfig(**COLOUR, lut="panel.cube"))]))
    file = tmp_path / "panel.cube"
    written_table(file)
    before = table_of("a", wall, tmp_path)
    assert table_of("a", wall, tmp_path) is before
    written_table(file, nodes=4)
    os.utime(file, (1.0, 1.0))
    assert table_of("a", wall, tmp_path) != before


def test_a_panel_that_is_not_there_is_named_with_those_that_are(page):
    page.goto(page.url.partition("#")[0] + "#nix")
    page.locator(".banner.uncorrected").wait_for()
    panels = page.evaluate("[...new Set([...document.querySelectorAll('[data-panel]')].map((e) => e.dataset.panel))]")
    said = f"There is no panel nix, so this is the whole wall: {', '.join(panels)}."
    assert page.locator(".banner.uncorrected").inner_text() == said
