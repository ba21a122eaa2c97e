"""A still view of `adaptive` completes, and is right, where the display's range or float32 ends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scenes import BLACK, Triple, instance, quad, scene_of, turned, with_every_feature

from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Float64
from wall.roles.plan import Plan, aimed, make_layout
from wall.run.single_process import SingleProcess
from wall.scene.build import Scene
from wall.scene.model import Material, PointLight, Sky
from wall.study.quality.metrics import display_values
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 24  # pixels
CONFIG = """\
version: 1
scene: {{source: courtyard, animation: []}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [24, 24], size: [0.24, 0.24]}}}}
views: [{{camera: {{position: {position}, target: {target}, fov: 40}}, refresh_hz: 30}}]
sampling: {{method: adaptive, samples_per_pixel: 2, samples_per_batch: 1024}}
"""
REFERENCE_SPP = 2048
OFF = 5.0  # 8-bit codes that no pixel is off by
UNIFORM = 8  # times the samples that uniform sampling needs for the same error
PATIENCE = 3000  # samples a pixel
DOWN, ALONG = (0.0, 0.01, -1.0), (0.0, 1.0, -0.01)  # onto a surface and along it
GREY = Sky(zenith=(0.2, 0.2, 0.2), horizon=(0.2, 0.2, 0.2), ground=(0.2, 0.2, 0.2))


def plan_of(folder: Path, scene: Scene, position: Triple, target: Triple) -> Plan:
    config = folder / "wall.yaml"
    config.write_text(CONFIG.format(position=list(position), target=list(target)))
    return aimed(make_layout(load(config)), with_every_feature(scene))


def codes(plan: Plan, spp: int) -> Float64:
    radiance = render(plan, spp=spp, seed=7, at=0.0)
    assert radiance is not None
    return 255.0 * np.asarray(display_values(radiance), np.float64)


def complete(plan: Plan) -> tuple[Float64, float]:
    """The complete picture, 8-bit codes, and the samples a pixel that it took."""
    single = SingleProcess(plan, make_tracer_scene(plan.scene))
    first = single.clock.now()
    while single.clock.now() - first < 0.01 or single.step() > 0:
        single.step()
        assert sum(worker.work.samples for worker in single.workers) < PATIENCE * EDGE**2, "it never completes"
    (image,) = single.until_complete()
    return image.rgb.astype(np.float64), sum(worker.work.samples for worker in single.workers) / EDGE**2


@pytest.mark.parametrize("radiance", [4.0, 10.0])
def test_the_edge_of_a_lamp_is_right_and_complete(tmp_path: Path, compiled_only: None, radiance: float) -> None:
    """Judged by light as it comes, not as it is shown, 4 took 9,120 samples a pixel, and 10 never was complete."""
    lamp = Material(name="lamp", base_color=BLACK, emission=(radiance, radiance, radiance))
    scene = scene_of([quad(1.0, 1.3)], [instance(0, turn=("z", 17.0))], materials=[lamp], sky=GREY)
    plan = plan_of(tmp_path, scene, (0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    reference = codes(plan, REFERENCE_SPP)

    shown, samples = complete(plan)

    uniform = np.round(codes(plan, int(samples / UNIFORM)))
    assert np.abs(shown - reference).max() <= OFF
    assert np.sqrt(((shown - reference) ** 2).mean()) < np.sqrt(((uniform - reference) ** 2).mean())


@pytest.mark.parametrize(("height", "ahead"), [(1e-6, DOWN), (1e-9, DOWN), (0.0, DOWN), (1e-9, ALONG)])
def test_an_eye_at_a_surface_sees_it(tmp_path: Path, compiled_only: None, height: float, ahead: Triple) -> None:
    """Where the surface is in float32, as seen from so near, does not say which pixel shows what; its own ray does."""
    rotation, at = turned("x", 37.0) @ turned("y", 23.0), np.array([1.3, 0.7, -2.1])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, at
    colours = np.random.default_rng(1).uniform(0.2, 0.9, (4, 3))
    placed = replace(instance(0), world_from_object=matrix)
    x, y, z = (at + rotation @ [0.3, 0.2, 1.0]).tolist()
    light = PointLight(position=(x, y, z), intensity=(3.0, 3.0, 3.0))
    scene = scene_of([quad(2.0, 2.0, colors=colours)], [placed], lights=[light], sky=GREY)
    eye = at + rotation @ [0.31, 0.17, height]
    target = eye + rotation @ ahead
    plan = plan_of(tmp_path, scene, tuple(eye.tolist()), tuple(target.tolist()))

    shown, _ = complete(plan)

    assert np.abs(shown - codes(plan, 64)).max() <= OFF
