"""What `wall check` expects of a wall: rates of all of it, and notes of what is too much."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from wall.commands.check import launch_line
from wall.commands.expectations import expected
from wall.commands.one_core import OneCore
from wall.config.loading import loads
from wall.roles.plan import Layout, make_layout

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 4, rows: 2, pixels: [{pixels}], size: [0.9, 0.5]}}}}
views: [{{camera: auto, refresh_hz: 30}}]
reconstruction: cpu
graph: {{preset: sort-first, compositors: {compositors}}}
"""
CORE = OneCore(rate=500_000.0, size=4.0)


def layout_of(pixels: str, compositors: int = 1) -> Layout:
    return make_layout(loads(TEXT.format(pixels=pixels, compositors=compositors), path=Path("w.yaml")))


def test_the_rate_of_a_wall_is_that_of_all_its_threads_and_of_the_cores_that_are_here() -> None:
    [line] = expected(layout_of("400, 250"), CORE, cores=2)
    assert "4 M samples/s if each of 8 threads has a core like this one, 5 a pixel and second" in line
    assert line.endswith("; 1 M samples/s, 1.2 a pixel, on the 2 cores here")


def test_refreshes_take_their_time_from_rays_and_where_cores_are_few_images_become_rarer() -> None:
    """30 refreshes of 10 ms leave 0.7 of a core; of two ninths of a core, 0.9 make 20 images."""
    core = replace(CORE, refresh_s=0.01)
    assert list(expected(layout_of("400, 250"), core, cores=2))[1] == (
        "expected while everything moves: about 30 of 30 images/s and 2.8 M samples/s if each thread has a core; "
        "20 of 30 images/s and 88.9 k samples/s on the 2 cores here"
    )


@pytest.mark.parametrize(("compositors", "loaded"), [(1, 1), (4, 0)])
def test_a_wall_of_50_megapixels_is_warned_of_its_traces_and_of_what_its_head_takes_in(
    compositors: int, loaded: int
) -> None:
    notes = list(expected(layout_of("3200, 2000", compositors), CORE, cores=64))[1:]
    assert notes[0].startswith("note: all pixels are traced once in 13 s at best: fewer pixels, or more ranks")
    assert len(notes) == 1 + loaded
    if loaded:  # 8 x 3200 x 2000 pixels, 3 bytes, 30 times a second
        assert notes[1].startswith("note: rank 0 takes in 4.61 GB/s of images, if all of them change, more than the")


def test_samples_for_which_a_link_is_too_slow_are_noted() -> None:
    notes = [
        line for line in expected(layout_of("400, 250"), replace(CORE, rate=5e7), cores=64) if line.startswith("note: ")
    ]
    assert notes == [
        "note: rank 0 takes in 1.6 GB/s of samples, more than the 1.25 GB/s of a 10 Gbit/s link: more compositors "
        "(graph: {compositors: 2}), or transport: {codec: zstd}"
    ]


def test_the_launch_line_oversubscribes_where_cores_are_few() -> None:
    layout = layout_of("400, 250")
    assert launch_line(layout, 9) == "launch: mpirun --with-ft ulfm -x PATH -n 9 wall run w.yaml"
    told = launch_line(layout, 2)
    assert "here mpirun --oversubscribe --with-ft ulfm -x PATH -n 9 wall run w.yaml: 9 ranks share 2 cores" in told
