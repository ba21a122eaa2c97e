"""The last image of a run that was moving is one moment's, whatever was foreseen when it ended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import panels, wall, write_config

from wall.commands.render import render
from wall.config.loading import load
from wall.roles.plan import make_layout, make_plan
from wall.study.quality.metrics import display_values

SECONDS, STARTED_S = 1.5, 0.9  # a run's path has gone on for so long, and for no more than so much longer
AHEAD_S, STEP_S = 0.1, 0.03
ALIKE = 12.0  # RMSE in 8-bit steps at the nearest tried moment: half a step of time and a few samples a pixel


@pytest.mark.clock
def test_last_image_of_a_moving_wall_is_of_one_moment_at_all_compositors(tmp_path: Path) -> None:
    """Each refresh looks AHEAD_S into a fast orbit; a panel that still did so at the end would fit another moment."""
    path = f", path: {{type: orbit, period_s: 3}}, display_delay_s: {AHEAD_S}"
    config = write_config(tmp_path, columns=2, compositors=2, method="adaptive", path=path)

    done = wall("run", config, "--seconds", SECONDS, "--headless", "--out", tmp_path / "out")

    assert done.returncode == 0, done.stderr
    plan = make_plan(make_layout(load(config)))
    moments = np.arange(STARTED_S, SECONDS + 1.5, STEP_S)
    errors = np.zeros((2, len(moments)))
    for k, moment in enumerate(moments):
        ideal = render(plan, spp=4, seed=1, at=float(moment))
        assert ideal is not None
        for j, (panel, shown) in enumerate(zip(plan.layout.wall.panels, panels(tmp_path / "out"), strict=True)):
            x, y = panel.screen
            part = 255.0 * display_values(ideal[y : y + shown.shape[0], x : x + shown.shape[1]])
            errors[j, k] = np.sqrt(((part - shown) ** 2).mean())
    assert errors.min(axis=1).max() < ALIKE
    left, right = moments[errors.argmin(axis=1)]
    assert abs(left - right) < AHEAD_S / 2


FILES_ELSEWHERE = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3], bezel: 0.01}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}]
sampling: {method: frameless, samples_per_batch: 256}
transport: {lost_after_s: 10}
graph:
  compositors: 2
  nodes:
    - {id: s0, op: samples, panel: r0c0}
    - {id: s1, op: samples, panel: r0c1, on: host elsewhere}
    - {id: p0, op: reconstruct, input: s0, on: compositor 1}
    - {id: p1, op: reconstruct, input: s1, on: compositor 1}
    - {id: w, op: tile, inputs: [p0, p1], on: head}
    - {id: here, op: sink, kind: png, input: w}
    - {id: there, op: sink, kind: png, input: p1, on: compositor 1}
    - {id: kept, op: sink, kind: recorder, input: p0, on: compositor 1}
"""


def test_files_are_written_where_their_sinks_run(tmp_path: Path) -> None:
    config, out = tmp_path / "wall.yaml", tmp_path / "out"
    config.write_text(FILES_ELSEWHERE, encoding="utf-8")
    done = wall("run", config, "--headless", "--until-complete", "--seconds", 60, "--out", out)
    assert done.returncode == 0, done.stderr
    here, there = (np.asarray(Image.open(path)) for path in (out / "here/panel-r0c1.png", out / "panel-r0c1.png"))
    assert here.std() > 10
    assert np.array_equal(here, there)
    assert list((out / "recording").glob("*.jpg"))
