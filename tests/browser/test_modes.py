"""The live page in a real Chromium: two samplers side by side, and overlays over the image."""

from __future__ import annotations

import io

import numpy as np
import pytest
from page_input import close_after_the_run, drag, eventually, find
from PIL import Image

from wall.reconstruction.statistics import AGE, DENSITY, ERROR_REDUCTION

pytestmark = pytest.mark.browser

STEPS = 6  # of 255: JPEG's, and the screenshot's own colour rounding
FIRST = (40, 100, 30)  # panel r0c0 of the source,
SECOND = (20, 40, 220)  # and all of its second images


def seen(page, x, y, *, panel="r0c0", face=".face:not(.second)", size=2):
    """(n, 3) RGB of `size` x `size` pixels of the screen at a fraction of a panel's width and height."""
    box = page.locator(f"{face} .panel:has(canvas[data-panel={panel}])").bounding_box()
    corner = {"x": box["x"] + x * box["width"] - size / 2, "y": box["y"] + y * box["height"] - size / 2}
    screen = page.screenshot(clip={**corner, "width": size, "height": size})
    return np.array(Image.open(io.BytesIO(screen)).convert("RGB")).reshape(-1, 3).astype(float)


def looks(page, x, y, **where):
    return seen(page, x, y, **where).mean(0)


def similar(colour, expected):
    return bool((np.abs(np.asarray(colour) - expected) <= STEPS).all())


def start_comparing(page, source, view="Wipe"):
    page.get_by_label(view, exact=True).click()
    eventually(page, lambda: source.compare == "hilbert", "the run compares")
    find(page, ".face.second:not(.empty)")


def test_wipe_shows_the_adaptive_sampler_at_the_left_and_the_other_at_the_right(page, source):
    start_comparing(page, source)
    assert source.received == [{"kind": "compare", "value": "hilbert"}]  # what was shown before
    eventually(page, lambda: similar(looks(page, 0.5, 0.5, panel="r0c1"), SECOND), "second picture at the right")
    assert similar(looks(page, 0.5, 0.5), FIRST)
    page.wait_for_function("document.getElementById('right-rate').textContent === '2.00 M/s'")
    assert page.inner_text("#left-tag").split() == ["adaptive", "3.00", "M/s"]  # of 5 M/s of four ranks
    assert page.inner_text("#right-tag").split() == ["hilbert", "2.00", "M/s"]


def test_divider_is_dragged_and_moved_by_keys_without_turning_the_wall(page, source):
    start_comparing(page, source)
    wall, grip = page.locator("#wall").bounding_box(), page.locator("#divider i").bounding_box()
    y = grip["y"] + grip["height"] / 2
    page.mouse.move(grip["x"] + grip["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(wall["x"] + 0.1 * wall["width"], y, steps=4)
    page.mouse.up()
    assert page.get_attribute("#divider", "aria-valuenow") == "10"
    eventually(page, lambda: similar(looks(page, 0.5, 0.5), SECOND), "the second picture reaches to the divider")
    assert not page.is_visible("#left-tag")  # it would stand on the other's image

    for _ in range(5):
        page.keyboard.press("ArrowRight")
    assert page.get_attribute("#divider", "aria-valuenow") == "20"
    page.keyboard.press("End")
    eventually(page, lambda: similar(looks(page, 0.5, 0.5, panel="r0c1"), (90, 100, 30)), "the first one everywhere")
    assert {c["kind"] for c in source.received} == {"compare"}
    page.keyboard.press("Home")
    drag(page, 0.2, 0.0)
    eventually(page, lambda: source.turned > 0, "beside the divider the wall turns as ever")


def test_two_views_stand_beside_each_other_and_neither_covers_the_other(page, source):
    start_comparing(page, source, "Beside")
    assert not page.is_visible("#divider")
    eventually(page, lambda: similar(looks(page, 0.5, 0.5, face=".face.second"), SECOND), "second view")
    assert similar(looks(page, 0.5, 0.5), FIRST)
    first, second = (page.locator(face).bounding_box() for face in (".face:not(.second)", ".face.second"))
    assert first["width"] == second["width"]
    apart = second["x"] >= first["x"] + first["width"] or second["y"] >= first["y"] + first["height"]
    assert apart
    tags = [page.locator(tag).bounding_box() for tag in ("#left-tag", "#right-tag")]
    for tag, face in zip(tags, (first, second), strict=True):
        assert face["x"] <= tag["x"] <= face["x"] + face["width"] / 2
        assert face["y"] <= tag["y"] <= face["y"] + face["height"] / 2


def test_c_goes_through_the_views_and_leaving_gives_the_budget_back(page, source):
    views = []
    for _ in range(3):
        page.keyboard.press("c")
        views.append(page.evaluate("document.body.dataset.view"))
    assert views == ["wipe", "beside", "single"]
    eventually(page, lambda: len(source.received) == 2, "told once, and once that it is over")
    assert source.received[-1] == {"kind": "compare", "value": ""}
    assert not page.is_visible("#right-tag")
    assert page.locator("input[value=single]").is_checked()
    eventually(page, lambda: similar(looks(page, 0.5, 0.5, panel="r0c1"), (90, 100, 30)), "one picture again")


def test_while_comparing_other_samplers_change_the_right_side_and_adaptive_ends_it(page, source):
    start_comparing(page, source)
    page.keyboard.press("2")
    eventually(page, lambda: source.compare == "framed", "framed at the right")
    assert page.inner_text("#right-name") == "framed"
    assert page.locator("input[value=framed]").is_checked()
    page.get_by_label("frameless").click()
    eventually(page, lambda: source.compare == "frameless", "frameless at the right")
    page.keyboard.press("1")
    eventually(page, lambda: (source.compare, source.sampler) == ("", "adaptive"), "adaptive alone")
    assert page.evaluate("document.body.dataset.view") == "single"
    page.wait_for_timeout(900)  # longer than what was asked for is trusted
    assert page.evaluate("document.body.dataset.view") == "single"


def test_comparison_begun_by_another_viewer_is_shown(page, source):
    source.obey({"kind": "compare", "value": "framed"})
    find(page, "[data-view=wipe]")
    assert page.inner_text("#right-name") == "framed"


def test_age_map_is_coloured_by_tiles_in_growing_lightness(page, source):
    page.get_by_label("Age", exact=True).click()
    eventually(page, lambda: source.statistics == "on", "statistics_images are asked for")
    find(page, "canvas.cover")
    grey = looks(page, 0.06, 0.5)
    assert np.ptp(grey) <= STEPS, "nothing is known in the first column: the picture alone, grey"
    steps = [looks(page, (k + 0.5) * 16 / 120, 0.5) for k in range(1, 7)]
    lightness = [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in steps]
    assert lightness == sorted(lightness)
    assert lightness[-1] > lightness[0] + 80
    ticks = [text.strip() for text in page.locator("#legend-ticks span").all_inner_texts()]
    assert ticks == ["10 ms", "100 ms", "1 s", "10 s"]


def test_tiles_end_where_they_should_though_the_panel_is_no_multiple_of_them(page, source):
    """120 x 68 pixels are 7.5 x 4.25 tiles: the cover is cut off at the panel's edge, not squeezed."""
    page.get_by_label("Density", exact=True).click()
    find(page, "canvas.cover")
    sizes = page.evaluate("""() => { const c = document.querySelector('canvas.cover'), b = c.parentElement;
      const [x, y] = [c.getBoundingClientRect(), b.getBoundingClientRect()];
      return [c.width, c.height, x.width / y.width, x.height / y.height]; }""")
    assert sizes == [8, 5, pytest.approx(128 / 120, abs=0.01), pytest.approx(80 / 68, abs=0.01)]


def test_tiles_are_outlined_in_the_colour_of_their_error_reduction(page, source):
    page.get_by_label("Tiles", exact=True).click()
    find(page, "canvas.cover")
    left, right = looks(page, 0.25, 0.5), looks(page, 0.75, 0.5)
    assert right.sum() > left.sum() + 60  # code 200 removes more error than code 60
    between = seen(page, 0.5, 0.5, size=10).sum(1)
    assert between.max() > right.sum() + 60, "an outline stronger than what it encloses"


def test_o_goes_through_the_overlays_and_none_costs_nothing(page, source):
    overlays = []
    for _ in range(4):
        page.keyboard.press("o")
        overlays.append(page.evaluate("document.body.dataset.overlay"))
        page.wait_for_timeout(150)
    assert overlays == ["tiles", "age", "density", ""]
    eventually(page, lambda: source.statistics == "", "statistics_images are no longer asked for")
    assert page.locator("canvas.cover").count() == 0
    assert not page.is_visible("#legend")
    assert [c["kind"] for c in source.received] == ["statistics", "statistics"]
    assert similar(looks(page, 0.5, 0.5), FIRST)


def test_both_views_have_their_own_map(page, source):
    start_comparing(page, source, "Beside")
    page.keyboard.press("o")
    eventually(page, lambda: page.locator("canvas.cover").count() == 8, "four panels, twice")


def test_an_overlay_survives_a_reconnection(page, source, grid):
    port = int(source.sink.address.rsplit(":", 1)[1].strip("/"))
    page.keyboard.press("o")
    eventually(page, lambda: source.statistics == "on", "statistics are asked for")
    source.stop()
    find(page, "#banner:not([hidden])")
    following = type(source)(grid, port)
    try:
        eventually(page, lambda: following.statistics == "on", "the next run is asked, too")
    finally:
        following.stop()
    close_after_the_run(page)


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (420, 860), (1920, 600), (760, 1024)])
@pytest.mark.parametrize("view", ["Wipe", "Beside"])
def test_everything_fits_in_every_mode(page, source, width, height, view):
    page.set_viewport_size({"width": width, "height": height})
    start_comparing(page, source, view)
    page.keyboard.press("o")
    page.wait_for_timeout(150)
    sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert sizes[0] <= sizes[1]
    wall, controls = (page.locator(what).bounding_box() for what in ("#wall", "#controls"))
    assert wall["x"] >= 0
    assert wall["x"] + wall["width"] <= width
    assert controls["y"] >= wall["y"] + wall["height"]
    if width >= 900:
        assert controls["y"] + controls["height"] <= height
    right = page.evaluate(
        "Math.max(...[...document.querySelectorAll('button, .choice')].map((e) => e.getBoundingClientRect().right))"
    )
    assert right <= width


def test_the_page_reads_codes_as_they_are_written(page):
    kinds = page.evaluate("import('/overlay.js').then((m) => m.KINDS)")
    for name, scale in {"age": AGE, "density": DENSITY, "tiles": ERROR_REDUCTION}.items():
        assert (kinds[name]["steps"], kinds[name]["least"]) == tuple(scale)


def test_the_colour_scale_grows_evenly_in_lightness(page):
    """Lightness by CIE L* of the colours that the page uses; a step is never more than 1.5 times the mean one."""
    scale = np.array(page.evaluate("import('/colors.js').then((m) => m.SCALE)")) / 255
    linear = np.where(scale <= 0.04045, scale / 12.92, ((scale + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    y = linear @ [0.2126, 0.7152, 0.0722]
    lightness = 116 * np.cbrt(y) - 16
    steps = np.diff(lightness[::5])
    assert steps.min() > 0
    assert steps.max() < 1.5 * steps.mean()
