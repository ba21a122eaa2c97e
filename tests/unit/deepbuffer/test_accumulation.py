"""Accumulations are cleared where something changed, and tiles tell which of them have any."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import SAMPLE
from wall.core.jit import kernel
from wall.deepbuffer.kernels.accumulation import accumulate, object_bits, reject_accumulation
from wall.deepbuffer.kernels.columns import AMOUNT, COUNT, NEAREST_OBJECT, OBJECTS
from wall.deepbuffer.store import PixelHistory

WIDTH, HEIGHT, OBJECT_COUNT = 40, 20, 3


@kernel
def accumulate_all(history, samples, pixels):
    """One sample in each of the pixels (n, 2)."""
    for k in range(samples.shape[0]):
        accumulate(history, pixels[k, 0], pixels[k, 1], samples[k])


def test_tiles_follow_the_accumulation(random_numbers: np.random.Generator) -> None:
    history = PixelHistory.of(WIDTH, HEIGHT, detects_change=False)
    history.nearest[..., NEAREST_OBJECT] = random_numbers.integers(-1, OBJECT_COUNT, (HEIGHT, WIDTH))
    everywhere = np.ones_like(history.dirty)
    for _ in range(40):
        samples = np.zeros(100, SAMPLE)
        samples["radiance"] = random_numbers.random((100, 3))
        samples["object_id"] = random_numbers.integers(0, OBJECT_COUNT, 100)
        accumulate_all(history, samples, random_numbers.integers(0, (HEIGHT, WIDTH), (100, 2)))
        history.rejection[5:9, 5:30, AMOUNT] = random_numbers.choice([0.0, 0.5, 1.0], (4, 25))
        history.contradicted[0, :] = True
        changed = random_numbers.integers(0, 2, OBJECT_COUNT).astype(np.uint8)
        reject_accumulation(history, changed, everywhere, everywhere)
        assert not history.rejection[..., AMOUNT].any()
        assert not history.contradicted.any()
        rows, columns = np.nonzero(history.accumulation[..., COUNT])
        assert {*zip(rows // 16, columns // 16, strict=True)} == {*zip(*np.nonzero(history.accumulating), strict=True)}
        shown = history.nearest[rows, columns, NEAREST_OBJECT].astype(int)
        assert not changed[shown[shown >= 0]].any()
        assert not (history.accumulation[rows, columns, OBJECTS].astype(int) & object_bits(changed)).any()
    assert 0 < len(rows) < WIDTH * HEIGHT


def test_only_the_tiles_given_are_looked_at_and_those_that_hold_what_changed() -> None:
    """Object 1 shows everywhere, samples are of object 0, one of object 2; object 1 changes, then object 2."""
    history = PixelHistory.of(WIDTH, HEIGHT, detects_change=False)
    history.nearest[..., NEAREST_OBJECT] = 1
    pixels = np.argwhere(np.ones((HEIGHT, WIDTH), np.bool_))
    samples = np.zeros(len(pixels), SAMPLE)
    samples["object_id"][0] = 2  # in tile (0, 0)
    accumulate_all(history, samples, pixels)
    tiles, none = np.zeros_like(history.dirty), np.zeros_like(history.dirty)
    tiles[1, 1] = True
    reject_accumulation(history, np.uint8([0, 1, 0]), tiles, none)
    left = np.ones((HEIGHT, WIDTH), np.bool_)
    left[16:, 16:32] = False
    np.testing.assert_array_equal(history.accumulation[..., COUNT] > 0.0, left)
    reject_accumulation(history, np.uint8([0, 0, 1]), none, none)
    left[0, 0] = False
    np.testing.assert_array_equal(np.argwhere(history.dirty), [[0, 0]])
    np.testing.assert_array_equal(history.accumulation[..., COUNT] > 0.0, left)


def test_clearing_leaves_nothing_of_what_was_written_without_a_list() -> None:
    history = PixelHistory.of(40, 25, detects_change=False)
    for i, j in ((0, 0), (15, 31), (24, 39)):  # the last tiles are cut
        history.accumulation[i, j], history.accumulating[i // 16, j // 16] = 1.0, True
    history.begun[0] = len(history.begun)
    history.clear_accumulation()
    assert not history.accumulation.any()
    assert not history.accumulating.any()


@pytest.mark.parametrize("share", [0.05, 0.9], ids=["few", "many"])
@pytest.mark.parametrize("times", [1, 2], ids=["once", "again"])
def test_clearing_leaves_nothing_and_no_tile_marked(
    share: float, times: int, random_numbers: np.random.Generator
) -> None:
    history = PixelHistory.of(40, 25, detects_change=False)  # the last tiles are cut
    samples = np.zeros(1000, SAMPLE)
    samples["radiance"] = 1.0
    for _ in range(times):  # what is listed of the time before is not in the way
        pixels = np.argwhere(random_numbers.random((25, 40)) < share)
        accumulate_all(history, samples[: len(pixels)], pixels)
        accumulate_all(history, samples[: len(pixels)], pixels)
        assert (history.accumulation[..., COUNT] > 0).sum() == len(pixels)
        history.clear_accumulation()
        assert not history.accumulation.any()
        assert not history.accumulating.any()
