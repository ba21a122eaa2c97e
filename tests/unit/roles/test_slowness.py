"""Why a wall is slow: the rank and the stage that lag are named, with what to lower."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from wall.config.loading import loads
from wall.packets.control import Heartbeat
from wall.roles.plan import Layout, make_layout, reconstructed_at_renderers
from wall.roles.slowness import why_slow

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [100, 50], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}]
"""


@pytest.fixture(scope="module")
def layout() -> Layout:
    """Two panels, each with a renderer whose samples travel to the head."""
    return make_layout(loads(TEXT, path=Path("wall.yaml")))


def beats(**of_head: Any) -> dict[int, Heartbeat]:
    rates = {0: {"refreshes_per_s": 30.0, **of_head}, 1: {"samples_per_s": 50_000.0}, 2: {"samples_per_s": 5_000.0}}
    return {rank: Heartbeat(rank=rank, time=9.0, seconds=9.0, **more) for rank, more in rates.items()}


def test_a_wall_that_keeps_up_is_not_called_slow(layout: Layout) -> None:
    assert why_slow(layout, beats(right_s=0.2)) == ""


def test_a_compositor_that_makes_too_few_images_is_named_before_ranks_that_trace_too_little(layout: Layout) -> None:
    said = why_slow(layout, beats(refreshes_per_s=12.0, right_s=3.0))
    assert said.startswith("Rank 0 (head) makes 12 of 30 images a second. Lower: pixels, refresh_hz, or share")


def test_the_renderer_with_the_fewest_samples_a_pixel_is_named_where_images_are_late(layout: Layout) -> None:
    said = why_slow(layout, beats(right_s=3.0))
    assert said.startswith("Rank 2 (r0c1) traces 1 samples a pixel and second; its image is right after 3 s. Lower: ")


def test_a_renderer_that_makes_its_own_images_too_slowly_is_named(layout: Layout) -> None:
    placed = reconstructed_at_renderers(layout, ["here"] * layout.size)
    slow = beats() | {1: Heartbeat(rank=1, time=9.0, seconds=9.0, refreshes_per_s=29.0)}
    slow[2] = Heartbeat(rank=2, time=9.0, seconds=9.0, refreshes_per_s=6.0)
    assert why_slow(placed, slow).startswith("Rank 2 (r0c1) makes 6 of 30 images a second.")
    slow[2] = Heartbeat(rank=2, time=9.0, seconds=1.0, refreshes_per_s=6.0)
    assert why_slow(placed, slow) == "", "it has only begun"


def test_what_rests_is_not_slow(layout: Layout) -> None:
    """At rest nothing is traced, and images are not made again."""
    placed = reconstructed_at_renderers(layout, ["here"] * layout.size)
    late = {rank: Heartbeat(rank=rank, time=9.0, seconds=9.0, refreshes_per_s=30.0, right_s=3.0) for rank in (1, 2)}
    assert why_slow(placed, late) == "", "no rank traces anything"
    late[2] = Heartbeat(rank=2, time=9.0, seconds=9.0, refreshes_per_s=30.0, right_s=2.0, samples_per_s=5000.0)
    assert why_slow(placed, late).startswith("Rank 2 (r0c1) traces 1 samples a pixel and second; ")
    resting = {rank: Heartbeat(rank=rank, time=9.0, seconds=9.0, complete=True, refreshes_per_s=4.0) for rank in (1, 2)}
    assert why_slow(placed, resting) == ""
    resting[2] = Heartbeat(rank=2, time=9.0, seconds=9.0, refreshes_per_s=4.0)
    assert why_slow(placed, resting).startswith("Rank 1 (r0c0) makes 4 of 30 images a second. ")
