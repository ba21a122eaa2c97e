"""The page as a display of samples, in a real Chromium: what WebGL2 draws is the wall's image, byte for byte."""

from __future__ import annotations

from base64 import b64decode, b64encode
from contextlib import closing
from io import BytesIO

import numpy as np
import pytest
from page_input import eventually
from PIL import Image

from wall.config.screens import GridConfig, WallConfig
from wall.core.colour import CURVE_STEPS, srgb_curve
from wall.core.tone_mapping import TONE_MAPPINGS, Tone, tone_mapped
from wall.display.base import PanelImage, PanelSamples, Status, WallImage
from wall.display.browser import Browser
from wall.display.sample_store import Samples, codes_of_halves, halves
from wall.display.stream import encode_samples, samples_message
from wall.display.tiles import updated
from wall.geometry.expanding import expand

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 310, 170
PNG = "() => [...document.querySelectorAll('.panel canvas')].map((c) => c.toDataURL().split(',')[1])"
STATUS = Status(
    seconds=1.0, paused=False, sampler="frameless", samplers=("frameless", "adaptive"), ranks=(),
    latency_ms=(0.0, 0.0, 0.0), latencies_ms=(), refreshes_per_s=30.0, view_samplers=("frameless",),
)  # fmt: skip
WORDS = "document.getElementById('display-words').textContent"
LOSE = """() => { const own = WebGL2RenderingContext.prototype.drawArrays;
  WebGL2RenderingContext.prototype.drawArrays = function (...all) {
    own.apply(this, all);
    this.getExtension("WEBGL_lose_context")?.loseContext(); }; }"""
PAINT = """async (messages) => { const { Painter, unpack } = await import("./painter.js"), painter = new Painter();
  const context = Object.assign(document.createElement("canvas"), { width: 2, height: 2 }).getContext("2d");
  for (const text of messages) painter.take(await unpack(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer));
  painter.draw(0, context);
  painter.close();
  return [...context.getImageData(0, 0, 2, 2).data]; }"""
NO_WEBGL2 = """HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext,
  { apply: (own, self, [kind, ...more]) => (kind === "webgl2" ? null : Reflect.apply(own, self, [kind, ...more])) });"""


def codes(radiance, tone):
    """What a wall shows of light: see wall.operators.kernels.pixels.encode_row."""
    exposed = np.clip(tone_mapped(tone.gain * radiance, tone.mapping), np.float32(0.0), np.float32(1.0))
    return srgb_curve()[(np.sqrt(exposed) * np.float32(CURVE_STEPS) + np.float32(0.5)).astype(int)]


class Panels:
    """Panels whose pixels show their newest samples, handed to the page as a compositor does."""

    def __init__(self, count):
        self.wall = expand(WallConfig(grid=GridConfig(columns=count, rows=1, pixels=(WIDTH, HEIGHT), size=(0.3, 0.2))))
        self.browser = Browser("127.0.0.1", 0, self.wall, why_images=[""] * count)
        self.rng, self.tone, self.handed, self.version = np.random.default_rng(1), Tone(), False, 0
        self.radiance = [np.zeros((HEIGHT, WIDTH, 3), np.float32) for _ in range(count)]
        self.images = [
            PanelImage(id=p.id, rgb=np.zeros((HEIGHT, WIDTH, 3), np.uint8), screen=p.screen, version=0)
            for p in self.wall.panels
        ]

    def step(self, samples, *, reprojected=(), whole=False):
        """New samples of every panel, handed on but for `reprojected` ones; `whole`: with every pixel."""
        self.version += 1
        handed = []
        for k, radiance in enumerate(self.radiance):
            pixels = np.unique(self.rng.integers(0, HEIGHT * WIDTH, samples))
            light = (4.0 * self.rng.random((len(pixels), 3)) ** 4).astype(np.float32)  # dark ones, and more than white
            radiance.reshape(-1, 3)[pixels] = light
            self.images[k] = updated(self.images[k], codes(radiance, self.tone), self.version)
            if whole or not self.handed:
                pixels, light = np.arange(HEIGHT * WIDTH), radiance.reshape(-1, 3).copy()
            handed.append(PanelSamples(panel=k, pixels=pixels, radiance=light, tone=self.tone))
        self.handed = self.browser.wants_samples
        self.browser.show(
            WallImage(
                width=self.wall.width, height=self.wall.height, panels=tuple(self.images), time=0.0, camera_event=0,
                scene_event=0, samples=tuple(s for s in handed if s.panel not in reprojected) if self.handed else (),
            ), STATUS,
        )  # fmt: skip

    def differs(self, page, of=(0, 1)):
        """The largest difference of canvases from the wall's bytes, and the share of bytes that differ."""
        drawn = page.evaluate(PNG)
        rgb = [np.array(Image.open(BytesIO(b64decode(drawn[k]))).convert("RGB"), np.int16) for k in of]
        off = np.abs(np.array(rgb) - np.array([self.images[k].rgb for k in of]))
        return int(off.max()), float((off > 0).mean())


@pytest.fixture
def panels():
    panels = Panels(2)
    with closing(panels.browser):
        yield panels


@pytest.fixture
def page(chromium, panels):
    page = chromium.new_page()
    page.complaints = []
    page.on("console", lambda m: m.type in ("error", "warning") and page.complaints.append(m.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(panels.browser.address)
    panels.step(2000)
    page.wait_for_selector(".panel canvas")
    yield page
    page.close()


def ask(page, panels):
    """Ask for samples by the key, and wait until they come."""
    page.keyboard.press("s")
    eventually(page, lambda: panels.browser.wants_samples, "the server to know")
    panels.step(0)
    page.wait_for_function("() => document.body.dataset.sampled === '2'")


def test_samples_paint_the_wall_s_image_exactly(page, panels):
    ask(page, panels)
    for _ in range(20):
        panels.step(1500)
        page.wait_for_timeout(15)
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "every byte as on the wall")
    complaints = [text for text in page.complaints if "ReadPixels" not in text]  # no GPU here: slow, says the driver
    assert complaints == []


def test_exposure_is_the_page_s_own_and_at_most_one_step_off(page, panels):
    """Light is kept as half floats: under another exposure a byte in a thousand is next to the wall's."""
    panels.step(30_000)
    ask(page, panels)
    eventually(page, lambda: panels.differs(page)[0] == 0, "the first exposure")
    sent = panels.browser.sent_bytes
    panels.tone = Tone(1.5)
    panels.step(0)
    eventually(page, lambda: panels.differs(page)[0] <= 1, "the second exposure")
    assert panels.differs(page)[1] < 0.005
    assert panels.browser.sent_bytes - sent < 50  # not one sample
    panels.radiance = [np.zeros_like(each) for each in panels.radiance]
    panels.step(0, whole=True)
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "new samples are exact")
    panels.step(30_000)
    for mapping in TONE_MAPPINGS[1:]:
        panels.tone = Tone(2.0, mapping)
        panels.step(0)
        eventually(page, lambda: panels.differs(page)[0] <= 1, mapping)
        assert panels.differs(page)[1] < 0.02, mapping


def test_a_panel_that_hands_on_no_samples_comes_as_an_image_and_back(page, panels):
    ask(page, panels)
    panels.step(1500, reprojected=[1])
    page.wait_for_function(f"() => {WORDS}.startsWith('1 of 2 panels come as images')")
    eventually(page, lambda: panels.differs(page, [0]) == (0, 0.0), "the one by samples")
    eventually(page, lambda: panels.differs(page, [1]) == (0, 0.0), "the other exact, as it rests")
    panels.step(1500, whole=True)
    page.wait_for_function(f"() => {WORDS}.startsWith('Made by this page')")
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "both by samples")
    page.keyboard.press("s")
    eventually(page, lambda: not panels.browser.wants_samples, "images again")
    panels.step(0)
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "both by images, as they rest")


def test_without_webgl2_the_page_says_so_and_shows_images(chromium, panels):
    page = chromium.new_page()
    page.add_init_script(NO_WEBGL2)
    page.goto(panels.browser.address)
    panels.step(1500)
    page.wait_for_selector(".panel canvas")
    page.keyboard.press("s")
    page.wait_for_function(f"() => {WORDS}.startsWith('This browser cannot make images of samples (no WebGL2)')")
    panels.step(1500)
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "images")
    assert not panels.browser.wants_samples
    assert page.locator("#displays input:checked").input_value() == "images"
    page.close()


def test_a_lost_context_brings_images_back(page, panels):
    ask(page, panels)
    page.evaluate(LOSE)
    panels.step(100)
    page.wait_for_function(f"() => {WORDS}.startsWith('The browser took WebGL2 away')")
    panels.step(1500)
    eventually(page, lambda: panels.differs(page) == (0, 0.0), "images")


def test_samples_in_any_order_end_in_the_newest(page, panels):
    """Messages as the server makes them, turned round by the test: older samples do not come over newer ones."""
    messages, light = [], np.zeros((4, 3), np.float32)
    for version, pixels in enumerate(([0, 1, 2, 3], [0, 1], [1, 2], [1, 2, 3]), 1):
        light[pixels] = version / 8
        bits = halves(light[pixels], codes(light[pixels], Tone()), Tone())
        samples = Samples(np.array(pixels, np.uint32), bits, Tone())
        encoded = encode_samples(samples, whole=version == 1)
        messages.append(samples_message(0, (2, 2), encoded=encoded, version=version, number=version))
    drawn = page.evaluate(PAINT, [b64encode(messages[k]).decode() for k in (0, 3, 1, 2)])
    assert np.array_equal(np.array(drawn).reshape(4, 4)[:, :3], codes(light, Tone()))


def test_page_and_server_agree_what_every_half_float_shows_as(page):
    for tone in (Tone(), Tone(-7.3), Tone(0.3), Tone(5.0), Tone(0.0, "reinhard"), Tone(1.7, "aces")):
        gain, code = float(tone.gain), tone.code
        found = page.evaluate("async (all) => [...(await import('./painter.js')).codesOfHalves(...all)]", [gain, code])
        assert np.array_equal(found, codes_of_halves(gain, tone.mapping)), tone
