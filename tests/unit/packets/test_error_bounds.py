"""The error of every quantisation at its worst cases; the bounds are those of docs/guide/packet_format.md."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike
from packet_examples import batch_of, check_bounds, mantissa_bits, subpixel_bits

from wall.core.data import SAMPLE, Float32, Rect, Samples
from wall.packets.plain_body import subpixel_bits as wire_subpixel_bits
from wall.packets.samples import decode, encode

F32 = np.float32


def through(samples: Samples, *, rect: Rect | None = None) -> Samples:
    """What arrives, its bounds checked."""
    batch = batch_of(samples, rect=rect)
    came = decode(encode(batch))
    check_bounds(batch, came)
    return came.samples


def colours(values: ArrayLike) -> Float32:
    """(n, 3) colours after the wire."""
    rgb = np.asarray(values, F32)
    samples = np.zeros(len(rgb), SAMPLE)
    samples["radiance"] = rgb
    return np.asarray(through(samples)["radiance"])


def depths(values: ArrayLike) -> Float32:
    d = np.asarray(values, F32)
    samples = np.zeros(len(d), SAMPLE)
    samples["depth"] = d
    return np.asarray(through(samples)["depth"])


def test_every_edge_keeps_its_pixels_and_as_many_subpixel_bits_as_fourteen_allow() -> None:
    for edge in range(1, 4097):
        bits = wire_subpixel_bits(edge)
        assert bits == subpixel_bits(edge)
        assert bits >= 2
        assert edge * 2**bits <= 2**14


@pytest.mark.parametrize("corner", [0, 1, 1919, 7680, 61439])
def test_positions_at_every_edge_size_keep_their_pixel(corner: int, compiled_only: None) -> None:
    for edge in range(1, 4097):
        rect = Rect(x=corner, y=0, width=edge, height=4097 - edge)
        samples = np.zeros(4, SAMPLE)
        last = np.nextafter(F32(corner + edge), F32(0))
        samples["xy"][:, 0] = (corner, last, min(last, F32(corner + edge - 0.25)), F32(corner + 0.5))
        samples["xy"][:, 1] = (0, np.nextafter(F32(rect.height), F32(0)), rect.height - 0.25, 0.5)
        came = through(samples, rect=rect)
        assert (came["xy"][2:, 1] == samples["xy"][2:, 1]).all()


@pytest.mark.parametrize("edge", [1, 2, 3, 16, 480, 1080, 1920, 2049, 4095, 4096])
def test_quarter_pixels_are_exact(edge: int) -> None:
    quarters = np.unique(np.linspace(0, 4 * edge - 1, 200).astype(int)) / 4
    samples = np.zeros(len(quarters), SAMPLE)
    samples["xy"][:, 0] = samples["xy"][:, 1] = quarters
    came = through(samples, rect=Rect(x=0, y=0, width=edge, height=edge))
    assert (came["xy"] == samples["xy"]).all()


def test_position_error_comes_as_near_to_its_bound_as_positions_are_fine() -> None:
    samples = np.zeros(1, SAMPLE)
    samples["xy"] = np.nextafter(F32(0.25), F32(0))
    came = through(samples, rect=Rect(x=0, y=0, width=4096, height=4096))
    assert (came["xy"] == 0).all()


def test_colours_of_every_size_stay_within_a_511th_of_their_largest_channel() -> None:
    tops = np.geomspace(2.0**-30, 65408.0, 400)
    shares = np.array([(1.0, 0.0, 0.5), (1.0, 1.0, 1.0), (1e-3, 1.0, 0.499), (0.3, 0.7, 1.0)])
    colours((tops[:, None, None] * shares).reshape(-1, 3))


def test_the_worst_colour_lies_just_above_a_512th() -> None:
    """511.5 steps round up to 512, which doubles the step: half of it is 1/511.5 of the largest channel."""
    top, odd = 511.5 * 2.0**-8, 255.0 * 2.0**-8
    ((_, green, _),) = colours([(top, odd, 0.0)])
    assert 1 / 512 < abs(float(green) - odd) / top <= 1 / 511


def test_powers_of_two_in_range_are_exact() -> None:
    powers = 2.0 ** np.arange(-24, 16)
    assert (colours(np.repeat(powers[:, None], 3, axis=1)) == F32(powers)[:, None]).all()


def test_colours_beyond_the_range_are_clamped() -> None:
    came = colours([(-1.0, -1e38, -0.0), (65408.0, 65409.0, 3.4e38), (1e-45, 2.0**-26, 1e-38)])
    assert came.tolist() == [[0, 0, 0], [65408, 65408, 65408], [0, 0, 0]]


def test_negative_channels_become_zero_and_spare_the_others() -> None:
    assert colours([(-5.0, 0.5, 0.25)]).tolist() == [[0.0, 0.5, 0.25]]


@pytest.mark.parametrize("octaves", [1, 2, 3, 4, 7, 8, 15, 16, 31, 32, 64, 127, 128, 200, 254])
def test_depths_over_any_number_of_octaves_stay_within_half_a_step(octaves: int) -> None:
    low = max(-126, 64 - octaves) if octaves < 190 else -126
    rng = np.random.default_rng(octaves)
    values = F32(2.0 ** rng.uniform(low, low + octaves, 300))
    values[:2] = F32(2.0**low), np.nextafter(F32(2.0 ** min(low + octaves, 127.9999999)), F32(0))
    assert mantissa_bits(values) == min(15, int(np.log2(65534 // octaves)))
    depths(values)


@pytest.mark.parametrize(("octaves", "bits"), [(1, 15), (2, 14), (8, 12), (254, 8)])
def test_the_worst_depth_is_off_by_half_a_step(octaves: int, bits: int) -> None:
    base = 2.0**-126 if octaves == 254 else 1.0
    top = np.nextafter(F32(base * 2.0 ** (octaves - 1) * 2), F32(0)) if octaves < 254 else np.finfo(F32).max
    middle = F32(base * (1 + 2.0 ** -(bits + 1)))
    came = depths([base, middle, top])
    assert abs(came[1] / middle - 1) == pytest.approx(2.0 ** -(bits + 1), rel=0.01)


def test_zero_and_denormal_depths_become_the_smallest_normal_number() -> None:
    assert depths([0.0, 1e-45, 1e-39, -0.0]).tolist() == [2.0**-126] * 4


def test_zero_beside_an_ordinary_depth_costs_precision_but_not_the_depth() -> None:
    assert depths([0.0, 5.0])[1] == pytest.approx(5.0, rel=2.0**-9)


def test_the_largest_depth_stays_finite() -> None:
    assert np.isfinite(depths([float(np.finfo(F32).max)])).all()
    assert np.isfinite(depths([1e-38, float(np.finfo(F32).max)])).all()


def test_infinity_is_infinity_alone_or_beside_others() -> None:
    assert np.isinf(depths([np.inf, np.inf])).all()
    assert depths([np.inf, 3.0, np.inf]).tolist() == [np.inf, 3.0, np.inf]


@pytest.mark.filterwarnings("error")  # without JIT, a span that overflows the arithmetic says so
@pytest.mark.parametrize("span", [1e-45, 1e-36, 1e-6, 0.001, 1.0, 3600.0, 999999.0])
def test_times_stay_within_a_sixth_of_their_span(span: float) -> None:
    samples = np.zeros(500, SAMPLE)
    samples["time"] = np.linspace(0.0, span, 500)
    through(samples)


def test_the_worst_time_is_off_by_half_a_step() -> None:
    samples = np.zeros(2, SAMPLE)
    samples["time"] = 0.5 / 3 * 1.001, 1.0
    assert abs(through(samples)["time"][0] - samples["time"][0]) == pytest.approx(1 / 6, rel=0.01)


def test_first_and_last_time_are_exact() -> None:
    samples = np.zeros(3, SAMPLE)
    samples["time"] = 0.0, 0.25, 0.75
    assert through(samples)["time"][[0, 2]].tolist() == [0.0, pytest.approx(0.75, rel=1e-6)]


@pytest.mark.parametrize("most", [16384, 65535, 65536, 2**32 - 1])
def test_object_ids_are_exact(most: int) -> None:
    ids = [k for k in (0, 1, 16382, 16383, 16384, 20001, 65535, 65536, 2**31, 2**32 - 1) if k <= most]
    samples = np.zeros(len(ids), SAMPLE)
    samples["object_id"] = ids
    assert through(samples)["object_id"].tolist() == ids
