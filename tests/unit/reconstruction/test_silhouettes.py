"""Which deeper samples nearer ones hide: silhouettes stay where they are, gaps of two pixels open, covers cover."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.visibility import SILHOUETTE_PER_S, behind, bound_depths, find_nearest, weigh

SIZE = 40  # pixels
NEAR, FAR = 1.0, 2.0


def covered(
    nearer: Float64, deeper: Float64, *, far: float = FAR, pixel: float = 1.0, same: bool = False
) -> NDArray[np.bool_]:
    """(m,) which of deeper samples (m, 2) samples (n, 2) before them hide, all xy in pixels of a square image.

    `far`: their depth, where that of the nearer ones is 1; `pixel`: see Pose.pixel; `same`: they are of one object
    """
    places = np.concatenate([nearer, deeper])
    screen = np.concatenate([places.T, np.where(np.arange(len(places)) < len(nearer), NEAR, far)[None]])
    screen = screen.astype(np.float32)
    n = len(places)
    object_id, ones = np.where(same | (screen[2] == NEAR), 1, 2).astype(np.uint32), np.ones(n, np.float32)
    store = SampleStore.of(n, lit=False)._replace(
        object_id=object_id, time=ones, confidence=ones.copy(), screen_position=screen
    )
    nearest: Float32 = np.zeros((SIZE, SIZE, 4), np.float32)
    bounds, decay = np.zeros((3, SIZE, SIZE), np.float32), np.zeros((SIZE // TILE + 1, SIZE // TILE + 1), np.float32)
    now = np.float32(2.0)  # all are from second 1: old enough not to wait
    everywhere = np.ones(decay.shape, np.bool_)
    find_nearest(store, n, nearest, everywhere, None)
    no_image: Float32 = np.zeros((SIZE + 2, SIZE + 2, 4), np.float32)
    ratios = behind(pixel)
    moved, rows = np.ones(3, np.uint8), (0, len(nearest))
    bound_depths(nearest, ratios.own, moved, decay, SILHOUETTE_PER_S, no_image, everywhere, bounds, *rows)
    weigh(store, 0, n, nearest, ratios, bounds, now, np.float32(0.0), np.zeros(n, np.float32), np.zeros(n, np.uint32))
    return np.asarray(screen[2, len(nearer) :] == OUTSIDE, bool)


def scattered(rng: np.random.Generator, density: float) -> Float64:
    """(n, 2) places of `density` samples a pixel, one at random in each of as many strata."""
    n = round(SIZE * np.sqrt(density))
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2)
    return np.asarray(np.minimum((grid + rng.random(grid.shape)) * SIZE / n, SIZE - 1e-3), np.float64)


def half_plane(density: float, degrees: float) -> tuple[Float64, NDArray[np.bool_]]:
    """(m,) distances of deeper samples outside the edge of a nearer half-plane, and whether they are hidden.

    Deeper samples lie everywhere: those behind the half-plane were traced before it came there.
    """
    rng = np.random.default_rng(1)
    normal = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    distances, hides = [], []
    for _ in range(30):
        offset = SIZE / 2 * normal.sum() + rng.random()
        nearer, deeper = scattered(rng, density), scattered(rng, density)
        hides.append(covered(nearer[nearer @ normal < offset], deeper))
        distances.append(deeper @ normal - offset)
    return np.concatenate(distances), np.concatenate(hides)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0])
@pytest.mark.parametrize("density", [1.0, 2.0, 4.0])
def test_a_silhouette_stays_within_a_sixth_of_a_pixel(density: float, degrees: float, compiled_only: None) -> None:
    """Were all behind the edge hidden and nothing else, the hidden share from -1 to 1 would sum up to 1 pixel.

    3,600 samples and more a pixel of distance: the sum is good to 0.01.
    """
    distance, hides = half_plane(density, degrees)
    near = np.abs(distance) < 1
    edge = np.linspace(-1, 1, 17)
    shares = np.histogram(distance[near & hides], edge)[0] / np.histogram(distance[near], edge)[0]
    assert abs(shares.sum() / 8 - 1) < 1 / 6
    assert hides[distance > 0.5].mean() < 0.002
    assert hides[distance < -1].mean() > 0.92


@pytest.mark.parametrize(
    ("width", "density", "least"),
    [(1.0, 1.0, 0.25), (1.0, 4.0, 0.05), (2.0, 1.0, 0.85), (2.0, 2.0, 0.8), (2.0, 4.0, 0.55), (3.0, 4.0, 0.8)],
)
def test_slots_stay_visible(width: float, density: float, least: float, compiled_only: None) -> None:
    """At least this share of the samples seen through a slot, at any offset, straight or slanted, is shown."""
    rng = np.random.default_rng(2)
    for degrees in (0.0, 30.0):
        normal = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        hides = []
        for _ in range(30):
            middle = SIZE / 2 * normal.sum() + rng.random()
            nearer, deeper = scattered(rng, density), scattered(rng, density)
            inside = np.abs(deeper @ normal - middle) < width / 2
            hides.append(covered(nearer[np.abs(nearer @ normal - middle) > width / 2], deeper[inside]))
        assert 1 - np.concatenate(hides).mean() > least


@pytest.mark.parametrize(
    ("density", "deeper_density", "least"),
    [(0.25, 1.0, 0.2), (0.5, 1.0, 0.45), (1.0, 1.0, 0.95), (4.0, 1.0, 0.92), (0.25, 0.25, 0.4), (0.5, 0.25, 0.7)],
)
def test_sparse_nearer_samples_cover_what_is_behind(
    density: float, deeper_density: float, least: float, compiled_only: None
) -> None:
    """A lone one covers a disc of radius 1/2: 0.2 and 0.39 of the area at 1/4 and 1/2 a pixel, without overlap.

    Where deeper ones are sparse too, the pixels between them that show nothing are no gaps.
    """
    rng = np.random.default_rng(3)
    assert np.mean([covered(scattered(rng, density), scattered(rng, deeper_density)).mean() for _ in range(20)]) > least


def test_nothing_hides_where_nothing_is_nearer(compiled_only: None) -> None:
    rng = np.random.default_rng(4)
    assert not covered(np.zeros((0, 2)), scattered(rng, 2.0)).any()


@pytest.mark.parametrize(
    ("pixel", "same", "ratio"),
    [
        (0.001, True, 1.016), (0.001, False, 1.0016), (1e-4, True, 1.0016), (1e-4, False, 1.00016),
        (0.1, True, 1.05), (0.1, False, 1.005),
    ],
)  # fmt: skip
def test_how_far_behind_is_hidden_goes_by_the_pixels_and_is_finer_for_another_object(
    pixel: float, same: bool, ratio: float, random_numbers: np.random.Generator
) -> None:
    nearer, deeper = scattered(random_numbers, 2.0), scattered(random_numbers, 2.0)
    within = 0.05 * (ratio - 1.0)
    assert not covered(nearer, deeper, far=ratio - within, pixel=pixel, same=same).any()
    hidden = covered(nearer, deeper, far=ratio + within, pixel=pixel, same=same)
    assert hidden.mean() > 0.95
