"""One truth: whatever carries the samples, and however many ranks share the work, a still view ends in the same bits.

The truth is run/single_process.py; everything else is started as a user starts it.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import mpirun, panels, summary, wall, write_config

from wall.config.loading import load
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import make_tracer_scene


def truth(config: Path) -> list[NDArray[np.uint8]]:
    plan = make_plan(make_layout(load(config)))
    images = SingleProcess(plan, make_tracer_scene(plan.scene)).until_complete()
    return [image.rgb for image in sorted(images, key=lambda p: p.id)]


def assert_same(folder: Path, config: Path) -> None:
    assert summary(folder)["ended"] == "complete"
    expected, found = truth(config), panels(folder)
    assert len(found) == len(expected)
    for k, (ours, theirs) in enumerate(zip(found, expected, strict=True)):
        assert theirs.std() > 10, "the truth itself shows nothing"
        assert np.array_equal(ours, theirs), f"panel {k}: {(ours != theirs).any(-1).sum()} pixels differ"


def of_three_samplers(folder: Path, **changes: object) -> Path:
    """A wall of three panels, whose views have a sampler each."""
    config = write_config(folder, columns=3, **changes)
    views = ", ".join(
        f"{{id: {method}, panels: [r0c{k}], sampling: {{method: {method}}}, "
        f"camera: {{position: [{6 + k}, 4.5, 10], target: [0, 0.6, 0]}}, refresh_hz: 30}}"
        for k, method in enumerate(("framed", "frameless", "hilbert"))
    )
    config.write_text(re.sub(r"views: .*", f"views: [{views}]", config.read_text()), encoding="utf-8")
    return config


@pytest.mark.parametrize("transport", ["loopback", "zmq"])
def test_distributed_run_gives_the_single_process_image(tmp_path: Path, transport: str) -> None:
    config = of_three_samplers(tmp_path, transport=transport)

    done = wall("run", config, "--until-complete", "--seconds", 20, "--headless", "--out", tmp_path / "out")

    assert done.returncode == 0, done.stderr
    assert_same(tmp_path / "out", config)


def test_sharing_a_panel_among_ranks_and_threads_changes_no_pixel(tmp_path: Path) -> None:
    alone = of_three_samplers(tmp_path)
    shared = of_three_samplers(tmp_path, ranks=3, threads=2)

    done = wall("run", shared, "--until-complete", "--seconds", 20, "--headless", "--out", tmp_path / "out")

    assert done.returncode == 0, done.stderr
    assert_same(tmp_path / "out", alone)


def test_compressed_packets_and_a_second_compositor_change_no_pixel(tmp_path: Path) -> None:
    plain = write_config(tmp_path, columns=2)
    config = write_config(tmp_path, columns=2, compositors=2, codec="zstd")

    done = wall("run", config, "--until-complete", "--seconds", 20, "--headless", "--out", tmp_path / "out")

    assert done.returncode == 0, done.stderr
    assert_same(tmp_path / "out", plain)


INSET = "viewport: {left: 0.3, top: 0.1, width: 0.4, height: 0.4}, weight: 0.5, refresh_hz: 20"
SECOND_VIEW = f"}}, {{id: map, {INSET}, camera: {{position: [0, 20, 0.1], target: [0, 0, 0]}}"


@pytest.mark.parametrize("changes", [{"columns": 2, "compositors": 2}, {"ranks": 2, "threads": 2}], ids=str)
def test_an_inset_of_another_view_is_the_same_however_it_is_shared(tmp_path: Path, changes: dict[str, int]) -> None:
    """Across a bezel and through a second compositor, and cut between ranks with two threads each."""
    alone = write_config(tmp_path, path=SECOND_VIEW, columns=changes.get("columns", 1))
    config = write_config(tmp_path, path=SECOND_VIEW, **changes)

    done = wall("run", config, "--until-complete", "--seconds", 20, "--headless", "--out", tmp_path / "out")

    assert done.returncode == 0, done.stderr
    assert_same(tmp_path / "out", alone)
    rates = {view["view"]: view for view in summary(tmp_path / "out")["views"]}
    assert all(rates[name]["samples_per_s"] > 0 for name in ("main", "map"))
    assert sum(view["share"] for view in rates.values()) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.mpi
def test_mpi_run_gives_the_single_process_image(tmp_path: Path) -> None:
    config = write_config(tmp_path, columns=2)

    done = wall(
        "run", config, "--until-complete", "--seconds", 20, "--headless", "--out", tmp_path / "out",
        launcher=mpirun(3),
    )  # fmt: skip

    assert done.returncode == 0, done.stdout + done.stderr
    assert_same(tmp_path / "out", config)
