"""Images that can be computed on paper: coverage, Lambert, inverse square, sky, shadow, colour, emission."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    BLACK_SKY,
    Triple,
    directions,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_with_every_feature,
    view,
)

from wall.core.data import BACKGROUND, SAMPLE
from wall.scene.model import DirectionalLight, Material, PointLight, Sky
from wall.tracing.kernels.rows import LIGHT_VISIBILITY
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

FLOAT32 = 2e-6  # a dozen float32 roundings, relative


def directional(x: float, y: float, z: float, *, irradiance: Triple = (math.pi, math.pi, math.pi)) -> DirectionalLight:
    length = math.sqrt(x * x + y * y + z * z)
    return DirectionalLight(direction=(x / length, y / length, z / length), irradiance=irradiance)


def test_quad_covers_exactly_the_pixels_whose_centres_it_is_before() -> None:
    """At distance d a wall h pixels high spans 2 d tan(fov / 2); a quad of height q covers h q / (2 d tan(fov / 2)).

    fov = 2 atan(1/2) and d = 4 make 4 units an image, so 2 x 1 units are 32 x 16 of 64 pixels.
    """
    seen = view((0, 0, 4), (0, 0, 0), pixels=(64, 64), fov=2 * math.degrees(math.atan(0.5)))
    got = traced_with_every_feature(scene_of([quad(2.0, 1.0)]), seen)
    expected = np.zeros((64, 64), np.uint32)
    expected[24:40, 16:48] = 1
    np.testing.assert_array_equal(got.objects, expected)


def test_depth_is_the_distance_along_the_ray() -> None:
    """A plane at z = 0 seen from z = 4: a ray at angle a to the axis meets it at 4 / cos a."""
    seen = view((0, 0, 4), (0, 0, 0), pixels=(16, 16))
    got = traced_with_every_feature(scene_of([quad(50.0, 50.0)]), seen)
    np.testing.assert_allclose(got.depth, 4.0 / -directions(seen)[..., 2], rtol=FLOAT32)


def test_a_ray_that_leaves_the_scene_has_no_object_and_infinite_depth() -> None:
    seen = view((0, 0, 4), (0, 0, 9), pixels=(5, 3))
    got = traced_with_every_feature(scene_of([quad(1.0, 1.0)]), seen)
    assert (got.objects == BACKGROUND).all()
    assert np.isposinf(got.depth).all()
    assert got.cost.shadow == 0


def test_object_k_is_the_kth_instance_counted_from_one() -> None:
    scene = scene_of([quad(1.0, 9.0)], [instance(0, at=(x, 0.0, 0.0)) for x in (-1.5, -0.5, 0.5, 1.5)])
    got = traced_with_every_feature(
        scene, view((0, 0, 4), (0, 0, 0), pixels=(4, 1), fov=2 * math.degrees(math.atan(0.125)))
    )
    assert got.objects.tolist() == [[1, 2, 3, 4]]


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 85.0, 89.9])
def test_directional_light_gives_albedo_over_pi_times_irradiance_times_cosine(degrees: float) -> None:
    """Lambert: L = albedo / pi * E * cos, here with E = (pi, 2 pi, 3 pi)."""
    light = directional(math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees)))
    light = replace(light, irradiance=(math.pi, 2 * math.pi, 3 * math.pi))
    scene = scene_of([quad(50.0, 50.0)], materials=[material(0.2, 0.4, 0.6)], lights=[light])
    got = traced_with_every_feature(scene, view((0, 0, 3), (0, 0, 0), pixels=(4, 4)))
    expected = math.cos(math.radians(degrees)) * np.array([0.2, 0.8, 1.8])
    np.testing.assert_allclose(got.radiance, np.broadcast_to(expected, (4, 4, 3)), rtol=1e-5, atol=1e-7)


def test_a_light_behind_the_surface_lights_nothing_and_costs_no_shadow_ray() -> None:
    got = traced_with_every_feature(
        scene_of([quad(50.0, 50.0)], lights=[directional(0.1, 0.0, -1.0)]), view((0, 0, 3), (0, 0, 0), pixels=(4, 4))
    )
    assert (got.radiance == 0.0).all()
    assert got.cost.shadow == 0


def test_both_sides_of_a_surface_are_lit_from_their_own_side() -> None:
    scene = scene_of([quad(50.0, 50.0)], lights=[directional(0.0, 0.0, -1.0)])
    got = traced_with_every_feature(scene, view((0, 0, -3), (0, 0, 0), pixels=(4, 4)))
    np.testing.assert_allclose(got.radiance, 0.5, rtol=FLOAT32)


@pytest.mark.parametrize("height", [0.01, 1.0, 30.0, 1000.0])
def test_point_light_falls_off_with_the_square_of_the_distance(height: float) -> None:
    """L = albedo / pi * I cos / r^2; with r^2 = x^2 + y^2 + z^2 and cos = z / r, at each pixel's own point."""
    seen = view((0, 0, 5), (0, 0, 0), pixels=(8, 8))
    light = PointLight(position=(0.1, -0.2, height), intensity=(math.pi, math.pi, math.pi))
    got = traced_with_every_feature(scene_of([quad(50.0, 50.0)], lights=[light]), seen)
    rays = directions(seen)
    hit = np.array([0.0, 0.0, 5.0]) + rays * (5.0 / -rays[..., 2:3])
    r = np.linalg.norm(hit - light.position, axis=-1)
    error = 1e-6 * (1 + 5 / height)  # the hit itself is off by a few float32 roundings of 5
    np.testing.assert_allclose(got.radiance[..., 1], 0.5 * height / r**3, rtol=error)


def test_lights_add_up() -> None:
    lights = [
        directional(0, 0, 1),
        directional(0, 1, 1),
        PointLight(position=(0.0, 0.0, 2.0), intensity=(1.0, 2.0, 3.0)),
    ]
    seen = view((0, 0, 3), (0, 0, 0), pixels=(4, 4))
    together = traced_with_every_feature(scene_of([quad(50.0, 50.0)], lights=lights), seen)
    apart = [traced_with_every_feature(scene_of([quad(50.0, 50.0)], lights=[light]), seen).radiance for light in lights]
    np.testing.assert_allclose(together.radiance, np.sum(apart, axis=0), rtol=FLOAT32)
    assert together.cost.shadow == 3 * 16


def test_sky_is_linear_in_the_height_of_the_direction() -> None:
    sky = Sky(zenith=(0.1, 0.2, 0.9), horizon=(1.0, 0.8, 0.6), ground=(0.3, 0.2, 0.1))
    seen = view((0, 0, 0), (0.3, 0.1, -1.0), pixels=(12, 12), fov=140.0)
    got = traced_with_every_feature(scene_of([quad(1e-3, 1e-3)], [instance(0, at=(0, 0, 50))], sky=sky), seen)
    y = directions(seen)[..., 1:2]
    zenith, horizon, ground = (np.array(c) for c in (sky.zenith, sky.horizon, sky.ground))
    expected = np.where(y > 0, horizon + y * (zenith - horizon), horizon - y * (ground - horizon))
    assert (y > 0).any()
    assert (y < 0).any()
    np.testing.assert_allclose(got.radiance, expected, rtol=1e-5)


def test_shadow_has_its_edges_where_geometry_puts_them() -> None:
    """A square of edge 2 at height 1 under light 45 degrees from +x shades x in [-2, 0], y in [-1, 1] of the floor.

    Seen from straight above through the square's height the floor is 8 units in 64 pixels; pixels below the square
    itself are another object.
    """
    above = instance(1, at=(0, 0, 1))
    scene = scene_of([quad(40.0, 40.0), quad(2.0, 2.0)], [instance(0), above], lights=[directional(1, 0, 1)])
    got = traced_with_every_feature(scene, view((0, 0, 4), (0, 0, 0), pixels=(64, 64), fov=90.0))
    x = np.broadcast_to((np.arange(64) + 0.5) / 8 - 4, (64, 64))
    y = -x.T
    floor = got.objects == 1
    shaded = (x > -2) & (x < 0) & (abs(y) < 1)
    np.testing.assert_array_equal((got.radiance[..., 0] == 0.0)[floor], shaded[floor])
    assert (shaded & floor).sum() > 30
    np.testing.assert_allclose(got.radiance[floor & ~shaded], 0.5 / math.sqrt(2), rtol=1e-5)


def test_vertex_colours_are_interpolated_linearly_and_multiply_the_base_colour() -> None:
    """Corner colours equal to the corner's place: at (x, y) of the 4 x 4 quad (x / 4 + 1/2, y / 4 + 1/2, 1)."""
    colors = [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    scene = scene_of(
        [quad(4.0, 4.0, colors=colors)], materials=[material(0.5, 1.0, 0.25)], lights=[directional(0, 0, 1)]
    )
    got = traced_with_every_feature(
        scene, view((0, 0, 2), (0, 0, 0), pixels=(16, 16), fov=2 * math.degrees(math.atan(0.5)))
    )
    x = np.broadcast_to((np.arange(16) + 0.5) / 8 - 1, (16, 16))
    expected = np.stack([0.5 * (x / 4 + 0.5), -x.T / 4 + 0.5, np.full((16, 16), 0.25)], axis=-1)
    np.testing.assert_allclose(got.radiance, expected, rtol=1e-5)


def test_emission_is_seen_whatever_the_light_and_on_both_sides() -> None:
    emitter = Material(name="emitter", base_color=(0.0, 0.0, 0.0), emission=(3.0, 2.0, 1.0))
    for z in (3.0, -3.0):
        got = traced_with_every_feature(
            scene_of([quad(50.0, 50.0)], materials=[emitter]), view((0, 0, z), (0, 0, 0), pixels=(4, 4))
        )
        np.testing.assert_array_equal(got.radiance, np.broadcast_to(np.float32([3, 2, 1]), (4, 4, 3)))


def test_smooth_normals_shade_a_coarse_sphere_like_a_round_one() -> None:
    """Lambert on the unit sphere facing light along the view: L = 0.5 cos, with cos from the interpolated normal.

    In the middle of the image the ray meets the sphere where sin(angle) is the ray's height; 48 segments keep the
    interpolated normal within (pi / 48)^2 / 8 < 0.001 of the round one's.
    """
    scene = scene_of([sphere_mesh(segments=48)], lights=[directional(0, 0, 1)])
    seen = view((0, 0, 400), (0, 0, 0), pixels=(32, 32), fov=2 * math.degrees(math.atan(1 / 400)))
    got = traced_with_every_feature(scene, seen)
    x = np.broadcast_to((np.arange(32) + 0.5) / 16 - 1, (32, 32))
    square = x**2 + x.T**2
    inside = square < 0.9
    np.testing.assert_allclose(got.radiance[inside, 0], 0.5 * np.sqrt(1 - square[inside]), rtol=0.01, atol=0.002)


def test_black_sky_and_no_light_is_black() -> None:
    got = traced_with_every_feature(
        scene_of([quad(1.0, 1.0)], sky=BLACK_SKY), view((0, 0, 3), (0, 0, 0), pixels=(8, 8))
    )
    assert (got.radiance == 0.0).all()


def test_lights_beyond_the_mask_change_no_bit_of_it(compiled_only: None) -> None:
    """The mask has 32 bits. A roof hides lights 32 and 33: shifts by 32 and more are undefined."""
    above, aside = directional(0.0, 0.0, 1.0), directional(1.0, 0.0, 1.0)
    roof = instance(0, at=(8.0, 0.0, 8.0))
    scene = scene_of([quad(8.0, 8.0)], [instance(0), roof], lights=[above] * 32 + [aside] * 2)
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(4, 4), fov=10.0)
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = (np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 2) + 0.5).astype(np.float32)
    _, traced = tracer.trace(xy)
    assert traced.shadow == 34 * 16
    mask = tracer.arguments(xy, np.zeros(16, SAMPLE)).work.bits[LIGHT_VISIBILITY : LIGHT_VISIBILITY + 16]
    assert mask.tolist() == [0xFFFFFFFF] * 16
