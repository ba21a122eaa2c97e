"""A browser as the display of one panel: its image alone, with the panel's own gain, gamma and table."""

from __future__ import annotations

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


@pytest.mark.parametrize("lut", [None, "panel.cube"])
def test_the_page_of_one_panel_shows_it_as_its_display_needs_it(chromium, tmp_path, lut):
    written_table(tmp_path / "panel.cube")
    colour = ColourConfig(**COLOUR, lut=lut)
    wall = expand(WallConfig(panels=[panel("a", 0.0, None), panel("b", 0.13, colour, rotation=180)]))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    rgb = np.stack([2 * x, 3 * y, 255 - x - y], -1).astype(np.uint8)
    images = [
        updated(PanelImage(id=p.id, rgb=np.zeros_like(rgb), screen=p.screen, version=0), rgb, 1) for p in wall.panels
    ]
    light = srgb_decoded(rgb.astype(np.float32) / 255)
    shown = srgb_encoded(np.float32(COLOUR["gain"]) * light ** np.float32(COLOUR["gamma"]))
    expected = 255 * (np.clip(read_lut(tmp_path / lut)(shown), 0, 1) if lut else shown)
    with closing(Browser("127.0.0.1", 0, wall, folder=tmp_path)) as browser:
        page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(browser.address + "#b")
        shows = {"width": wall.width, "height": wall.height, "panels": tuple(images)}
        browser.show(WallImage(**shows, time=0.0, camera_event=0, scene_event=0), STATUS)
        page.wait_for_selector(".own canvas + canvas")

        def off():
            shown = np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB"), np.float64)
            return np.abs(shown[::-1, ::-1] - expected).max()  # the display is mounted upside down

        eventually(page, lambda: off() <= MOST_OFF, "every pixel, with the panel's own colours, once its tiles rest")
        page.close()
