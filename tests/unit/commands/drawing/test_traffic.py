"""Bytes a second on the edges of the graph, worked out by hand."""

from __future__ import annotations

import pytest

from wall.commands.drawing.traffic import bytes_a_sample, framelet_traffic, samples_traffic, si

COLOUR = frozenset({"colour"})


@pytest.mark.parametrize(("depths", "objects", "size"), [(True, True, 12), (True, False, 10), (False, False, 8)])
def test_plain_samples_take_their_fields_and_their_share_of_the_header(depths: bool, objects: bool, size: int) -> None:
    """A packet of 4096 samples: a header of 182 bytes and 8 to 12 bytes each (docs/guide/packet_format.md)."""
    found = bytes_a_sample("frameless", 4096, depths=depths, objects=objects)
    assert found == pytest.approx((182 + size * 4096) / 4096, abs=1e-12)


def test_adaptive_samples_take_at_most_their_limit() -> None:
    assert bytes_a_sample("adaptive", 2048, depths=True, objects=True) == 6.5


def test_ranks_of_a_panel_add_up() -> None:
    assert samples_traffic(3, 2e6, 12.5) == 75e6


@pytest.mark.parametrize(
    ("channels", "encoded", "bytes_a_pixel"),
    [
        (COLOUR, True, 3),
        (COLOUR, False, 12),
        (COLOUR | {"depth"}, False, 16),
        (COLOUR | {"depth", "alpha", "time", "object_id", "variance"}, False, 32),
        (COLOUR | {"time"}, True, 7),
    ],
)
def test_a_framelet_takes_its_channels_for_every_pixel_and_refresh(
    channels: frozenset[str], encoded: bool, bytes_a_pixel: int
) -> None:
    found = framelet_traffic(1920 * 1080, channels, encoded=encoded, refresh_hz=60.0)
    assert found == 1920 * 1080 * bytes_a_pixel * 60.0


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0 B/s"),
        (999.0, "999 B/s"),
        (999.6, "1 kB/s"),
        (1000.0, "1 kB/s"),
        (12_035_644.0, "12 MB/s"),
        (6_912_000.0, "6.91 MB/s"),
        (99_960_000.0, "100 MB/s"),
        (995_328_000.0, "995 MB/s"),
        (999_600_000.0, "1 GB/s"),
        (1.5e12, "1.5 TB/s"),
        (2e15, "2000 TB/s"),
    ],
)
def test_rates_are_written_with_three_digits(value: float, text: str) -> None:
    assert si(value, "B/s") == text
