"""Statistics images survive the wire exactly; whatever is not a whole one is refused on both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wall.core.data import StatisticsImage
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets.control import parse_control, serialise
from wall.packets.statistics_image import parse_statistics_image, statistics_image_body


def statistics_image(rows: int = 3, columns: int = 5, rects: int = 4) -> StatisticsImage:
    rng = np.random.default_rng(rows)
    return StatisticsImage(
        panel=7,
        compared=True,
        age=rng.integers(0, 256, (rows, columns)).astype(np.uint8),
        density=rng.integers(0, 256, (rows, columns)).astype(np.uint8),
        rects=rng.integers(0, 65536, (rects, 4)).astype(np.uint16),
        error_reduction=rng.integers(0, 256, rects).astype(np.uint8),
    )


@pytest.mark.parametrize("shape", [(3, 5, 4), (1, 1, 1), (17, 30, 510)])
def test_a_statistics_image_comes_back_equal(shape: tuple[int, int, int]) -> None:
    sent = statistics_image(*shape)
    came = parse_control(serialise(sent))
    assert isinstance(came, StatisticsImage)
    assert (came.panel, came.compared) == (7, True)
    for name in ("age", "density", "rects", "error_reduction"):
        assert np.array_equal(getattr(came, name), getattr(sent, name)), name


def test_a_renderer_s_tiles_come_back_equal() -> None:
    sent = replace(statistics_image(), rank=3, age=np.empty((0, 0), np.uint8), density=np.empty((0, 0), np.uint8))
    came = parse_control(serialise(sent))
    assert isinstance(came, StatisticsImage)
    assert (came.rank, came.age.shape, came.density.shape) == (3, (0, 0), (0, 0))
    assert np.array_equal(came.rects, sent.rects)
    assert np.array_equal(came.error_reduction, sent.error_reduction)


def test_an_image_without_tiles_is_not_sent() -> None:
    with pytest.raises(LocalProtocolError, match="out of range"):
        serialise(statistics_image(rects=0))


def test_a_panel_of_480_x_270_takes_less_than_6_kilobytes() -> None:
    """1,020 codes of tiles, and 9 bytes a tile of the fixed grid."""
    assert len(serialise(statistics_image(17, 30, 510))) == 16 + 13 + 1020 + 9 * 510 < 6000


def test_a_body_cut_anywhere_is_refused() -> None:
    body = statistics_image_body(statistics_image())
    for length in range(len(body)):
        with pytest.raises(RemoteProtocolError):
            parse_statistics_image(body[:length])
    with pytest.raises(RemoteProtocolError, match="bytes came of"):
        parse_statistics_image(body + b"\0")


@pytest.mark.parametrize(("at", "value"), [(0, 1), (4, 2), (5, 0), (6, 255), (7, 0), (11, 255)])
def test_numbers_out_of_range_are_refused(at: int, value: int) -> None:
    body = bytearray(statistics_image_body(statistics_image()))
    body[at] = value
    with pytest.raises(RemoteProtocolError, match="statistics_image of panel 7"):
        parse_statistics_image(bytes(body))


def test_arrays_that_do_not_match_are_not_sent() -> None:
    good = statistics_image()
    for wrong in (
        replace(good, density=good.density[1:]),
        replace(good, error_reduction=good.error_reduction[1:]),
        replace(good, rects=good.rects[:, :3]),
    ):
        with pytest.raises(LocalProtocolError, match="statistics_image of panel 7"):
            serialise(wrong)
