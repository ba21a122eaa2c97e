"""Curves are cones between spheres as exact as float32 lets them be, in colours that blend along them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_scenes import directions, instance, material, scene_of, traced_with_every_feature, view

from wall.core.data import Float64
from wall.scene.model import Cut, DirectionalLight
from wall.scene.picking import Picking
from wall.scene.points import curve_points

EDGE = 48  # pixels
ONE_CURVE = np.array([True, False, False])
ASIDE = np.array([1.0, 0.9, 1.1]) / np.linalg.norm([1.0, 0.9, 1.1])
AXES = [DirectionalLight(direction=tuple(row), irradiance=tuple(math.pi * row)) for row in np.eye(3)]
WHITE = [material(1.0, 1.0, 1.0)]
OFF_SURFACE = 16.0  # of 2^-24 (the eye's distance + the curve's length): largest distance of a hit from its surface
OFF_NORMAL = 16.0  # likewise over the smallest radius: largest error of a normal
SILHOUETTE = 3.0  # likewise: rays that pass the edge nearer than this may go either way

pytestmark = pytest.mark.usefixtures("compiled_only")


def from_surface(points: Float64, spheres: Float64) -> tuple[Float64, Float64]:
    """How far points (n, 3) are outside of a curve of spheres (m, 4), and the unit normals (n, 3) there.

    The hull of two spheres is the union of all those between them, p - q(h) less r(h): the nearest one is where the
    way to it makes the cone's angle with the axis.
    """
    nearest, normals = np.full(len(points), np.inf), np.zeros_like(points)
    for (*a, ra), (*b, rb) in pairwise(spheres):
        axis, fall = np.subtract(b, a), ra - rb
        length = math.sqrt(axis @ axis)
        along = (points - a) @ axis / length
        beside = np.linalg.norm(points - a - np.outer(along, axis) / length, axis=1)
        h = np.clip((along - beside * fall / math.sqrt(length**2 - fall**2)) / length, 0.0, 1.0)
        way = points - a - np.outer(h, axis)
        away = np.linalg.norm(way, axis=1) - (ra - h * fall)
        closer = away < nearest
        nearest[closer], normals[closer] = away[closer], (way / np.linalg.norm(way, axis=1)[:, None])[closer]
    return nearest, normals


@pytest.mark.parametrize(
    ("radii", "length", "distance", "away"),
    [
        ((1.0, 1.0), 2.0, 8.0, 0.0),
        ((1.0, 0.5), 2.0, 8.0, 1e6),  # far from the world's origin
        ((1.0, 0.2), 0.9, 6.0, 0.0),  # blunt
        ((1e-3, 2e-3), 1e-2, 10.0, 0.0),
        ((1e-2, 1e-2), 1.0, 0.1, 0.0),  # long and near
        ((1e-3, 1e-3), 100.0, 10.0, 0.0),
    ],
)
def test_hits_and_normals_are_those_of_cones_and_spheres(
    radii: tuple[float, float], length: float, distance: float, away: float
) -> None:
    """White under three lights along the axes, a curve with a bend shows its normals as its radiance."""
    middle, way = away * np.array([1.0, 0.3, -0.2]), np.array([0.3, 1.0, -0.2]) / math.sqrt(1.13)
    ends = [middle - 0.5 * length * way, middle + 0.5 * length * way]
    ends.append(ends[1] + 0.8 * length * np.array([1.0, 0.0, 0.0]))
    curves = curve_points(np.column_stack([ends, [*radii, radii[1]]]), ONE_CURVE, material=0)
    scene = scene_of([curves], materials=WHITE, lights=AXES)
    size = max(2.0 * max(radii), min(length, 50.0 * max(radii)))
    fov = math.degrees(2.0 * math.atan(min(0.7 * size / distance, 1.2)))
    eye = tuple((middle + distance * ASIDE).tolist())
    seen = view(eye, tuple(middle.tolist()), pixels=(EDGE, EDGE), fov=fov)
    image = traced_with_every_feature(scene, seen)

    assert curves.spheres is not None
    origin, rays, unit = seen.event.camera.origin() - curves.origin, directions(seen), 2.0**-24 * (distance + length)
    spheres, hit = curves.spheres.astype(np.float64), image.objects == 1
    points = (origin + image.depth[..., None].astype(np.float64) * rays)[hit]
    off, normals = from_surface(points, spheres)
    assert np.abs(off).max() <= OFF_SURFACE * unit
    facing = normals > 0.02 + OFF_NORMAL * unit / min(radii)
    shown = image.radiance[hit]
    lit = facing & (shown > 0.0)  # one part of the curve shadows the other
    assert lit.sum() > 0.7 * facing.sum() > 10
    assert np.abs(shown - normals)[lit].max() <= OFF_NORMAL * unit / min(radii)

    picking, moment = Picking(scene), scene.at(0.0)
    for row, column in np.argwhere(np.ones((EDGE, EDGE))[::6, ::6]) * 6:
        expected = picking.first(moment, seen.event.camera.origin(), rays[row, column])[0]
        if math.isfinite(expected) != hit[row, column]:
            near = origin + rays[row, column] * np.linspace(0.0, 3.0 * distance, 20_000)[:, None]
            assert abs(from_surface(near, spheres)[0].min()) < 1e-4 * distance
        elif hit[row, column]:
            steep = max(
                0.02,
                -float(rays[row, column] @ from_surface((origin + expected * rays[row, column])[None], spheres)[1][0]),
            )
            assert abs(image.depth[row, column] - expected) <= 2.0 * OFF_SURFACE * unit / steep


TWO = np.array([[-2.0, 0.0, 0.0, 0.4], [2.0, 0.0, 0.0, 0.4], [-2.0, 2.0, 0.0, 0.2], [2.0, 2.0, 0.0, 0.2]])
COLORS = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
AHEAD = view((0.0, 0.0, 20.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=20.0)
LIGHT = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi, math.pi, math.pi))


def pixel_of(x: float, y: float) -> tuple[int, int]:
    per_unit = EDGE / (2.0 * 20.0 * math.tan(math.radians(10.0)))
    return int(EDGE / 2 - y * per_unit), int(EDGE / 2 + x * per_unit)


def test_colours_are_blended_along_a_curve_and_two_curves_are_not_joined() -> None:
    one = curve_points(TWO, np.array([True, False, True, False]), material=0, colors=COLORS)
    plain = curve_points(TWO - [0.0, 2.0, 0.0, 0.0], np.array([True, False, True, False]), material=0)
    placed = [instance(0), instance(1, at=(0.0, -2.0, 0.0), turn=("z", 180.0)), instance(0, at=(0.0, 0.0, -50.0))]
    scene = scene_of([one, plain], placed, materials=WHITE, lights=[LIGHT])
    image = traced_with_every_feature(scene, AHEAD)
    for x in (-1.0, 0.0, 1.5):
        row, column = pixel_of(x, 0.0)
        shown = image.radiance[row, column]
        middle = (column + 0.5 - EDGE / 2) / EDGE * 2.0 * 20.0 * math.tan(math.radians(10.0)) * (19.6 / 20.0)
        share = (middle + 2.0) / 4.0
        assert shown / shown[2] == pytest.approx([2.0 * (1.0 - share), 2.0 * share, 1.0], abs=0.02)
    assert image.radiance[pixel_of(1.0, 2.0)][0] == pytest.approx(0.0, abs=1e-6)
    assert image.objects[pixel_of(0.0, 1.0)] == 0
    assert image.objects[pixel_of(0.0, -2.0)] == 2
    assert np.ptp(image.radiance[pixel_of(0.0, -2.0)]) < 1e-6


def test_a_cut_shows_the_inside_of_a_curve() -> None:
    scene = scene_of([curve_points(TWO[:2], np.array([True, False]), material=0)], materials=WHITE, lights=[LIGHT])
    cut = Cut(position=(0.0, 0.0, 0.2), normal=(0.0, 0.0, 1.0))
    image = traced_with_every_feature(replace(scene, cuts=(cut,)), AHEAD)
    assert image.depth[pixel_of(0.0, 0.0)] == pytest.approx(20.4, abs=0.02)


def test_equal_neighbours_and_lone_points_are_left_out() -> None:
    rows = np.repeat(TWO, [1, 3, 1, 1], axis=0)
    curves = curve_points(rows, np.array([True, False, False, False, True, True]), material=0, colors=np.ones((6, 3)))
    assert curves.segments is not None
    assert curves.segments.tolist() == [0, 1]  # 4 long and 0.4 thick: in two pieces
    assert curves.primitives == 2
    assert curves.colors is not None
    assert len(curves.colors) == len(curves.vertices) == 5
    np.testing.assert_allclose(curves.vertices[:3, 0] + curves.origin[0], [-2.0, 0.0, 2.0])
