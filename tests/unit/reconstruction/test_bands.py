"""An image that threads share is the image that one makes, bit for bit: they write no pixel and no sample together."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from adaptive_images import START, event_at, traced
from numpy.testing import assert_array_equal
from small_scenes import instance, keyframes, quad, view

from wall.core.data import Event, Float32, Samples
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.bands import Band, join_lists, list_bands
from wall.reconstruction.kernels.splat import splat
from wall.reconstruction.kernels.visibility import find_nearest
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import assemble
from wall.scene.model import Instance, Material, PointLight, Source

SIZE = (130, 101)  # 7 rows of tiles, the last one cut
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)
GREY = Material(name="grey", base_color=(0.5, 0.5, 0.5))
SCENE = assemble(
    Source(
        meshes=(quad(40.0, 40.0, material=0), quad(1.0, 1.0, material=0)),
        materials=(GREY,),
        instances=(
            replace(instance(0), name="wall"),
            Instance(name="plate", mesh=1, world_from_object=instance(1, at=(-0.5, 0.1, 1.0)).world_from_object),
        ),
        lights=(PointLight(position=(0.0, 1.0, 3.0), intensity=(9.0, 9.0, 9.0)),),
        animation=(
            keyframes((-0.5, 0.1, 1.0), (0.5, 0.1, 1.0), object="plate"),
            keyframes((0.0, 1.0, 3.0), (1.0, 1.0, 3.0), light=0),
        ),
    )
)


def event(k: int) -> Event:
    """Eye, plate and light move; then all stand; then the plate and the light move alone, so that parts are redone."""
    number, moves = k if k < 20 or k > 26 else 20, min(k, 20)
    position = (0.01 * moves, 0.003 * moves, 4.0 - 0.02 * moves)
    return event_at(number, SEEN, scene_time=0.02 * number, position=position)


@pytest.fixture
def batches(compiled_only: None, random_numbers: np.random.Generator) -> list[Samples]:
    """A quarter of a sample a pixel for each refresh, at random places; a third of a panel gets none: holes."""
    found = []
    for k in range(40):
        xy = (random_numbers.random((SIZE[0] * SIZE[1] // 4, 2)) * SIZE).astype(np.float32)
        xy = np.minimum(xy, np.nextafter(np.float32(SIZE), 0))
        found.append(traced(SCENE, event(k), xy[(xy[:, 0] < 70) | (xy[:, 1] > 60)], SEEN))
    return found


@pytest.mark.parametrize("threads", [2, 3, 7, 12])
@pytest.mark.parametrize("changes", [False, True])
def test_forty_refreshes_are_the_same_bits(batches: list[Samples], threads: int, changes: bool) -> None:
    """With sorts, evictions, holes, hidden and contradicted samples, light that moves, and parts of the image."""
    one, many = (
        Reconstruction(SEEN.panel, SEEN.eye, SCENE, detects_change=changes, samples_per_pixel=2.0, threads=count)
        for count in (1, threads)
    )
    shown = [np.zeros((*SIZE[::-1], 3), np.uint8) for _ in range(2)]
    rests = 0
    for k, batch in enumerate(batches):
        for image, rgb in zip((one, many), shown, strict=True):
            image.insert(batch.copy(), START + k / 60, event(k))
            image.refresh(event(k), START + (k + 1) / 60)
            image.display(image.take_dirty(), rgb)
        assert one.count == many.count
        assert_array_equal(one.radiance, many.radiance)
        assert_array_equal(*shown)
        assert_array_equal(one.buffer.store.confidence[: one.count], many.buffer.store.confidence[: one.count])
        rests += one.nothing_moves
    assert one.count < sum(map(len, batches)), "some were evicted"
    assert rests > 2
    assert_array_equal(one.find_nearest(), many.find_nearest())
    assert many.bytes > one.bytes


def test_a_band_writes_its_own_rows_alone(batches: list[Samples]) -> None:
    image = Reconstruction(SEEN.panel, SEEN.eye, SCENE, detects_change=True, threads=2)
    image.insert(batches[0], START, event(0))
    image.refresh(event(0), START)
    store, count, tiles = image.buffer.store, image.count, np.ones_like(image.buffer.history.dirty)
    band = Band(32, 64, np.arange(count, dtype=np.uint32), count)
    nearest: Float32 = np.full((*SIZE[::-1], 4), 7.0, np.float32)
    sums: Float32 = np.full((SIZE[1] + 2, SIZE[0] + 2, 4), 7.0, np.float32)
    irradiance: Float32 = np.full((*SIZE[::-1], 2), 7.0, np.float32)
    bounds = np.ones((3, *SIZE[::-1]), np.float32)
    find_nearest(store, count, nearest, tiles, band)
    splat(store, np.ones(count, np.float32), count, bounds, tiles, sums, irradiance, band)
    for written, rows in ((nearest, slice(32, 64)), (sums, slice(33, 65)), (irradiance, slice(32, 64))):
        inside = np.zeros(len(written), np.bool_)
        inside[rows] = True
        assert (written[~inside] == 7.0).all()
        assert (written[inside] != 7.0).any(axis=(1, 2)).all()


@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("edges", [(0, 101), (0, 16, 101), (0, 16, 32, 48, 96, 101)])
def test_each_band_lists_the_samples_of_its_rows_and_of_the_row_beside_in_their_order(
    random_numbers: np.random.Generator, edges: tuple[int, ...], ordered: bool
) -> None:
    """Twelve samples a row, those of one in ten rows outside the image, by ranges of 256; an end cuts a run short."""
    count = 1200
    store = SampleStore.of(2048, lit=False)
    rows = (random_numbers.random(count) * 101).astype(np.float32)
    store.screen_position[1, :count] = np.sort(rows) if ordered else rows
    store.screen_position[2, :count] = np.where(store.screen_position[1, :count] % 10 < 1, -1.0, 1.0)
    indices = np.zeros((len(edges) - 1, 2048), np.uint32)
    firsts, listed = np.arange(0, count, 256), []
    for first in firsts:
        listed.append(np.zeros(len(edges) - 1, np.int64))
        list_bands(store, first, min(first + 256, count), np.array(edges), indices, listed[-1])

    for band, (top, bottom) in enumerate(pairwise(edges)):
        found = join_lists(indices[band], firsts, np.array([own[band] for own in listed]))
        row, inside = np.floor(store.screen_position[1, :count]), store.screen_position[2, :count] > 0.0
        wanted = np.flatnonzero(inside & (row >= top - 1) & (row <= bottom))
        assert_array_equal(indices[band, :found], wanted)
