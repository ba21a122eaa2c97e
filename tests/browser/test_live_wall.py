"""The whole system as a viewer has it: real renderers, packets and Chromium; the hand moves, the image follows."""

from __future__ import annotations

import io
import json
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from running import page_of, start, summary, wall

pytestmark = [pytest.mark.browser, pytest.mark.clock]

CONFIG = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [160, 120], size: [0.4, 0.3], bezel: 0.01}}
views: [{id: main, camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}]
sampling: {method: frameless, samples_per_batch: 512}
graph: {preset: sort-first, sinks: [browser, png]}
"""
PATIENCE_S = 30.0


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """The page's address of a still wall of two panels."""
    config = tmp_path / "wall.yaml"
    config.write_text(CONFIG, encoding="utf-8")
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


def test_other_sampler_shows_the_same_still_scene(page: Any, address: str) -> None:
    frameless = settled(address)

    page.keyboard.press("2")
    deadline = time.monotonic() + PATIENCE_S
    while status(address)["sampler"] != "framed":
        assert time.monotonic() < deadline, "the sampler was not switched"
    framed = settled(address)

    assert changed(frameless, framed) == 0.0


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


def status(address: str) -> dict[str, Any]:
    with urllib.request.urlopen(address + "status.json", timeout=5) as answer:
        found: dict[str, Any] = json.loads(answer.read())
    return found


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
