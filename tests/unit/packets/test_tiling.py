"""Tilings survive the wire: rectangles exactly, measures within the stated bounds; what is no tiling is refused."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.data import Float32, Rect, Tiling
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets.samples import decode, is_samples
from wall.packets.tiling import HEADER_BYTES, decode_tiling, encode_tiling, grid, is_tiling

RECT = Rect(x=16, y=32, width=100, height=50)
STEP = 2.0 ** (1 / 16) - 1  # half of an eighth of an octave
SMALLEST, LARGEST = 2.0**-20, 2.0**11.75
COUNT_AT, LENGTH_AT, CHECKSUM_AT = 46, 50, 54
MEASURES = ("spatial", "temporal", "density")


def tiling_of(rects: Any, *, rect: Rect = RECT, seed: int = 1, **fields: Any) -> Tiling:
    rng = np.random.default_rng(seed)
    n = len(rects)
    plain: dict[str, Any] = {
        "view": 1, "panel": 2, "rank": 3, "sequence": 2**40, "camera_event": 7, "scene_event": 8, "base_time": 9.25,
        "spatial": np.float32(rng.gamma(1.0, 0.1, n)), "temporal": np.float32(rng.gamma(0.5, 2.0, n)),
        "density": np.float32(rng.gamma(2.0, 1.0, n)),
    }  # fmt: skip
    return Tiling(rect=rect, rects=np.asarray(rects, np.uint16).reshape(n, 4), **(plain | fields))


def check(sent: Tiling, came: Tiling) -> None:
    for name in ("view", "panel", "rect", "rank", "sequence", "camera_event", "scene_event", "base_time"):
        assert getattr(came, name) == getattr(sent, name)
    assert came.rects.dtype == np.uint16
    assert (came.rects == sent.rects).all()
    for name in MEASURES:
        check_measure(getattr(sent, name), getattr(came, name))


def check_measure(sent: Float32, came: Float32) -> None:
    wanted = np.minimum(np.float64(sent), LARGEST)
    assert came.dtype == np.float32
    assert (np.abs(came - wanted) <= np.maximum(wanted * (STEP + 1e-6), SMALLEST / 2)).all()


def resealed(packet: bytes | bytearray) -> bytes:
    data = bytearray(packet)
    struct.pack_into("<I", data, LENGTH_AT, len(data) - HEADER_BYTES)
    struct.pack_into("<I", data, CHECKSUM_AT, zlib.crc32(data[HEADER_BYTES:], zlib.crc32(data[:CHECKSUM_AT])))
    return bytes(data)


@st.composite
def tilings(draw: st.DrawFn) -> Tiling:
    rect = Rect(
        x=draw(st.integers(0, 60000)), y=draw(st.integers(0, 60000)), width=draw(st.integers(1, 4096)),
        height=draw(st.integers(1, 4096)),
    )  # fmt: skip
    rects = []
    for _ in range(draw(st.integers(0, 12))):
        x, y = draw(st.integers(0, rect.width - 1)), draw(st.integers(0, rect.height - 1))
        sides = draw(st.integers(1, rect.width - x)), draw(st.integers(1, rect.height - y))
        rects.append((rect.x + x, rect.y + y, *sides))
    values = st.one_of(st.floats(0.0, 4000.0, width=32), st.sampled_from([0.0, 2.0**-20, 2.0**-21, 1e-30, 3e38]))
    measures = {name: np.float32(draw(st.lists(values, min_size=len(rects), max_size=len(rects)))) for name in MEASURES}
    return tiling_of(np.array(rects, np.uint16).reshape(-1, 4), rect=rect, **measures)


@given(tiling=tilings())
@settings(max_examples=150, deadline=None)
def test_any_tiling_comes_back_within_the_stated_bounds(tiling: Tiling) -> None:
    check(tiling, decode_tiling(encode_tiling(tiling)))


@pytest.mark.parametrize("edge", [1, 7, 16, 64, 100, 4096])
def test_grids_come_back_and_their_tiles_are_not_listed(edge: int) -> None:
    tiles = grid(RECT, min(edge, 100))
    tiling = tiling_of(tiles)
    packet = encode_tiling(tiling)
    check(tiling, decode_tiling(packet))
    listed = encode_tiling(tiling_of(tiles[::-1]))
    check(tiling_of(tiles[::-1]), decode_tiling(listed))
    assert len(tiles) == 1 or len(listed) > len(packet)


def test_a_grid_covers_its_rectangle_once() -> None:
    seen = np.zeros((50, 100), int)
    for x, y, width, height in grid(RECT, 16):
        seen[y - 32 : y - 32 + height, x - 16 : x - 16 + width] += 1
    assert (seen == 1).all()


def test_a_16_pixel_grid_of_a_small_panel_takes_less_than_three_bytes_a_tile() -> None:
    rect = Rect(x=0, y=0, width=480, height=270)
    packet = encode_tiling(tiling_of(grid(rect, 16), rect=rect))
    assert len(packet) < 3 * 510


def test_measures_over_the_whole_range_stay_within_half_a_step() -> None:
    values = np.concatenate([[0.0], np.geomspace(1e-8, 1e5, 5000)]).astype(np.float32)
    tiling = tiling_of(np.tile((16, 32, 1, 1), (5001, 1)), spatial=values, temporal=values[::-1], density=values)
    came = decode_tiling(encode_tiling(tiling))
    check(tiling, came)
    ordinary = (values > 2 * SMALLEST) & (values < LARGEST)
    worst = np.abs(came.spatial[ordinary] / np.float64(values[ordinary]) - 1).max()
    assert worst > 0.98 * STEP  # the bound is tight


@pytest.mark.parametrize(
    "wrong",
    [
        {"view": 65536}, {"panel": -1}, {"sequence": 2**64}, {"base_time": np.nan},
        {"rect": Rect(x=0, y=0, width=0, height=9)},
        {"rect": Rect(x=0, y=0, width=4097, height=9)}, {"rect": Rect(x=17, y=32, width=100, height=50)},
        {"spatial": np.float32([1.0])}, {"temporal": np.float32([1.0, -1.0])}, {"density": np.float32([np.nan, 1.0])},
        {"density": np.float32([np.inf, 1.0])}, {"rects": np.uint16([(16, 32, 0, 1), (16, 32, 1, 1)])},
        {"rects": np.uint16([(16, 32, 101, 1), (16, 32, 1, 1)])},
    ],
)  # fmt: skip
def test_what_the_format_cannot_carry_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(LocalProtocolError, match=r"rank 3 tiling [0-9]+: "):
        encode_tiling(replace(tiling_of([(16, 32, 5, 5), (30, 40, 1, 1)]), **wrong))


def harmless(data: bytes) -> bool:
    """Whether it was accepted; then every tile lies inside and every measure is finite."""
    try:
        tiling = decode_tiling(data)
    except RemoteProtocolError:
        return False
    n, rect = len(tiling.rects), tiling.rect
    assert n <= 65536
    low = tiling.rects[:, :2].astype(int) - (rect.x, rect.y)
    high = low + tiling.rects[:, 2:]
    assert ((low >= 0) & (high <= (rect.width, rect.height)) & (tiling.rects[:, 2:] > 0)).all()
    for name in MEASURES:
        values = getattr(tiling, name)
        assert values.shape == (n,)
        assert (np.isfinite(values) & (values >= 0)).all()
    return True


PACKETS = [encode_tiling(tiling_of(tiles)) for tiles in (grid(RECT, 32), [(16, 32, 5, 5), (30, 40, 1, 1)], [])]


@pytest.mark.parametrize("packet", PACKETS, ids=("grid", "listed", "empty"))
def test_every_changed_bit_is_noticed_and_under_a_valid_checksum_harmless(packet: bytes) -> None:
    for bit in range(8 * len(packet)):
        changed = bytearray(packet)
        changed[bit // 8] ^= 1 << bit % 8
        assert not harmless(bytes(changed))
        harmless(resealed(changed))


@pytest.mark.parametrize("packet", PACKETS, ids=("grid", "listed", "empty"))
def test_a_packet_cut_anywhere_is_refused(packet: bytes) -> None:
    assert harmless(packet)
    for length in range(len(packet)):
        assert not harmless(packet[:length])
        if length > HEADER_BYTES:
            assert not harmless(resealed(packet[:length]))


@pytest.mark.parametrize(("offset", "value"), [(COUNT_AT, 65536), (COUNT_AT, 2**32 - 1), (COUNT_AT, 7)])
def test_a_count_that_does_not_fit_the_body_is_refused(offset: int, value: int) -> None:
    changed = bytearray(PACKETS[0])
    struct.pack_into("<I", changed, offset, value)
    assert not harmless(resealed(changed))


def test_kinds_are_told_apart() -> None:
    assert is_tiling(PACKETS[0])
    assert not is_samples(PACKETS[0])
    assert not is_tiling(b"WALL\x02\x01")
    assert not is_tiling(b"")
    with pytest.raises(RemoteProtocolError):
        decode(PACKETS[0] + bytes(200))
