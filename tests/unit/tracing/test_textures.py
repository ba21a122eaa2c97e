"""Filtered textures: one sample of a footprint against the mean of many points in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_scenes import Triple, View, instance, material, quad, scene_of, view, with_every_feature

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Sky, Texture
from wall.tracing.mip_levels import mip_levels
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 32  # texels
NOISE = np.random.default_rng(5).integers(0, 256, (EDGE, EDGE, 3)).astype(np.uint8)
POINTS = 24  # of a pixel, in each direction, for its mean
WHITE = (1.0, 1.0, 1.0)
FACING = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi, math.pi, math.pi))


def plane(*, repeats: float, turn: float = 0.0, stretch: float = 1.0) -> Scene:
    """A textured square of 20 units, turned about x by degrees."""
    mesh = quad(20.0, 20.0, uvs=True)
    assert mesh.uvs is not None
    mesh.uvs[:] *= np.float32([repeats * stretch, repeats])
    sky = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
    placed = [instance(0, turn=("x", turn))]
    textures = [Texture(name="noise", texels=NOISE)]
    return scene_of([mesh], placed, materials=[material(*WHITE, base_color_texture=0)], textures=textures, sky=sky)


def traced(scene: Scene, seen: View, xy: Float64, footprint: float) -> Float32:
    """(n, 3) radiance at positions, one object everywhere."""
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=True)
    tracer.set_event(seen.event)
    samples, _ = tracer.trace(xy.astype(np.float32), footprint)
    assert (samples["object_id"] > 0).all()
    radiance: Float32 = samples["radiance"]
    return radiance


def errors(scene: Scene, seen: View, footprint: float) -> tuple[float, float]:
    """RMSE of filtered samples in pixels' middles, and of points there, against means over squares about them."""
    width, height = seen.panel.pixels
    middles = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1).reshape(-1, 2)
    steps = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    square = footprint * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2)
    means = traced(scene, seen, (square + middles).reshape(-1, 2), 0.0).reshape(POINTS**2, -1, 3).mean(axis=0)
    return rmse(traced(scene, seen, middles, footprint) - means), rmse(traced(scene, seen, middles, 0.0) - means)


def rmse(values: Float32) -> float:
    return math.sqrt(float((values.astype(np.float64) ** 2).mean()))


# the eye, the plane turned about x, the field of view
FROM_ABOVE = ((0.0, 0.0, 12.0), 0.0, 30.0)
AT_60_DEGREES = ((0.0, 0.0, 9.0), -60.0, 30.0)
GRAZING = ((0.0, 0.0, 8.0), -80.0, 8.0)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize(
    ("place", "repeats", "stretch", "best"),
    [
        (FROM_ABOVE, 4.0, 1.0, 0.6),
        (FROM_ABOVE, 20.0, 1.0, 0.2),
        (FROM_ABOVE, 8.0, 5.0, 0.2),
        (AT_60_DEGREES, 8.0, 1.0, 0.25),
        (AT_60_DEGREES, 30.0, 0.25, 0.2),
        (GRAZING, 8.0, 1.0, 0.2),
    ],
)
def test_a_sample_shows_the_mean_over_its_footprint(
    place: tuple[Triple, float, float], repeats: float, stretch: float, best: float
) -> None:
    """The bound is of the error of points: a square of mip texels is not the pixel's own square."""
    at, turn, fov = place
    seen = view(at, (0.0, 0.0, 0.0), pixels=(24, 24), fov=fov)
    filtered, points = errors(plane(repeats=repeats, turn=turn, stretch=stretch), seen, 1.0)
    assert filtered < best * points


def test_footprints_smaller_than_a_texel_change_nothing() -> None:
    scene, seen = plane(repeats=0.5), view((0.0, 0.0, 12.0), (0.0, 0.0, 0.0), pixels=(24, 24), fov=30.0)
    xy = np.random.default_rng(1).uniform(0.0, 24.0, (256, 2))
    np.testing.assert_array_equal(traced(scene, seen, xy, 1.0), traced(scene, seen, xy, 0.0))


@pytest.mark.parametrize("turn", [0.0, -60.0, -89.0])
def test_a_texture_far_finer_than_a_pixel_is_its_mean(turn: float) -> None:
    seen = view((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), pixels=(8, 8), fov=2.0)
    mean = srgb_decoded(NOISE / 255.0).mean(axis=(0, 1))
    got = traced(plane(repeats=20000.0, turn=turn), seen, np.full((16, 2), 4.0), 1.0)
    np.testing.assert_allclose(got, np.broadcast_to(mean, got.shape), rtol=0.02)


@pytest.mark.usefixtures("compiled_only")
def test_a_mirror_carries_footprints_on() -> None:
    """A mirror in z = 0 shows the plane behind the eye as it would be seen from the mirrored eye."""
    sky = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
    noise = [Texture(name="noise", texels=NOISE)]
    looks = [material(*WHITE, base_color_texture=0), material(0.0, 0.0, 0.0, mirror=1.0)]
    mesh = quad(20.0, 20.0, uvs=True)
    assert mesh.uvs is not None
    mesh.uvs[:] *= np.float32(8.0)
    meshes = [mesh, quad(50.0, 50.0, material=1)]
    shown = scene_of(
        meshes,
        [instance(0, at=(0.0, 0.0, 9.0), turn=("y", 180.0)), instance(1)],
        materials=looks, textures=noise, sky=sky,
    )  # fmt: skip
    behind = scene_of(
        meshes[:1], [instance(0, at=(0.0, 0.0, -9.0), scale=(-1.0, 1.0, 1.0))],
        materials=looks, textures=noise, sky=sky,
    )  # fmt: skip
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(24, 24), fov=30.0)
    xy = np.random.default_rng(2).uniform(0.0, 24.0, (256, 2))
    through, straight = traced(shown, seen, xy, 1.0), traced(behind, seen, xy, 1.0)
    np.testing.assert_allclose(through, straight, atol=2e-3)
    assert rmse(straight - traced(behind, seen, xy, 0.0)) > 0.05


def test_scale_and_place_of_everything_together_do_not_matter() -> None:
    """The footprint is an angle: a scene a thousand times larger looks the same."""
    xy = np.random.default_rng(3).uniform(0.0, 24.0, (256, 2))
    small = plane(repeats=8.0, turn=-60.0)
    large = scene_of(
        small.meshes, [instance(0, turn=("x", -60.0), scale=1000.0)],
        materials=small.materials, textures=small.textures, sky=small.sky,
    )  # fmt: skip
    near = traced(small, view((0, 0, 9), (0, 0, 0), pixels=(24, 24), fov=30.0), xy, 1.0)
    far = traced(large, view((0, 0, 9000), (0, 0, 0), pixels=(24, 24), fov=30.0), xy, 1.0)
    np.testing.assert_allclose(far, near, atol=2e-3)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 3), (16, 16), (33, 64)])
def test_mip_levels_keep_the_mean_light(shape: tuple[int, int]) -> None:
    texels = np.random.default_rng(4).integers(0, 256, (*shape, 3)).astype(np.uint8)
    levels = mip_levels(texels)
    sizes = [(shape[0], shape[1])]
    while sizes[-1] != (1, 1):
        sizes.append((max(1, sizes[-1][0] // 2), max(1, sizes[-1][1] // 2)))
    assert len(levels) == sum(h * w for h, w in sizes)
    np.testing.assert_array_equal(levels[: shape[0] * shape[1]], texels.reshape(-1, 3))
    mean = srgb_decoded(texels / 255.0).mean(axis=(0, 1))
    np.testing.assert_allclose(srgb_decoded(levels[-1] / 255.0), mean, atol=0.006)  # a rounding to sRGB bytes
