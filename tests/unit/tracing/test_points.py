"""Points are spheres as exact as float32 lets them be, in their own colours, wherever and however they are placed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    TracedImage,
    View,
    directions,
    instance,
    material,
    quad,
    scene_of,
    traced_with_every_feature,
    view,
)

from wall.core.data import Float64
from wall.scene.bounds import framing_sphere
from wall.scene.model import Cut, DirectionalLight, Instance, Mesh
from wall.scene.picking import Picking
from wall.scene.points import sphere_points

EDGE = 48  # pixels
OFF_SPHERE = 6.0  # of 2^-24 (the eye's distance + the cloud's radius): largest distance of a hit from its sphere
OFF_NORMAL = 4.0  # likewise over the sphere's radius: largest error of a normal
SILHOUETTE = 3.0  # likewise: rays that pass the edge of a sphere nearer than this may go either way
AXES = [DirectionalLight(direction=tuple(row), irradiance=tuple(math.pi * row)) for row in np.eye(3)]
ASIDE = np.array([1.0, 0.9, 1.1]) / np.linalg.norm([1.0, 0.9, 1.1])

pytestmark = pytest.mark.usefixtures("compiled_only")


def close_up(middle: Float64, radius: float, distance: float) -> View:
    """A sphere that fills the image, seen from where all three lights light it."""
    fov = math.degrees(2.0 * math.asin(min(1.05 * radius / distance, 0.99)))
    eye = middle + distance * ASIDE
    return view(tuple(eye.tolist()), tuple(middle.tolist()), pixels=(EDGE, EDGE), fov=fov)


@pytest.mark.parametrize(
    ("radius", "distance", "cloud", "away"),
    [
        (1.0, 4.0, 0.0, 0.0),
        (1.0, 1.001, 0.0, 0.0),  # rays graze it but for a few
        (1.0, 1.2, 0.0, 1e6),  # far from the world's origin
        (1e-3, 10.0, 0.0, 1e6),
        (1e-4, 100.0, 0.0, 0.0),  # errors are 6% of the radius
        (1e-3, 10.0, 100.0, 0.0),  # small in a large cloud
        (1e-6, 1e-4, 0.0, 0.0),
        (1e3, 4e3, 1e5, 1e7),
    ],
)
def test_hits_and_normals_are_those_of_the_sphere(radius: float, distance: float, cloud: float, away: float) -> None:
    """White under three lights along the axes, a sphere shows its normals as its radiance."""
    middle = away * np.array([1.0, 0.3, -0.2])
    rows = [[*middle, radius], [*(middle - cloud * ASIDE), radius / 2]]
    points = sphere_points(np.array(rows), material=0)
    scene = scene_of([points], materials=[material(1.0, 1.0, 1.0)], lights=AXES)
    seen = close_up(middle, radius, distance)
    image = traced_with_every_feature(scene, seen)

    assert points.spheres is not None
    center = np.array(points.origin) + points.spheres[0, :3]
    eye, rays = seen.event.camera.origin(), directions(seen)
    unit = 2.0**-24 * (distance + cloud)
    along = rays @ (center - eye)
    beside = np.linalg.norm(eye + along[..., None] * rays - center, axis=-1) - radius
    hit = image.objects == 1
    assert hit[beside < -SILHOUETTE * unit].all()
    assert not hit[beside > SILHOUETTE * unit].any()
    from_center = (eye + image.depth[..., None].astype(np.float64) * rays - center)[hit]
    reach = np.linalg.norm(from_center, axis=1)
    assert np.abs(reach - radius).max() <= OFF_SPHERE * unit
    normals = from_center / reach[:, None]
    lit = (normals > 0.02 + OFF_NORMAL * unit / radius).all(axis=1)  # elsewhere some light does not reach it
    assert lit.sum() > EDGE
    assert np.abs(image.radiance[hit][lit] - normals[lit]).max() <= OFF_NORMAL * unit / radius


COLORS = np.array([[1.0, 0.5, 0.2], [0.1, 0.9, 0.3]])
SPHERES = sphere_points(np.array([[0.0, 0.0, 0.0, 1.0], [3.0, 0.0, 0.0, 0.5]]), material=0, colors=COLORS)
WHITE = [material(1.0, 1.0, 1.0)]
AHEAD = view((1.5, 0.0, 20.0), (1.5, 0.0, 0.0), pixels=(EDGE, EDGE), fov=20.0)


def image_of_spheres(*more: Mesh, placed: list[Instance] | None = None, cuts: tuple[Cut, ...] = ()) -> TracedImage:
    """The spheres under light from the right and the front."""
    light = DirectionalLight(direction=(0.8, 0.0, 0.6), irradiance=(math.pi, math.pi, math.pi))
    scene = scene_of([SPHERES, *more], placed, materials=WHITE, lights=[light])
    return traced_with_every_feature(replace(scene, cuts=cuts), AHEAD)


def pixel_of(x: float, y: float) -> tuple[int, int]:
    """Row and column of the pixel that shows the world's point x, y, 0."""
    per_unit = EDGE / (2.0 * 20.0 * math.tan(math.radians(10.0)))
    return int(EDGE / 2 - y * per_unit), int(EDGE / 2 + (x - 1.5) * per_unit)


def test_each_sphere_has_its_own_colour() -> None:
    image = image_of_spheres()
    for x, color in ((0.0, (1.0, 0.5, 0.2)), (3.0, (0.1, 0.9, 0.3))):
        shown = image.radiance[pixel_of(x, 0.0)]
        assert shown / shown.max() == pytest.approx(np.array(color) / max(color), rel=1e-5)


def test_colours_of_a_second_mesh_of_spheres_and_of_a_mesh_beside_them_are_their_own() -> None:
    blue = sphere_points(np.array([[0.0, 3.0, 0.0, 1.0]]), material=0, colors=np.array([[0.0, 0.0, 1.0]]))
    plain = sphere_points(np.array([[3.0, 3.0, 0.0, 1.0]]), material=0)
    green = replace(quad(1.0, 1.0, colors=np.tile([0.0, 1.0, 0.0], (4, 1))), origin=(0.0, -2.5, 0.0))
    image = image_of_spheres(blue, plain, green)
    shown = [image.radiance[pixel_of(*at)] for at in ((0.0, 3.0), (3.0, 3.0), (0.0, -2.5), (3.0, 0.0))]
    expected = [(0.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 0.0), (1 / 9, 1.0, 3 / 9)]
    for radiance, color in zip(shown, expected, strict=True):
        assert radiance / radiance.max() == pytest.approx(color, rel=1e-5)


def test_one_sphere_shadows_another() -> None:
    """Light from the right: the small sphere's shadow falls on the large one, and on nothing without it."""
    alone = sphere_points(np.array([[0.0, 0.0, 0.0, 1.0]]), material=0)
    light = DirectionalLight(direction=(1.0, 0.0, -0.3), irradiance=(1.0, 1.0, 1.0))
    images = [
        traced_with_every_feature(scene_of([mesh], materials=WHITE, lights=[light]), AHEAD) for mesh in (SPHERES, alone)
    ]
    shadowed, lit = (image.radiance[pixel_of(0.7, 0.0)].sum() for image in images)
    assert shadowed == 0.0
    assert lit > 0.1


def test_instances_are_turned_and_stretched() -> None:
    """Turned a quarter about z and stretched to ellipsoids, the small sphere stands above the large one."""
    image = image_of_spheres(placed=[instance(0, at=(0.0, 0.0, 0.0), turn=("z", 90.0), scale=(1.0, 2.0, 1.0))])
    assert image.objects[pixel_of(0.0, 3.0)] == 1
    assert image.objects[pixel_of(3.0, 0.0)] == 0
    assert image.objects[pixel_of(1.8, 0.0)] == 1  # stretched along what was y
    assert image.depth[pixel_of(0.0, 0.0)] == pytest.approx(math.hypot(1.5, 19.0), abs=0.02)


def test_a_cut_shows_the_inside_of_a_sphere() -> None:
    image = image_of_spheres(cuts=(Cut(position=(0.0, 0.0, 0.5), normal=(0.0, 0.0, 1.0)),))
    assert image.depth[pixel_of(0.0, 0.0)] == pytest.approx(math.hypot(1.5, 21.0), abs=0.02)


def test_a_click_meets_the_sphere_that_is_seen() -> None:
    scene = scene_of([SPHERES], [instance(0, at=(10.0, 0.0, 0.0), scale=2.0)], materials=WHITE)
    picking, still = Picking(scene), scene.at(0.0)
    ahead, front = np.array([0.0, 0.0, -2.0]), np.array([16.0, 0.0, 9.0])
    assert picking.first(still, front, ahead) == (pytest.approx(4.0), 0)
    assert picking.distance(still, np.array([16.0, 0.0, 0.0]), ahead) == pytest.approx(0.5)  # from inside
    assert picking.distance(still, np.array([13.0, 1.5, 9.0]), ahead) == math.inf


def test_the_framing_sphere_holds_every_sphere() -> None:
    """Exactly for few; within a cell of the grid for many."""
    center, radius = framing_sphere([SPHERES], [instance(0)])
    assert center == pytest.approx((1.25, 0.0, 0.0))
    assert radius == pytest.approx(math.sqrt(2.25**2 + 2.0), abs=1e-6)
    chance = np.random.default_rng(3)
    ball = chance.standard_normal((100_000, 3))
    ball *= (chance.random(len(ball)) ** (1 / 3) / np.linalg.norm(ball, axis=1))[:, None]
    many = sphere_points(np.concatenate([ball, np.full((len(ball), 1), 0.01)], axis=1), material=0)
    _, radius = framing_sphere([many], [instance(0)])
    assert 1.0 < radius < 1.01 + 2.0 * math.sqrt(3.0) / 32 + 0.05
