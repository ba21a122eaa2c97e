"""A tracer shows each step of a series as a scene with that step alone does, in whatever order it comes to them."""

from __future__ import annotations

import gc
from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import ref

import numpy as np
import pytest
from small_scenes import TracedImage, image_of, traced_with_every_feature, view, with_every_feature

from wall.config.scene import SceneConfig
from wall.scene.build import Scene, build
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SEEN = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(48, 48))
LIGHTS = [{"type": "directional", "direction": [0.3, 0.5, 0.8], "irradiance": [3.0, 3.0, 3.0]}]
HEAT = {"column": 3, "color_map": {"range": [0.0, 3.0]}}
AS_EXACT = {"rtol": 1e-3, "atol": 1e-4}  # steps are kept about the middle of the first one


def _surface(height: float, heat: float, pieces: int) -> str:
    """Squares beside each other at a height, more and more of them, which grow hotter."""
    corners = [
        (x + k, height, z) for k in range(pieces) for x, z in ((-2.0, 1.0), (-1.2, 1.0), (-1.2, -1.0), (-2.0, -1.0))
    ]
    rows = "\n".join(f"{x} {y} {z}" for x, y, z in corners)
    polygons = "\n".join(f"4 {4 * k} {4 * k + 1} {4 * k + 2} {4 * k + 3}" for k in range(pieces))
    heats = " ".join(str(heat + 0.1 * k) for k in range(4 * pieces))
    return (
        f"# vtk DataFile Version 3.0\nsquares\nASCII\nDATASET POLYDATA\nPOINTS {4 * pieces} float\n{rows}\n"
        f"POLYGONS {pieces} {5 * pieces}\n{polygons}\nPOINT_DATA {4 * pieces}\nSCALARS heat float 1\n"
        f"LOOKUP_TABLE default\n{heats}\n"
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four steps of points that fly up, and of squares that sink; and each step alone."""
    for k in range(4):
        rows = [[-1.0 + 0.7 * j + 0.1 * k, 0.3 + 0.2 * k, 0.2 * j, 0.5 * k + 0.1 * j] for j in range(3 + k)]
        np.save(tmp_path / f"points{k}.npy", rows)
        (tmp_path / f"squares{k}.vtk").write_text(_surface(-0.2 - 0.2 * k, 0.3 * k, 4 - k))
    return tmp_path


def scene_of_files(folder: Path, which: str, **more: Any) -> Scene:
    points = {"type": "points", "file": f"points{which}.npy", "radius": 0.25, "color_by": HEAT}
    heat = {"array": "heat", "color_map": HEAT["color_map"]}
    squares = {"type": "surface", "file": f"squares{which}.vtk", "color_by": heat}
    data = [{**each, **more} for each in (points, squares)]
    return build(SceneConfig.model_validate({"data": data, "lights": LIGHTS}), folder)


def alone(folder: Path, step: int) -> TracedImage:
    return traced_with_every_feature(scene_of_files(folder, str(step)), SEEN)


def same(image: TracedImage, expected: TracedImage) -> None:
    hit = (image.objects > 0) & (expected.objects > 0)
    assert (hit != (expected.objects > 0)).sum() <= 2  # rays at edges
    assert hit.sum() > 120
    off = ~np.isclose(image.radiance[hit], expected.radiance[hit], **AS_EXACT).all(axis=1)
    assert off.sum() <= 4  # at edges of shadows
    np.testing.assert_allclose(image.depth[hit], expected.depth[hit], rtol=1e-3)


@pytest.mark.usefixtures("compiled_only")
def test_every_step_looks_as_it_does_alone(folder: Path) -> None:
    series = {"step_s": 1.0}
    laid = make_tracer_scene(with_every_feature(scene_of_files(folder, "*", series=series)))
    tracer = Tracer(laid, SEEN.panel, SEEN.eye, coherent=True)
    beside = Tracer(laid, SEEN.panel, SEEN.eye, coherent=True)
    for time in (0.0, 1.0, 3.0, 2.5, 0.0, 3.0):
        tracer.set_event(replace(SEEN.event, scene_time=time))
        image = image_of(tracer, SEEN)
        same(image, alone(folder, int(time)))
        assert set(np.unique(image.objects)) <= {0, 1 + int(time), 5 + int(time)}
        beside.set_event(replace(SEEN.event, scene_time=2.0))
    same(image_of(beside, SEEN), alone(folder, 2))


@pytest.mark.usefixtures("compiled_only")
def test_steps_that_no_tracer_shows_leave_the_memory(folder: Path) -> None:
    laid = make_tracer_scene(with_every_feature(scene_of_files(folder, "*", series={"step_s": 1.0})))
    tracers = [Tracer(laid, SEEN.panel, SEEN.eye, coherent=True) for _ in range(2)]
    assert laid.steps is not None
    for tracer in tracers:
        tracer.set_event(replace(SEEN.event, scene_time=1.0))
    shown = ref(laid.steps.of(laid, (1, 1)))
    for k, tracer in enumerate(tracers):
        gc.collect()
        assert shown() is not None, k
        tracer.set_event(replace(SEEN.event, scene_time=3.0))
    gc.collect()
    assert shown() is None
