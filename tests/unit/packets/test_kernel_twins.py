"""Each packing kernel against NumPy arithmetic on whole columns: logarithms and powers instead of bit operations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from packet_examples import plain_samples

from wall.core.data import SAMPLE, Float32, Samples
from wall.packets.kernels import plain_body as kernels

RECT = (100, 40, 480, 270)
X_BITS = Y_BITS = 5
BASE, BITS = 120, 12
SPAN = np.float32(0.0011)
SCALES = kernels.Scales(X_BITS, Y_BITS, BASE, BITS, SPAN)


def twin_shared_exponent(rgb: Float32) -> NDArray[np.uint32]:
    """The published encoding of RGB9E5 in float64. Source: EXT_texture_shared_exponent, issue 4."""
    c = np.clip(np.float64(rgb), 0.0, 511 / 512 * 2.0**16)
    largest = c.max(axis=1)
    with np.errstate(divide="ignore"):
        exponent = np.maximum(-16, np.floor(np.log2(largest))) + 16
    exponent += np.floor(largest / 2.0 ** (exponent - 24) + 0.5) == 512
    mantissas = np.floor(c / 2.0 ** (exponent - 24)[:, None] + 0.5).astype(np.uint32)
    shifts = np.array([0, 9, 18], np.uint32)
    return (mantissas << shifts).sum(axis=1).astype(np.uint32) | (exponent.astype(np.uint32) << np.uint32(27))


def twin_pack(samples: Samples) -> tuple[NDArray[Any], ...]:
    """Colour, x, y, depth, time codes; times apart from the words that hold them."""
    x, y = (np.floor((np.float64(samples["xy"]) - RECT[:2]) * 2.0**X_BITS).astype(np.uint16)).T
    depth = np.float64(samples["depth"])
    with np.errstate(invalid="ignore", over="ignore"):
        octave = np.floor(np.log2(np.where(np.isinf(depth), 1.0, depth)))
        mantissa = depth / 2.0**octave - 1.0
        code = np.floor((octave + 127 - BASE + mantissa) * 2.0**BITS + 0.5)
    depths = np.where(np.isinf(depth), 0xFFFF, code).astype(np.uint16)
    times = np.floor(np.float64(samples["time"]) / np.float64(SPAN) * 3 + 0.5).astype(int)
    return twin_shared_exponent(samples["radiance"]), x, y, depths, times


def twin_unpack(planes: kernels.Planes) -> Samples:
    colour, xs, ys, depths, _ = planes
    samples = np.empty(len(colour), SAMPLE)
    scale = 2.0 ** (np.float64(colour >> 27) - 24)
    samples["radiance"] = np.stack([(colour >> shift & 511) * scale for shift in (0, 9, 18)], axis=1)
    samples["xy"][:, 0] = RECT[0] + (xs & 0x3FFF) / 2.0**X_BITS
    samples["xy"][:, 1] = RECT[1] + ys / 2.0**Y_BITS
    value = np.float64(depths) / 2.0**BITS
    depth = 2.0 ** (np.floor(value) + BASE - 127) * (1.0 + value % 1.0)
    samples["depth"] = np.where(depths == 0xFFFF, np.inf, depth)
    samples["time"] = (xs >> 14) * (np.float64(SPAN) / 3)
    return samples


def planes_of(n: int) -> kernels.Planes:
    return kernels.Planes(np.zeros(n, np.uint32), *(np.zeros(n, np.uint16) for _ in range(4)))


def moved_samples(n: int) -> Samples:
    samples = plain_samples(n, seed=3)
    samples["xy"] += np.float32(RECT[:2])
    samples["xy"] = np.minimum(samples["xy"], np.float32([579.9, 309.9]))
    return samples


def test_shared_exponents_are_those_of_the_published_encoding() -> None:
    rng = np.random.default_rng(1)
    edges = [0.0, 1e-45, 2.0**-25, 2.0**-16, 2.0**-15, 511.5 / 256, 511.49 / 256, 1.0, 65407.0, 65408.0, 1e30, -1.0]
    random = np.float32(2.0 ** rng.uniform(-30, 17, (500, 3)) * rng.choice([1, 1, 1, -1], (500, 3)))
    rgb = np.concatenate([np.float32([(a, b, a / 3) for a in edges for b in edges]), random])
    words = np.array([kernels.shared_exponent(*colour) for colour in rgb], np.uint32)
    assert (words == twin_shared_exponent(rgb)).all()


@pytest.mark.parametrize("n", [0, 1, 300])
def test_pack_gives_the_twin_s_words(n: int) -> None:
    samples, planes = moved_samples(n), planes_of(n)
    assert kernels.pack(samples, RECT, SCALES, planes) == 0
    colour, x, y, depth, times = twin_pack(samples)
    got = [planes.colours, planes.xs & np.uint16(0x3FFF), planes.ys, planes.depths]
    assert all((a == b).all() for a, b in zip(got, (colour, x, y, depth), strict=True))
    codes = planes.xs >> 14
    assert (np.abs(codes.astype(int) - times) <= 1).all()  # float32 may tip a time that lies between two codes
    assert (codes == times).mean() > 0.98 if n else True


@pytest.mark.parametrize("n", [0, 1, 300])
def test_unpack_gives_the_twin_s_samples(n: int) -> None:
    planes = planes_of(n)
    kernels.pack(moved_samples(n), RECT, SCALES, planes)
    samples = np.empty(n, SAMPLE)
    assert kernels.unpack(planes, RECT, SCALES, samples) == 0
    wanted = twin_unpack(planes)
    for name in ("xy", "radiance", "depth"):
        assert (samples[name] == wanted[name]).all()
    np.testing.assert_allclose(samples["time"], wanted["time"], rtol=1e-6)


def test_both_count_what_lies_outside() -> None:
    samples, planes = moved_samples(6), planes_of(6)
    samples["xy"][:4] = (99.99, 50), (580.0, 50), (200, np.nan), (200, 39.5)
    assert kernels.pack(samples, RECT, SCALES, planes) == 4
    planes.xs[0], planes.ys[1] = 480 << X_BITS, 270 << Y_BITS
    assert kernels.unpack(planes, RECT, SCALES, samples) == 2


def test_depth_range_is_that_of_the_usable_samples() -> None:
    samples = moved_samples(200)
    finite = np.float64(samples["depth"][np.isfinite(samples["depth"])])
    low, high, latest, bad, _ = kernels.depth_range(samples)
    assert (low, high) == tuple(int(np.floor(np.log2(d))) + 127 for d in (finite.min(), finite.max()))
    assert (latest, bad) == (samples["time"].max(), 0)


def test_depth_range_of_nothing_and_of_sky_alone_is_empty() -> None:
    sky = np.zeros(3, SAMPLE)
    sky["depth"] = np.inf
    for samples in (sky[:0], sky):
        low, high, latest, bad, _ = kernels.depth_range(samples)
        assert low > high
        assert (latest, bad) == (0.0, 0)


def test_depth_range_counts_unusable_samples() -> None:
    samples = plain_samples(8)
    samples["radiance"][0, 2], samples["depth"][1], samples["time"][2] = np.nan, -1.0, np.inf
    samples["depth"][3], samples["radiance"][3, 0] = 1e30, np.inf
    low, high, _, bad, _ = kernels.depth_range(samples)
    assert bad == 4
    assert 127 <= low <= high < 127 + 10  # the unusable depth of 1e30 does not widen the range
