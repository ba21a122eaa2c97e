"""Changed tiles in a real Chromium: the page shows every pixel of an image that rests, whatever came before."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest
from page_input import eventually

from wall.config.screens import GridConfig, WallConfig
from wall.display.base import PanelImage, Status, WallImage
from wall.display.browser import Browser
from wall.display.tiles import updated
from wall.geometry.expanding import expand

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 310, 170  # neither a multiple of tiles, nor of the blocks of a JPEG
PIXELS = """() => { const c = document.querySelector('.panel canvas');
  const context = new OffscreenCanvas(c.width, c.height).getContext('2d'); context.drawImage(c, 0, 0);
  return [...context.getImageData(0, 0, c.width, c.height).data]; }"""
STATUS = Status(
    seconds=1.0, paused=False, sampler="adaptive", samplers=("adaptive",), ranks=(), latency_ms=(0.0, 0.0, 0.0),
    latencies_ms=(), refreshes_per_s=30.0, view_samplers=("adaptive",),
)  # fmt: skip


def canvas(page):
    return np.array(page.evaluate(PIXELS), np.uint8).reshape(HEIGHT, WIDTH, 4)[..., :3]


def test_changes_here_and_there_end_in_exactly_the_image(chromium):
    wall = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(WIDTH, HEIGHT), size=(0.31, 0.17))))
    panel, rng = wall.panels[0], np.random.default_rng(1)
    image = PanelImage(id=panel.id, rgb=np.zeros((HEIGHT, WIDTH, 3), np.uint8), screen=(0, 0), version=0)
    rgb = rng.integers(0, 256, image.rgb.shape, np.uint8)
    with closing(Browser("127.0.0.1", 0, wall)) as browser:
        page = chromium.new_page()
        page.goto(browser.address)
        for version in range(1, 25):
            y, x = rng.integers(0, HEIGHT - 20), rng.integers(0, WIDTH - 20)
            rgb = rgb.copy()
            rgb[y : y + 20, x : x + 20] = rng.integers(0, 256, 3)
            image = updated(image, rgb, version)
            browser.show(
                WallImage(width=WIDTH, height=HEIGHT, panels=(image,), time=0.0, camera_event=0, scene_event=0), STATUS
            )
            page.wait_for_timeout(15)
        eventually(page, lambda: np.array_equal(canvas(page), rgb), "every pixel as it was sent")
        page.close()
