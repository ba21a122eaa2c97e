"""Compact packets with normals and lamps (layout 2): normals come back within 2 of 127, lamps as they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from packet_examples import (
    batch_of,
    batches,
    check_cut,
    check_flipped_bits,
    check_sane,
    facing_samples,
    plain_samples,
    resealed,
)

from wall.core.data import SAMPLE, Batch, Float64, Rect, Samples
from wall.core.errors import RemoteProtocolError
from wall.packets import compact as body
from wall.packets.kernels import compact_write as kernels
from wall.packets.kernels.bit_planes import LONGEST_CODE
from wall.packets.kernels.normals import normal_code, normal_of
from wall.packets.samples import decode, encode

RECT = Rect(x=0, y=0, width=480, height=270)
NUMBERS = (RECT.x, RECT.y, RECT.width, RECT.height)
WIRE_STEPS = 2 / 127  # of a component: 127/31 and two roundings are at most 2.55 apart, and both ends are whole
WIRE_ANGLE = np.sqrt(18) * WIRE_STEPS  # see octahedral()
SENT_LIGHTS = np.uint32(0xFFFF)  # bits of the light visibility mask that packets bring


def octahedral(codes: NDArray[np.int64]) -> Float64:
    """(n, 3) float64 unit normals of (n, 2) codes of -127 to 127.

    A step of e in both components moves a point of the octahedron by at most sqrt(e^2 + e^2 + (2 e)^2), and none of its
    points is nearer to the centre than 1 / sqrt(3): at most sqrt(18) e radians.
    """
    u, v = codes.T / 127
    z = 1 - np.abs(u) - np.abs(v)
    fold = np.maximum(-z, 0)
    n = np.stack([u - np.where(u >= 0, fold, -fold), v - np.where(v >= 0, fold, -fold), z], axis=1)
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True), np.float64)


def placed(samples: Samples) -> Samples:
    """By pixel; those of one pixel as they were."""
    return samples[np.lexsort(np.floor(samples["xy"]).T)]


def check_facing(sent: Samples, came: Samples) -> None:
    a, b = placed(sent), placed(came)
    assert np.abs(np.maximum(a["normal"].astype(int), -127) - b["normal"]).max(initial=0) <= 2
    assert (a["light_visibility"] & SENT_LIGHTS == b["light_visibility"] & SENT_LIGHTS).all()


def lit(samples: Samples, rect: Rect = RECT) -> Batch:
    return batch_of(samples, rect=rect, adaptive=True, relightable=True)


@pytest.mark.parametrize("n", [0, 1, 2, 16, 300, 3000])
def test_normals_come_back_within_two_steps_and_lamps_exactly(n: int) -> None:
    samples = facing_samples(n)
    came = decode(encode(lit(samples)))
    assert came.relightable
    check_facing(samples, came.samples)


@given(batch=batches(), data=st.data())
@settings(max_examples=60, deadline=None)
def test_any_batch_brings_its_normals_and_lamps(batch: Batch, data: st.DataObject) -> None:
    for name, values in (("normal", st.integers(-128, 127)), ("light_visibility", st.integers(0, 2**32 - 1))):
        column = batch.samples[name].ravel()
        batch.samples[name] = np.reshape([data.draw(values) for _ in column], batch.samples[name].shape)
    came = decode(encode(replace(batch, adaptive=True, relightable=True)))
    check_facing(batch.samples, came.samples)
    check_sane(came)


def test_all_else_is_the_same_with_and_without_normals() -> None:
    samples = facing_samples(500)
    with_them, without = decode(encode(lit(samples))).samples, decode(encode(batch_of(samples, adaptive=True)))
    assert not without.relightable
    assert not without.samples["normal"].any()
    assert not without.samples["light_visibility"].any()
    for name in ("xy", "radiance", "depth", "time", "object_id", "change"):
        assert (with_them[name] == without.samples[name]).all()


def test_every_normal_turns_by_less_than_its_bound() -> None:
    one = np.arange(-127, 128)
    through = np.array([normal_of(normal_code(np.int8(k))) for k in one])
    assert (through == np.rint(np.rint(one * 31 / 127) * 127 / 31)).all()
    u, v = np.meshgrid(np.arange(255), np.arange(255))
    before = octahedral(np.stack([one[u].ravel(), one[v].ravel()], axis=1))
    after = octahedral(np.stack([through[u].ravel(), through[v].ravel()], axis=1))
    angles = np.arcsin(np.minimum(np.linalg.norm(np.cross(before, after), axis=1), 1.0))
    assert ((before * after).sum(axis=1) > 0).all()
    assert 0.8 * WIRE_ANGLE < angles.max() <= WIRE_ANGLE


def test_a_normal_that_was_sent_once_does_not_change_when_it_is_sent_again() -> None:
    once = np.array([normal_of(normal_code(np.int8(k))) for k in range(-128, 128)])
    assert [normal_of(normal_code(np.int8(k))) for k in once] == once.tolist()
    assert (once.min(), once.max()) == (-127, 127)


def test_tiles_of_one_normal_and_one_light_cost_two_bits() -> None:
    samples = plain_samples(600)
    samples["light_visibility"] = 2**32 - 1
    tiles = len({tuple(k) for k in (samples["xy"] // 16).astype(int).tolist()})
    more = len(encode(lit(samples))) - len(encode(batch_of(samples, adaptive=True)))
    assert 8 * more <= 2 * tiles + 31


def test_samples_that_differ_as_much_as_they_can_fit_the_space_that_is_set_aside() -> None:
    rng = np.random.default_rng(6)
    n = 600
    samples = np.zeros(n, SAMPLE)
    samples["xy"] = rng.random((n, 2)) * 4095.9
    samples["radiance"] = rng.choice([0.0, 65408.0], (n, 3))
    samples["depth"] = rng.choice(np.float32([1e-38, 3e38, np.inf]), n)
    samples["object_id"] = rng.integers(0, 16384, n)
    samples["time"], samples["change"] = rng.choice([0.0, 1.0], n), rng.choice([0.0, 1.0], n)
    samples["normal"] = rng.choice([-127, 127], (n, 2))
    samples["light_visibility"] = rng.choice(np.uint32([0, 2**32 - 1]), n)
    most = kernels.WORDS_A_SAMPLE * n + kernels.WORDS_BESIDE
    words = np.full(2 * most, 0xDEADBEEF, np.uint32)

    written = kernels.encode(samples, (0, 0, 4096, 4096), True, body.TABLES, words)[0]

    assert 4 * n < written < most
    assert (words[most:] == 0xDEADBEEF).all()


def test_no_sample_can_need_more_words_than_are_set_aside() -> None:
    """Eleven escaped numbers of layout 1, two of a normal, one of lamps; flags, sub-pixel, any object, if it turned."""
    others = kernels.LIT_FLAG_BITS + 6 + kernels.OBJECT_BITS + 1
    assert 14 * LONGEST_CODE + others <= 32 * kernels.WORDS_A_SAMPLE


def written(samples: Samples, row: int, code: int) -> tuple[bytes, int, float]:
    """A body whose third sample has another code in one row of columns; its depth base and time span."""
    keys, subpixels = np.empty(len(samples), np.uint32), np.empty((len(samples), 2), np.int32)
    kernels.places(samples, NUMBERS, body.TABLES[0], keys, subpixels)
    order, columns = kernels.sorted_order(keys), np.empty((10, len(samples)), np.int32)
    packed = body.pack(samples, RECT, lit=True)
    kernels.codes(samples, order, subpixels, packed.depth_base, np.float32(packed.span), body.TABLES, columns)
    columns[row, 2] = code
    words = np.empty(40 * len(samples), np.uint32)
    return words[: kernels.write(keys, order, subpixels, columns, words)].tobytes(), packed.depth_base, packed.span


@pytest.mark.parametrize(("row", "largest"), [(7, 31), (8, 31), (9, 65535)])
def test_normals_and_lamps_out_of_their_range_are_refused(row: int, largest: int) -> None:
    samples = facing_samples(5)
    for code, good in [(largest, True), (largest + 1, False), (1 << 20, False)] + [(-32, False)] * (row < 9):
        data, base, span = written(samples, row, code)
        came = body.unpack(memoryview(data), 5, rect=RECT, depth_base=base, depth_bits=11, span=span, lit=True)
        assert (came is not None) == good


def packet_of(n: int) -> bytes:
    return encode(lit(facing_samples(n)))


def test_every_flipped_bit_under_a_valid_checksum_is_refused_or_harmless() -> None:
    check_flipped_bits(packet_of(6))


@pytest.mark.parametrize("cut", [1, 4, 8, 40])
def test_a_body_that_is_too_short_or_too_long_is_refused(cut: int) -> None:
    check_cut(packet_of(60), cut, samples=60)


@pytest.mark.parametrize("layout", [1, 2])
def test_a_body_read_in_the_other_layout_is_refused_or_harmless(layout: int) -> None:
    samples = facing_samples(40)
    changed = bytearray(encode(lit(samples) if layout == 1 else batch_of(samples, adaptive=True)))
    changed[8] = layout
    with pytest.raises(RemoteProtocolError, match="is not 40 samples"):
        decode(resealed(changed))
