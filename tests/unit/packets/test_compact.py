"""The compact layout: every sample comes back once, in its place, within the bounds of docs/guide/packet_format.md."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from packet_examples import (
    HEADER,
    SMALLEST_NORMAL,
    TIME_ROUNDING,
    batch_of,
    batches,
    check_flipped_bits,
    check_sane,
    plain_samples,
    resealed,
)

from wall.core.data import SAMPLE, Batch, Float64, Rect, Samples
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets.colour_curve import make_colour_curve
from wall.packets.kernels import colour_codes
from wall.packets.kernels import compact_body as kernels
from wall.packets.samples import Codec, decode, encode

HALF_CODE = 0.51  # the exact curve bends between whole codes, most at code 10.3
RECT = Rect(x=0, y=0, width=480, height=270)


def curve_position(colour: Float64) -> Float64:
    """Position on the curve of colour codes, exactly (between whole codes the packet's curve is straight)."""
    low = np.clip(colour, 0.0, 65408.0)
    srgb = np.where(low <= 0.0031308, 12.92 * low, 1.055 * np.maximum(low, 1e-9) ** (1 / 2.4) - 0.055)
    return np.where(low <= 1.0, 255 * srgb, 255 + 80 * np.log2(np.maximum(low, 1.0)))


def morton_code(x: int, y: int) -> int:
    """The Morton code of a sub-pixel: bits of x and y in turn, x lowest."""
    return int("".join(b + a for a, b in zip(f"{x:015b}", f"{y:015b}", strict=True)), 2)


def in_order(samples: Samples, rect: Rect) -> Samples:
    """Samples by object and sub-pixel, those of one sub-pixel as they were."""
    eighths = np.floor((np.float64(samples["xy"]) - (rect.x, rect.y)) * 8).astype(int)
    codes = np.array([morton_code(x, y) for x, y in eighths.tolist()], np.int64)
    return samples[np.lexsort((codes, samples["object_id"]))]


def check_compact(sent: Batch, came: Batch) -> None:
    a, b = in_order(sent.samples, sent.rect), came.samples
    assert len(a) == len(b)
    assert (np.abs(np.float64(a["xy"]) - b["xy"]) <= 1 / 16).all()
    assert (np.floor(a["xy"]) == np.floor(b["xy"])).all()
    error = np.abs(curve_position(np.float64(a["radiance"])) - curve_position(np.float64(b["radiance"])))
    assert (error <= HALF_CODE).all()
    finite = np.isfinite(a["depth"])
    assert (np.isinf(b["depth"]) == ~finite).all()
    depth = np.float64(a["depth"][finite])
    assert (np.abs(depth - b["depth"][finite]) <= np.maximum(depth * 2.0**-12, SMALLEST_NORMAL)).all()
    assert (b["object_id"] == a["object_id"]).all()
    span = float(a["time"].max(initial=0.0))
    assert (np.abs(np.float64(a["time"]) - b["time"]) <= max(span / 126 * TIME_ROUNDING, 1e-30)).all()
    assert (np.abs(a["change"] - b["change"]) <= 1 / 30 + 1e-6).all()
    assert not b["sqrt_irradiance"].any()


def through(samples: Samples, *, rect: Rect = RECT) -> Samples:
    """What arrives, its bounds checked."""
    batch = batch_of(samples, rect=rect, adaptive=True)
    came = decode(encode(batch))
    check_compact(batch, came)
    return came.samples


def tile_samples(n: int, seed: int = 3) -> Samples:
    """(n,) samples in sixteens inside tiles, of three objects, as the adaptive sampler sends them."""
    rng = np.random.default_rng(seed)
    samples = plain_samples(n, seed=seed)
    tiles = rng.integers(0, (30, 16), (-(-n // 16), 2)).repeat(16, axis=0)[:n] * 16
    samples["xy"] = tiles + rng.random((n, 2)) * 15.99
    samples["object_id"] = 40 + (np.linspace(0, 20, n).astype(int) % 3)
    samples["change"] = np.maximum(rng.random(n) * 4 - 3, 0)
    return samples


@given(batch=batches())
@settings(max_examples=150, deadline=None)
def test_any_batch_comes_back_within_the_stated_bounds(batch: Batch) -> None:
    batch = replace(batch, adaptive=True)
    came = decode(encode(batch))
    check_compact(batch, came)
    check_sane(came)


@pytest.mark.parametrize("n", [0, 1, 2, 16, 17, 300, 1500])
def test_tiles_of_samples_come_back_within_the_stated_bounds(n: int) -> None:
    through(tile_samples(n))


def test_a_packet_of_the_most_samples_comes_back(compiled_only: None) -> None:
    through(plain_samples(65536))


@pytest.mark.parametrize("rect", [Rect(x=65535, y=65535, width=4096, height=4096), Rect(x=7, y=3, width=17, height=1)])
def test_corners_of_the_rectangle_stay_in_their_pixels(rect: Rect) -> None:
    samples = np.zeros(4, SAMPLE)
    last = [np.nextafter(np.float32(k), np.float32(0)) for k in (rect.x + rect.width, rect.y + rect.height)]
    samples["xy"] = [(rect.x, rect.y), (last[0], rect.y), (rect.x, last[1]), last]
    through(samples, rect=rect)


def test_samples_of_one_pixel_keep_their_order() -> None:
    samples = np.zeros(40, SAMPLE)
    samples["xy"] = 100.3, 77.7
    samples["depth"] = np.arange(1, 41)
    assert (np.diff(through(samples)["depth"]) > 0).all()


def test_the_worst_errors_come_near_their_bounds() -> None:
    samples = plain_samples(4000)
    a, b = in_order(samples, RECT), through(samples)
    assert np.abs(np.float64(a["xy"]) - b["xy"]).max() > 0.99 / 16
    positions = [curve_position(np.float64(s["radiance"])) for s in (a, b)]
    assert np.abs(positions[0] - positions[1]).max() > 0.495
    finite = np.isfinite(a["depth"])
    assert np.abs(b["depth"][finite] / np.float64(a["depth"][finite]) - 1).max() > 0.98 * 2.0**-12


def test_colours_of_every_size_stay_within_half_a_code() -> None:
    tops = np.concatenate([np.geomspace(2.0**-30, 7e4, 1200), make_colour_curve().colour_of_code[:1536:5, 0]])
    samples = np.zeros(len(tops), SAMPLE)
    samples["xy"] = np.random.default_rng(1).random((len(tops), 2)) * (480, 270)
    samples["radiance"] = np.float32(tops[:, None] * (1.0, 0.3, -1.0))
    through(samples)


def test_a_flat_colour_is_right_on_average() -> None:
    """Rounded without dither, 0.3 of a code would stay off by 0.3; the mean of 10,000 draws is good to 0.003."""
    samples = np.zeros(10_000, SAMPLE)
    samples["xy"] = np.random.default_rng(1).random((10_000, 2)) * (480, 270)
    codes = np.array([100.3, 181.5, 240.7])
    samples["radiance"] = np.float32(((codes / 255 + 0.055) / 1.055) ** 2.4)
    assert np.abs(curve_position(np.float64(through(samples)["radiance"])).mean(axis=0) - codes).max() < 0.012


@pytest.mark.parametrize("span", [0.0, 1e-45, 1e-36, 0.001, 999999.0])
def test_times_stay_within_a_126th_of_their_span(span: float) -> None:
    samples = tile_samples(400)
    samples["time"] = np.linspace(0.0, span, 400)[np.random.default_rng(2).permutation(400)]
    through(samples)


def test_object_ids_are_exact() -> None:
    samples = plain_samples(10)
    samples["object_id"] = ids = [0, 1, 16382, 16383, 16384, 20001, 32767, 65536, 2**31, 2**32 - 1]
    assert sorted(through(samples)["object_id"].tolist()) == ids


def test_every_sample_may_be_of_another_object(compiled_only: None) -> None:
    samples = plain_samples(65536)
    samples["object_id"] = np.random.default_rng(3).permutation(65536) * 65537
    through(samples)


def test_samples_that_differ_as_much_as_they_can_are_carried() -> None:
    rng = np.random.default_rng(6)
    samples = np.zeros(600, SAMPLE)
    samples["xy"] = rng.random((600, 2)) * 4095.9
    samples["radiance"] = rng.choice([0.0, 65408.0], (600, 3))
    samples["depth"] = rng.choice(np.float32([1e-38, 3e38, np.inf]), 600)
    samples["object_id"] = rng.integers(0, 2**32, 600)
    samples["time"], samples["change"] = rng.choice([0.0, 1.0], 600), rng.choice([0.0, 1.0], 600)
    through(samples, rect=Rect(x=0, y=0, width=4096, height=4096))


def test_a_codec_is_not_applied_to_it() -> None:
    batch = batch_of(tile_samples(200), adaptive=True)
    assert encode(batch, Codec.ZSTD) == encode(batch, Codec.NONE)


def test_spread_bits_stand_in_every_second_bit_and_come_back() -> None:
    for number in (0, 1, 2, 5, 0x1234, 0x7FFF, 0xFFFF):
        spread = kernels.spread_bits(np.int64(number))
        assert spread == morton_code(number & 0x7FFF, 0) | (number >> 15) << 30
        assert kernels.gather_bits(spread) == kernels.gather_bits(spread | 0xAAAAAAAA) == number


def test_the_dither_is_the_document_s() -> None:
    for x, y in [(0, 0), (84, 162), (32767, 32767), (1, 32767), (32767, 0)]:
        h = (x * 2**16 + y) * 0x9E3779B1 % 2**32
        h ^= h >> 15
        h = h * 0x85EBCA77 % 2**32
        h ^= h >> 13
        bits = colour_codes.dither_bits(np.int64(x), np.int64(y))
        for shift in (0, 10, 20):
            assert colour_codes.dither(bits >> shift) == ((h >> shift) % 1024 + 0.5) / 1024


def test_sorting_is_stable_and_growing() -> None:
    keys = np.random.default_rng(7).integers(0, 2**32, 500).astype(np.uint32)
    keys[::3] = keys[0]
    assert (kernels.sorted_by(keys, np.arange(500)) == np.argsort(keys, kind="stable")).all()
    assert kernels.sorted_by(keys[:0], np.arange(0)).tolist() == []


@pytest.mark.parametrize(
    ("field", "value"),
    [("xy", (480.0, 1.0)), ("xy", (np.nan, 1.0)), ("radiance", (np.nan, 0, 0)), ("depth", -1.0), ("time", np.inf)],
)
def test_a_sample_that_cannot_be_carried_is_refused(field: str, value: object) -> None:
    samples = plain_samples(5)
    samples[3][field] = value
    with pytest.raises(LocalProtocolError, match="rank 2 packet 812: 1 of 5 samples"):
        encode(batch_of(samples, adaptive=True))


def packet_of(n: int) -> bytes:
    return encode(batch_of(tile_samples(n), adaptive=True))


def recompressed(packet: bytes, change: Callable[[bytearray], None]) -> bytes:
    """A packet whose body was changed before compression, its length and checksum right."""
    body = bytearray(zstandard.decompress(packet[HEADER:]))
    change(body)
    return resealed(packet[:HEADER] + zstandard.compress(bytes(body)))


def test_every_flipped_bit_of_what_was_compressed_is_refused_or_harmless() -> None:
    packet = packet_of(6)
    outcomes = set()
    for bit in range(8 * len(zstandard.decompress(packet[HEADER:]))):

        def flip(body: bytearray, bit: int = bit) -> None:
            body[bit // 8] ^= 1 << bit % 8

        try:
            check_sane(decode(recompressed(packet, flip)))
            outcomes.add("accepted")
        except RemoteProtocolError:
            outcomes.add("refused")
    assert outcomes == {"accepted", "refused"}


def test_every_flipped_bit_under_a_valid_checksum_is_refused_or_harmless() -> None:
    check_flipped_bits(packet_of(6))


@pytest.mark.parametrize("cut", [1, 4, 8, 40])
def test_a_body_that_is_too_short_or_too_long_is_refused(cut: int) -> None:
    packet = packet_of(60)
    for wrong in (packet[:-cut], packet + bytes(cut)):
        with pytest.raises(RemoteProtocolError, match="rank 2 packet 812: body"):
            decode(resealed(wrong))
    for change in (lambda body: body.extend(bytes(cut)), lambda body: body.__delitem__(slice(-cut, None))):
        with pytest.raises(RemoteProtocolError, match="is not 60 samples"):
            decode(recompressed(packet, change))


@pytest.mark.parametrize("fill", [b"\x00", b"\xff", b"\x55"])
def test_a_body_of_one_byte_repeated_is_refused(fill: bytes) -> None:
    packet = packet_of(60)
    with pytest.raises(RemoteProtocolError):
        decode(resealed(packet[:HEADER] + fill * (len(packet) - HEADER)))
    with pytest.raises(RemoteProtocolError):
        decode(recompressed(packet, lambda body: body.__setitem__(slice(None), fill * len(body))))


def test_a_short_body_cannot_ask_for_much_memory() -> None:
    changed = bytearray(packet_of(6))
    changed[82:86] = (65536).to_bytes(4, "little")
    bombs = [changed, packet_of(6)[:HEADER] + zstandard.compress(bytes(1 << 28))]
    for bomb in bombs:
        packet = resealed(bomb)
        tracemalloc.start()
        try:
            with pytest.raises(RemoteProtocolError):
                decode(packet)
            assert tracemalloc.get_traced_memory()[1] < 1 << 16
        finally:
            tracemalloc.stop()


@pytest.mark.parametrize("channels", [0, 1, 31, 64 | 63, 256 | 63, 0xFFFF])
def test_channels_that_are_not_known_are_refused(channels: int) -> None:
    changed = bytearray(packet_of(6))
    changed[8:10] = channels.to_bytes(2, "little")
    with pytest.raises(
        RemoteProtocolError, match=f"channels {channels:#x} in layout 1.*wanted 0xb and any of 0x214 in layout 0"
    ):
        decode(resealed(changed))
