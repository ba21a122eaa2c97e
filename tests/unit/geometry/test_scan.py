"""Each pixel of a scanning display has its moment: rows of the display itself, however it is mounted and divided."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.geometry.scan import LEAST_ROWS, MOST_BANDS, ImageScan, Scan
from wall.roles.plan import Layout, make_layout

ROW_S = 1e-4
TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [64, 48], size: [0.4, 0.3], row_time: 1.0e-4EXTRA}}
"""
VIEW = "views: [{refresh_hz: 60}]\nsampling: {method: framed}\n"


def layout_of(extra: str = "", rest: str = VIEW) -> Layout:
    return make_layout(loads(TEXT.replace("EXTRA", extra) + rest, path=Path("wall.yaml")))


def scan_of(extra: str = "", panel: int = 0) -> Scan:
    scan = layout_of(extra).wall.panels[panel].scan
    assert scan is not None
    return scan


@pytest.mark.parametrize(
    ("rotation", "first", "last"),
    [
        (0, (20.0, 0.0), (20.0, 48.0)),
        (180, (20.0, 48.0), (20.0, 0.0)),
        (90, (64.0, 20.0), (0.0, 20.0)),  # its top edge is at the viewer's right
        (270, (0.0, 20.0), (64.0, 20.0)),
    ],
)
def test_rows_are_those_of_the_display_as_it_is_mounted(
    rotation: int, first: tuple[float, float], last: tuple[float, float]
) -> None:
    scan, count = scan_of(f", rotation: {rotation}"), 64 if rotation in (90, 270) else 48

    assert scan.at(*first) == pytest.approx(0.0, abs=1e-12)
    assert scan.at(*last) == pytest.approx(count * ROW_S)


def test_a_display_without_row_time_has_no_scan() -> None:
    text = TEXT.replace("1.0e-4EXTRA", "0") + VIEW
    assert make_layout(loads(text, path=Path("wall.yaml"))).wall.panels[0].scan is None


def test_the_lower_half_of_an_image_for_both_eyes_is_shown_later() -> None:
    upper, lower = scan_of(", stereo: top_bottom"), scan_of(", stereo: top_bottom", panel=1)

    assert upper.at(0.0, 24.0) == pytest.approx(24 * ROW_S) == pytest.approx(lower.at(0.0, 0.0))


def test_an_inset_is_shown_when_its_rows_of_the_panel_are() -> None:
    inset = "views: [{id: a}, {id: b, viewport: {left: 0.5, top: 0.25, width: 0.5, height: 0.5}}]\n"
    (panel,) = layout_of(rest=inset + "sampling: {method: framed}\n").wall.insets

    assert panel.scan is not None
    assert panel.scan.at(3.0, 5.0) == pytest.approx((12 + 5) * ROW_S)


@pytest.mark.parametrize(
    ("rest", "said"),
    [
        ("views: [{prediction: none}]\nsampling: {method: framed}\n", "prediction"),
        (VIEW + "graph: {preset: sort-first, sync: frame}\n", "sync"),
        (VIEW + "reconstruction: gpu\n", "reconstruction"),
        ("views: [{refresh_hz: 500}]\nsampling: {method: framed}\n", "row_time"),
    ],
)
def test_what_cannot_make_rows_for_their_moments_is_refused_where_it_stands(rest: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        layout_of(rest=rest)


@pytest.mark.parametrize("height", [5, 40, 4000])
def test_bands_hold_every_position_once_and_no_moment_is_off_by_more_than_half_a_band(height: int) -> None:
    scan = Scan(first=0.002, per_x=0.0, per_y=ROW_S)
    xy = np.random.default_rng(3).uniform((0, 0), (640, height), (2000, 2)).astype(np.float32)
    xy[:2, 1] = 0, height

    parts = scan.bands(xy)

    found = np.concatenate([part for _, part in parts])
    assert np.array_equal(found[np.lexsort(found.T)], xy[np.lexsort(xy.T)])
    rows = max(LEAST_ROWS, height / MOST_BANDS)
    for seconds, part in parts:
        assert np.abs(scan.at(0.0, part[:, 1].astype(np.float64)) - seconds).max() <= 0.5001 * rows * ROW_S
    assert [seconds for seconds, _ in parts] == sorted(seconds for seconds, _ in parts)
    assert len(parts) == min(-(-height // LEAST_ROWS), MOST_BANDS)


def test_no_position_has_no_band() -> None:
    assert Scan(first=0.0, per_x=0.0, per_y=1.0).bands(np.empty((0, 2), np.float32)) == []


def test_an_image_is_scanned_from_its_own_first_row_to_its_own_last() -> None:
    image = ImageScan.of(Scan(first=0.001, per_x=-ROW_S, per_y=0.0), Rect(x=10, y=4, width=20, height=6))

    a, b, _ = image.share
    assert (image.first, image.last) == pytest.approx((0.001 - 30 * ROW_S, 0.001 - 10 * ROW_S))
    assert (a + b * 20, a) == pytest.approx((0.0, 1.0), abs=1e-6)
