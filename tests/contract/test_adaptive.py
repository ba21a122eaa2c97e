"""A still view ends, and what it ends with is the converged image, however the region is cut and shared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from running import write_config
from srgb import display

from wall.commands.render import render
from wall.config.loading import load
from wall.roles.plan import Plan, aimed, make_layout
from wall.run.single_process import SingleProcess
from wall.scene.build import Scene
from wall.tracing.tracer_scene import make_tracer_scene

RMSE = 0.01  # display values; a pixel ends at a standard error of 0.002 by its own first samples; measured 0.0078
REFERENCE_SPP = 256
SMALL = ("pixels: [64, 48]", "pixels: [32, 24]")  # a pixel on an edge takes 2,000 samples to half an 8-bit step


def plan_of(folder: Path, scene: Scene, *, tiling: str, **changes: object) -> Plan:
    path = write_config(folder, method=f"adaptive, tiling: {tiling}", **changes)
    path.write_text(path.read_text().replace(*SMALL).replace("[6, 4.5, 10]", "[0, 2.2, 5]"))
    layout = make_layout(load(path))
    return aimed(layout, scene)


@pytest.mark.parametrize(
    ("threads", "ranks", "tiling"), [(1, 1, "grid"), (2, 1, "grid"), (1, 3, "grid"), (1, 3, "cut")]
)
def test_a_still_view_ends_and_equals_the_reference(
    tmp_path: Path, tiny_scene: Scene, threads: int, ranks: int, tiling: str
) -> None:
    plan = plan_of(tmp_path, tiny_scene, threads=threads, ranks=ranks, tiling=tiling)
    reference = render(plan, spp=REFERENCE_SPP, seed=7, at=0.0)
    assert reference is not None

    single = SingleProcess(plan, make_tracer_scene(tiny_scene))
    (image,) = single.until_complete()

    shown = image.rgb.astype(np.float32) / 255.0
    assert shown.std() > 0.1, "the picture shows nothing"
    assert np.sqrt(((shown - display(reference)) ** 2).mean()) < RMSE
    assert sum(worker.work.samples for worker in single.workers) < 2000 * shown.shape[0] * shown.shape[1]
