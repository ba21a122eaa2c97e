"""The whole system as a viewer has it: real renderers, packets and Chromium; the hand moves, the image follows."""

from __future__ import annotations

import io
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from running import page_of, start, status, summary, wall

pytestmark = [pytest.mark.browser, pytest.mark.clock]

CONFIG = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [160, 120], size: [0.4, 0.3], bezel: 0.01}}
views: [{id: main, camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}]
sampling: {method: frameless, samples_per_batch: 512}
graph: {preset: sort-first, sinks: [browser, png]}
"""
WITH_SAMPLES = "output: {browser: {samples: true}}\n"
PATIENCE_S = 60.0
PIXELS = """(c) => { const copy = new OffscreenCanvas(c.width, c.height), context = copy.getContext('2d');
  context.drawImage(c, 0, 0); return [...context.getImageData(0, 0, c.width, c.height).data]; }"""


@pytest.fixture
def more() -> str:
    """What the configuration says beside CONFIG."""
    return ""


@pytest.fixture
def address(tmp_path: Path, more: str) -> Iterator[str]:
    """The page's address of a still wall of two panels."""
    config = tmp_path / "wall.yaml"
    config.write_text(CONFIG + more, encoding="utf-8")
    process = start("run", config, "--still", "--out", tmp_path / "out", "--seconds", 60)
    yield page_of(process)
    process.terminate()
    assert process.wait(10) == 0
    assert summary(tmp_path / "out")["ended"] == "terminated"


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    """The page of that wall, its panels laid out."""
    page = chromium.new_page(viewport={"width": 1280, "height": 720})
    page.goto(address)
    page.wait_for_selector(".panel canvas")
    yield page
    page.close()


def shown(address: str) -> NDArray[np.int16]:
    with urllib.request.urlopen(address + "wall.png", timeout=5) as answer:
        return np.asarray(Image.open(io.BytesIO(answer.read())).convert("RGB")).astype(np.int16)


def settled(address: str) -> NDArray[np.int16]:
    """The image once every pixel has a sample, no renderer traces any more, and it has stopped changing."""
    deadline, last = time.monotonic() + PATIENCE_S, shown(address)
    while time.monotonic() < deadline:
        ranks = [rank for rank in status(address)["ranks"] if rank["role"] == "renderer"]
        image = shown(address)
        idle = all(rank["oldest_sample_s"] is not None and rank["samples_per_s"] == 0 for rank in ranks)
        if idle and np.array_equal(image, last):
            assert image.std() > 20, "nothing is shown"
            return image
        last = image
    pytest.fail("the picture never settled")


def changed(before: NDArray[np.int16], after: NDArray[np.int16]) -> float:
    """Share of pixels that differ visibly."""
    return float((np.abs(before - after).max(-1) > 8).mean())


def test_dragging_turns_the_scene_and_reset_brings_it_back(page: Any, address: str) -> None:
    before = settled(address)

    box = page.locator("#wall").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.4 * box["height"], y, steps=8)
    page.mouse.up()
    deadline = time.monotonic() + PATIENCE_S
    while changed(before, turned := settled(address)) < 0.05:
        assert time.monotonic() < deadline, "dragging changed nothing"
    page.keyboard.press("r")
    while changed(before, settled(address)) > 0.001:
        assert time.monotonic() < deadline, "reset did not bring the first view back"

    assert changed(before, turned) >= 0.05


def test_a_quiet_wall_sends_the_page_nothing_and_another_sampler_shows_the_same(page: Any, address: str) -> None:
    """Once the picture rests, what came as JPEG follows without losses; then not a byte of an image comes."""
    frameless, deadline = settled(address), time.monotonic() + PATIENCE_S
    before, sent = -1, status(address)["page_bytes"]
    while sent != before:  # for twice as long as a panel must rest
        assert time.monotonic() < deadline, "bytes never stopped"
        time.sleep(1.0)
        before, sent = sent, status(address)["page_bytes"]
    assert sent > 0
    assert canvases(page, frameless)

    page.keyboard.press("2")
    deadline = time.monotonic() + PATIENCE_S
    while status(address)["sampler"] != "framed":
        assert time.monotonic() < deadline, "the sampler was not switched"
    framed = settled(address)

    assert changed(frameless, framed) == 0.0


def canvases(page: Any, image: NDArray[np.int16]) -> bool:
    """Whether every canvas is a part of the wall's image, byte for byte."""
    found = [canvas.evaluate(PIXELS) for canvas in page.query_selector_all(".panel canvas")]
    panels = [np.array(pixels, np.int16).reshape(120, 160, 4)[..., :3] for pixels in found]
    places = range(image.shape[1] - 159)
    return all(any(np.array_equal(panel, image[:120, x : x + 160]) for x in places) for panel in panels)


@pytest.mark.parametrize("more", [WITH_SAMPLES])
def test_a_page_that_gets_samples_makes_the_wall_s_image_byte_for_byte(page: Any, address: str) -> None:
    """Through motion, which scatters samples; adaptive samples come as images, and the others again."""
    words = "(start) => document.getElementById('display-words').textContent.startsWith(start)"
    page.keyboard.press("s")
    page.wait_for_function(words, arg="Made by this page", timeout=1000 * PATIENCE_S)
    page.keyboard.press("Space")
    deadline = time.monotonic() + PATIENCE_S
    while status(address)["seconds"] < 3.0 or not status(address)["refreshes_per_s"]:
        assert time.monotonic() < deadline, "nothing moved"
    page.keyboard.press("Space")
    while not canvases(page, settled(address)):
        assert time.monotonic() < deadline, "the page never showed the wall's image"

    page.locator("#samplers input[value=adaptive]").check(force=True)
    page.wait_for_function(words, arg="Images come: the wall reprojects", timeout=1000 * PATIENCE_S)
    page.locator("#samplers input[value=framed]").check(force=True)
    page.wait_for_function(words, arg="Made by this page", timeout=1000 * PATIENCE_S)
    deadline = time.monotonic() + PATIENCE_S
    while not canvases(page, settled(address)):
        assert time.monotonic() < deadline, "the page never showed the wall's image again"


def test_two_samplers_run_at_once_and_maps_of_their_samples_are_shown(page: Any, address: str) -> None:
    page.keyboard.press("Space")  # it moves: both have something to do
    page.keyboard.press("c")
    page.keyboard.press("o")
    page.keyboard.press("o")
    both = "() => ['left-rate', 'right-rate'].every((id) => parseFloat(document.getElementById(id).textContent) > 0)"
    page.wait_for_function(both, timeout=1000 * PATIENCE_S)
    page.wait_for_selector(".face.second:not(.empty)")
    painted = """() => [...document.querySelectorAll('canvas.cover')].filter((c) => {
        const found = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        return found.some((v) => v > 0); }).length === 4"""
    page.wait_for_function(painted, timeout=1000 * PATIENCE_S)

    until, share = time.monotonic() + PATIENCE_S, 0.0
    while not 0.2 < share < 0.8 and time.monotonic() < until:  # rates of late; in all it is a half to a batch
        found = status(address)
        share = found["compared_per_s"] / sum(rank["samples_per_s"] for rank in found["ranks"])
        time.sleep(0.1)
    assert (found["sampler"], found["compare"]) == ("adaptive", "frameless")
    assert 0.2 < share < 0.8
    page.keyboard.press("c")
    page.keyboard.press("c")
    deadline = time.monotonic() + PATIENCE_S
    while status(address)["compare"] or status(address)["compared_per_s"] > 0:
        assert time.monotonic() < deadline, "the budget did not come back"
    assert status(address)["sampler"] == "frameless"


def test_a_slider_changes_the_light_and_the_page_follows_another_terminal(
    page: Any, address: str, tmp_path: Path
) -> None:
    page.wait_for_selector("#parameters:not([hidden])")
    before = settled(address)
    page.keyboard.press("p")
    page.get_by_label("lights.2.irradiance", exact=True).fill("-8")  # its left end: dark
    deadline = time.monotonic() + PATIENCE_S
    while changed(before, dark := settled(address)) < 0.05:
        assert time.monotonic() < deadline, "the slider changed nothing"
    assert dark.mean() < before.mean()

    assert wall("set", "lights.2.irradiance=default", "--out", tmp_path / "out").returncode == 0
    deadline = time.monotonic() + PATIENCE_S
    while changed(before, settled(address)) > 0.0:
        assert time.monotonic() < deadline, "what is configured did not come back"
    row = "() => document.querySelector('[data-name=\"lights.2.irradiance\"] input').value === '0'"
    page.wait_for_function(row, timeout=1000 * PATIENCE_S)
