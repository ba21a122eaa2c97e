"""Textures, mirrors, instances, broken colours: closed forms where light is not just Lambert."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    TracedImage,
    Triple,
    View,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_with_every_feature,
    turned,
    view,
    with_every_feature,
)

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Instance, Material, Mesh, PointLight, Sky, Texture, TextureSet
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

LIGHT = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi, math.pi, math.pi))
WHITE = (1.0, 1.0, 1.0)
FOUR_UNITS = 2 * math.degrees(math.atan(0.5))  # at distance 4 this field of view is 4 units high
TEXELS = np.array([[[0, 51, 255], [128, 10, 0], [255, 200, 5]], [[30, 90, 160], [12, 250, 77], [64, 32, 16]]], np.uint8)


def linear(code: Float64) -> Float64:
    """IEC 61966-2-1, float64."""
    c = code / 255.0
    return np.asarray(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), np.float64)


def bilinear(texels: Float64, u: float, v: float) -> Float64:
    """Twin: texel (i, j)'s centre is at ((i + 1/2) / w, 1 - (j + 1/2) / h), repeated in both directions."""
    h, w = texels.shape[:2]
    x, y = u * w - 0.5, (1.0 - v) * h - 0.5
    i, j = math.floor(x), math.floor(y)
    total = np.zeros(3)
    for di, dj in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = (1 - abs(x - i - di)) * (1 - abs(y - j - dj))
        total += weight * texels[(j + dj) % h, (i + di) % w]
    return total


def textured(texels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], *, scale: float, shift: Triple) -> TracedImage:
    mesh = quad(4.0, 4.0, uvs=True)
    assert mesh.uvs is not None
    mesh = replace(mesh, uvs=(mesh.uvs * scale + np.float32(shift[:2])).astype(np.float32))
    scene = scene_of(
        [mesh],
        materials=[material(*WHITE, base_color_texture=0)],
        textures=[Texture(name="t", texels=texels)],
        lights=[LIGHT],
    )
    return traced_with_every_feature(scene, view((0, 0, 4), (0, 0, 0), pixels=(12, 12), fov=FOUR_UNITS))


@pytest.mark.parametrize(("scale", "shift"), [(1.0, (0, 0, 0)), (2.5, (-0.7, 0.3, 0)), (1.0, (1000.25, -3.5, 0))])
def test_textures_are_bilinear_in_linear_light_and_repeat(scale: float, shift: Triple) -> None:
    got = textured(TEXELS, scale=scale, shift=shift)
    place = (np.arange(12) + 0.5) / 12
    expected = [
        [bilinear(linear(TEXELS), x * scale + shift[0], (1 - y) * scale + shift[1]) for x in place] for y in place
    ]
    np.testing.assert_allclose(got.radiance, expected, rtol=1e-4, atol=1e-3 * abs(shift[0]) / 1000 + 2e-6)


def test_a_texture_of_one_texel_is_a_colour() -> None:
    got = textured(np.full((1, 1, 3), 188, np.uint8), scale=7.0, shift=(0.1, 0.2, 0.0))
    np.testing.assert_allclose(got.radiance, linear(np.float64(188)), rtol=1e-5)


def test_texture_coordinates_that_are_not_numbers_read_some_texel_and_crash_nothing() -> None:
    got = textured(TEXELS, scale=math.nan, shift=(0, 0, 0))
    assert np.isfinite(got.radiance).all()


def two_objects(middle: Mesh, mirror: float) -> Scene:
    """A mirror at z = 0 before the camera at z = 3, and a red object behind the camera at z = 6."""
    red = Material(name="red", base_color=(0, 0, 0), emission=(1.0, 0.0, 0.0))
    return scene_of(
        [middle, quad(2.0, 1.0, material=1)],
        [instance(0), instance(1, at=(0.5, 0.25, 6.0))],
        materials=[material(0, 0, 0, mirror=mirror), red],
        sky=Sky(zenith=(0, 0, 1), horizon=(0, 0, 1), ground=(0, 0, 1)),
    )


def test_a_flat_mirror_shows_the_mirrored_scene() -> None:
    """What a mirror in z = 0 shows is what the scene mirrored to z = -6 shows without it."""
    seen = view((0, 0, 3), (0, 0, 0), pixels=(48, 48), fov=30.0)
    mirrored = traced_with_every_feature(two_objects(quad(50.0, 50.0), 1.0), seen)
    red = Material(name="red", base_color=(0, 0, 0), emission=(1.0, 0.0, 0.0))
    blue = Sky(zenith=(0, 0, 1), horizon=(0, 0, 1), ground=(0, 0, 1))
    moved = scene_of([quad(2.0, 1.0)], [instance(0, at=(0.5, 0.25, -6.0))], materials=[red], sky=blue)
    behind = traced_with_every_feature(moved, seen)
    np.testing.assert_array_equal(mirrored.radiance, behind.radiance)
    assert 100 < (mirrored.radiance[..., 0] == 1.0).sum() < 2000
    assert (mirrored.objects == 1).all(), "the object of a sample is the mirror itself"


@pytest.mark.parametrize("share", [0.25, 0.9])
def test_a_mirrors_share_is_of_what_it_shows_and_the_rest_of_its_own_light(share: float) -> None:
    """L = (1 - s) albedo E / pi + s L_sky, with albedo E / pi = 0.5 and a black-to-blue constant sky of (0, 0, 1)."""
    sky = Sky(zenith=(0, 0, 1), horizon=(0, 0, 1), ground=(0, 0, 1))
    scene = scene_of([quad(50.0, 50.0)], materials=[material(0.5, 0.5, 0.0, mirror=share)], lights=[LIGHT], sky=sky)
    got = traced_with_every_feature(scene, view((0, 0, 3), (0, 0, 0), pixels=(4, 4)))
    np.testing.assert_allclose(got.radiance, np.broadcast_to([0.5 * (1 - share)] * 2 + [share], (4, 4, 3)), rtol=1e-5)
    assert got.cost.secondary == 16


def test_two_parallel_mirrors_stop_at_the_depth_limit_with_a_geometric_series() -> None:
    """Emission 1 and mirror share s on both: the eye sees sum over k = 0..4 of (1 - s) s^k = 1 - s^5."""
    share = 0.8
    shining = Material(name="m", base_color=(0, 0, 0), mirror=share, emission=WHITE)
    mirrors = [instance(0), instance(0, at=(0, 0, 10), turn=("y", 180.0))]
    scene = scene_of([quad(90.0, 90.0)], mirrors, materials=[shining])
    got = traced_with_every_feature(scene, view((0, 0, 5), (0, 0, 0), pixels=(3, 3)))
    np.testing.assert_allclose(got.radiance, 1 - share**5, rtol=1e-6)
    assert got.cost.secondary == 9 * 4


def balls_that_mirror_each_other() -> Scene:
    """Two balls side by side, of which each shows the other one and so on; behind the eye a finely textured wall."""
    balls = [instance(0, at=(x, 0.0, 0.0)) for x in (-1.05, 1.05)]
    wall = quad(60.0, 60.0, material=1, uvs=True)
    assert wall.uvs is not None
    return scene_of(
        [sphere_mesh(segments=48), replace(wall, uvs=np.float32(40.0) * wall.uvs)],
        [*balls, instance(1, at=(0.0, 0.0, 8.0), turn=("y", 180.0))],
        materials=[material(0.5, 0.5, 0.0, mirror=0.7), material(*WHITE, base_color_texture=0)],
        textures=[Texture(name="t", texels=TEXELS)],
        sky=Sky(zenith=(0, 0, 1), horizon=(0, 1, 0), ground=(1, 0, 0)),
    )


@pytest.mark.parametrize("order", ["shuffled", "as many wait as may"])
def test_rays_behind_mirrors_show_the_same_whatever_packets_they_come_from(order: str) -> None:
    """In raster order mirrored lanes lie side by side; shuffled, a few stand in each packet, and wait for others.

    At most 15 wait while a packet of 16 more comes.
    """
    seen = view((0, 0, 4), (0, 0, 0), pixels=(40, 24))
    scene = make_tracer_scene(with_every_feature(balls_that_mirror_each_other()))
    tracer = Tracer(scene, seen.panel, seen.eye, coherent=True)
    tracer.set_event(seen.event)
    y, x = np.mgrid[0:24, 0:40]
    xy = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32) + np.float32(0.5)
    together, cost = tracer.trace(xy)
    places = np.random.default_rng(5).permutation(len(xy))
    if order != "shuffled":
        hit = np.isfinite(together["depth"])[places]
        hits, misses = places[hit], places[~hit]
        places = np.concatenate([hits[:15], misses[:1], hits[15:31], hits[31:], misses[1:]])
    apart, other = tracer.trace(xy[places])
    assert cost == other
    mirrored = np.isfinite(together["depth"]).sum()
    assert 16 < mirrored < len(xy) / 2
    assert mirrored < cost.secondary < 2 * mirrored, "some show the other ball"
    np.testing.assert_array_equal(apart, together[places])


def test_what_is_broken_behind_a_mirror_is_left_out_and_counted() -> None:
    """A mirror shows two triangles behind the eye; one has a vertex whose colour is no number."""
    colors = [[1, 1, 1], [1, 1, 1], [1, 1, 1], [math.nan, 1, 1]]
    behind = instance(1, at=(0, 0, 8), turn=("y", 180.0))
    scene = scene_of(
        [quad(50.0, 50.0), quad(4.0, 4.0, material=1, colors=colors)], [instance(0), behind],
        materials=[material(0, 0, 0, mirror=1.0), material(1, 1, 1)],
        lights=[PointLight(position=(3.0, 0.0, 4.0), intensity=(100.0, 100.0, 100.0))],
    )  # fmt: skip
    got = traced_with_every_feature(scene, view((0, 0, 4), (0, 0, 0), pixels=(16, 16), fov=FOUR_UNITS))
    dropped = np.isnan(got.radiance).any(axis=-1)
    assert 20 < dropped.sum() == got.cost.bad < 200
    assert (got.radiance[~dropped] > 0.1).any(), "the other triangle"
    assert got.cost.secondary == 256


def test_a_mirror_ball_shows_the_sky_of_the_mirrored_direction() -> None:
    """In the middle of its image a mirror ball sends the ray back to where it came from: here, the horizon."""
    sky = Sky(zenith=(0, 0, 1), horizon=(0, 1, 0), ground=(1, 0, 0))
    scene = scene_of([sphere_mesh(segments=64)], materials=[material(0, 0, 0, mirror=1.0)], sky=sky)
    got = traced_with_every_feature(
        scene, view((0, 0, 9), (0, 0, 0), pixels=(64, 64), fov=2 * math.degrees(math.asin(1 / 9)))
    )
    np.testing.assert_allclose(got.radiance[31:33, 31:33, 1], 1.0, atol=0.08)
    assert got.radiance[12, 32, 2] > 0.6, "its upper part shows the zenith"
    assert got.radiance[52, 32, 0] > 0.6, "its lower part shows the ground"


PLACEMENTS = {
    "turned": instance(0, turn=("x", 40.0)),
    "long": instance(0, turn=("z", 25.0), scale=(3.0, 1.0, 0.5)),
    "mirrored": instance(0, turn=("y", 70.0), scale=(-1.0, 1.0, 1.0)),
    "mirrored all ways": instance(0, turn=("x", 10.0), scale=-1.5),
    "tiny": instance(0, turn=("y", 33.0), scale=1e-4),
    "flattened": instance(0, turn=("x", 50.0), scale=(1.0, 0.01, 1.0)),
}


@pytest.mark.parametrize("smooth", [True, False], ids=["smooth", "flat"])
@pytest.mark.parametrize("placed", PLACEMENTS.values(), ids=PLACEMENTS.keys())
def test_a_placed_mesh_looks_like_the_same_mesh_with_its_vertices_moved(placed: Instance, smooth: bool) -> None:
    """Normals transform by the inverse transpose; a mirroring placement must not turn them inside out.

    The second scene does all of it in float64 beforehand: vertices by M, normals by M^-T (their lengths weigh
    the interpolation, so they are kept).
    """
    mesh, matrix = sphere_mesh(segments=16, smooth=smooth), placed.world_from_object
    moved = (mesh.vertices.astype(np.float64) @ matrix[:3, :3].T).astype(np.float32)
    normals = mesh.normals
    if normals is not None:
        turned_normals = normals.astype(np.float64) @ np.linalg.inv(matrix[:3, :3])
        normals = (turned_normals / np.abs(turned_normals).max()).astype(np.float32)
    size = float(np.abs(moved).max())
    seen = view((0.0, 0.0, 4 * size), (0, 0, 0), pixels=(24, 24), fov=32.0)
    lights = [DirectionalLight(direction=(0.6, 0.64, 0.48), irradiance=(math.pi, math.pi, math.pi))]
    got = traced_with_every_feature(scene_of([mesh], [placed], lights=lights), seen)
    twin = traced_with_every_feature(scene_of([replace(mesh, vertices=moved, normals=normals)], lights=lights), seen)
    agree = np.isclose(got.radiance, twin.radiance, rtol=1e-3, atol=1e-4).all(axis=-1)
    assert (got.objects == twin.objects).mean() > 0.99
    assert agree.mean() > 0.985, "all but silhouettes and facet edges"
    assert (got.radiance[..., 0] > 0.1).sum() > 10


def test_a_placement_that_flattens_to_nothing_is_counted_and_hurts_nothing_else() -> None:
    flat = instance(1, scale=(1.0, 0.0, 1.0))
    seen = view((0, 0, 3), (0, 0, 0), pixels=(8, 8))
    got = traced_with_every_feature(
        scene_of([quad(50.0, 50.0), sphere_mesh()], [instance(0), flat], lights=[LIGHT]), seen
    )
    alone = traced_with_every_feature(scene_of([quad(50.0, 50.0)], lights=[LIGHT]), seen)
    np.testing.assert_array_equal(got.radiance, alone.radiance)


def test_samples_of_broken_colours_are_left_out_and_counted() -> None:
    """The upper left vertex has no colour that is a number: its triangle is dropped, the other one is not."""
    colors = [[1, 1, 1], [1, 1, 1], [1, 1, 1], [math.nan, 1, 1]]
    scene = scene_of([quad(4.0, 4.0, colors=colors)], lights=[LIGHT])
    got = traced_with_every_feature(scene, view((0, 0, 4), (0, 0, 0), pixels=(16, 16), fov=FOUR_UNITS))
    dropped = np.isnan(got.radiance).any(axis=-1)
    assert got.cost.bad == dropped.sum()
    x, y = np.meshgrid(np.arange(16), 15 - np.arange(16))
    assert (dropped[y > x]).all()
    assert not dropped[y < x].any()
    assert got.cost.primary == 256


def unused_features(scene: Scene, seen: View) -> tuple[TracedImage, TracedImage]:
    """An image, and one of the same scene with an object behind the camera that uses every feature."""
    position, back = seen.event.camera.origin(), seen.event.camera.rotation()[:, 2]
    everything = replace(
        quad(0.1, 0.1, uvs=True, colors=np.full((4, 3), 0.5), material=len(scene.materials)),
        normals=np.tile(np.float32([0, 0, 1]), (4, 1)),
    )
    far = position + 500.0 * back
    placed = instance(len(scene.meshes), at=(float(far[0]), float(far[1]), float(far[2])))
    rich = scene_of(
        [*scene.meshes, everything],
        [*scene.instances, placed],
        materials=[
            *scene.materials,
            Material(name="rich", base_color=WHITE, textures=TextureSet(0), mirror=0.5, emission=(2.0, 0.0, 0.0)),
        ],
        textures=[Texture(name="t", texels=TEXELS)],
        lights=[*scene.point_lights, *scene.directional_lights],
        sky=scene.sky,
    )
    return traced_with_every_feature(scene, seen), traced_with_every_feature(rich, seen)


def test_features_left_out_give_the_same_image_as_features_unused(tiny_scene: Scene, tiny_view: View) -> None:
    poor, rich = unused_features(tiny_scene, tiny_view)
    np.testing.assert_array_equal(poor.radiance, rich.radiance)
    np.testing.assert_array_equal(poor.depth, rich.depth)
    np.testing.assert_array_equal(poor.objects, rich.objects)


@pytest.mark.parametrize("n", [0, 1, 15, 16, 17, 33])
def test_packets_that_are_not_full_give_the_same_samples(tiny_scene: Scene, tiny_view: View, n: int) -> None:
    tracer = Tracer(make_tracer_scene(tiny_scene), tiny_view.panel, tiny_view.eye, coherent=True)
    tracer.set_event(tiny_view.event)
    xy = np.random.default_rng(3).uniform(0, 24, (40, 2)).astype(np.float32)
    whole, part = tracer.trace(xy)[0], tracer.trace(xy[:n])
    assert part[1].primary == n
    np.testing.assert_array_equal(part[0], whole[:n])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_turning_scene_sun_and_camera_together_changes_nothing_but_rounding(axis: str) -> None:
    """Sky aside (it has an up), nothing depends on the world's axes."""
    matrix = np.eye(4)
    matrix[:3, :3] = turned(axis, 77.0)

    def seen_from(rotation: Float64) -> TracedImage:
        place = np.eye(4)
        place[:3, :3] = rotation
        towards = rotation @ np.array([0.48, 0.6, 0.64])
        light = DirectionalLight(direction=tuple(towards.tolist()), irradiance=WHITE)
        ball = Instance(name="ball", mesh=0, world_from_object=place)
        eye, up = rotation @ np.array([1.0, 1.0, 3.0]), rotation @ np.array([0.0, 1.0, 0.0])
        seen = view(tuple(eye.tolist()), (0, 0, 0), pixels=(24, 24), up=tuple(up.tolist()))
        return traced_with_every_feature(scene_of([sphere_mesh()], [ball], lights=[light]), seen)

    still, moved = seen_from(np.eye(3)), seen_from(matrix[:3, :3])
    assert (still.objects == moved.objects).mean() > 0.995
    assert np.isclose(still.radiance, moved.radiance, rtol=1e-4, atol=1e-5).all(axis=-1).mean() > 0.99
