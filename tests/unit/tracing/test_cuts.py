"""Planes that cut a scene open: what is left is seen, casts shadows, shines and hides light; the rest does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    View,
    directions,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
    with_every_feature,
)

from wall.core.data import BACKGROUND, Float64, Samples
from wall.scene.build import Scene
from wall.scene.cuts import piece_left, planes_of
from wall.scene.model import AmbientOcclusion, Cut, DirectionalLight, Material, PointLight, Sky
from wall.scene.picking import Picking
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 32  # pixels
RIGHT_OF = Cut(position=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))  # removes x > 0
BELOW = Cut(position=(0.0, 0.0, 0.0), normal=(0.2, -1.0, 0.1))
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE))
SEGMENTS = 256  # of a sphere
TESSELLATED = 5e-4  # of a distance: 1 - cos(pi / 256) is 8e-5, and more where it is met at a slant
SKY = Sky(zenith=(0.2, 0.3, 0.4), horizon=(0.5, 0.6, 0.7), ground=(0.1, 0.1, 0.1))
PAINTS = (material(0.6, 0.5, 0.4), material(0.2, 0.3, 0.4), material(1.0, 1.0, 1.0, mirror=1.0))

pytestmark = pytest.mark.usefixtures("compiled_only")


def cut_open(scene: Scene, *cuts: Cut) -> Scene:
    return replace(with_every_feature(scene), cuts=cuts)


def samples_of(scene: Scene, seen: View = SEEN, sweeps: int = 1) -> Samples:
    """(sweeps, h, w) of the middles of all pixels."""
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    width, height = seen.panel.pixels
    xy = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1).reshape(-1, 2)
    found = [tracer.trace(xy.astype(np.float32), 0.0, number)[0] for number in range(sweeps)]
    return np.stack(found).reshape(sweeps, height, width)


def roots(seen: View) -> Float64:
    """(2, h, w) where rays meet the unit sphere about the origin, NaN where they do not."""
    eye, rays = seen.event.camera.origin(), directions(seen)
    along = rays @ eye
    with np.errstate(invalid="ignore"):
        half = np.sqrt(along**2 - eye @ eye + 1.0)
    return np.stack([-along - half, -along + half])


def octahedral(normals: Float64) -> Float64:
    """(..., 2) of unit normals, as samples have them: -127 to 127."""
    flat = 127.0 * normals / np.abs(normals).sum(axis=-1, keepdims=True)
    x, y, z = np.moveaxis(flat, -1, 0)
    folded = (127.0 - np.abs(y)) * np.where(x >= 0, 1, -1), (127.0 - np.abs(x)) * np.where(y >= 0, 1, -1)
    return np.stack([np.where(z < 0, folded[0], x), np.where(z < 0, folded[1], y)], axis=-1)


@pytest.mark.parametrize(
    ("cuts", "inner"),
    [
        ([Cut(position=(0.1, 0.0, 0.3), normal=(0.0, 0.0, 2.0))], True),
        ([Cut(position=(0.3, 0.1, 0.2), normal=(1.0, 0.5, 1.0)), replace(BELOW, position=(0.0, -0.2, 0.0))], True),
        ([replace(RIGHT_OF, position=(0.2, 0.0, 0.0)), replace(BELOW, enabled=False)], False),
        ([Cut(position=(0.0, 0.0, -0.4), normal=(0.0, 0.1, -1.0)), replace(BELOW, normal=(0.0, 0.0, 0.0))], False),
    ],
)
def test_a_cut_sphere_shows_what_is_left_of_it(cuts: Sequence[Cut], inner: bool) -> None:
    """The first of a ray's two roots that lies in the piece of it that is left; normals are turned towards the ray."""
    scene = replace(cut_open(scene_of([sphere_mesh(segments=SEGMENTS)]), *cuts), path_depth=1)
    seen, rays, both = SEEN, directions(SEEN), roots(SEEN)
    eye = seen.event.camera.origin()
    planes = planes_of(cuts, eye)
    ends = np.array([piece_left(planes, ray) for ray in rays.reshape(-1, 3)]).reshape(EDGE, EDGE, 2)
    left = (both > ends[..., 0]) & (both <= ends[..., 1])
    wanted = np.where(left[0], both[0], np.where(left[1], both[1], np.inf))
    grazing = ~(both[1] - both[0] > 0.2) & (np.abs(np.linalg.norm(np.cross(rays, eye), axis=-1) - 1.0) < 0.02)
    near_a_plane = (np.abs(both[:, :, :, None] - ends) < 0.01).any(axis=(0, 3))
    sure = ~grazing & ~near_a_plane
    (found,) = samples_of(scene)
    np.testing.assert_allclose(found["depth"][sure], wanted[sure], rtol=TESSELLATED)
    hit = sure & np.isfinite(wanted)
    assert hit.sum() > 50
    assert (hit & left[1] & ~left[0]).any() == inner
    outward = eye + np.where(np.isfinite(wanted), wanted, 0.0)[..., None] * rays
    inward = np.where((outward * rays).sum(axis=-1, keepdims=True) > 0.0, -outward, outward)
    off = np.abs(found["normal"][hit] - octahedral(inward[hit] / np.linalg.norm(inward[hit], axis=-1, keepdims=True)))
    assert off.max() < 3.0  # of 127
    clicked = Picking(scene)
    for i, j in np.argwhere(sure)[:: EDGE // 2]:
        assert clicked.distance(scene.at(0.0), eye, rays[i, j]) == pytest.approx(wanted[i, j], rel=TESSELLATED)


def awning(width: float, *, mirror: bool, path_depth: int | None, occlusion: bool) -> Scene:
    """A floor from x = -2 to 2, or to 0, and an awning above it from x = -0.5 to 0.5, or to 0."""
    meshes = [quad(width, 4.0, material=2 if mirror else 0), quad(width / 4, 1.0, material=1)]
    placed = [instance(0, at=(width / 2 - 2.0, 0.0, 0.0)), instance(1, at=(width / 8 - 0.5, 0.0, 0.6))]
    sun = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(3.0, 2.0, 1.0))
    lamp = PointLight(position=(0.4, 0.2, 1.5), intensity=(1.0, 2.0, 3.0))  # beyond the plane, where it stays
    scene = scene_of(meshes, placed, materials=PAINTS, lights=[sun, lamp], sky=SKY)
    if occlusion:
        return replace(scene, path_depth=1, occlusion=AmbientOcclusion(distance=5.0))
    return replace(with_every_feature(scene), path_depth=path_depth)


@pytest.mark.parametrize(
    ("path_depth", "mirror", "occlusion"),
    [(None, False, False), (None, True, False), (3, False, False), (3, True, False), (1, False, True)],
)
def test_what_is_cut_away_looks_as_if_it_had_never_been(path_depth: int | None, mirror: bool, occlusion: bool) -> None:
    """Half of everything: what is seen, its shadows, what a mirror shows, light over several surfaces, hidden sky."""
    seen = view((-0.3, -2.0, 2.0), (-0.3, 0.0, 0.3), pixels=(EDGE, EDGE))
    kept = replace(RIGHT_OF, enabled=False)
    whole, half = (awning(width, mirror=mirror, path_depth=path_depth, occlusion=occlusion) for width in (4.0, 2.0))
    cut, other = traced_image(replace(whole, cuts=(RIGHT_OF,)), seen), traced_image(replace(half, cuts=(kept,)), seen)
    np.testing.assert_array_equal(cut.objects, other.objects)
    np.testing.assert_allclose(cut.depth, other.depth, rtol=1e-5)
    same = np.isclose(cut.radiance, other.radiance, rtol=1e-3, atol=1e-5).all(axis=-1)
    assert same.mean() > 0.99  # where a path grazes the plane, rounding decides
    uncut = traced_image(replace(whole, cuts=(kept,)), seen)
    on_both = (uncut.objects == cut.objects) & (cut.objects == 1)
    assert on_both.sum() > 100
    assert not np.allclose(uncut.radiance[on_both], cut.radiance[on_both], rtol=0.05)  # light that the awning hid


def test_a_cut_lamp_shines_as_much_as_a_smaller_one() -> None:
    """What a floor gets from a square lamp that is cut in two is what it gets from a lamp of one half, on average."""
    lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=(5.0, 5.0, 5.0))
    means = []
    for width, cut in ((1.0, RIGHT_OF), (0.5, replace(RIGHT_OF, enabled=False))):
        placed = [instance(0), instance(1, at=(width / 2 - 0.5, 0.0, 0.8), turn=("y", 180.0))]
        scene = scene_of([quad(0.8, 0.8), quad(width, 1.0, material=1)], placed, materials=[PAINTS[0], lamp])
        seen = view((-0.2, 0.0, 0.7), (-0.2, 0.0, 0.0), pixels=(EDGE, EDGE), fov=10.0)
        found = samples_of(replace(cut_open(scene, cut), path_depth=1), seen, sweeps=8)
        means.append(found["radiance"].astype(np.float64).mean(axis=(0, 1, 2)))
    np.testing.assert_allclose(means[0], means[1], rtol=0.01)
    assert means[0][0] > 0.1


@pytest.mark.parametrize("far", [3.0, 3000.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_surface_in_the_plane_itself_stays_whole(far: float, side: float) -> None:
    """A floor at a slant in the plane of a cut of either side: no hole, and light reaches it as if nothing were cut."""
    turn = ("x", 33.0)
    up = np.array([0.0, -math.sin(math.radians(33.0)), math.cos(math.radians(33.0))])
    scene = scene_of(
        [quad(2.0, 2.0)],
        [instance(0, at=(0.1, 0.2, 0.3), turn=turn)],
        lights=[PointLight(position=(0.1, 0.0, 3.0), intensity=(9.0, 9.0, 9.0))],
    )
    x, y, z = (side * up).tolist()
    seen = view(
        tuple((far * up + (0.0, 0.2 * far, 0.0)).tolist()), (0.1, 0.2, 0.3), pixels=(EDGE, EDGE), fov=100.0 / far
    )
    for path_depth in (None, 1):
        cut = replace(cut_open(scene, Cut(position=(0.1, 0.2, 0.3), normal=(x, y, z))), path_depth=path_depth)
        image, uncut = (
            traced_image(cut, seen),
            traced_image(replace(cut, cuts=(replace(RIGHT_OF, enabled=False),)), seen),
        )
        np.testing.assert_array_equal(image.objects, uncut.objects)
        np.testing.assert_allclose(image.radiance, uncut.radiance, rtol=1e-5)
    assert (uncut.objects == 1).mean() > 0.9


@pytest.mark.parametrize("path_depth", [None, 1])
def test_where_nothing_is_left_the_sky_is_seen(path_depth: int | None) -> None:
    """Between two planes that leave nothing, from before them and along them."""
    low, high = (Cut(position=(0.0, 0.0, side * 0.1), normal=(0.0, 0.0, -side)) for side in (1.0, -1.0))
    scene = replace(cut_open(scene_of([sphere_mesh()], sky=SKY), low, high), path_depth=path_depth)
    for position in ((0.0, 0.0, 4.0), (3.0, 0.0, 0.1), (3.0, 0.0, 0.0)):
        image = traced_image(scene, view(position, (0.0, 0.0, position[2] % 4.0), pixels=(8, 8)))
        assert (image.objects == BACKGROUND).all()
        assert np.isposinf(image.depth).all()
        assert image.cost.shadow == 0
        assert image.radiance.min() > 0.09


def test_glass_absorbs_from_the_plane_on() -> None:
    """Light passes one face of a block of thickness 1 that was cut in the middle: n^2 exp(-d / 2) of it, but for
    what that face reflects, ((n - 1) / (n + 1))^2."""
    n = 1.05
    glass = Material(
        name="glass", base_color=(1.0, 1.0, 1.0), transmission=1.0, ior=n, roughness=0.0,
        attenuation_color=(0.5, 0.25, 0.9), attenuation_distance=1.0,
    )  # fmt: skip
    faces = [instance(0, at=(0.0, 0.0, 0.5)), instance(0, at=(0.0, 0.0, -0.5), turn=("y", 180.0))]
    white = Sky(zenith=(1.0, 1.0, 1.0), horizon=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0))
    scene = cut_open(
        scene_of([quad(9.0, 9.0)], faces, materials=[glass], sky=white), replace(RIGHT_OF, normal=(0, 0, 1))
    )
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=1.0)
    found = samples_of(replace(scene, path_depth=2), seen, sweeps=4)["radiance"].astype(np.float64).mean(axis=(0, 1, 2))
    wanted = n * n * np.sqrt([0.5, 0.25, 0.9])
    np.testing.assert_allclose(found, wanted, rtol=0.01)
