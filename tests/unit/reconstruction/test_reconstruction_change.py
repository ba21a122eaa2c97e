"""An image at rest averages; a contradicted one lets go of what was contradicted, and of nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from adaptive_images import (
    GREEN,
    PLATE,
    RED,
    SIZE,
    START,
    WALL,
    centres,
    event_at,
    hits,
    image_of,
    plate_before_wall,
)
from numpy.testing import assert_allclose, assert_array_equal

from wall.core.data import Camera, Float32, Samples
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene

REFRESH_S = 1 / 64
NO_CHANGE, CHANGED = 0.5, 1.0  # of the square root of irradiance


@pytest.fixture(scope="module")
def scene() -> Scene:
    return plate_before_wall((9.0, 0.0, 2.0))  # two objects; which one is hit is decided by hand


def lit(samples: Samples, light: float, change: float = 0.0) -> Samples:
    samples["sqrt_irradiance"], samples["change"] = light, change
    return samples


def all_pixels(light: float = NO_CHANGE) -> Samples:
    """The left half shows the wall, the right half the plate; both green, and 4 deep."""
    samples = lit(hits(centres(SIZE), GREEN), light)
    samples["object_id"][samples["xy"][:, 0] > SIZE[0] / 2] = PLATE
    return samples


def at_rest_after(scene: Scene, *batches: Samples, detects_change: bool = False) -> Reconstruction:
    """Event 0 was shown with nothing in it; batch k came k refreshes later."""
    image = image_of(scene, detects_change=detects_change)
    image.refresh(event_at(0), START)
    image.take_dirty()
    for k, samples in enumerate(batches):
        image.insert(samples, START + k * REFRESH_S, event_at(0))
        image.refresh(event_at(0), START + (k + 1) * REFRESH_S)
    return image


def seen_then_contradicted(
    scene: Scene, second: Samples, *, detects_change: bool = False, quiet: int = 0
) -> Reconstruction:
    """Pixel centres sampled once, shown (after `quiet` more events like it), then `second`, then one more event."""
    image = image_of(scene, detects_change=detects_change, parts=False)
    for k in range(1 + quiet):
        image.insert(all_pixels(), START + (k - 0.5) * REFRESH_S, event_at(k))
        image.refresh(event_at(k), START + k * REFRESH_S)
    when = START + (1 + quiet) * REFRESH_S
    image.insert(second, when, event_at(quiet))
    image.refresh(event_at(1 + quiet), when)
    return image


def weights(image: Reconstruction) -> Float32:
    return image.splat_sums[1:-1, 1:-1, 3]


@pytest.mark.parametrize(("n", "share"), [(1, 3 / 4), (2, 8 / 9), (3, 15 / 16), (4, 1), (12, 1)])
def test_at_rest_a_pixel_shows_the_mean_of_its_samples(scene: Scene, n: int, share: float) -> None:
    """The mean counts 1 - 1 / (1 + n)^2; the rest is the reconstruction, and from 4 samples on nothing."""
    random = np.random.default_rng(2)
    rounds = random.uniform(0, 1, (12, SIZE[0] * SIZE[1], 3)).astype(np.float32)

    image = at_rest_after(scene, *(hits(centres(SIZE), colors) for colors in rounds[:n]))

    mean = rounds[:n].mean(axis=0).reshape(SIZE[1], SIZE[0], 3)
    assert_allclose(image.radiance, mean * share + image.resolved * (1 - share), rtol=1e-5)


def test_where_a_moving_image_comes_to_rest_splats_stay_what_means_are_mixed_into(scene: Scene) -> None:
    """A moving image shows splats alone, with no second image of them; at rest red means come over the green ones."""
    image = image_of(scene)
    moving = [event_at(k, position=(1e-5 * k, 0.0, 4.0)) for k in range(3)]
    for k, event in enumerate(moving):
        image.insert(all_pixels(), START + (k - 0.5) * REFRESH_S, event)
        image.refresh(event, START + k * REFRESH_S)
    assert not image.buffer.history.accumulating.any()
    assert_allclose(image.radiance[11, 20], GREEN, atol=1e-5)
    image.insert(hits(np.array([[20.5, 11.5]], np.float32), RED), START + 3 * REFRESH_S, moving[2])
    image.refresh(moving[2], START + 3 * REFRESH_S)

    assert_allclose(image.resolved[11, 20], GREEN, atol=1e-5)
    assert_allclose(image.radiance[11, 20], np.multiply(RED, 3 / 4) + np.multiply(GREEN, 1 / 4), atol=1e-5)
    assert_allclose(image.radiance[11, 19], GREEN, atol=1e-5)


def test_at_rest_samples_anywhere_in_a_pixel_count_for_that_pixel_alone(scene: Scene) -> None:
    random = np.random.default_rng(3)
    xy = np.add((20, 11), random.uniform(0.01, 0.99, (500, 2))).astype(np.float32)
    image = at_rest_after(scene, hits(xy, GREEN))
    assert image.buffer.history.accumulation[11, 20, 3] == 500
    assert image.buffer.history.accumulation[..., 3].sum() == 500


@pytest.mark.parametrize("foreseen", [{"camera": (0.01, 0.0, 4.0)}, {"scene_time": 0.01}, {"turned": 1e-6}])
def test_at_rest_samples_that_were_traced_ahead_of_their_event_are_no_part_of_the_mean(
    scene: Scene, foreseen: dict[str, Any]
) -> None:
    """They have the number of the event that came true, but not its pose."""
    image = at_rest_after(scene, hits(centres(SIZE), GREEN))
    event = event_at(0)
    x, *rest = event.camera.world_from_wall
    position = foreseen.get("camera", event.camera.position)
    camera = Camera(position=position, world_from_wall=(x + foreseen.get("turned", 0.0), *rest))
    ahead = replace(event, camera=camera, scene_time=foreseen.get("scene_time", 0.0))
    assert (image.buffer.history.accumulation[..., 3] == 1).all()

    image.insert(hits(centres(SIZE), RED), START + 1.0, ahead)
    assert (image.buffer.history.accumulation[..., 3] == 1).all()

    image.insert(hits(centres(SIZE), RED), START + 1.0, event)
    assert (image.buffer.history.accumulation[..., 3] == 2).all()


def test_many_samples_of_one_pixel_at_rest_do_not_drive_out_the_others(scene: Scene) -> None:
    """Edges take thousands of samples at rest and plain surfaces a few; when something moves again, all are needed."""
    edge = hits(np.full((4096, 2), (20.5, 11.5)), RED)
    image = at_rest_after(scene, hits(centres(SIZE), GREEN), *(edge.copy() for _ in range(8)))

    image.refresh(event_at(1), START + 1.0)

    assert (weights(image) > 0.5).all(), "a hole where there was a sample"
    assert_allclose(image.resolved[20, 30], GREEN, atol=1e-5)


def test_what_a_pixel_at_rest_accumulates_is_numpys_mean_and_variance(scene: Scene) -> None:
    """Of luminance (Rec. 709), and of the irradiance's square root; Welford 1962."""
    random = np.random.default_rng(4)
    colors = random.uniform(0, 1, (40, 3)).astype(np.float32)
    lights = random.uniform(0, 1, 40).astype(np.float32)
    samples = hits(np.full((40, 2), (20.5, 11.5)), colors)
    samples["sqrt_irradiance"] = lights

    accumulated = at_rest_after(scene, samples[:13], samples[13:]).buffer.history.accumulation[11, 20]

    luminance = colors @ np.array([0.2126, 0.7152, 0.0722])
    assert_allclose(accumulated[:3], colors.mean(axis=0), rtol=1e-5)
    assert accumulated[3] == 40
    assert accumulated[4] == 1 << WALL
    assert_allclose(accumulated[5], 40 * luminance.var(), rtol=1e-4)
    assert_allclose(accumulated[6:8], [lights.mean(), 40 * lights.var()], rtol=1e-4)


def test_at_rest_only_tiles_that_got_samples_change_and_without_samples_none(scene: Scene) -> None:
    image = at_rest_after(scene)
    image.refresh(event_at(0), START + REFRESH_S)
    assert not image.take_dirty().any()

    image.insert(hits([(20.5, 11.5), (47.9, 31.9)], GREEN), START, event_at(0))
    image.refresh(event_at(0), START + 2 * REFRESH_S)

    assert_array_equal(image.take_dirty(), [[False, True, False], [False, False, True]])
    changed = image.radiance.any(axis=2)
    assert set(zip(*np.nonzero(changed), strict=True)) == {(11, 20), (31, 47)}
    image.refresh(event_at(0), START + 3 * REFRESH_S)
    assert not image.take_dirty().any()


def test_with_another_number_every_tile_changes(scene: Scene) -> None:
    image = at_rest_after(scene, all_pixels())
    image.take_dirty()
    image.refresh(event_at(1), START + 1)
    assert not image.nothing_moves
    assert image.take_dirty().all()


def test_a_contradiction_takes_weight_from_the_same_object_around_and_from_nothing_else(scene: Scene) -> None:
    """Rejection is 1 / (1 + d^2 / 2) at a distance of d pixels, in a square of 5: all at the pixel, 2/3 beside it."""
    plain = weights(seen_then_contradicted(scene, lit(hits([(23.5, 9.5)], RED), NO_CHANGE)))
    image = seen_then_contradicted(scene, lit(hits([(23.5, 9.5)], RED), NO_CHANGE, change=1.0))

    kept = weights(image) / plain

    i, j = np.mgrid[: SIZE[1], : SIZE[0]]
    reached = (np.abs(i - 9) <= 2) & (np.abs(j - 23) <= 2) & (j < 24)  # from column 24 on it is the plate
    expected = np.where(reached, 1.0 - 1.0 / (1.0 + 0.5 * ((i - 9) ** 2 + (j - 23) ** 2)), 1.0)
    kept[9, 23] -= 1 / plain[9, 23]  # the red sample itself
    assert_allclose(kept, expected, atol=1e-5)
    assert_allclose(image.resolved[9, 23], RED, atol=1e-5)


def test_the_newest_samples_are_not_rejected_by_themselves(scene: Scene) -> None:
    """Of two contradicting samples in one pixel both stay: only older ones are rejected."""
    image = seen_then_contradicted(scene, lit(hits([(10.5, 9.5), (10.5, 9.5)], RED), NO_CHANGE, change=1.0))
    assert_allclose(weights(image)[9, 10], 2.0, rtol=1e-5)


def test_a_contradicted_pixel_at_rest_forgets_its_mean(scene: Scene) -> None:
    """8 samples agreed, and one with another number contradicts: the next refresh shows the new one."""
    image = at_rest_after(scene, *(all_pixels() for _ in range(8)))
    image.refresh(event_at(1), START + 1)
    assert_allclose(image.radiance, np.broadcast_to(GREEN, image.radiance.shape), atol=1e-3)

    image.insert(lit(hits([(10.5, 9.5)], RED), NO_CHANGE, change=1.0), START + 1, event_at(1))
    image.refresh(event_at(2), START + 1 + REFRESH_S)

    assert_allclose(image.radiance[9, 10], RED, atol=1e-3)
    assert_allclose(image.radiance[9, 14], GREEN, atol=1e-3)


def test_a_contradiction_beside_an_object_leaves_that_object_s_means(scene: Scene) -> None:
    image = at_rest_after(scene, *(all_pixels() for _ in range(8)))
    image.refresh(event_at(1), START + 1)
    image.insert(lit(hits([(23.5, 9.5)], RED), NO_CHANGE, change=1.0), START + 1, event_at(1))
    image.refresh(event_at(2), START + 1 + REFRESH_S)
    counts = image.accumulated_counts()
    assert (counts[9, 21:24] < 8).all()
    assert (counts[9, 24:] == 8).all(), "of the plate"


def test_changes_of_lighting_are_detected_and_nothing_else(scene: Scene) -> None:
    """A texture changes radiance and not irradiance; less than 0.018 counts as noise, 0.078 and more as all."""
    image = image_of(scene, detects_change=True)
    image.insert(all_pixels(), START, event_at(0))
    image.refresh(event_at(0), START)
    found = hits([(2.5, 2.5), (6.5, 2.5), (10.5, 2.5), (14.5, 2.5), (18.5, 2.5), (40.5, 2.5)], RED)
    found["sqrt_irradiance"] = NO_CHANGE + np.array([0.0, 0.017, 0.018 + 0.03, -0.018 - 0.03, 0.2, 0.2], np.float32)
    found["object_id"] = WALL  # the last one hits another object than what was seen there
    found["change"] = np.nan

    image.insert(found, START, event_at(0))

    assert_allclose(found["change"], [0, 0, 0.5, 0.5, 1, 0], atol=1e-5)


def test_the_smaller_part_of_an_edge_is_no_change_and_the_same_light_amid_a_surface_is(scene: Scene) -> None:
    """Of the samples in column 10 nine are as light as what is left of it, and one as dark as what is right of it."""
    light, dark = 0.9, 0.1
    batches = [hits(centres(SIZE), GREEN) for _ in range(10)]
    for k, samples in enumerate(batches):
        x = samples["xy"][:, 0]
        samples["sqrt_irradiance"] = np.where((x > 11) | ((x > 10) & (k == 4)), dark, light)
    image = at_rest_after(scene, *batches, detects_change=True)
    image.refresh(event_at(1), START + 1)
    found = hits([(10.5, 9.5), (5.5, 9.5), (15.5, 9.5)], GREEN)
    found["sqrt_irradiance"] = dark, dark, light

    image.insert(found, START + 1, event_at(1))

    assert_array_equal(found["change"], [0, 1, 1])


def test_at_rest_changes_count_as_noise(scene: Scene) -> None:
    image = at_rest_after(scene, all_pixels(), detects_change=True)
    second = all_pixels(CHANGED)
    image.insert(second, START + 1, event_at(0))
    image.refresh(event_at(0), START + 1 + REFRESH_S)
    assert (second["change"] == 0.0).all()
    assert (image.buffer.history.accumulation[..., 3] == 2).all()
