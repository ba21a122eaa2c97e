"""Handles at the object that is selected: drawn where it stands in every viewport, dragged along an axis."""

from __future__ import annotations

import math

import pytest
from page_input import eventually, find, middle

from wall.display.base import Handles, HandlesPlace, ParameterState

pytestmark = pytest.mark.browser

NAME = "objects.urn.offset"
LIMIT = 3.0


def place(
    x: float, y: float, rect: tuple[int, int, int, int], *, unit: float = 40.0, view: int = 0, parameter: str = NAME
) -> HandlesPlace:
    """Seen along -z from far away: x to the right, y up, 40 pixels a unit; z comes 0.3 as far up and to the right."""
    z = 0.3 * unit
    rows = ((0.0, 0.0, 0.0, 1.0), (unit, 0.0, z, x), (0.0, -unit, -z, y))
    matrix = tuple(number for row in rows for number in row)
    return HandlesPlace(view=view, parameter=parameter, value=(0.5, 0.0, 0.0), rect=rect, wall_from_object=matrix)


@pytest.fixture
def selected(page, source):
    """An object is selected that stands 60 pixels left of the wall's middle, and is shown by two panels' viewports."""
    width, height = source.wall.width, source.wall.height
    half = width // 2
    source.offered = (
        ParameterState(
            name=NAME, kind="position", low=-LIMIT, high=LIMIT, unit="", default=(0.0, 0.0, 0.0), value=(0.5, 0.0, 0.0)
        ),
    )
    rects = (0, 0, half, height), (half, 0, width - half, height)
    source.handles = Handles(places=tuple(place(width / 2 - 60.0, height / 2, rect) for rect in rects))
    page.wait_for_selector("#parameters:not([hidden])")
    find(page, ".handle.x .tip")
    return page


def tip(page, axis, k=0):
    """Middle of a handle's tip, page coordinates."""
    box = page.locator(f".handle.{axis} .tip").nth(k).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def pixel(page, source):
    """CSS pixels of a pixel of the wall."""
    return page.locator(".face > svg").bounding_box()["width"] / page.evaluate(
        "document.querySelector('.face > svg').viewBox.baseVal.width"
    )


def sets(source):
    return [c["numbers"] for c in source.received if c["kind"] == "set"]


def test_axes_are_drawn_from_the_object_in_every_viewport_that_shows_it(selected, source):
    x, y, _ = middle(selected)
    scale = pixel(selected, source)
    assert selected.locator(".handles").count() == 2
    for k in range(2):
        (ax, ay), (bx, by) = tip(selected, "x", k), tip(selected, "y", k)
        assert ay == pytest.approx(y, abs=2.0)
        assert bx == pytest.approx(x - 60.0 * scale, abs=2.0)
        assert ax - bx == pytest.approx(ay - by, abs=2.0)
        assert 30.0 < ax - bx < 90.0
    source.handles = None
    eventually(selected, lambda: selected.locator(".handles").count() == 0, "handles of nothing go")


@pytest.mark.parametrize(("axis", "way"), [("x", (50, 11)), ("y", (17, -40)), ("z", (30, -30))])
def test_a_drag_moves_the_object_along_the_axis_as_far_as_the_pointer_goes(selected, source, axis, way):
    """The pointer's way along the axis, over the pixels of a unit of it; what it goes aside counts nothing."""
    x, y = tip(selected, axis)
    selected.mouse.move(x, y)
    selected.mouse.down()
    selected.mouse.move(x + way[0], y + way[1], steps=5)
    selected.mouse.up()
    ways = {"x": (40.0, 0.0), "y": (0.0, -40.0), "z": (12.0, -12.0)}[axis]
    size, scale = math.hypot(*ways), pixel(selected, source)
    moved = (way[0] * ways[0] + way[1] * ways[1]) / size / (size * scale)
    wanted = [0.5, 0.0, 0.0]
    wanted["xyz".index(axis)] += moved
    wanted = [min(number, LIMIT) for number in wanted]
    eventually(selected, lambda: sets(source) and sets(source)[-1] == pytest.approx(wanted, abs=0.03), "it came there")
    assert {c["kind"] for c in source.received} == {"set"}, "the camera stays"
    assert len(sets(source)) <= 7, "no more than one an animation frame"


def test_escape_puts_it_back_and_the_rest_of_the_drag_does_nothing(selected, source):
    x, y = tip(selected, "x")
    selected.mouse.move(x, y)
    selected.mouse.down()
    selected.mouse.move(x + 40, y, steps=3)
    eventually(selected, lambda: sets(source), "it moves")
    selected.keyboard.press("Escape")
    eventually(selected, lambda: sets(source)[-1] == [0.5, 0.0, 0.0], "it is back")
    count = len(sets(source))
    selected.mouse.move(x + 90, y, steps=3)
    selected.mouse.up()
    selected.wait_for_timeout(100)
    assert len(sets(source)) == count
    assert selected.locator(".handle.held").count() == 0


def test_a_finger_drags_as_a_mouse_does(selected, source):
    x, y = tip(selected, "x")
    touch = selected.context.new_cdp_session(selected)
    for kind, points in (
        ("touchStart", [(x, y)]), ("touchMove", [(x + 15, y)]), ("touchMove", [(x + 30, y)]), ("touchEnd", [])
    ):  # fmt: skip
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": px, "y": py} for px, py in points]})
    wanted = 0.5 + 30.0 / (40.0 * pixel(selected, source))
    eventually(
        selected, lambda: sets(source) and sets(source)[-1][0] == pytest.approx(wanted, abs=0.05), "it came there"
    )
    assert {c["kind"] for c in source.received} == {"set"}


def test_a_handle_is_seen_and_dragged_over_a_bezel(selected, source):
    """Models are framed where four bezels meet."""
    width, height = source.wall.width, source.wall.height
    half, gap = width // 2, 150
    rects = (0, 0, half - gap, height), (half + gap, 0, width - half - gap, height)
    source.handles = Handles(places=tuple(place(width / 2 - 40.0, height / 2, rect) for rect in rects))
    seen = """() => [...document.querySelectorAll('.handle.x .tip')].some((tip) => {
        const box = tip.getBoundingClientRect(), x = box.x + box.width / 2, y = box.y + box.height / 2;
        return document.elementFromPoint(x, y)?.closest('.handle.x');
    })"""
    there = "(x) => Math.abs(document.querySelector('.handles .middle')?.x1.baseVal.value - x) < 1"
    selected.wait_for_function(there, arg=width / 2 - 40.0)
    selected.wait_for_function(seen, timeout=5000)
    x, y = tip(selected, "x")
    selected.mouse.move(x, y)
    selected.mouse.down()
    selected.mouse.move(x + 30, y, steps=3)
    selected.mouse.up()
    eventually(selected, lambda: sets(source), "the drag moved it")


def test_where_another_viewport_lies_over_it_a_handle_is_not(selected, source):
    """An inset of another view over the tip: what is beneath it is steered, not the handle."""
    (first, second), (x, y) = source.handles.places, tip(selected, "x")
    box, scale = selected.locator(".face > svg").bounding_box(), pixel(selected, source)
    frame = -selected.evaluate("document.querySelector('.face > svg').viewBox.baseVal.x")
    left, top = int((x - box["x"]) / scale - frame) - 12, int((y - box["y"]) / scale - frame) - 12
    over = place(-500.0, -500.0, (left, top, 24, 24), view=1)
    source.handles = Handles(places=(first, second, over))
    eventually(selected, lambda: selected.locator(".handles").count() == 3, "three viewports")
    selected.mouse.move(x, y)
    selected.mouse.down()
    selected.mouse.move(x + 30, y, steps=3)
    selected.mouse.up()
    eventually(selected, lambda: source.received, "the drag was heard")
    assert {c["kind"] for c in source.received} == {"orbit"}
