"""The baselines' kernels against closed forms and plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from wall.study.quality.baseline import fill_holes
from wall.study.quality.kernels import afr as kernels_afr
from wall.study.quality.kernels import afr_image as kernels_afr_image
from wall.study.quality.kernels import render_cache as kernels_cache
from wall.study.quality.kernels import taa as kernels_taa
from wall.study.quality.kernels import warp as kernels_warp
from wall.study.quality.methods_afr import tree_of
from wall.study.quality.methods_reduced import between

ROUNDING = 1e-5  # a few float32 operations on values near 1


def ramp(height: int, width: int) -> np.ndarray:
    """(h, w, 4) float32: red grows by 0.01 a pixel to the right, green by 0.02 downward, blue is 0.5."""
    y, x = np.mgrid[:height, :width]
    planes = [0.01 * (x + 0.5), 0.02 * (y + 0.5), np.full((height, width), 0.5), np.ones((height, width))]
    return np.stack(planes, axis=-1).astype(np.float32)


@pytest.mark.parametrize(("u", "v"), [(5.5, 4.5), (5.0, 4.0), (6.2, 3.9)])
def test_catmull_rom_reproduces_a_ramp(u: float, v: float) -> None:
    found = kernels_warp.catmull_rom(ramp(9, 12), np.float32(u), np.float32(v))
    np.testing.assert_allclose(found, (0.01 * u, 0.02 * v, 0.5), atol=ROUNDING)


def test_catmull_rom_does_not_overshoot_an_edge() -> None:
    edge = np.zeros((8, 8, 3), np.float32)
    edge[:, 4:] = 1.0
    found = [kernels_warp.catmull_rom(edge, np.float32(x), np.float32(4.0))[0] for x in np.arange(1, 7, 0.25)]
    assert min(found) >= 0.0
    assert max(found) <= 1.0
    assert found == sorted(found)


def test_holes_of_a_plain_image_take_its_colour_and_the_rest_stays() -> None:
    image = np.zeros((13, 21, 4), np.float32)
    image[3, 4] = image[9, 17] = (0.25, 0.5, 0.75, 1.0)
    fill_holes(image)
    np.testing.assert_allclose(image[:, :, :3], np.broadcast_to((0.25, 0.5, 0.75), (13, 21, 3)), atol=ROUNDING)


def test_a_hole_in_a_ramp_is_filled_between_its_neighbours() -> None:
    image = ramp(16, 16)
    whole = image.copy()
    image[7, 7, :] = 0.0
    fill_holes(image)
    around = whole[6:9, 6:9].reshape(-1, 4)
    assert (image[7, 7] >= around.min(axis=0)).all()
    assert (image[7, 7] <= around.max(axis=0)).all()
    image[7, 7] = whole[7, 7]
    np.testing.assert_array_equal(image, whole)


def test_an_empty_image_stays_black() -> None:
    picture = np.zeros((5, 6, 4), np.float32)
    fill_holes(picture)
    assert not picture[:, :, :3].any()


def sideways(pixels: float) -> np.ndarray:
    """(2, 12) float32 panel_from_object: points (x, y, z) of object 1 appear at (x / z + pixels, y / z), depth z."""
    table = np.zeros((2, 12), np.float32)
    table[1] = [0, 0, 1, 0, 1, 0, pixels, 0, 0, 1, 0, 0]
    return table


def surfaces(depth: np.ndarray) -> np.ndarray:
    """(h, w, 5) float32: each pixel's point of object 1 at `depth` along the axis, seen by sideways(0)."""
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]]
    one = np.ones(depth.shape)
    return np.stack([(x + 0.5) * depth, (y + 0.5) * depth, depth, one, depth], axis=-1).astype(np.float32)


def warped(colour: np.ndarray, found: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, int]:
    height, width = colour.shape[:2]
    moved, origin = np.zeros((2, height, width, 3), np.float32)
    nearest, fallback = np.zeros((2, height, width), np.float32)
    picture = np.zeros((height, width, 4), np.float32)
    kernels_warp.move_surfaces(found, table, moved, nearest, fallback)
    kernels_warp.sources(moved, nearest, fallback, origin)
    return picture, kernels_warp.gather(colour, origin, picture)


@pytest.mark.parametrize("pixels", [0.0, 2.0, 2.5])
def test_a_plane_that_moves_sideways_is_the_image_moved(pixels: float) -> None:
    colour = ramp(10, 16)
    picture, holes = warped(colour, surfaces(np.full((10, 16), 3.0)), sideways(pixels))
    assert holes == 10 * int(pixels)
    inner = slice(int(np.ceil(pixels)) + 2, 14)
    expected = colour[:, inner, 0] - np.float32(0.01 * pixels)
    np.testing.assert_allclose(picture[1:-1, inner, 0], expected[1:-1], atol=ROUNDING)


def test_what_is_nearer_moves_further_and_hides_what_is_behind() -> None:
    depth = np.full((8, 24), 4.0)
    depth[:, 6:10] = 1.0
    colour = np.zeros((8, 24, 4), np.float32)
    colour[:, 6:10, 0] = 1.0
    table = sideways(0.0)
    table[1, 7] = 8.0  # the eye moves: a point at depth z shifts by 8 / z pixels
    picture, _ = warped(colour, surfaces(depth), table)
    assert (picture[:, 15:17, 0] == 1.0).all()  # the inside of the near strip, 8 pixels on
    assert (picture[:, 19:, 0] == 0.0).all()
    assert (picture[:, 8:12, 3] == 0.0).all()  # uncovered: nothing is known of it


def test_a_clipped_colour_lies_on_the_boxs_side_towards_the_mean() -> None:
    around = np.zeros(kernels_taa.AROUND, np.float32)
    for grey in (0.4, 0.6):  # mean 0.5, deviation 0.1 of luma, none of chroma
        around[kernels_taa.MEAN : kernels_taa.MEAN + 3] += np.float32(grey)
        around[kernels_taa.MEAN + 3] += np.float32(1.0)
        around[kernels_taa.SQUARES] += np.float32(grey**2)
    bright, dark = np.float32(0.9), np.float32(0.45)
    found = kernels_taa.clip_to_box(bright, bright, bright, around, np.float32(1.0))
    np.testing.assert_allclose(found, (0.6, 0.6, 0.6), atol=1e-3)  # deviations are widened by 1e-5
    kept = kernels_taa.clip_to_box(dark, dark, dark, around, np.float32(1.0))
    np.testing.assert_allclose(kept, (0.45, 0.45, 0.45), atol=ROUNDING)


@pytest.mark.parametrize(("coarse", "fine"), [(4, 16), (5, 16), (12, 16), (16, 16)])
def test_enlarging_is_exact_for_a_ramp_inside_the_outer_samples(coarse: int, fine: int) -> None:
    samples = (np.arange(coarse) + 0.5) * fine / coarse
    first, second, share = between(fine, coarse)
    found = samples[first] * (1 - share) + samples[second] * share
    at = np.arange(fine) + 0.5
    inner = (at >= samples[0]) & (at <= samples[-1])
    np.testing.assert_allclose(found[inner], at[inner], rtol=1e-6)


@pytest.mark.parametrize("wanted", [1.0, 40.0, 300.0])
def test_error_diffusion_chooses_as_many_pixels_as_are_wanted(wanted: float) -> None:
    chosen = np.zeros((32 * 24, 2), np.int32)
    count = kernels_cache.choose_pixels(np.ones((24, 32), np.float32), wanted, 0.3, chosen)
    assert abs(count - wanted) <= 32 / 4  # the last row's rest, half a ray a pixel at the very most, is lost
    assert len(np.unique(chosen[:count], axis=0)) == count


def test_error_diffusion_follows_priorities() -> None:
    priority = np.ones((32, 64), np.float32)
    priority[:, 32:] = 3.0
    chosen = np.zeros((64 * 32, 2), np.int32)
    count = kernels_cache.choose_pixels(priority, 400.0, 0.0, chosen)
    right = int((chosen[:count, 0] >= 32).sum())
    assert abs(right - 300) <= 15


def test_a_point_far_behind_its_neighbours_is_culled() -> None:
    owner = np.arange(9, dtype=np.int32).reshape(3, 3)
    depth = np.ones((3, 3), np.float32)
    depth[1, 1] = 2.0
    kept = np.zeros((3, 3), np.int32)
    assert kernels_cache.cull(owner, depth, kept) == 1
    assert kept[1, 1] == -1
    assert (np.delete(kept.ravel(), 4) == np.delete(np.arange(9), 4)).all()


def test_a_gap_is_filled_by_weights_4_2_1_and_wants_its_neighbours_age() -> None:
    kept = np.full((3, 3), -1, np.int32)
    kept[0, 1], kept[0, 0] = 0, 1  # beside the middle, and at its corner
    colour = np.array([[0.9, 0, 0], [0.3, 0, 0]], np.float32)
    age = np.array([10.0, 30.0], np.float32)
    picture, priority = np.zeros((3, 3, 4), np.float32), np.zeros((3, 3), np.float32)
    kernels_cache.interpolate(kept, colour, age, picture, priority)
    assert picture[1, 1, 0] == pytest.approx((2 * 0.9 + 1 * 0.3) / 3)
    assert priority[1, 1] == pytest.approx((2 * 10.0 + 1 * 30.0 + 13 * 255.0) / 16)
    assert priority[0, 1] == 10.0
    assert picture[2, 2, 0] == pytest.approx((0.9 + 0.3) / 2)  # out of reach of 3x3: the plain mean of 7x7


def cut_of(tree: kernels_afr.Tree) -> kernels_afr.Cut:
    """A cut of the root alone."""
    cut = kernels_afr.Cut(np.zeros(len(tree.parent), np.int32), np.full(len(tree.parent), -1, np.int32))
    cut.slot[0] = 0
    return cut


def covered(cut: np.ndarray, rect: np.ndarray, width: int, height: int) -> np.ndarray:
    times = np.zeros((height, width), int)
    for left, top, right, bottom in rect[cut]:
        times[top:bottom, left:right] += 1
    return times


@pytest.mark.parametrize(("width", "height"), [(16, 16), (21, 13), (3, 40), (1, 1)])
def test_finest_tiles_cover_every_pixel_once(width: int, height: int) -> None:
    rect, child, _, cell_of, _ = tree_of(width, height)
    finest = np.flatnonzero(child[:, 0] < 0)
    assert (covered(finest, rect, width, height) == 1).all()
    for y, x in np.ndindex(height, width):
        left, top, right, bottom = rect[cell_of[y, x]]
        assert left <= x < right
        assert top <= y < bottom


def test_the_cut_covers_every_pixel_once_whatever_is_merged_and_split(random_numbers: np.random.Generator) -> None:
    width, height = 21, 13
    tree = tree_of(width, height)
    cut, count = cut_of(tree), 1
    for trend in random_numbers.integers(-1, 2, 200):
        tree.sums[:, :3] = random_numbers.random((len(tree.rect), 3))
        count = kernels_afr.adjust(cut, count, tree, 1.0, trend, 2, 12)
        assert (covered(cut.nodes[:count], tree.rect, width, height) == 1).all()
        assert (cut.slot[cut.nodes[:count]] == np.arange(count)).all()
        assert (cut.slot >= 0).sum() == count <= 12


def test_the_most_important_tile_is_split_and_the_least_important_pair_merged() -> None:
    tree = tree_of(16, 16)
    cut, count = cut_of(tree), 1
    slope = np.zeros(4)
    for x in range(16):  # a checkerboard to the left, plain grey to the right
        for y in range(16):
            value = 0.5 if x >= 8 else float((x + y) % 2)
            kernels_afr.add_along(tree.cell_of[y, x], tree, 1.0, value, slope)
    for _ in range(8):
        count = kernels_afr.adjust(cut, count, tree, 1.0, 1, 1, 6)
    left = tree.rect[cut.nodes[:count], 2] <= 8
    assert count == 6
    assert left.sum() == 5
    kernels_afr.adjust(cut, count, tree, 1.0, -1, 1, 6)
    assert (tree.rect[cut.nodes[: count - 1], 0] >= 8).sum() == 1


def test_filter_extents_fulfil_the_papers_equations() -> None:
    """e_x d_x = e_y d_y = e_t d_t and e_x e_y e_t = V, where no bound is reached."""
    none, one = np.full((1, 2), -1, np.int32), np.zeros(1, np.int32)
    tree = kernels_afr.Tree(np.array([[0, 0, 10, 10]], np.int32), none, none[0], one, np.zeros((1, kernels_afr.SUMS)))
    dx, dy, dt = 0.02, 0.03, 0.25
    tree.sums[0, kernels_afr.SLOPES :] = (5.0, 5 * dx, 5 * dy, 5 * dt)
    image = kernels_afr_image.Image(
        tile_of=one, screen=np.zeros((1, 3), np.float32), nearest=np.zeros((1, 1), np.float32),
        recent=np.array([50.0]),  # half a sample a pixel: V = 2 pixel^2 seconds
        extent=np.zeros((1, 3), np.float32), sums=np.zeros((1, 1, 4), np.float32),
    )  # fmt: skip
    kernels_afr_image.extents(one, tree, 1.0, 1.0, image)
    ex, ey, et = image.extent[0]
    np.testing.assert_allclose([ex * dx, ey * dy], et * dt, rtol=1e-5)
    assert ex * ey * et == pytest.approx(2.0, rel=1e-5)
