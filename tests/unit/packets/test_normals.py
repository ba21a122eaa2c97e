"""Compact packets with normals and light visibility masks: normals come back within 2 of 127, masks as they were."""

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
    check_flipped_bits,
    check_sane,
    plain_samples,
    relightable_samples,
    resealed,
)

from wall.core.data import Batch, Float64, Rect, Samples
from wall.core.errors import RemoteProtocolError
from wall.packets import compact_body as body
from wall.packets.kernels import compact_body as kernels
from wall.packets.kernels.normals import normal_code, normal_of
from wall.packets.samples import decode, encode

RECT = Rect(x=0, y=0, width=480, height=270)
WIRE_STEPS = 2 / 127  # of a component: 127/31 and two roundings are at most 2.55 apart, and both ends are whole
WIRE_ANGLE = np.sqrt(18) * WIRE_STEPS  # see octahedral()


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
    """By object and sub-pixel; those of one sub-pixel as they were."""
    return samples[np.lexsort((*np.floor(np.float64(samples["xy"]) * 8).T, samples["object_id"]))]


def check_normals(sent: Samples, came: Samples) -> None:
    a, b = placed(sent), placed(came)
    assert np.abs(np.maximum(a["normal"].astype(int), -127) - b["normal"]).max(initial=0) <= 2
    assert (a["light_visibility"] == b["light_visibility"]).all()


def lit(samples: Samples, rect: Rect = RECT) -> Batch:
    return batch_of(samples, rect=rect, adaptive=True, relightable=True)


@pytest.mark.parametrize("n", [0, 1, 2, 16, 300, 3000])
def test_normals_come_back_within_two_steps_and_masks_exactly(n: int) -> None:
    samples = relightable_samples(n)
    came = decode(encode(lit(samples)))
    assert came.relightable
    check_normals(samples, came.samples)


@pytest.mark.parametrize("n", [0, 1, 300])
def test_noisy_samples_bring_normals_and_albedos_and_no_masks(n: int) -> None:
    samples = relightable_samples(n)
    samples["albedo"] = np.random.default_rng(2).integers(0, 2**24, n)
    came = decode(encode(batch_of(samples, rect=RECT, adaptive=True, noisy=True)))
    assert came.noisy
    assert not came.relightable
    a, b = placed(samples), placed(came.samples)
    assert np.abs(np.maximum(a["normal"].astype(int), -127) - b["normal"]).max(initial=0) <= 2
    assert (a["albedo"] == b["albedo"]).all()
    assert not b["light_visibility"].any()


@given(batch=batches(), data=st.data())
@settings(max_examples=60, deadline=None)
def test_any_batch_brings_its_normals_and_masks(batch: Batch, data: st.DataObject) -> None:
    for name, values in (("normal", st.integers(-128, 127)), ("light_visibility", st.integers(0, 2**32 - 1))):
        column = batch.samples[name].ravel()
        batch.samples[name] = np.reshape([data.draw(values) for _ in column], batch.samples[name].shape)
    came = decode(encode(replace(batch, adaptive=True, relightable=True)))
    check_normals(batch.samples, came.samples)
    check_sane(came)


def test_all_else_is_the_same_with_and_without_normals() -> None:
    samples = relightable_samples(500)
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


def test_one_normal_and_one_light_for_all_cost_a_few_bytes() -> None:
    samples = plain_samples(600)
    samples["light_visibility"] = 2**32 - 1
    more = len(encode(lit(samples))) - len(encode(batch_of(samples, adaptive=True)))
    assert more <= 8


def body_with(samples: Samples, column: int, number: int) -> bytes:
    """A body whose third sample has another number in one column."""
    columns = np.empty((kernels.SURFACE_COLUMNS, len(samples)), np.int32)
    objects = np.empty((2, len(samples)), np.uint32)
    known = kernels.encode(samples, (0, 0, RECT.width, RECT.height), body.CURVE, False, columns, objects)[0]
    columns[column] = 0
    columns.view(np.uint32)[column, 2] = number
    return body._compressed([*objects[:, :known], *columns.view(np.uint32)])


@pytest.mark.parametrize(
    ("column", "largest"), [(kernels.NORMAL_X, 62), (kernels.NORMAL_Y, 62), (kernels.SURFACE, 2**32 - 1)]
)
def test_normals_out_of_their_range_are_refused_and_any_mask_is_taken(column: int, largest: int) -> None:
    """Differences are zigzag codes: 62 is 31, 63 is -32, 64 is 32."""
    samples = relightable_samples(5)
    packed = body.pack(samples, RECT, relightable=True, noisy=False)
    for number in (largest, largest + 1, largest + 2, 1 << 20):
        if number < 2**32:
            data = memoryview(body_with(samples, column, number))
            code = (packed.depth_base, kernels.DEPTH_BITS)
            came = body.unpack(
                data,
                5,
                packed.objects,
                rect=RECT,
                depth_code=code,
                span=packed.span,
                relightable=True,
                noisy=False,
                where="here",
            )
            assert (came is not None) == (number <= largest)


def packet_of(n: int) -> bytes:
    return encode(lit(relightable_samples(n)))


def test_every_flipped_bit_under_a_valid_checksum_is_refused_or_harmless() -> None:
    check_flipped_bits(packet_of(6))


@pytest.mark.parametrize("relightable", [False, True])
def test_a_body_read_with_other_channels_is_refused(relightable: bool) -> None:
    samples = relightable_samples(40)
    changed = bytearray(encode(batch_of(samples, adaptive=True, relightable=relightable)))
    changed[8] ^= 64 | 128
    with pytest.raises(RemoteProtocolError, match="is not 40 samples"):
        decode(resealed(changed))
