"""The fused kernel against ten lines of float64 NumPy: every ray against every triangle, every light by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from small_scenes import Triple, View, directions, instance, material, quad, scene_of, sphere_mesh, traced_image, view

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Light, PointLight, Sky
from wall.scene.sky import sky_irradiance

AGREEING = 0.999  # share of pixels within RTOL; the rest are edges of objects and shadows
RTOL = 1e-4
FAR_FROM_EDGES = 1e-3  # barycentric
STEEP = 0.1  # cosine to the flat triangle from which on shadow rays start at it


@dataclass(frozen=True, slots=True, kw_only=True)
class Soup:
    """All triangles of a scene in the world, float64."""

    corners: Float64  # (t, 3, 3)
    normals: Float64  # (t, 3, 3) shading normals of the corners, any length
    objects: Float64  # (t,)
    colours: Float64  # (t, 3)


def soup(scene: Scene) -> Soup:
    corners, normals, objects, colours = [], [], [], []
    for k, placed in enumerate(scene.instances):
        mesh, m = scene.meshes[placed.mesh], placed.world_from_object
        world = mesh.vertices.astype(np.float64) @ m[:3, :3].T + m[:3, 3]
        corners.append(world[mesh.triangles])
        if mesh.normals is None:
            a, b, c = corners[-1].transpose(1, 0, 2)
            normals.append(np.repeat(np.cross(b - a, c - a)[:, None], 3, axis=1))
        else:
            normals.append((mesh.normals.astype(np.float64) @ np.linalg.inv(m[:3, :3]))[mesh.triangles])
        objects.append(np.full(len(mesh.triangles), k + 1.0))
        colours.append(np.tile(scene.materials[mesh.material].base_color, (len(mesh.triangles), 1)))
    return Soup(
        corners=np.concatenate(corners),
        normals=np.concatenate(normals),
        objects=np.concatenate(objects),
        colours=np.concatenate(colours),
    )


def cross_all(origins: Float64, rays: Float64, corners: Float64) -> tuple[Float64, Float64, Float64]:
    """t, u, v of every ray (n, 3) with every triangle, each (n, triangles); t = inf where it misses.

    Moeller and Trumbore 1997.
    """
    a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(rays[:, None], f[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("nti,ti->nt", p, e)
        s = origins[:, None] - a[None]
        u = np.einsum("nti,nti->nt", p, s) * inverse
        q = np.cross(s, e[None])
        v = np.einsum("nti,ni->nt", q, rays) * inverse
        t = np.einsum("nti,ti->nt", q, f) * inverse
        return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf), u, v


def arc_cosine(height: Float64) -> Float64:
    """Integral of max(up . d, 0) max(n . d, 0) over all directions d, for n at that height (Cho and Saul 2009)."""
    theta = np.arccos(np.clip(height, -1, 1))
    return np.asarray(2 / 3 * (np.sin(theta) + (math.pi - theta) * height), np.float64)


def ambient(sky: Sky, normals: Float64) -> Float64:
    zenith, horizon, ground = (np.array(c) for c in (sky.zenith, sky.horizon, sky.ground))
    up, down = arc_cosine(normals[:, 1])[:, None], arc_cosine(-normals[:, 1])[:, None]
    return np.asarray((math.pi * horizon + up * (zenith - horizon) + down * (ground - horizon)) / math.pi, np.float64)


def light_on(light: Light, points: Float64) -> tuple[Float64, Float64, Float64]:
    """Unit directions to the light, distances, and irradiance on a facing surface."""
    if isinstance(light, DirectionalLight):
        towards = np.broadcast_to(np.array(light.direction), points.shape)
        return towards, np.full(len(points), np.inf), np.broadcast_to(np.array(light.irradiance), points.shape)
    towards = np.array(light.position) - points
    distance = np.linalg.norm(towards, axis=1)
    return towards / distance[:, None], distance, np.array(light.intensity) / distance[:, None] ** 2


def raises(world: Soup, k: NDArray[np.intp], weights: Float64, turned: Float64) -> Float64:
    """(n, 3) from hits of triangles `k` at `weights` (n, 3) up to the planes through their corners across the normals.

    turned : (n,) 1 or -1, which side of the normals is seen. Hanika 2021.
    """
    corners = world.corners[k]
    points = np.einsum("nc,nci->ni", weights, corners)
    normals = world.normals[k] / np.linalg.norm(world.normals[k], axis=2, keepdims=True) * turned[:, None, None]
    heights = np.maximum(np.einsum("nci,nci->nc", corners - points[:, None], normals), 0.0)
    return np.asarray(np.einsum("nc,nc,nci->ni", weights, np.where(heights > 1e-12, heights, 0.0), normals))


def shade(scene: Scene, seen: View) -> tuple[Float64, Float64, Float64]:
    """Radiance (n, 3), object ids (n,), and the least barycentric distance to an edge (n,), of every pixel."""
    world, rays = soup(scene), directions(seen).reshape(-1, 3)
    eye = np.broadcast_to(seen.event.camera.origin(), rays.shape)
    t, u, v = cross_all(eye, rays, world.corners)
    k, row = t.argmin(axis=1), np.arange(len(rays))
    hit = np.isfinite(t[row, k])
    u, v = u[row, k], v[row, k]
    y = rays[:, 1:2]
    zenith, horizon, ground = (np.array(c) for c in (scene.sky.zenith, scene.sky.horizon, scene.sky.ground))
    radiance = horizon + np.maximum(y, 0) * (zenith - horizon) + np.maximum(-y, 0) * (ground - horizon)
    flat = np.cross(world.corners[k, 1] - world.corners[k, 0], world.corners[k, 2] - world.corners[k, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    flat *= -np.sign(np.einsum("ni,ni->n", flat, rays))[:, None]
    weights = np.stack([1 - u - v, u, v], axis=1)
    smooth = np.einsum("nc,nci->ni", weights, world.normals[k])
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    turned = np.sign(np.einsum("ni,ni->n", smooth, flat))
    smooth *= turned[:, None]
    points = (eye + t[row, k][:, None] * rays + 1e-9 * flat)[hit]
    raised = raises(world, k, weights, turned)[hit]
    lit = ambient(scene.sky, smooth[hit])
    for light in (*scene.point_lights, *scene.directional_lights):
        towards, distance, strength = light_on(light, points)
        side = np.einsum("ni,ni->n", flat[hit], towards)
        starts = points + np.clip(1 - side / STEEP, 0, 1)[:, None] * raised
        ways = np.array(light.position) - starts if isinstance(light, PointLight) else towards
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        blocked = (cross_all(starts, ways, world.corners)[0] < distance[:, None]).any(axis=1)
        cosine = np.einsum("ni,ni->n", smooth[hit], towards)
        faced = ((side > 0) | (raised != 0).any(axis=1)) & (cosine > 0) & ~blocked
        lit = lit + np.where(faced, cosine / math.pi, 0.0)[:, None] * strength
    radiance[hit] = world.colours[k][hit] * lit
    edge = np.where(hit, np.minimum(np.minimum(u, v), 1 - u - v), 1.0)
    return radiance, np.where(hit, world.objects[k], 0), edge


def random_scene(seed: int) -> Scene:
    """Five objects, turned and stretched, three lights and a sky."""
    random = np.random.default_rng(seed)

    def triple(low: float, high: float) -> Triple:
        x, y, z = random.uniform(low, high, 3).tolist()
        return (x, y, z)

    towards = random.normal(size=3) + np.array([0.0, 2.0, 0.0])
    x, y, z = (towards / np.linalg.norm(towards)).tolist()
    placed = [instance(0, at=(0.0, -1.5, 0.0), turn=("x", -90.0))]
    for k in range(4):
        turn = ("xyz"[k % 3], float(random.uniform(0, 360)))
        placed.append(instance(1 + k % 2, at=triple(-1.5, 1.5), turn=turn, scale=triple(0.3, 1.0)))
    return scene_of(
        [quad(8.0, 8.0), sphere_mesh(1, segments=10), sphere_mesh(2, segments=8, smooth=False)],
        placed,
        materials=[material(*triple(0.2, 0.9)) for _ in range(3)],
        lights=[
            DirectionalLight(direction=(x, y, z), irradiance=triple(0.5, 2.0)),
            PointLight(position=triple(2.0, 3.0), intensity=triple(2.0, 9.0)),
            PointLight(position=triple(-3.0, -1.0), intensity=triple(2.0, 9.0)),
        ],
        sky=Sky(zenith=triple(0, 1), horizon=triple(0, 1), ground=triple(0, 1)),
    )


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_equal_their_float64_twin(seed: int, compiled_only: None) -> None:
    scene, seen = random_scene(seed), view((1.0, 1.5, 5.0), (0.0, -0.2, 0.0), pixels=(56, 44), fov=50.0)
    radiance, objects, edge = shade(scene, seen)
    got = traced_image(scene, seen)
    inside = edge > FAR_FROM_EDGES
    np.testing.assert_array_equal(got.objects.ravel()[inside], objects[inside])
    close = np.isclose(got.radiance.reshape(-1, 3), radiance, rtol=RTOL, atol=1e-5).all(axis=1)
    assert close.mean() >= AGREEING
    assert len(np.unique(objects)) >= 4


def test_a_pixel_row_equals_its_twin_in_plain_python_too() -> None:
    """The same on few pixels, so that the kernels also run uncompiled."""
    scene, seen = random_scene(1), view((1.0, 1.5, 5.0), (0.0, -0.2, 0.0), pixels=(21, 3), fov=12.0)
    radiance, objects, edge = shade(scene, seen)
    got = traced_image(scene, seen)
    inside = edge > FAR_FROM_EDGES
    np.testing.assert_array_equal(got.objects.ravel()[inside], objects[inside])
    wrong = ~np.isclose(got.radiance.reshape(-1, 3), radiance, rtol=RTOL, atol=1e-5).all(axis=1)
    assert wrong.sum() <= 1


def test_sky_table_is_within_1e_4_of_numerical_quadrature() -> None:
    """E(n) / pi by midpoint rule over the sphere, 400 x 800 directions, between the table's rows and on them."""
    sky = Sky(zenith=(1.0, 0.0, 0.3), horizon=(0.0, 1.0, 0.2), ground=(0.0, 0.5, 1.0))
    table = sky_irradiance(sky).astype(np.float64)
    cosine = (np.arange(400) + 0.5) / 200 - 1.0
    angle = (np.arange(800) + 0.5) * 2 * math.pi / 800
    y, phi = np.meshgrid(cosine, angle, indexing="ij")
    zenith, horizon, ground = (np.array(c) for c in (sky.zenith, sky.horizon, sky.ground))
    up, down = np.maximum(y, 0)[..., None], np.maximum(-y, 0)[..., None]
    radiance = horizon + up * (zenith - horizon) + down * (ground - horizon)
    for height in (-1.0, -0.999, -0.7, -0.004, 0.0, 0.31, 0.998, 1.0):
        cosine = np.maximum(height * y + math.sqrt(1 - height**2) * np.sqrt(1 - y**2) * np.cos(phi), 0)
        expected = (radiance * cosine[..., None]).mean(axis=(0, 1)) * 4
        at = (height + 1) * 128
        row = min(int(at), 255)
        looked_up = table[row] + (at - row) * (table[row + 1] - table[row])
        np.testing.assert_allclose(looked_up, expected, atol=1e-4)


def test_sky_table_is_within_1e_4_of_the_closed_form_everywhere() -> None:
    sky = Sky(zenith=(1.0, 0.0, 0.0), horizon=(0.0, 0.0, 1.0), ground=(0.0, 1.0, 0.0))
    height = np.linspace(-1.0, 1.0, 20001)
    table, at = sky_irradiance(sky).astype(np.float64), (height + 1) * 128
    row = np.minimum(at.astype(int), 255)
    looked_up = table[row] + (at - row)[:, None] * (table[row + 1] - table[row])
    normals = np.stack([np.sqrt(1 - height**2), height, np.zeros_like(height)], axis=1)
    assert np.abs(looked_up - ambient(sky, normals)).max() < 1e-4
