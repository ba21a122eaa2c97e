"""A panel of more pixels than a machine fills: coarse while the camera moves, and whole where it stands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import write_config
from srgb import display

from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Event, Float32
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.roles import resolution
from wall.roles.plan import Plan, aimed, make_layout
from wall.run.single_process import SingleProcess
from wall.scene.build import Scene
from wall.tracing.tracer_scene import make_tracer_scene

RMSE = 0.01  # display values; a pixel ends at a standard error of 0.002 by its own first samples; measured 0.0032
REFERENCE_SPP = 256
WIDTH, HEIGHT = 32, 24


@pytest.fixture
def plan(tmp_path: Path, tiny_scene: Scene) -> Plan:
    path = write_config(tmp_path, method="adaptive")
    small = path.read_text().replace("[64, 48]", f"[{WIDTH}, {HEIGHT}]").replace("[6, 4.5, 10]", "[0, 2.2, 5]")
    path.write_text(small)
    return aimed(make_layout(load(path)), tiny_scene)


def image_of(single: SingleProcess) -> DynamicResolution:
    [layer] = [layer for layer in single.layers.values() if layer.layer.at_renderer]
    return layer.reprojected.shared()


def shown(single: SingleProcess) -> NDArray[np.uint8]:
    [image] = single.composition.shown()[0].images()
    return image.rgb.copy()


def slid(event: Event, number: int, aside: float) -> Event:
    """The camera so far aside, as event `number` after this one."""
    x, y, z = event.camera.position
    return replace(
        event, camera_event=event.camera_event + number, camera=replace(event.camera, position=(x + aside, y, z))
    )


def distance(rgb: NDArray[np.uint8], reference: Float32) -> float:
    """RMSE of display values."""
    difference = rgb.astype(np.float32) / 255.0 - display(reference)
    return float(np.sqrt((difference**2).mean()))


def test_while_the_camera_moves_it_is_coarse_and_where_that_stands_it_ends_as_the_reference(
    plan: Plan, tiny_scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resolution, "FIRST", WIDTH * HEIGHT // 4)
    monkeypatch.setattr(resolution, "FEWEST", WIDTH * HEIGHT // 16)
    single, scales = SingleProcess(plan, make_tracer_scene(tiny_scene)), set()
    first = single.event
    for k in range(1, 300):
        single.event = slid(first, k // 30, 0.01 * (9 - k // 30))
        single.step()
        scales.add(image_of(single).scale)
    assert min(scales) > 1
    coarse = shown(single)
    assert len(np.unique(coarse.reshape(-1, 3), axis=0)) > WIDTH * HEIGHT // 6, "it shows the scene"

    whole = single.until_complete()[0].rgb
    assert image_of(single).scale == 1
    reference = render(plan, spp=REFERENCE_SPP, seed=7, at=0.0)
    assert reference is not None
    assert distance(whole, reference) < RMSE
    assert distance(coarse, reference) > 2 * RMSE, "coarse images are told apart"
