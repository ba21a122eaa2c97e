"""Several views: a key goes on to the next, a drag steers what is beneath the pointer, and each has its sampler."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from page_input import drag, eventually

from wall.config.loading import loads
from wall.config.sampling import METHODS
from wall.display.base import ParameterState
from wall.geometry.panels import Wall
from wall.roles.plan import make_layout

pytestmark = pytest.mark.browser

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [120, 136], size: [0.12, 0.136], bezel: 0.003}}
views: [{id: main}, {id: map, viewport: {left: 0.4, top: 0, width: 0.3, height: 0.25}}]
"""


@pytest.fixture
def grid() -> Wall:
    """Two panels, the second view across the bezel between them."""
    return make_layout(loads(TEXT, path=Path("wall.yaml"))).wall


@pytest.fixture
def views() -> tuple[str, ...]:
    return ("main", "map")


def steered(page: Any) -> str:
    return str(page.evaluate("document.querySelector('#steered input:checked').value"))


def orbits(source: Any) -> list[int]:
    return [command.get("view", 0) for command in source.received if command["kind"] == "orbit"]


def test_n_steers_the_next_view_and_outlines_it(page: Any, source: Any) -> None:
    assert steered(page) == "main"
    page.focus("#wall")
    page.keyboard.press("n")
    assert steered(page) == "map"
    assert page.locator(".outline").count() == 2, "one part on each panel"
    page.keyboard.press("ArrowLeft")
    eventually(page, lambda: set(orbits(source)) == {1}, "the map turns")
    page.keyboard.press("Enter")
    eventually(page, lambda: source.received[-1]["kind"] == "select", "what the map shows is selected")
    assert (source.received[-1]["x"], source.received[-1]["y"]) == pytest.approx((0.55, 0.125), abs=0.01)
    page.keyboard.press("n")
    assert steered(page) == "main"
    page.keyboard.press("ArrowLeft")
    eventually(page, lambda: orbits(source)[-1] == 0, "the main view turns")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.name") == "steered", "Tab leaves the wall, of several views too"


def test_a_drag_steers_what_is_beneath_the_pointer(page: Any, source: Any) -> None:
    drag(page, 0.1, 0.0)
    eventually(page, lambda: set(orbits(source)) == {0}, "the wall's middle is the main view's")
    box = page.locator("#wall").bounding_box()
    page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.15 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.9 * box["height"], steps=4)  # it leaves its rectangle
    page.mouse.up()
    eventually(page, lambda: orbits(source)[-1] == 1, "the map turns")
    assert steered(page) == "map"


def test_each_view_has_its_sampler_and_nothing_is_compared(page: Any, source: Any) -> None:
    assert page.locator("#views").is_hidden()
    assert page.evaluate("document.querySelector('#samplers input:checked').value") == "hilbert"
    page.locator("#steered input").nth(1).check(force=True)
    chosen = "document.querySelector('#samplers input:checked').value"
    eventually(page, lambda: page.evaluate(chosen) == METHODS[0], "the map's sampler")
    page.locator(f"#samplers input[value={METHODS[2]}]").check(force=True)
    eventually(page, lambda: source.received and source.received[-1].get("view") == 1, "asked for the map")
    assert source.received[-1] == {"kind": "sampler", "value": METHODS[2], "view": 1}


def test_time_and_selection_are_those_of_the_steered_view(page: Any, source: Any) -> None:
    source.selected = ("urn", "lamp")
    names = "objects.urn.visible", "objects.lamp.visible"
    source.offered = tuple(
        ParameterState(name=name, kind="whole", low=0, high=1, unit="", default=(1.0,), value=(1.0,)) for name in names
    )
    page.wait_for_selector("#parameters:not([hidden])")
    page.focus("#wall")
    shown = page.locator(".parameter")
    eventually(page, lambda: shown.evaluate_all("e => e.map((each) => each.dataset.name)") == [names[0]], "the urn's")
    page.keyboard.press("n")
    eventually(page, lambda: shown.evaluate_all("e => e.map((each) => each.dataset.name)") == [names[1]], "the lamp's")
    page.keyboard.press(".")
    page.keyboard.press(" ")
    wanted = [{"kind": "seek", "x": 0.5, "view": 1}, {"kind": "pause", "view": 1}]
    eventually(page, lambda: source.received == wanted, "the map's time")
