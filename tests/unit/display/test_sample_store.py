"""Samples for displays that make images themselves: which are sent, and as which bytes."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.display.base import PanelSamples
from wall.display.sample_store import INFINITE, Samples, SampleStore, codes_of_halves, halves
from wall.display.stream import MORE, SAMPLES_COUNTS, encode_samples
from wall.reconstruction.display_values import update_display

TONES = (Tone(), Tone(-6.0), Tone(0.3), Tone(5.0), Tone(0.5, "aces"), Tone(-1.0, "reinhard"))


def wall_codes(radiance, tone):
    """(n, 3) uint8: what the wall shows of (n, 3) light."""
    rgb = np.zeros((1, len(radiance), 3), np.uint8)
    if len(radiance):
        update_display(radiance[None], np.ones((1, -(-len(radiance) // 16)), bool), 16, rgb, tone=tone)
    return rgb[0]


@pytest.mark.parametrize("tone", TONES, ids=str)
def test_every_half_float_shows_as_on_the_wall(tone):
    light = np.arange(INFINITE, dtype=np.uint16).view(np.float16).astype(np.float32)  # without infinity
    shown = wall_codes(np.repeat(light[:, None], 3, axis=1), tone)[:, 0]
    assert np.array_equal(codes_of_halves(float(tone.gain), tone.mapping)[:-1], shown)


@pytest.mark.parametrize("tone", TONES, ids=str)
def test_the_half_float_sent_is_a_neighbour_that_shows_as_the_light_does(tone):
    rng = np.random.default_rng(3)
    radiance = np.exp(rng.uniform(np.log(1e-9), np.log(1e5), (200_000, 3))).astype(np.float32)
    radiance[:3] = 0.0, -1.0, np.float32(65_519.0)
    bits = halves(radiance, wall_codes(radiance, tone), tone)

    assert np.array_equal(codes_of_halves(float(tone.gain), tone.mapping)[bits], wall_codes(radiance, tone))
    nearest = np.clip(radiance, 0.0, 65_504.0).astype(np.float16).view(np.uint16)
    assert np.abs(bits.astype(int) - nearest).max() <= 1


def taken(store, pixels, value, tone=AS_IT_IS):
    radiance = np.full((len(pixels), 3), value, np.float32)
    image = np.zeros((4, 6, 3), np.uint8)
    image.reshape(-1, 3)[pixels] = wall_codes(radiance, tone)
    store.take(PanelSamples(panel=0, pixels=np.array(pixels, np.int64), radiance=radiance, tone=tone), image)


def test_who_missed_samples_gets_of_each_pixel_the_newest_once():
    store = SampleStore(6, 4)
    taken(store, range(24), 0.0)
    early, first = store.since(None)
    assert first.pixels.tolist() == list(range(24))
    for k in range(1, 50):
        taken(store, [3, 5, k % 4], k / 64)
    late, samples = store.since(early)
    assert samples.pixels.tolist() == [0, 1, 2, 3, 5]
    assert samples.light.view(np.float16)[:, 0].tolist() == [48 / 64, 49 / 64, 46 / 64, 49 / 64, 49 / 64]
    assert store.since(late)[1].pixels.size == 0


def test_another_exposure_is_news_without_samples():
    store = SampleStore(6, 4)
    taken(store, range(24), 0.25)
    before, _ = store.since(None)
    taken(store, [], 0.0)
    assert store.version == before
    taken(store, [], 0.0, tone=Tone(2.0))
    after, samples = store.since(before)
    assert (after > before, samples.pixels.size, samples.tone) == (True, 0, Tone(2.0))


@given(st.sets(st.integers(0, 5000), max_size=40), st.booleans())
def test_pixels_are_decoded_as_the_page_does(found, whole):
    pixels = np.array(sorted(found), np.uint32)
    light = np.arange(3 * len(pixels), dtype=np.uint16).reshape(-1, 3)
    data = zlib.decompress(encode_samples(Samples(pixels, light, Tone(1.0)), whole=whole))

    gain, mapping, count, coded = SAMPLES_COUNTS.unpack_from(data)
    assert (gain, mapping, count, len(data)) == (2.0, 0, len(pixels), SAMPLES_COUNTS.size + 6 * count + coded)
    assert np.array_equal(np.frombuffer(data, "<u2", 3 * count, SAMPLES_COUNTS.size), light.ravel())
    decoded, pixel = [], -1
    for step in data[SAMPLES_COUNTS.size + 6 * count :]:
        pixel += step
        if step < MORE:
            decoded.append(pixel)
    assert decoded == ([] if whole else pixels.tolist())
