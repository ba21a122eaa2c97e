"""Coarse smooth meshes: light ends where the smooth normal says, not where flat triangles do.

A unit sphere whose normals are its vertices: at a hit p of a triangle, whatever its weights, the normal is p / |p|.
So light that nothing but the sphere itself could stop is albedo / pi * E * max(n . l, 0), to rounding.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    TracedImage,
    Triple,
    View,
    directions,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_with_every_feature,
    view,
    with_every_feature,
)

from wall.core.data import Float64
from wall.scene.model import DirectionalLight, Light, Mesh, PointLight, Sky
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE = (1.0, 1.0, 1.0)
LIT = 1e-3  # of the light on a surface that faces it: below, the cosine itself is within rounding of nothing
EXACT = 2e-5
MOST_LOST = 1e-3  # of samples: those of corners, where the patch is lower than the ray offset, and of silhouettes
LIGHTS = [(40.0, 0.37), (65.0, 0.37), (97.0, 0.37), (75.0, -0.2)]  # degrees from the line of sight, and height


def round_mesh(segments: int) -> Mesh:
    mesh = sphere_mesh(segments=segments)
    return replace(mesh, normals=mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True))


def sun(degrees: float, height: float) -> DirectionalLight:
    x, y, z = math.sin(math.radians(degrees)), height, math.cos(math.radians(degrees))
    size = math.sqrt(x * x + y * y + z * z)
    return DirectionalLight(direction=(x / size, y / size, z / size), irradiance=(math.pi, math.pi, math.pi))


def smooth_normals(got: TracedImage, seen: View, scale: Triple) -> Float64:
    """(n, 3) of all pixels that show the sphere at the origin, stretched by `scale`, by its exact normals."""
    hits = seen.event.camera.origin() + got.depth[..., None].astype(np.float64) * directions(seen)
    normals = hits[got.objects > 0] / np.square(scale)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True), np.float64)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (1.0, 0.4, 0.7)])
@pytest.mark.parametrize("segments", [8, 12, 48])
def test_a_coarse_sphere_is_lit_wherever_its_normals_are(segments: int, scale: Triple, compiled_only: None) -> None:
    """Of 12 segments and seen from 3, hundreds of pixels were black that faced a light at up to 18 degrees."""
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(72, 72))
    for degrees, height in LIGHTS:
        light = sun(degrees, height)
        scene = scene_of([round_mesh(segments)], [instance(0, scale=scale)], lights=[light])
        got = traced_with_every_feature(scene, seen)
        cosine = smooth_normals(got, seen, scale) @ light.direction
        radiance = got.radiance[got.objects > 0, 0]
        assert (cosine > LIT).sum() > 300
        np.testing.assert_allclose(radiance[cosine > LIT], 0.5 * cosine[cosine > LIT], atol=EXACT)
        assert (radiance[cosine < -LIT] == 0.0).all()


@pytest.mark.parametrize(("segments", "bound"), [(12, 0.2), (24, 0.18), (48, 0.06)])
def test_a_mesh_with_its_own_normals_is_near_a_ball(segments: int, bound: float, compiled_only: None) -> None:
    """Of the light on a surface that faces it; what is left comes from the normals and from the silhouette.

    Without raised rays facets at the light's edge were off by up to 0.32, 0.16 and 0.08.
    """
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(128, 128))
    eye, rays = seen.event.camera.origin(), directions(seen)
    ahead = rays @ eye
    square = ahead**2 - (eye @ eye - 1.0)
    normals = eye + (-ahead - np.sqrt(np.maximum(square, 0.0)))[..., None] * rays
    for degrees, height in LIGHTS:
        light = sun(degrees, height)
        got = traced_with_every_feature(scene_of([sphere_mesh(segments=segments)], lights=[light]), seen)
        both = (got.objects > 0) & (square > 0.0)
        off = np.abs(2.0 * got.radiance[..., 0] - np.maximum(normals @ light.direction, 0.0))
        assert off[both].max() < bound


def test_a_point_light_near_a_coarse_sphere_lights_what_its_normals_see(compiled_only: None) -> None:
    seen, at = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(72, 72)), np.array([1.6, 0.5, 0.4])
    other = PointLight(position=(-4.0, 1.0, 0.0), intensity=(0.0, 0.0, 0.0))  # aimed at first, and not seen here
    light = PointLight(position=(1.6, 0.5, 0.4), intensity=(math.pi, math.pi, math.pi))
    got = traced_with_every_feature(scene_of([round_mesh(12)], lights=[other, light]), seen)
    hit = got.objects > 0
    way = at - (seen.event.camera.origin() + got.depth[hit][:, None].astype(np.float64) * directions(seen)[hit])
    cosine = np.einsum("ni,ni->n", smooth_normals(got, seen, (1.0, 1.0, 1.0)), way) / np.linalg.norm(way, axis=1)
    expected = 0.5 * np.maximum(cosine, 0.0) / np.einsum("ni,ni->n", way, way)
    lit = cosine > LIT
    np.testing.assert_allclose(got.radiance[hit, 0][lit], expected[lit], atol=EXACT)
    assert (got.radiance[hit, 0][cosine < -LIT] == 0.0).all()


def test_no_light_comes_into_a_coarse_sphere(compiled_only: None) -> None:
    """Seen from inside it is hollow, and its normals turn: nothing is raised through the wall."""
    lights: list[Light] = [sun(40.0, 0.3), PointLight(position=(1.3, 0.2, 0.1), intensity=WHITE)]
    got = traced_with_every_feature(
        scene_of([round_mesh(8)], lights=lights), view((0.0, 0.0, 0.2), (0.3, 0.1, -1.0), pixels=(48, 48), fov=100.0)
    )
    assert (got.objects == 1).all()
    assert (got.radiance == 0.0).all()


def test_what_nearly_touches_a_coarse_mesh_keeps_its_shadow_in_steep_light(compiled_only: None) -> None:
    """A pillow: its normals lean out by 45 degrees, so the patch over it stands 0.25 above its middle."""
    square = quad(2.0, 2.0)
    lean = np.hstack([np.sign(square.vertices[:, :2]), np.full((4, 1), math.sqrt(2.0))]).astype(np.float32) / 2.0
    light = DirectionalLight(direction=(0.6, 0.0, 0.8), irradiance=WHITE)
    scene = scene_of([replace(square, normals=lean), quad(0.5, 0.5)], [instance(0), instance(1, at=(0.0, 0.0, 0.01))],
                     lights=[light])  # fmt: skip
    seen = view((0.0, -0.5, 0.008), (0.0, 0.0, 0.0), pixels=(48, 48), fov=20.0)
    got = traced_with_every_feature(scene, seen)
    hits = seen.event.camera.origin() + got.depth[..., None] * directions(seen)
    below = (got.objects == 1) & (np.abs(hits[..., :2]) < 0.2).all(axis=-1)
    assert below.sum() > 50
    assert (got.radiance[below] == 0.0).all()


def test_a_white_coarse_sphere_loses_no_light_on_paths(compiled_only: None) -> None:
    """Under an even sky what leaves above the horizon of the normal reaches the sky: radiance is the sky's, 1.

    Directions below the triangle were dropped: up to half of the light near edges that stand out.
    """
    sky = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
    scene = replace(scene_of([round_mesh(8)], materials=[material(1.0, 1.0, 1.0)], sky=sky), path_depth=4)
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(96, 96))
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.random.default_rng(1).uniform(0.0, 96.0, (20_000, 2)).astype(np.float32)
    samples, _ = tracer.trace(xy)
    lost = samples["radiance"][samples["object_id"] == 1].min(axis=1) < 0.999
    assert len(lost) > 5000
    assert lost.mean() < MOST_LOST
