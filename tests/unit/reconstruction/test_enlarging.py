"""A framelet enlarged: smooth channels between pixels, surfaces of one pixel, and only what changed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from wall.core.data import Framelet, Rect
from wall.reconstruction.enlarging import CubicAxis, Enlarger
from wall.reconstruction.kernels.enlarge import widen, widen_twice

CHANNELS = frozenset({"colour", "depth", "alpha", "object_id"})


def framelet(width: int, height: int) -> Framelet:
    return Framelet.blank(Rect(x=0, y=0, width=width, height=height), CHANNELS)


def everything(small: Framelet) -> np.ndarray:
    height, width = small.colour.shape[:2]
    return np.ones((-(-height // 16), -(-width // 16)), np.bool_)


@pytest.mark.parametrize("size", [(8, 6), (12, 9), (13, 7)])
def test_a_ramp_stays_a_ramp(size: tuple[int, int]) -> None:
    """Bilinear interpolation is exact for what is linear, up to half a small pixel from the border."""
    small, large = framelet(4, 3), framelet(*size)
    x, y = np.meshgrid((np.arange(4) + 0.5) / 4, (np.arange(3) + 0.5) / 3)
    small.colour[...] = (2.0 * x + y)[..., None]
    Enlarger(small, large).enlarge(everything(small))
    x, y = np.meshgrid((np.arange(size[0]) + 0.5) / size[0], (np.arange(size[1]) + 0.5) / size[1])
    wanted = 2.0 * x.clip(0.125, 0.875) + y.clip(1 / 6, 5 / 6)
    assert_allclose(large.colour[..., 0], wanted, atol=1e-6)


def test_edges_invent_no_depth_and_what_has_a_colour_has_one() -> None:
    """Left of the middle an object at 5 covers all, right of it nothing is; between, alpha falls and depth does not."""
    small, large = framelet(4, 2), framelet(16, 8)
    small.colour[:, :2], small.channel("alpha")[:, :2] = 1.0, 1.0
    small.channel("depth")[:, 0], small.channel("depth")[:, 1], small.channel("object_id")[:, :2] = 3.0, 5.0, 7
    Enlarger(small, large).enlarge(everything(small))
    alpha, depth = large.channel("alpha"), large.channel("depth")
    assert set(np.unique(depth[np.isfinite(depth)])) == {3.0, 5.0}
    assert ((alpha > 0.0) == np.isfinite(depth)).all()
    assert ((alpha > 0.0) == (large.channel("object_id") == 7)).all()
    assert ((alpha > 0.0) & (alpha < 1.0)).any()
    assert_allclose(large.colour[..., 0], alpha)


def test_only_what_takes_from_changed_tiles_is_redone() -> None:
    """The same as all of it: a tile of the small image reaches half a small pixel into its neighbours."""
    small, part, whole = framelet(64, 48), framelet(128, 96), framelet(128, 96)
    some = Enlarger(small, part)
    some.enlarge(everything(small))
    small.colour[16:32, 32:48] = 1.0
    dirty = np.zeros((3, 4), np.bool_)
    dirty[1, 2] = True
    redone = some.enlarge(dirty)
    assert redone.sum() == 16
    Enlarger(small, whole).enlarge(everything(small))
    np.testing.assert_array_equal(part.colour, whole.colour)


@pytest.mark.parametrize(("small", "first", "last"), [(40, 0, 40), (40, 8, 24), (40, 32, 40), (3, 0, 3), (1, 0, 1)])
def test_twice_as_many_pixels_are_the_same_bits_as_any_number(
    random_numbers: np.random.Generator, small: int, first: int, last: int
) -> None:
    line, axis = random_numbers.integers(0, 256, 3 * small).astype(np.uint8), CubicAxis(small, 2 * small)
    wanted, found = (np.zeros(6 * (last - first), np.float32) for _ in range(2))
    part = slice(2 * first, 2 * last)
    widen(line, axis.pixels[part], axis.weights[part], wanted)
    widen_twice(line, first, last, axis.weights, np.zeros((3, 3 * small + 12), np.float32), found)
    assert_array_equal(found, wanted)
