"""Directional lights with an angular diameter: as much light as without, and penumbrae of the right width."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import instance, quad, scene_of, traced_image, view, with_every_feature

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight
from wall.scene.needs import needs
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 32


def sun(diameter: float, *, up: tuple[float, float, float] = (0.0, 1.0, 0.0)) -> DirectionalLight:
    return DirectionalLight(direction=up, irradiance=(math.pi, 2 * math.pi, 3 * math.pi), angular_diameter=diameter)


def mean_at(scene: Scene, x: float, sweeps: int) -> Float64:
    """Mean radiance of the floor at (x, 0, 0), seen from low beside it."""
    seen = view((x, 0.05, 3.0), (x, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.001)
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1).reshape(-1, 2).astype(np.float32)
    got = [tracer.trace(xy, 0.0, n)[0]["radiance"].astype(np.float64) for n in range(sweeps)]
    return np.asarray(np.mean(got, axis=(0, 1)), np.float64)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("diameter", [0.53, 20.0, 58.0])
@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_a_disc_gives_as_much_light_as_a_direction(diameter: float, tilt: float) -> None:
    """A disc wholly above the horizon: irradiance E cos(tilt), so radiance albedo E cos(tilt) / pi."""
    turned = (math.sin(math.radians(tilt)), math.cos(math.radians(tilt)), 0.0)
    scene = scene_of([quad(50.0, 50.0)], [instance(0, turn=("x", -90.0))], lights=[sun(diameter, up=turned)])
    got = mean_at(replace(scene, path_depth=1), 0.0, 16)
    np.testing.assert_allclose(got, 0.5 * math.cos(math.radians(tilt)) * np.array([1.0, 2.0, 3.0]), rtol=0.005)


@pytest.mark.usefixtures("compiled_only")
def test_half_of_a_hemisphere_of_light_is_the_same_hemisphere() -> None:
    """A disc of 180 degrees is a white sky: E = pi L."""
    scene = scene_of([quad(50.0, 50.0)], [instance(0, turn=("x", -90.0))], lights=[sun(180.0)])
    np.testing.assert_allclose(mean_at(replace(scene, path_depth=1), 0.0, 32), (0.5, 1.0, 1.5), rtol=0.01)


@pytest.mark.usefixtures("compiled_only")
def test_the_penumbra_of_an_edge_is_as_wide_as_the_disc() -> None:
    """Below the edge of a half plane at height h the light of a disc of radius a at the zenith is that of a circle cut
    by a line: 1/2 + (t sqrt(1 - t^2) + asin t) / pi with t = x / (h tan a); all beyond t = 1, none before t = -1."""
    height, diameter = 2.0, 6.0
    placed = [
        instance(0, turn=("x", -90.0)),
        instance(1, at=(-25.0, height, 0.0), turn=("x", -90.0)),
    ]
    scene = scene_of([quad(90.0, 90.0), quad(50.0, 50.0)], placed, lights=[sun(diameter)])
    width = height * math.tan(math.radians(diameter / 2))
    for t in (-1.01, -0.75, -0.3, 0.0, 0.5, 0.9, 1.01):
        cut = min(max(t, -1.0), 1.0)
        share = 0.5 + (cut * math.sqrt(1.0 - cut * cut) + math.asin(cut)) / math.pi
        got = mean_at(replace(scene, path_depth=1), t * width, 8)
        np.testing.assert_allclose(got[0], 0.5 * share, atol=0.003)


def test_direct_light_takes_a_disc_for_a_direction_and_paths_of_both_add_up() -> None:
    seen = view((0.0, 2.0, 3.0), (0.0, 0.0, 0.0), pixels=(8, 6))

    def floor(*lights: DirectionalLight, depth: int | None) -> Scene:
        return replace(scene_of([quad(5.0, 5.0)], [instance(0, turn=("x", -90.0))], lights=lights), path_depth=depth)

    scenes = [with_every_feature(floor(sun(size), sun(0.0), depth=None)) for size in (10.0, 0.0)]
    soft, sharp = (traced_image(scene, seen).radiance for scene in scenes)
    np.testing.assert_array_equal(soft, sharp)
    assert not needs(floor(sun(10.0), depth=None)).suns
    assert needs(floor(sun(10.0), depth=1)).suns
    both = traced_image(with_every_feature(floor(sun(10.0), sun(0.0), depth=1)), seen)
    apart = [traced_image(with_every_feature(floor(light, depth=1)), seen).radiance for light in (sun(10.0), sun(0.0))]
    np.testing.assert_allclose(both.radiance, apart[0] + apart[1], rtol=1e-5)
