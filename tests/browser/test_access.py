"""The page for those who see little contrast, and for those who have only a keyboard: WCAG 2.1, level AA."""

from __future__ import annotations

from typing import Any

import pytest
from page_input import close_after_the_run, eventually, find

from wall.display.base import ParameterState

pytestmark = pytest.mark.browser

TEXT, LARGE_TEXT, CONTROL = 4.5, 3.0, 3.0  # WCAG 2.1, success criteria 1.4.3 and 1.4.11
OFFERED = (
    ParameterState(name="exposure", kind="number", low=-20, high=20, unit="stops", default=(0.0,), value=(0.0,)),
    ParameterState(name="lens.focus", kind="number", low=0.1, high=9.0, unit="m", default=(3.0,), value=(3.0,)),
    ParameterState(
        name="materials.oak.color", kind="color", low=0, high=1, unit="", default=(0.5, 0.2, 0.1), value=(0.5, 0.2, 0.1)
    ),
)

# Contrast of every text, and of every control's edge, against what is painted beneath: the least over the colours of a
# gradient; over images of the wall, that against black and against white. Relative luminance as WCAG 2.1 defines it.
CONTRASTS = r"""() => {
  const parse = (text) => [...text.matchAll(/rgba?\(([^)]*)\)/g)].map(([, inside]) => {
    const [r, g, b, a = 1] = inside.split(/[\s,/]+/).map(Number);
    return [r, g, b, a]; });
  const over = ([r, g, b, a], ground) => [r, g, b].map((x, k) => a * x + (1 - a) * ground[k]);
  const grounds = (e) => {
    if (!e) return [[255, 255, 255]];
    const style = getComputedStyle(e), painted = parse(style.backgroundColor), images = parse(style.backgroundImage);
    if (e.id === 'wall') return [[0, 0, 0], [255, 255, 255]];
    const below = painted[0]?.[3] === 1 ? [[0, 0, 0]] : grounds(e.parentElement);
    const here = painted.length ? below.map((ground) => over(painted[0], ground)) : below;
    return images.length ? images.flatMap((image) => here.map((ground) => over(image, ground))) : here; };
  const light = (x) => (x /= 255, x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
  const luminance = ([r, g, b]) => 0.2126 * light(r) + 0.7152 * light(g) + 0.0722 * light(b);
  const contrast = (a, b) => {
    const [p, q] = [luminance(a), luminance(b)].sort((x, y) => y - x);
    return (p + 0.05) / (q + 0.05); };
  const least = (colour, e) => Math.min(...grounds(e).map((ground) => contrast(over(colour, ground), ground)));
  const seen = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true })
    && !e.closest(':disabled') && e.getBoundingClientRect().width > 2;
  const name = (e) => (e.id || e.closest('[id]')?.id) + ' ' + (e.innerText ?? e.outerHTML).slice(0, 30);
  const found = { text: [], control: [] };
  const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = words.nextNode(); node; node = words.nextNode()) {
    const e = node.parentElement;
    if (!node.data.trim() || !seen(e)) continue;
    const style = getComputedStyle(e), px = parseFloat(style.fontSize);
    const large = px >= 24 || (px >= 56 / 3 && style.fontWeight >= 700);
    found.text.push([least(parse(style.color)[0], e), large, name(e)]);
  }
  for (const e of document.querySelectorAll('button, .button, .choice, input[type=color]')) {
    const { borderTopWidth, borderTopColor } = getComputedStyle(e);
    if (!seen(e) || !parseFloat(borderTopWidth)) continue;
    found.control.push([least(parse(borderTopColor)[0], e.parentElement), name(e)]);
  }
  for (const e of document.querySelectorAll('.choice input:checked + span')) {
    const { boxShadow, backgroundColor } = getComputedStyle(e), marks = parse(boxShadow + backgroundColor);
    if (seen(e)) found.control.push([Math.max(...marks.map((c) => least(c, e.parentElement))), 'chosen: ' + name(e)]);
  }
  return found; }"""

# What has the focus, and the contrast of the ring around it: a radio button's is around its words
FOCUSED = """() => {
  const e = document.activeElement;
  const drawn = e.type === 'radio' ? e.nextElementSibling : e.id === 'divider' ? e.firstChild : e;
  const style = getComputedStyle(drawn);
  return [e.id || e.name || e.dataset.bookmark || e.getAttribute('aria-label') || e.className || e.tagName,
    style.outlineStyle === 'solid' && parseFloat(style.outlineWidth) >= 2 && style.outlineColor]; }"""
ACCENT = "rgb(99, 199, 178)"
IN_ORDER = [
    "sampler", "pause", "focus", "reset", "screenshot", "help-open", "wall", "divider", "view", "keep", "1", "overlay",
    "parameters-open", "exposure", "exposure, value", "exposure: as configured", "lens.focus", "lens.focus, value",
    "materials.oak.color, colour", "materials.oak.color, value", "scroll",
]  # fmt: skip


def too_faint(page: Any) -> list[Any]:
    found = page.evaluate(CONTRASTS)
    assert len(found["text"]) > 20
    assert len(found["control"]) > 3
    faint = [entry for entry in found["text"] if entry[0] < (LARGE_TEXT if entry[1] else TEXT)]
    return faint + [entry for entry in found["control"] if entry[0] < CONTROL]


def show_everything(page: Any, source: Any) -> None:
    """Parameters, a comparison, an overlay, a kept camera, a lost rank, a lens."""
    source.offered, source.bookmarks, source.lost_rank = OFFERED, (1,), True
    source.values["exposure"] = (1.0,)
    page.wait_for_selector("#focus:not([hidden])")
    for key in "pco":
        page.keyboard.press(key)
    find(page, ".face.second:not(.empty)")
    find(page, ".stale")
    find(page, "[data-bookmark='1']")
    page.wait_for_timeout(700)  # marks have faded in


def test_text_and_controls_have_the_contrast_of_wcag_aa(page, source):
    assert too_faint(page) == []
    show_everything(page, source)
    page.focus("#focus")
    page.keyboard.press("Enter")
    assert too_faint(page) == [], "while two are compared"
    page.keyboard.press("Space")
    page.keyboard.press("h")
    assert too_faint(page) == [], "the help"
    page.keyboard.press("h")
    page.set_viewport_size({"width": 390, "height": 800})
    source.stop()
    find(page, "#banner:not([hidden])")
    assert too_faint(page) == [], "on a phone, of a run that has ended"
    close_after_the_run(page)


def test_tab_reaches_every_control_in_the_order_of_the_page_with_a_ring_around_it(page, source):
    show_everything(page, source)
    reached = []
    for _ in IN_ORDER:
        page.keyboard.press("Tab")
        name, ring = page.evaluate(FOCUSED)
        reached.append(name)
        assert ring == ACCENT, reached
    assert reached == IN_ORDER
    page.keyboard.press("Shift+Tab")
    assert page.evaluate(FOCUSED)[0] == IN_ORDER[-2], "and back"
    page.locator("#wall").click(position={"x": 60, "y": 80})
    assert page.evaluate(FOCUSED) == ["wall", False], "no ring for a pointer"
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(FOCUSED) == ["wall", ACCENT]


def test_keys_select_and_focus_at_the_middle_of_the_view_or_the_panel_nearest_to_it(page, source):
    """The middle of 2 x 2 panels is a crossing of bezels, where nothing could be selected."""
    source.offered = OFFERED
    page.wait_for_selector("#focus:not([hidden])")
    page.keyboard.press("Enter")
    eventually(page, lambda: source.received, "selected")
    assert page.locator(".outline").count() == 1, "where that is"
    assert page.locator("#parameter-groups").is_visible(), "what can be done with it"
    page.keyboard.press("l")
    page.focus("#focus")
    page.keyboard.press("Enter")  # the next click, or Enter, focuses
    page.focus("#wall")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    eventually(page, lambda: len(source.received) == 4, "all came")
    assert [command["kind"] for command in source.received] == ["select", "focus", "focus", "select"]
    panels = [(*p.screen, *p.pixels) for p in source.wall.panels]
    for command in source.received:
        x, y = command["x"] * source.wall.width, command["y"] * source.wall.height
        assert any(left <= x < left + w and top <= y < top + h for left, top, w, h in panels)
        assert (command["x"], command["y"]) == pytest.approx((0.5, 0.5), abs=0.03), "half a bezel away"
