"""A panel of more pixels than a machine fills: coarse while the camera moves, and whole where it stands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import write_config

from wall.config.loading import load
from wall.core.data import Event
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.roles import resolution
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

CODE = 1.0  # RMSE of 8-bit codes between two complete images: both sample pixels where they please


@pytest.fixture(scope="module")
def courtyard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, TracerScene]:
    path: Path = write_config(tmp_path_factory.mktemp("large"), method="adaptive")
    plan = make_plan(make_layout(load(path)))
    return plan, make_tracer_scene(plan.scene)


def image_of(single: SingleProcess) -> DynamicResolution:
    [layer] = [layer for layer in single.layers.values() if layer.layer.at_renderer]
    return layer.reprojected.shared()


def shown(single: SingleProcess) -> NDArray[np.uint8]:
    [image] = single.composition.shown()[0].images()
    return image.rgb.copy()


def slid(event: Event, k: int) -> Event:
    x, y, z = event.camera.position
    return replace(
        event, camera_event=event.camera_event + k, camera=replace(event.camera, position=(x + 0.01 * k, y, z))
    )


def test_while_the_camera_moves_it_is_coarse_and_where_that_stands_it_ends_as_a_wall_that_was_never_coarse(
    courtyard: tuple[Plan, TracerScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resolution, "FIRST", 64 * 48 // 4)
    monkeypatch.setattr(resolution, "FEWEST", 64 * 48 // 16)
    moving, steady = SingleProcess(*courtyard), SingleProcess(*courtyard, at_renderers=False)
    first, scales = moving.event, set()
    for k in range(1, 300):
        moving.event = slid(first, k // 30)
        moving.step()
        scales.add(image_of(moving).scale)
    assert min(scales) > 1
    image = shown(moving)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 500, "it shows the scene"

    steady.event = moving.event
    whole = moving.until_complete()[0].rgb
    assert image_of(moving).scale == 1
    difference = whole.astype(float) - steady.until_complete()[0].rgb
    assert np.sqrt((difference**2).mean()) < CODE
    assert np.sqrt(((image.astype(float) - whole) ** 2).mean()) > 2 * CODE, "coarse images are told apart"
