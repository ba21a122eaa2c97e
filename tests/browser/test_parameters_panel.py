"""The panel of parameters: only where there are any, closed at first, used by keys, following others."""

from __future__ import annotations

import math

import pytest
from page_input import drag, eventually, middle

from wall.display.base import ParameterState, ZoomedPlace

pytestmark = pytest.mark.browser


def offer(name, kind, *default, low=0, high=1, unit=""):
    return ParameterState(name=name, kind=kind, low=low, high=high, unit=unit, default=default, value=default)


OFFERED = (
    offer("exposure", "number", 0.0, low=-20, high=20, unit="stops"),
    offer("lights.0.intensity", "light", 8.0, 4.0, 2.0, high=1e9, unit="W/sr"),
    offer("lights.1.direction", "direction", 0.0, 0.6, 0.8, low=-1),
    offer("materials.oak .001.color", "color", 0.5, 0.2, 0.1),
    offer("integrator.depth", "whole", 6.0, low=1, high=64, unit="surfaces"),
)

MAPPING = ParameterState(
    name="tone_mapping", kind="choice", low=0, high=2, unit="", default=(0.0,), value=(0.0,),
    choices=("none", "reinhard", "aces"),
)  # fmt: skip
LENS = (offer("lens.focus", "number", 3.0, low=1e-6, high=1e12, unit="world units"),)


@pytest.fixture
def panel(page, source):
    """The page of a run that offers parameters, its panel open."""
    source.offered = OFFERED
    page.wait_for_selector("#parameters:not([hidden])")
    page.keyboard.press("p")
    page.wait_for_selector(".parameter")
    return page


def sets(source):
    return [c for c in source.received if c["kind"] == "set"]


def test_without_parameters_there_is_no_panel_and_with_some_it_is_closed_at_first(page, source):
    assert page.locator("#parameters").is_hidden()
    page.keyboard.press("p")
    assert page.locator("#parameter-groups").is_hidden()
    source.offered = OFFERED
    page.wait_for_selector("#parameters:not([hidden])")
    assert page.locator("#parameter-groups").is_hidden()
    page.focus("#parameters-open")
    page.keyboard.press("Enter")
    assert page.locator(".parameter").count() == len(OFFERED)
    assert page.get_attribute("#parameters-open", "aria-expanded") == "true"
    assert page.locator("h3").all_inner_texts() == ["Picture", "Light 0", "Light 1", "oak .001", "Integrator"]


def test_a_choice_is_a_list_of_names(page, source):
    source.offered = (MAPPING,)
    page.wait_for_selector("#parameters:not([hidden])")
    page.keyboard.press("p")
    page.get_by_label("tone_mapping", exact=True).select_option("aces")
    eventually(page, lambda: sets(source), "the choice")
    assert sets(source)[-1] == {"kind": "set", "name": "tone_mapping", "numbers": [2]}


def test_arrow_keys_move_a_slider_and_not_the_wall(panel, source):
    panel.get_by_label("exposure", exact=True).focus()
    panel.keyboard.press("ArrowRight")
    eventually(panel, lambda: sets(source), "the slider was heard")
    assert [c["kind"] for c in source.received] == ["set"]
    assert sets(source)[-1] == {"kind": "set", "name": "exposure", "numbers": [pytest.approx(16 / 960)]}


def test_strength_keeps_the_colour_and_its_left_end_is_dark(panel, source):
    slider = panel.get_by_label("lights.0.intensity", exact=True)
    slider.fill("1")
    eventually(panel, lambda: sets(source), "the slider was heard")
    assert sets(source)[-1]["numbers"] == [pytest.approx(x) for x in (16.0, 8.0, 4.0)]
    slider.fill("-8")
    eventually(panel, lambda: sets(source)[-1]["numbers"] == [0, 0, 0], "the light is off")
    slider.fill("0")
    eventually(panel, lambda: sets(source)[-1]["numbers"][0] > 0, "the light is on")
    assert sets(source)[-1]["numbers"] == [pytest.approx(x) for x in (8.0, 4.0, 2.0)]  # as configured: black has no hue


def test_a_direction_is_turned_by_azimuth_and_elevation(panel, source):
    panel.get_by_label("lights.1.direction, azimuth").fill("90")
    eventually(panel, lambda: sets(source), "the slider was heard")
    assert sets(source)[-1]["numbers"] == [pytest.approx(x, abs=1e-3) for x in (0.8, 0.6, 0.0)]


def test_a_colour_is_sent_as_linear_light(panel, source):
    panel.get_by_label("materials.oak .001.color, colour").fill("#80ff00")
    eventually(panel, lambda: sets(source), "the colour was heard")
    linear = ((0x80 / 255 + 0.055) / 1.055) ** 2.4
    assert sets(source)[-1]["name"] == "materials.oak .001.color"
    assert sets(source)[-1]["numbers"] == [pytest.approx(linear), pytest.approx(1.0), 0]


def test_values_follow_edits_by_others_and_the_button_takes_them_back(panel, source):
    source.values["integrator.depth"] = (2.0,)
    row = panel.locator("[data-name='integrator.depth']")
    value = panel.get_by_label("integrator.depth, value")
    eventually(panel, lambda: value.input_value() == "2 surfaces", "the value is shown")
    assert row.locator("input[type=range]").input_value() == "2"
    row.locator("button").click()
    eventually(panel, lambda: sets(source), "the button was heard")
    assert sets(source)[-1] == {"kind": "set", "name": "integrator.depth", "numbers": None}
    assert row.locator("button").is_disabled()


@pytest.mark.parametrize(
    ("name", "typed", "sent"),
    [
        ("exposure", "1.25", [1.25]),
        ("exposure", "99", [20]),
        ("integrator.depth", "7.6 surfaces", [8]),
        ("lights.0.intensity", "3", [3, 3, 3]),
        ("lights.1.direction", "1, -1e-1 0", [1, -0.1, 0]),
        ("exposure", "\u22122", [-2]),
        ("lights.0.intensity", "#FF0000", [1, 0, 0]),
    ],
)
def test_a_value_is_typed(panel, source, name, typed, sent):
    field = panel.get_by_label(f"{name}, value")
    field.click()
    panel.keyboard.type(typed)
    panel.keyboard.press("Enter")
    eventually(panel, lambda: sets(source), "the value was heard")
    assert source.received == [{"kind": "set", "name": name, "numbers": sent}]


@pytest.mark.parametrize(
    ("typed", "key"),
    [("5", "Escape"), ("nothing", "Enter"), ("1 2", "Enter"), ("#ff8000", "Enter"), ("2px", "Enter"), ("1,", "Enter")],
)
def test_what_is_typed_and_left_or_no_value_changes_nothing(panel, source, typed, key):
    field = panel.get_by_label("exposure, value")
    field.click()
    panel.keyboard.type(typed)
    panel.keyboard.press(key)
    panel.locator("h3").first.click()
    eventually(panel, lambda: field.input_value() == "0 stops", "it is as it was")
    assert source.received == []


def test_brackets_expose_by_thirds_of_a_stop_and_periods_seek_by_half_a_second(page, source):
    for key in ("]", "]", "[", ".", ","):
        page.keyboard.press(key)
    eventually(page, lambda: len(source.received) == 5, "all keys came")
    assert [c["x"] for c in source.received if c["kind"] == "seek"] == [0.5, -0.5]
    assert [round(3 * c["x"]) for c in source.received if c["kind"] == "expose"] == [1, 1, -1]
    assert math.isclose(source.received[0]["x"], 1 / 3)


SIZES = [(1280, 720), (420, 800), (1920, 600), (760, 1024), (1200, 800), (1000, 760)]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_open_panel_fits_and_its_sliders_have_room(panel, source, width, height):
    source.offered = (*OFFERED, offer("cuts.0.position", "position", 0.0, 0.5, 0.0, low=-9, high=9))
    panel.wait_for_selector("[data-name='cuts.0.position']")
    panel.set_viewport_size({"width": width, "height": height})
    panel.wait_for_timeout(150)
    wide = panel.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert wide[0] <= wide[1]
    if width >= 900:
        tall = panel.evaluate("[document.documentElement.scrollHeight, document.documentElement.clientHeight]")
        assert tall[0] <= tall[1]
    assert panel.locator(".parameter").first.bounding_box()["height"] > 0
    sliders = panel.evaluate("[...document.querySelectorAll('.parameter input[type=range]')].map((e) => e.clientWidth)")
    assert len(sliders) >= 8
    assert min(sliders) >= 30


def test_every_control_of_the_panel_has_a_name(panel):
    unnamed = panel.evaluate("""() => [...document.querySelectorAll('#parameters input, #parameters button')]
      .filter((e) => !(e.getAttribute('aria-label') || e.innerText?.trim())).map((e) => e.outerHTML)""")
    assert unnamed == []


def clicks(source):
    return [c for c in source.received if c["kind"] != "statistics"]


def test_alt_and_a_click_focuses_there_where_there_is_a_lens(page, source):
    x, y, height = middle(page)
    page.keyboard.down("Alt")
    page.mouse.click(x - height / 4, y - height / 4)
    page.wait_for_timeout(100)
    assert clicks(source) == []  # no lens: nothing to focus
    source.offered = LENS
    page.wait_for_selector("#focus:not([hidden])")
    page.mouse.click(x, y)  # between four panels
    page.mouse.click(x - height / 4, y - height / 4)
    page.keyboard.up("Alt")
    eventually(page, lambda: clicks(source), "the click was heard")
    (click,) = clicks(source)
    assert click == {
        "kind": "focus",
        "x": pytest.approx(0.5 - 0.25 * 136 / 240, abs=0.03),
        "y": pytest.approx(0.25, abs=0.03),
    }
    drag(page, 0.2, 0.0)
    eventually(page, lambda: clicks(source)[-1]["kind"] == "orbit", "without alt the scene turns")


def test_the_button_aims_the_next_click_alone(page, source):
    source.offered = LENS
    page.wait_for_selector("#focus:not([hidden])")
    page.click("#focus")
    assert page.get_attribute("#focus", "aria-pressed") == "true"
    x, y, height = middle(page)
    page.mouse.click(x + height / 4, y + height / 4)
    eventually(page, lambda: clicks(source), "the click was heard")
    assert page.get_attribute("#focus", "aria-pressed") == "false"
    page.mouse.click(x + height / 4, y + height / 4)
    page.wait_for_timeout(100)
    assert [c["kind"] for c in clicks(source)] == ["focus"]


def test_a_double_click_selects_an_object_and_x_hides_it(page, source):
    source.offered = OFFERED[:1]
    page.wait_for_selector("#parameters:not([hidden])")
    x, y, height = middle(page)
    page.mouse.dblclick(x - 0.2 * height, y - 0.2 * height)
    eventually(page, lambda: [c for c in source.received if c["kind"] == "select"], "the click came")
    (select,) = (c for c in source.received if c["kind"] == "select")
    assert 0.3 < select["x"] < 0.45
    assert 0.25 < select["y"] < 0.35
    assert page.locator(".parameter").count() == 1, "the panel is open"
    source.offered = (
        offer("objects.urn.offset", "position", 0.0, 0.0, 0.0, low=-5e4, high=5e4),
        offer("objects.urn.scale", "number", 1.0, low=1e-3, high=1e4),
        offer("objects.urn.visible", "whole", 1.0),
    )
    eventually(page, lambda: page.locator("h3").all_inner_texts() == ["Object urn"], "its parameters")
    reach = page.locator("[aria-label='objects.urn.offset, x']").evaluate("e => [Number(e.min), Number(e.max)]")
    assert reach == [-5.0, 5.0], "as far as the scene is large"
    assert page.locator(".axis").all_inner_texts() == ["x", "y", "z"]
    page.locator("[aria-label='objects.urn.scale']").fill("1")
    eventually(page, lambda: sets(source) == [{"kind": "set", "name": "objects.urn.scale", "numbers": [2]}], "a stop")
    source.received.clear()
    page.focus("#wall")
    page.keyboard.press("x")
    eventually(page, lambda: sets(source) == [{"kind": "set", "name": "objects.urn.visible", "numbers": [0]}], "hidden")
    page.keyboard.press("z")
    eventually(page, lambda: source.received[-1] == {"kind": "undo"}, "and taken back")


def test_drag_and_wheel_over_a_very_large_image_move_it_and_no_camera(page, source):
    """It fits 80 x 60 pixels of the second panel, at a zoom of 1; the point under the wheel stays where it is."""
    names = {"x": (0.0, 1.0, 0.5), "y": (0.0, 1.0, 0.5), "zoom": (-8.0, 26.0, 1.0)}
    source.offered = tuple(
        offer(f"nodes.photo.{key}", "number", value, low=low, high=high) for key, (low, high, value) in names.items()
    )
    second = source.wall.panels[1]
    (x, y), (width, height) = second.screen, second.pixels
    place = ZoomedPlace(node="photo", x=x, y=y, width=width, height=height, fit=(80.0, 60.0))
    source.sink.lay_out(source.wall, list(source.views), (), [place])
    page.wait_for_selector("#parameters:not([hidden])")
    box = page.locator(f".panel:has([data-panel={second.id}])").bounding_box()
    scale = box["width"] / width  # CSS pixels a pixel
    page.mouse.move(box["x"] + box["width"] / 2 + 10 * scale, box["y"] + box["height"] / 2)
    page.mouse.wheel(0, -400)
    eventually(page, lambda: {"nodes.photo.zoom", "nodes.photo.x"} <= source.values.keys(), "the image was enlarged")
    zoom = source.values["nodes.photo.zoom"][0]
    assert zoom > 1.5
    assert source.values["nodes.photo.x"][0] == pytest.approx(0.5 + 10 / 80 * (2**-1 - 2**-zoom), abs=1e-3)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 10 * scale, box["y"] + box["height"] / 2 + 6 * scale, steps=4)
    page.mouse.up()
    eventually(page, lambda: source.values.get("nodes.photo.y") is not None, "the image was moved")
    page.wait_for_timeout(200)
    assert source.values["nodes.photo.y"][0] == pytest.approx(0.5 - 6 / 60 * 2**-zoom, abs=2e-3)
    assert {command["kind"] for command in source.received} == {"set"}
    source.received.clear()
    page.keyboard.press("n")
    page.keyboard.press("+")
    eventually(page, lambda: source.received and source.received[-1]["kind"] == "zoom", "keys steer the camera again")
    page.mouse.move(box["x"] - 0.7 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.wheel(0, -120)
    eventually(page, lambda: source.received and source.received[-1]["kind"] == "zoom", "the camera came nearer")
