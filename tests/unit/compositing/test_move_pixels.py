"""Pixels of another moment: each where its surface is now, surfaces whole, gaps behind silhouettes left open."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.compositing.kernels.timewarp import gather, move_pixels, true_depth
from wall.core.data import Float32, Float64
from wall.deepbuffer.kernels.reproject import object_tables

SIZE = (24, 32)  # rows, columns
FRAME = np.float64([[-0.16, 0.12, -0.2], [0.01, 0.0, 0.0], [0.0, -0.01, 0.0]])  # a pixel is 0.01 at distance 0.2
CORNER = np.zeros(2)
HALF_A_PIXEL = 0.5 + 1e-3  # and float32's rounding of places


class Moment:
    """An eye and where the objects are."""

    def __init__(self, eye: tuple[float, float, float] = (0.0, 0.0, 0.0), moved: tuple[float, ...] = (0.0, 0.0, 0.0)):
        world_from_object = np.stack([np.eye(4), np.eye(4)])
        world_from_object[1, :3, 3] = moved  # object 2
        self.eye = np.float64(eye)
        self.object_from_eye, self.panel_from_object = (np.empty((3, 12), np.float32) for _ in range(2))
        world_from_object.setflags(write=False)  # as a scene's are: the same compiled kernel
        object_tables(world_from_object, self.eye, FRAME, CORNER, self.object_from_eye, self.panel_from_object)


def rays() -> Float64:
    """(h, w, 3) directions of pixel centres whose component before the eye is 1."""
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]] + 0.5
    return (FRAME[0] + x[..., None] * FRAME[1] + y[..., None] * FRAME[2]) / 0.2


def plane(distance: float, moment: Moment) -> Float32:
    """(h, w) depth of the plane z = -distance."""
    directions = rays()
    return (np.linalg.norm(directions, axis=2) * (distance + moment.eye[2])).astype(np.float32)


def moved(depth: Float32, object_id: NDArray[np.uint32], old: Moment, new: Moment) -> tuple[NDArray[np.int32], Float32]:
    """Sources, and distances from the new eye."""
    near, source, distance = np.empty(SIZE, np.float32), np.empty(SIZE, np.int32), np.empty(SIZE, np.float32)
    move_pixels(depth, object_id, FRAME, CORNER, old.object_from_eye, new.panel_from_object, near, source)
    true_depth(near, FRAME, CORNER, distance)
    return source, distance


def all_of(name: int) -> NDArray[np.uint32]:
    return np.full(SIZE, name, np.uint32)


def test_the_same_moment_moves_nothing() -> None:
    here = Moment()
    source, distance = moved(plane(2.0, here), all_of(1), here, here)
    np.testing.assert_array_equal(source.ravel(), np.arange(source.size))
    np.testing.assert_allclose(distance, plane(2.0, here), rtol=1e-6)


@pytest.mark.parametrize("eye", [(0.13, -0.07, 0.0), (0.0, 0.0, -0.6), (-0.05, 0.02, 0.3), (0.04, 0.04, -0.9)])
def test_points_of_a_plane_are_off_by_half_a_pixel_and_a_pixel_where_a_crack_closed(
    eye: tuple[float, float, float],
) -> None:
    """The plane is at 2: from 0.6 nearer it is seen 1.43 times as large, from 0.9 nearer 1.82 times."""
    old, new = Moment(), Moment(eye)
    source, distance = moved(plane(2.0, old), all_of(1), old, new)
    points = (rays() * 2.0).reshape(-1, 3)
    u, v = ((-(points - new.eye) / (points - new.eye)[:, 2:] * [1, -1, 1])[:, c] * 20 for c in range(2))
    y, x = np.nonzero(source >= 0)
    k = source[y, x]
    off = np.maximum(np.abs(u[k] + 16 - x - 0.5), np.abs(v[k] + 12 - y - 0.5))
    assert off.max() <= 1.0 + HALF_A_PIXEL
    assert np.mean(off <= HALF_A_PIXEL) >= min(1.0, (1 + eye[2] / 2.0) ** 2) - 0.1  # as many as pixels can reach
    expected = plane(2.0, new)[source >= 0]
    np.testing.assert_allclose(distance[source >= 0], expected, rtol=1e-5)


@pytest.mark.parametrize(("nearer", "open_share"), [(0.2, 0.0), (0.45, 0.0), (0.5, 0.005), (0.9, 0.0)])
def test_a_surface_has_no_holes_until_it_is_seen_twice_as_large(nearer: float, open_share: float) -> None:
    """At 0.5 it is 4/3 times as large: places are on the very edges of pixels, and rounding sends them to either."""
    old = Moment()
    source, _ = moved(plane(2.0, old), all_of(1), old, Moment((0.0, 0.0, -nearer)))
    assert (source < 0).mean() <= open_share


def test_an_object_that_moves_takes_its_pixels_and_leaves_a_gap_not_a_wider_outline() -> None:
    """Object 2 is at 1, where a pixel is 0.05 wide: 0.2 to the right are 4 pixels. Nobody knows what the gap shows."""
    old, new = Moment(), Moment(moved=(0.2, 0.0, 0.0))
    object_id, depth = all_of(1), plane(2.0, old)
    object_id[8:16, 10:18] = 2
    depth[object_id == 2] = plane(1.0, old)[object_id == 2]
    source, _ = moved(depth, object_id, old, new)
    gap = source[8:16, 10:14].ravel()
    assert np.mean(gap == -1) > 0.8  # corners are amidst what is behind
    assert (object_id.ravel()[gap[gap >= 0]] == 1).all()
    expected = np.arange(source.size).reshape(SIZE)
    expected[8:16, 14:22] = expected[8:16, 10:18].copy()
    expected[8:16, 10:14] = source[8:16, 10:14]
    np.testing.assert_array_equal(source, expected)


def test_a_gap_of_one_pixel_shows_what_is_behind() -> None:
    old, new = Moment(), Moment(moved=(0.05, 0.0, 0.0))
    object_id, depth = all_of(1), plane(2.0, old)
    object_id[:, 10:18] = 2
    depth[object_id == 2] = plane(1.0, old)[object_id == 2]
    source, _ = moved(depth, object_id, old, new)
    assert (object_id.ravel()[source[:, 10]] == 1).all()
    assert (object_id.ravel()[source[:, 11:19]] == 2).all()


def test_the_sky_stays_where_it_is_when_the_eye_moves_on() -> None:
    depth = np.full(SIZE, np.inf, np.float32)
    source, distance = moved(depth, all_of(0), Moment(), Moment((0.5, 0.2, -3.0)))
    np.testing.assert_array_equal(source.ravel(), np.arange(source.size))
    assert np.isinf(distance).all()


def test_pixels_without_a_place_are_dropped() -> None:
    """An object that is not known, one infinitely far, a depth that is no number, and all of it behind the eye."""
    old, depth, object_id = Moment(), plane(2.0, Moment()), all_of(1)
    object_id[0, 0], depth[5, 5], depth[9, 9] = 7, np.inf, np.nan
    source, _ = moved(depth, object_id, old, old)
    assert not {0, 5 * 32 + 5, 9 * 32 + 9} & set(source.ravel().tolist())
    behind, distance = moved(plane(2.0, old), all_of(1), old, Moment((0.0, 0.0, -2.5)))
    assert (behind == -1).all()
    assert np.isinf(distance).all()


def test_gathering_leaves_pixels_without_a_source() -> None:
    out = np.full((3, 2), 9.0, np.float32)
    gather(np.int32([1, -1, 0]), np.float32([[1, 2], [3, 4], [5, 6]]), out)
    assert out.tolist() == [[3.0, 4.0], [9.0, 9.0], [1.0, 2.0]]
