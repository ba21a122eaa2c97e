"""The live page in a real Chromium, served by the real sink: what it shows, and what input does."""

from __future__ import annotations

import json
import urllib.request

import pytest
from page_input import close_after_the_run, drag, eventually, find, middle

from wall.display.base import ParameterState

pytestmark = pytest.mark.browser

# RGB in the middle of every panel's canvas, by panel id, as the page has drawn it
COLOURS = """() => {
  const pixel = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true });
  return Object.fromEntries([...document.querySelectorAll('.panel canvas')].map((c) => {
    pixel.drawImage(c, -c.width / 2, -c.height / 2);
    return [c.dataset.panel, [...pixel.getImageData(0, 0, 1, 1).data].slice(0, 3)];
  })); }"""
JPEG_STEPS = 3  # a flat colour through JPEG's YCbCr at quality 88


def near(colour, expected):
    return all(abs(a - b) <= JPEG_STEPS for a, b in zip(colour, expected, strict=True))


def kinds(source):
    return [command["kind"] for command in source.received]


def total(source, kind, axis):
    return sum(command[axis] for command in list(source.received) if command["kind"] == kind)


def test_page_shows_every_panel_with_its_own_image(page, source):
    colours = page.evaluate(COLOURS)
    assert list(colours) == ["r0c0", "r0c1", "r1c0", "r1c1"]
    for k, colour in enumerate(colours.values()):
        assert near(colour, (40 + 50 * k, 100, 30))


def test_a_page_of_another_format_loads_itself_anew(page, source, monkeypatch):
    with page.expect_event("framenavigated"):
        monkeypatch.setattr("wall.display.stream.FORMAT", 3)
        source.version += 1
    monkeypatch.undo()
    page.wait_for_selector("body[data-picture]", state="attached")  # it may come anew twice


def test_a_page_that_may_only_watch_shows_the_wall_and_has_nothing_that_steers(chromium, source_with_tokens):
    sink = source_with_tokens.sink
    page = chromium.new_context(viewport={"width": 640, "height": 480}).new_page()
    page.goto(sink.watch_address)
    eventually(page, lambda: page.evaluate("Boolean(document.body.dataset.picture)"), "the wall")
    eventually(page, lambda: "to watch only" in page.locator("#state").inner_text(), "what the page is for")
    assert "token" not in page.url
    assert not any(page.locator(f"#{name}").is_visible() for name in ("pause", "samplers", "keep", "parameters"))
    page.locator("#wall").press("Space")
    page.locator("#wall").press("o")
    eventually(page, lambda: source_with_tokens.statistics == "on", "an overlay is for those who watch, too")
    page.context.close()
    assert set(kinds(source_with_tokens)) == {"statistics"}
    assert sink.dropped() == {}, "the page does not even ask"


def test_panels_stand_at_their_true_places_with_bezels_between(page, grid):
    first = grid.panels[0].screen
    boxes = [page.locator(f".panel:has(canvas[data-panel={p.id}])").bounding_box() for p in grid.panels]
    scale = boxes[0]["width"] / 120
    for box, panel in zip(boxes, grid.panels, strict=True):
        assert box["x"] - boxes[0]["x"] == pytest.approx((panel.screen[0] - first[0]) * scale, abs=1.5)
        assert box["y"] - boxes[0]["y"] == pytest.approx((panel.screen[1] - first[1]) * scale, abs=1.5)
        assert box["x"] == round(box["x"])  # crisp: edges on whole pixels
        assert box["width"] == round(box["width"])
    assert boxes[1]["x"] > boxes[0]["x"] + boxes[0]["width"] + 2


def test_dragging_orbits_by_heights_of_the_wall_and_the_image_follows(page, source):
    before = page.evaluate(COLOURS)["r0c0"]
    drag(page, 0.5, -0.25)
    eventually(page, lambda: total(source, "orbit", "x") == pytest.approx(0.5, abs=0.01), "orbit by 0.5")
    assert total(source, "orbit", "y") == pytest.approx(-0.25, abs=0.01)
    assert set(kinds(source)) == {"orbit"}
    eventually(page, lambda: near(page.evaluate(COLOURS)["r0c0"], (40, source.green(), 30)), "picture followed")
    assert page.evaluate(COLOURS)["r0c0"][1] >= before[1] + 40


def test_a_frames_worth_of_moves_is_one_command(page, source):
    x, y, height = middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(
        """([x, y]) => { const wall = document.getElementById('wall');
        for (let k = 1; k <= 50; k++) wall.dispatchEvent(
          new PointerEvent('pointermove', { pointerId: 1, clientX: x + k, clientY: y, bubbles: true })); }""",
        [x, y],
    )
    eventually(page, lambda: total(source, "orbit", "x") == pytest.approx(50 / height, abs=0.01), "all moves came")
    page.mouse.up()
    assert len(source.received) <= 2


@pytest.mark.parametrize("how", ["right button", "shift"])
def test_right_or_shift_drag_pans(page, source, how):
    if how == "shift":
        page.keyboard.down("Shift")
    drag(page, 0.3, 0.1, button="left" if how == "shift" else "right")
    page.keyboard.up("Shift")
    eventually(page, lambda: total(source, "pan", "x") == pytest.approx(0.3, abs=0.01), "pan by 0.3")
    assert set(kinds(source)) == {"pan"}


def test_wheel_zooms_in_when_turned_away(page, source):
    x, y, _ = middle(page)
    page.mouse.move(x, y)
    page.mouse.wheel(0, -120)
    eventually(page, lambda: source.received, "zoom came")
    assert source.received[0]["kind"] == "zoom"
    assert 1.05 < source.received[0]["x"] < 1.5


def test_two_fingers_pinch_and_pan(page, source):
    page.evaluate("""() => {
      const wall = document.getElementById('wall'), box = wall.getBoundingClientRect();
      wall.setPointerCapture = () => {};                       // made-up pointers cannot be captured
      const say = (type, id, x) => wall.dispatchEvent(new PointerEvent(type, { pointerId: id, pointerType: 'touch',
        clientX: box.x + x, clientY: box.y + 50, bubbles: true, cancelable: true }));
      say('pointerdown', 11, 100); say('pointerdown', 12, 200);
      say('pointermove', 12, 300); say('pointerup', 11, 100); say('pointerup', 12, 300);
    }""")
    eventually(page, lambda: "zoom" in kinds(source) and "pan" in kinds(source), "pinch came")
    zoom = next(c for c in source.received if c["kind"] == "zoom")
    assert zoom["x"] == pytest.approx(2.0)  # 100 pixels apart, then 200
    assert "orbit" not in kinds(source)


def test_keys_do_what_the_help_says(page, source):
    for key in ("ArrowRight", "Shift+ArrowUp", "+", "-", "2", "r"):
        page.keyboard.press(key)
        page.wait_for_timeout(60)  # one animation frame each
    eventually(page, lambda: kinds(source)[-1:] == ["reset"], "all keys came")
    seen = [k for n, k in enumerate(kinds(source)) if n == 0 or kinds(source)[n - 1] != k]
    assert seen == ["orbit", "pan", "zoom", "sampler", "reset"]
    assert total(source, "orbit", "x") > 0
    assert total(source, "pan", "y") < 0
    zooms = [c["x"] for c in source.received if c["kind"] == "zoom"]
    assert zooms == [pytest.approx(1.12), pytest.approx(1 / 1.12)]


def test_pause_button_and_space_pause_and_go_on(page, source):
    page.click("#pause")
    eventually(page, lambda: source.paused, "paused")
    find(page, "#pause[aria-pressed=true]")
    assert page.inner_text("#state") == "Paused"
    page.focus("#wall")
    page.keyboard.press("Space")
    eventually(page, lambda: not source.paused, "went on")
    find(page, "#pause[aria-pressed=false]")
    assert kinds(source) == ["pause", "pause"]


def test_space_on_the_pause_button_pauses_once(page, source):
    page.focus("#pause")
    page.keyboard.press("Space")
    eventually(page, lambda: source.paused, "paused")
    page.wait_for_timeout(100)
    assert kinds(source) == ["pause"]


def test_sampler_buttons_show_and_choose_the_sampler(page, source):
    assert page.locator("input[value=hilbert]").is_checked()
    page.get_by_label("frameless").click()
    eventually(page, lambda: source.sampler == "frameless", "sampler chosen")
    assert source.received == [{"kind": "sampler", "value": "frameless"}]
    assert page.locator("input[value=frameless]").is_checked()
    source.sampler = "framed"  # by another viewer
    find(page, "input[value=framed]:checked")


def test_table_and_latency_say_what_the_status_says(page, source):
    source.busy_rank = True
    find(page, "#ranks tr[title*=busy]")
    row = page.locator("#ranks tr").nth(1).inner_text()
    assert " ".join(row.split()).startswith("2 r0c1 busy 4.0 s ")
    assert page.inner_text("#ranks-note") == "1 of 4 busy"
    source.busy_rank, source.lost_rank = False, True
    find(page, "#ranks tr.lost:not([title*=busy])")
    rows = [" ".join(row.split()) for row in page.locator("#ranks tr").all_inner_texts()]
    assert rows[0] == "1 r0c0 1.25 M 9.50 M 200 ms 0 150 MB"
    assert rows[1] == "2 r0c1 lost 1.25 M 9.50 M 200 ms 3 150 MB"
    assert page.inner_text("#ranks-note") == "1 of 4 lost"
    assert [page.inner_text(f"#{p}") for p in ("p50", "p95", "p99")] == ["21 ms", "34 ms", "55 ms"]
    assert page.inner_text("#fact-right") == "420 ms"
    assert page.inner_text("#slow") == "Rank 2 (r0c1) makes 3 of 30 images a second."
    assert page.inner_text("#notes") == "rank 2: no GPU\nrank 1: <b>died</b>"
    assert page.inner_text(".stale") == "no new samples"
    mark, panel = (page.locator(each).bounding_box() for each in (".stale", ".panel:has([data-panel=r0c1])"))
    assert mark["x"] == pytest.approx(panel["x"], abs=1.5)
    assert mark["width"] == pytest.approx(panel["width"] / 2, abs=1.5)
    source.lost_rank = False
    page.wait_for_selector(".stale", state="detached")
    assert "median 21 ms" in page.get_attribute("#plot", "aria-label")
    painted = (
        "() => { const c = document.getElementById('plot'); return c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }"
    )
    assert page.evaluate(painted)


def test_page_reconnects_to_the_next_run_by_itself(page, source, grid):
    port = int(source.sink.address.rsplit(":", 1)[1].strip("/"))
    source.stop()
    find(page, "#banner:not([hidden])")
    assert page.inner_text("#banner") == "The run has ended. This is its last picture."
    page.keyboard.press(" ")  # there is nothing to pause
    assert page.inner_text("#state") == "Ended"
    assert page.is_disabled("#pause")
    assert page.is_hidden("#screenshot")
    following = type(source)(grid, port)
    following.turned = 0.8
    try:
        find(page, "#banner[hidden]")
        eventually(page, lambda: near(page.evaluate(COLOURS)["r1c1"], (190, 180, 30)), "the new run's picture")
        page.click("#reset")
        eventually(page, lambda: kinds(following) == ["reset"], "steers the new run")
    finally:
        following.stop()
    close_after_the_run(page)


def test_run_that_stands_still_is_told(page, source):
    source.stopping.set()  # the server lives, the run's clock does not move
    find(page, "#banner:not([hidden])")
    assert "does not answer" in page.inner_text("#banner")


def test_garbage_from_a_page_harms_nobody(page, source):
    page.evaluate("""() => new Promise((done) => {
      const bad = new WebSocket(`ws://${location.host}/stream`);
      bad.onopen = () => { bad.send('nonsense'); bad.send('{"kind":"orbit","x":"1","y":0}');
                           bad.send(new Uint8Array(9)); bad.close(); };
      bad.onclose = done; })""")
    eventually(page, lambda: source.sink.dropped().get("browser_bad_message") == 3, "garbage counted")
    assert source.received == []
    drag(page, 0.1, 0.0)
    eventually(page, lambda: "orbit" in kinds(source), "still steers")


def test_another_sites_page_cannot_steer(page, source, chromium):
    context = chromium.new_context()
    other = context.new_page()
    empty = {"body": "<title>x</title>", "content_type": "text/html"}
    other.route("http://evil.example/**", lambda route: route.fulfill(**empty))
    other.goto("http://evil.example/")
    outcome = other.evaluate(
        """(address) => new Promise((done) => { const ws = new WebSocket(address);
        ws.onopen = () => done('open'); ws.onerror = () => done('refused'); })""",
        source.sink.address.replace("http", "ws") + "stream",
    )
    context.close()
    assert outcome == "refused"


SIZES = [(390, 800), (800, 1024), (1000, 700), (1280, 720), (1440, 900), (1920, 600), (1920, 1080), (3840, 2160)]
# Pairs of things on the page that lie over each other, and things that are wider than what holds them
CROWDED = """() => {
  const shown = (e) => e.offsetParent && !(e.closest('.facts') && e.offsetTop >= e.closest('.facts').offsetTop + 20);
  const all = '.mark, .state, .facts div, .tools > *, .wall, .controls > *, .card', words = 'button, .button';
  const boxes = [...document.querySelectorAll(all)].filter(shown).map((e) => [e, e.getBoundingClientRect()]);
  const over = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1;
  const name = (e) => e.id || e.className || e.innerText;
  const pairs = boxes.flatMap(([e, a], k) =>
    boxes.slice(k + 1).filter(([, b]) => over(a, b)).map(([f]) => [name(e), name(f)]));
  const cut = [...document.querySelectorAll(words)].filter((e) => e.offsetParent && e.scrollWidth > e.clientWidth + 1);
  const out = [...document.querySelectorAll('.choice span')].filter((e) => e.offsetParent
    && e.getBoundingClientRect().right > e.closest('.choice').getBoundingClientRect().right);
  return [...pairs, ...cut.map(name), ...out.map(name)]; }"""


def test_everything_fits_whatever_the_window(page, source):
    """With all that the bar may hold: a lens to focus, cameras that were kept, and the word while it is paused."""
    source.bookmarks, source.paused = (1, 2), True
    source.offered = (
        ParameterState(name="lens.focus", kind="number", low=0.1, high=9.0, unit="", default=(3.0,), value=(3.0,)),
    )
    page.wait_for_selector("#focus:not([hidden])")
    find(page, "[data-bookmark='2']")
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(150)
        sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        assert sizes[0] <= sizes[1], (width, "nothing to scroll sideways")
        box = page.locator("#wall").bounding_box()
        assert box["x"] >= 0, width
        assert box["x"] + box["width"] <= width, width
        assert box["width"] >= 0.35 * width, width
        assert page.evaluate(CROWDED) == [], width
        if width < 900:  # a finger's tip, 44 CSS pixels, finds each of them
            sizes = page.evaluate("""() => [...document.querySelectorAll('button, .button, .choice label')]
              .filter((e) => e.offsetParent).map((e) => e.getBoundingClientRect()).map((r) => [r.width, r.height])""")
            assert min(map(min, sizes)) >= 44, width


def test_cameras_are_kept_and_gone_back_to(page, source):
    page.click("#keep")
    find(page, "[data-bookmark='1']")
    page.keyboard.press("b")
    find(page, "[data-bookmark='2']")
    page.click("[data-bookmark='1']")
    page.keyboard.press("v")
    eventually(page, lambda: len(source.received) == 4, "all came")
    said = [(command["kind"], command["value"]) for command in source.received]
    assert said == [("bookmark", "1"), ("bookmark", "2"), ("recall", "1"), ("recall", "2")]


def test_help_opens_by_key_and_closes(page, source):
    page.keyboard.press("h")
    find(page, "#help[open]")
    page.keyboard.press("Escape")
    find(page, "#help:not([open])")
    assert source.received == []


def test_controls_have_names_for_those_who_cannot_see_them(page):
    unnamed = page.evaluate("""() => [...document.querySelectorAll('button, input, canvas#plot, #wall')]
      .filter((e) => !(e.getAttribute('aria-label') || e.innerText?.trim() || e.closest('label')?.innerText.trim()))
      .map((e) => e.outerHTML)""")
    assert unnamed == []


def test_script_and_page_see_the_same_status(page, source):
    with urllib.request.urlopen(source.sink.address + "status.json") as answer:
        status = json.load(answer)
    assert status["viewers"] == 1
    assert status["sampler"] == "hilbert"
