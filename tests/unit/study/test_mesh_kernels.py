"""Kernels of Tapestry and of the Shading Cache against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from wall.core.data import SAMPLE
from wall.study.quality.kernels import shading_cache as kernels_cache
from wall.study.quality.kernels import tapestry as kernels_tapestry
from wall.study.quality.methods_shading_cache import points_of

ROUNDING = 1e-5  # a few float32 operations on values near 1
HEIGHT, WIDTH = 12, 16
NEAR, FAR = 1.0, 4.0


def tapestry(xy: np.ndarray, depth: np.ndarray) -> tuple[kernels_tapestry.Vertices, kernels_tapestry.Mesh]:
    """Vertices seen at (n, 2) pixels and (n,) depth, whose red grows by 0.05 a pixel to the right, and their mesh."""
    frame, n = kernels_tapestry.FRAME, len(xy)
    vertices = kernels_tapestry.Vertices(
        position=np.full((frame + n, 4), -1.0, np.float32), radiance=np.full((frame + n, 3), 0.5, np.float32),
        age=np.zeros(frame + n, np.float32), screen=np.zeros((frame + n, 3), np.float32),
        meshed=np.zeros(frame + n, np.uint8),
    )  # fmt: skip
    vertices.position[frame:] = np.column_stack([xy[:, 0] * depth, xy[:, 1] * depth, depth, np.ones(n)])
    vertices.radiance[frame:, 0] = 0.05 * xy[:, 0]
    kernels_tapestry.project(vertices, sideways(0.0), WIDTH, HEIGHT)
    numbers, points = np.zeros(frame + n, np.int32), np.zeros((frame + n, 2))
    count = kernels_tapestry.list_points(vertices, numbers, points)
    simplices = Delaunay(points[:count]).simplices
    t = len(simplices)
    mesh = kernels_tapestry.Mesh(np.zeros((t, 3), np.int32), np.zeros(t, np.uint8), np.zeros(t))
    kernels_tapestry.link(simplices, numbers, vertices, mesh)
    return vertices, mesh


def sideways(shift: float) -> np.ndarray:
    """(2, 12) float32 panel_from_object: point (x, y, z) of object 1 appears at (x + shift) / z, y / z."""
    table = np.zeros((2, 12), np.float32)
    table[1] = [0, 0, 1, 0, 1, 0, 0, shift, 0, 1, 0, 0]
    return table


def drawn(vertices: kernels_tapestry.Vertices, mesh: kernels_tapestry.Mesh) -> np.ndarray:
    points = np.zeros((2 * HEIGHT, 2 * WIDTH, 4), np.float32)
    image = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    kernels_tapestry.draw(vertices, mesh, points)
    kernels_tapestry.average(points, image)
    return image


def grid() -> np.ndarray:
    """(n, 2) float64: positions on a plane, more than the image."""
    y, x = np.mgrid[-4 : HEIGHT + 5 : 2, -4 : WIDTH + 5 : 2]
    return np.stack([x, y], axis=-1).reshape(-1, 2) + 0.3


def test_a_tapestry_of_one_plane_is_exact_for_light_that_is_linear() -> None:
    image = drawn(*tapestry(grid(), np.full(len(grid()), NEAR)))
    expected = np.broadcast_to(0.05 * (np.arange(WIDTH) + 0.5), (HEIGHT, WIDTH))
    np.testing.assert_allclose(image[:, :, 0], expected, atol=1e-3)  # points are shifted by up to 0.002 pixels
    np.testing.assert_allclose(image[:, :, 3], 1.0, atol=ROUNDING)


def test_a_long_bridge_shows_the_farther_surface() -> None:
    xy = grid()
    xy = xy[(xy[:, 0] < 4) | (xy[:, 0] > 12)]
    vertices, mesh = tapestry(xy, np.where(xy[:, 0] < 8, NEAR, FAR))
    vertices.radiance[:, 0] = np.where(vertices.screen[:, 0] < 8, 0.0, 1.0)
    image = drawn(vertices, mesh)
    np.testing.assert_allclose(image[2:-2, 6:11, 0], 1.0, atol=ROUNDING)  # what was uncovered
    np.testing.assert_allclose(image[2:-2, :2, 0], 0.0, atol=ROUNDING)


def test_vertices_behind_the_moved_mesh_are_removed_and_others_stay() -> None:
    xy = grid()
    near = xy[:, 0] < 6
    vertices, mesh = tapestry(xy, np.where(near, NEAR, FAR))
    kernels_tapestry.project(vertices, sideways(6.0), WIDTH, HEIGHT)  # the near plane moves by 6, the far one by 1.5
    depth = np.zeros((HEIGHT, WIDTH), np.float32)
    kernels_tapestry.cover(vertices, mesh, depth)
    cells = np.zeros((2 * (HEIGHT + 12), 2 * (WIDTH + 12)), np.int32)
    kernels_tapestry.thin_out(vertices, depth, cells)
    alive = vertices.position[kernels_tapestry.FRAME :, 3] >= 0
    inside = (xy[:, 1] > 2) & (xy[:, 1] < HEIGHT - 2)
    assert alive[near].all()
    assert not alive[inside & ~near & (xy[:, 0] < 8)].any()  # seen below 9.5, where the near plane's edge is at 10.3
    assert alive[inside & (xy[:, 0] > 11)].all()


@pytest.mark.parametrize("wanted", [40, 200])
def test_positions_lie_in_their_triangles_and_most_where_the_mesh_is_worst(wanted: int) -> None:
    vertices, mesh = tapestry(grid(), np.full(len(grid()), NEAR))
    vertices.age[vertices.screen[:, 0] > WIDTH / 2] = 4.0
    values = np.array([1.0, 0.0, 0.01, 0.0], np.float32)
    total = kernels_tapestry.weigh(vertices, mesh, WIDTH, HEIGHT, values, np.float32(1.0))
    xy, triangle = np.zeros((2 * wanted, 2), np.float32), np.zeros(2 * wanted, np.int32)
    size = np.array((WIDTH, HEIGHT), np.float32)
    count = kernels_tapestry.choose(vertices, mesh, total / wanted, 7, size, xy, triangle)
    assert count <= wanted + 1
    corners = vertices.screen[mesh.corners[triangle[:count]]][:, :, :2]
    assert (xy[:count] >= corners.min(axis=1) - ROUNDING).all()
    assert (xy[:count] <= corners.max(axis=1) + ROUNDING).all()
    assert np.mean(xy[:count, 0] > WIDTH / 2 - 2) > 0.9


def square() -> kernels_cache.Patches:
    """Two triangles of object 1 that make up the square (0, 0) to (16, 16), of which nothing is known."""
    corners, position = np.full((400, 4), -1, np.int32), np.zeros((300, 3), np.float32)
    corners[0, :3], corners[1, :3] = (0, 1, 2), (1, 3, 2)
    position[:4, :2] = [(0, 0), (16, 0), (0, 16), (16, 16)]
    position[:, 2] = 1.0
    patches = kernels_cache.Patches(
        corners=corners, child=np.full(400, -1, np.int32), turn=np.zeros(2, np.uint8), first=np.zeros(2, np.int32),
        position=position, light=np.zeros((300, 3), np.float32), age=np.full(300, -1.0, np.float32),
        middles=np.full((1024, 3), -1, np.int32), counts=np.array([2, 4], np.int64),
    )  # fmt: skip
    kernels_cache.turn_roots(patches)
    return patches


def sampled(count: int, seed: int) -> tuple[np.ndarray, kernels_cache.Points]:
    """So many samples anywhere on the square, without light yet."""
    xy = np.random.default_rng(seed).uniform(0.01, 15.99, (count, 2)).astype(np.float32)
    samples, points = np.zeros(count, SAMPLE), points_of(count)
    second = xy.sum(axis=1) > 16
    samples["xy"], points.seen[:, 0], points.seen[:, 1] = xy, 1, second
    x, y = xy.T / 16
    points.weights[:] = np.where(second[:, None], np.stack([x + y - 1, 1 - x], axis=1), np.stack([x, y], axis=1))
    points.albedo[:] = 0.5
    return samples, points


def take(patches: kernels_cache.Patches, samples: np.ndarray, points: kernels_cache.Points) -> int:
    tuning, seen = np.array([1.0, 0.7, 0.04, 0.0], np.float32), np.full((16, 16, 3), -1, np.int32)
    splits: int = kernels_cache.take(samples, points, patches, sideways(0.0), tuning, seen)
    return splits


def light_at(patches: kernels_cache.Patches, points: kernels_cache.Points) -> np.ndarray:
    found = []
    for k in range(len(points.seen)):
        patch, *weights = kernels_cache.locate(patches, points, k)
        found.append(np.array(weights) @ patches.light[patches.corners[patch, :3], 0])
    return np.array(found)


def test_light_without_change_is_exact_and_splits_nothing() -> None:
    patches = square()
    samples, points = sampled(50, seed=1)
    samples["radiance"] = 0.3
    assert take(patches, samples, points) == 0
    np.testing.assert_allclose(patches.light[:4], 0.6, atol=ROUNDING)  # radiance over albedo
    assert patches.counts.tolist() == [2, 4]


def test_patches_are_split_at_an_edge_of_light_down_to_a_pixel_and_share_their_middles() -> None:
    patches = square()
    for seed in range(40):
        samples, points = sampled(200, seed)
        samples["radiance"] = np.where(samples["xy"][:, :1] > 8, 0.4, 0.1)
        take(patches, samples, points)
    used, vertices = patches.counts
    place = patches.position[:vertices, :2]
    assert len(np.unique(place, axis=0)) == vertices  # one vertex a place, whichever patch was split first
    leaves = patches.corners[:used, :3][patches.child[:used] < 0]
    sizes = np.ptp(place[leaves], axis=1).max(axis=1)
    beside = np.abs(place[leaves][:, :, 0] - 8).min(axis=1) < 1
    assert sizes.min() >= 0.5
    assert np.median(sizes[beside]) <= 2.0
    checked, where = sampled(300, seed=99)
    away = np.abs(checked["xy"][:, 0] - 8) > 3
    expected = np.where(checked["xy"][:, 0] > 8, 0.8, 0.2)
    np.testing.assert_allclose(light_at(patches, where)[away], expected[away], atol=0.02)


def test_splitting_does_not_change_light_that_is_linear() -> None:
    patches = square()
    patches.age[:4], patches.light[:4, :] = 0.0, (patches.position[:4, :1] / 16)
    samples, points = sampled(200, seed=3)
    before = light_at(patches, points)
    for patch in range(20):
        kernels_cache.split(patches, patch)
    np.testing.assert_allclose(light_at(patches, points), before, atol=ROUNDING)
    np.testing.assert_allclose(before, samples["xy"][:, 0] / 16, atol=ROUNDING)


def test_a_full_cache_splits_no_more() -> None:
    patches = square()._replace(child=np.full(4, -1, np.int32))
    for seed in range(4):
        samples, points = sampled(100, seed)
        samples["radiance"] = np.where(samples["xy"][:, :1] > 8, 0.4, 0.1)
        take(patches, samples, points)
    assert patches.counts[0] == 4


def test_vertices_around_a_contradiction_age() -> None:
    patches = square()
    patches.age[:4] = 0.0
    samples, points = sampled(1, seed=5)
    samples["radiance"] = 0.5
    tuning, seen = np.array([100.0, 0.0, 9.0, 4.0], np.float32), np.full((16, 16, 3), -1, np.int32)
    seen[:] = (0, 1, 3)
    kernels_cache.take(samples, points, patches, sideways(0.0), tuning, seen)
    assert patches.age[[0, 1, 3]].max() > 4.0
    assert patches.age[2] == 0.0
