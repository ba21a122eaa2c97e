"""What a pixel accumulated outlives its stored samples, until something tells that it no longer holds."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import FRONT, PLATE, START, WALL, centres, event_at, hits, image_of, plate_before_wall, traced
from numpy.testing import assert_array_equal

from wall.core.data import Float32, Samples
from wall.deepbuffer.kernels.accumulation import AROUND
from wall.deepbuffer.kernels.columns import AMOUNT
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene

PLACES = ((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0))  # of the plate: at once, and a second later; far enough apart
ROW, SAMPLES = 16, 6  # a row of pixels through the plate, and how many samples each of them got
COLOURS = np.random.default_rng(7).random((SAMPLES, 3)).astype(np.float32)
REFRESH_S = 1.0 / 60.0
Image = Reconstruction | GpuReconstruction


@pytest.fixture
def scene() -> Scene:
    return plate_before_wall(*PLACES)


@pytest.fixture(params=["all anew", "in parts", "on a GPU"])
def image(request: pytest.FixtureRequest, scene: Scene) -> Image:
    """With room for one sample a pixel."""
    if request.param == "on a GPU":
        request.getfixturevalue("opengl")
        return GpuReconstruction(FRONT.panel, FRONT.eye, scene, samples_per_pixel=1.0)
    return image_of(scene, kept=1.0, parts=request.param == "in parts")


def but_for_the_row(scene: Scene, scene_time: float) -> Samples:
    xy = centres(FRONT.panel.pixels)
    return traced(scene, event_at(0, scene_time=scene_time), xy[xy[:, 1].astype(int) != ROW])


def objects_in_row(scene: Scene, scene_time: float) -> Float32:
    xy = centres(FRONT.panel.pixels)
    return traced(scene, event_at(0, scene_time=scene_time), xy[xy[:, 1].astype(int) == ROW])["object_id"]


def left_with_means(image: Image, scene: Scene) -> int:
    """Fill a row of pixels with means, then all others with so many samples that none of the row stays stored.

    Returns the number of the event shown.
    """
    image.refresh(event_at(0), START)
    xy = centres(FRONT.panel.pixels)
    row = xy[xy[:, 1].astype(int) == ROW]
    for colour in COLOURS:
        samples = hits(row, colour)
        samples["object_id"] = objects_in_row(scene, 0.0)
        samples["depth"] = traced(scene, event_at(0), row)["depth"]
        image.insert(samples, START, event_at(0))
    others = but_for_the_row(scene, 0.0)
    for k in range(1, 5):  # events without motion: the plate stands until its path says otherwise
        image.refresh(event_at(k), START + k * REFRESH_S)
        image.insert(others, START + k * REFRESH_S, event_at(k))
    image.refresh(event_at(5), START + 5 * REFRESH_S)
    assert not image.nothing_moves
    return 5


def test_pixels_whose_samples_were_evicted_show_their_means(image: Image, scene: Scene) -> None:
    left_with_means(image, scene)
    assert (image.find_nearest().object_id[ROW] == -1).all(), "samples are stored"
    assert_array_equal(image.accumulated_counts()[ROW], SAMPLES)
    mean = np.broadcast_to(COLOURS.mean(axis=0), image.radiance[ROW].shape)
    np.testing.assert_allclose(image.radiance[ROW], mean, rtol=1e-5)


def test_what_an_object_left_or_may_have_come_to_is_cleared_and_nothing_else(image: Image, scene: Scene) -> None:
    """The plate jumps, and none of its samples is stored in the row: neither where it was, nor where it is now."""
    number = left_with_means(image, scene)
    was, shows = objects_in_row(scene, 0.0) == PLATE, objects_in_row(scene, 1.0) == PLATE
    assert not (was & shows).any()
    image.refresh(event_at(number + 1, scene_time=1.0), START + 1.0)
    assert (image.find_nearest().object_id[ROW] == -1).all(), "a sample of the plate came to the row"
    near = np.convolve(shows, np.ones(2 * AROUND + 1), "same") > 0
    assert near.sum() == shows.sum() + 2 * AROUND
    assert_array_equal(image.accumulated_counts()[ROW], np.where(was | near, 0, SAMPLES))


def test_what_an_object_left_is_cleared_where_a_sample_of_another_is_stored(image: Image, scene: Scene) -> None:
    number = left_with_means(image, scene)
    xy = centres(FRONT.panel.pixels)
    image.insert(hits(xy[xy[:, 1].astype(int) == ROW], (0.0, 0.5, 0.0)), START + 0.9, event_at(number))
    image.refresh(event_at(number + 1), START + 0.95)
    assert (image.find_nearest().object_id[ROW] == WALL).all()
    assert_array_equal(image.accumulated_counts()[ROW], SAMPLES + 1)
    image.refresh(event_at(number + 2, scene_time=1.0), START + 1.0)
    was = objects_in_row(scene, 0.0) == PLATE
    assert_array_equal(image.accumulated_counts()[ROW], np.where(was, 0, SAMPLES + 1))


@pytest.mark.parametrize(("light", "contradicts"), [(0.5, False), (0.1, True)], ids=["alike", "darker"])
def test_a_sample_contradicts_a_mean_of_which_no_sample_is_stored(
    scene: Scene, light: float, contradicts: bool
) -> None:
    image = image_of(scene, kept=1.0, detects_change=True)
    number = left_with_means(image, scene)
    history = image.buffer.history
    assert not history.rejection[..., AMOUNT].any()
    assert (history.nearest[ROW, :, 3] == -1).all()
    history.accumulation[ROW, :, 6:] = 0.5, 0.0
    sample = hits((2.5, ROW + 0.5), (0.1, 0.1, 0.1))
    sample["sqrt_irradiance"] = light
    image.insert(sample, START + 1.0, event_at(number))
    assert (history.rejection[ROW, 2, AMOUNT] > 0.9) == contradicts
    image.refresh(event_at(number + 1), START + 1.0 + REFRESH_S)
    assert (history.accumulation[ROW, 2, 3] < 0.1) == contradicts
    assert sample["object_id"][0] == WALL
