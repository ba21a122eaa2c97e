"""What hides what, what waits behind it, what is aged by tiles, and what watchers are told: on a GPU as on the CPU."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import GREEN, RED, START, centres, event_at, hits, plate_before_wall
from gpu_twins import DECIDED_BY_ROUNDING, ROUNDING, Noise, Twins
from numpy.testing import assert_allclose
from small_scenes import view

from wall.reconstruction.gpu.device import Device
from wall.reconstruction.kernels.visibility import DECAY, SILHOUETTE_PER_S, WAIT_S
from wall.reconstruction.statistics import statistics_of_store

SIZE = (97, 65)
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)
AWAY, BEFORE = (9.0, 0.0, 2.0), (0.0, 0.0, 2.0)  # where the plate is at 0 s and at 1 s


def around_the_plate(twins: Twins) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """(h, w) bool: pixels within one of its outline, as the CPU's image found them."""
    return np.asarray(twins.cpu._bounds[DECAY] >= SILHOUETTE_PER_S)


def test_at_silhouettes_samples_age_faster_by_as_much(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None
) -> None:
    """Two generations, 0.3 s apart and not alike: at the outline the new one counts 12 times as much as the old."""
    twins, source = Twins(plate_before_wall(BEFORE), SEEN), Noise(random_numbers, 12000)
    for k in range(2):
        samples = source.of(twins, event_at(k, SEEN))
        samples["change"], samples["radiance"] = 0.0, samples["radiance"] * (1.0 - 0.8 * k)
        twins.insert(samples, START + 0.3 * k, event_at(k, SEEN))
    twins.refresh(event_at(2, SEEN, position=(0.001, 0.0, 4.0)), START + 0.31)
    twins.agree(decided=DECIDED_BY_ROUNDING)
    outline = around_the_plate(twins)
    assert 0.01 < outline.mean() < 0.2
    shown = twins.gpu.radiance.max(axis=2)
    assert np.median(shown[outline]) < 0.7 * np.median(shown[~outline]), "SILHOUETTE_PER_S would not be noticed"


def test_hidden_samples_wait_come_out_again_and_die_when_they_are_old(opengl: Device, compiled_only: None) -> None:
    """A plate comes before the wall for 0.2 s, goes, comes back for longer than WAIT_S, and goes again."""
    twins = Twins(plate_before_wall(AWAY, BEFORE), SEEN)
    random = np.random.default_rng(5)
    wall = hits(centres(SIZE), GREEN)
    wall["radiance"] *= (0.5 + random.random((len(wall), 1))).astype(np.float32)
    assert float(WAIT_S) == 0.5
    twins.insert(wall, START, event_at(0, SEEN))
    twins.refresh(event_at(0, SEEN), START)
    at_first = twins.gpu.radiance.copy()
    plate_at = (np.abs(centres(SIZE) - np.array(SIZE) / 2) < 14).all(axis=1)
    plate = hits(centres(SIZE)[plate_at], RED, depth=2.0, object_id=2)
    came_out, counts = [], []
    for k, (moment, there) in enumerate(((0.1, 1), (0.2, 1), (0.3, 0), (0.4, 1), (0.6, 1), (0.7, 0)), 1):
        event = event_at(k, SEEN, scene_time=float(there))
        if there and k in (1, 4):
            twins.insert(plate, START + moment - 0.001, event)
        twins.refresh(event, START + moment)
        twins.agree(decided=DECIDED_BY_ROUNDING)
        came_out.append(float(np.abs(twins.gpu.radiance - at_first)[..., 1].max()))
        counts.append(int(np.count_nonzero(twins.gpu.stored().screen_position[2] > 0.0)))
    assert came_out[2] < ROUNDING, "all of them had waited"
    assert came_out[5] > 100 * ROUNDING, "some were too old"
    assert counts[2] == len(wall) > counts[5]


def test_samples_of_a_foreseen_pose_do_not_spoil_what_still_pixels_gather(
    opengl: Device, random_numbers: np.random.Generator
) -> None:
    """At rest, rays may still be on their way that were traced for a pose that never came, under the same number."""
    twins = Twins(plate_before_wall(BEFORE), SEEN)
    for k in range(3):
        twins.refresh(event_at(0, SEEN), START + k / 60)
        twins.insert(hits(centres(SIZE), GREEN), START + k / 60, event_at(0, SEEN))
    foreseen = event_at(0, SEEN, position=(0.3, 0.0, 4.0))
    twins.insert(hits(centres(SIZE), RED), START + 0.05, foreseen)
    twins.refresh(event_at(0, SEEN), START + 0.05)
    twins.agree()
    assert twins.gpu.radiance[..., 0].max() < RED[0] / 16, "the splats' share beside the mean of three"


@pytest.mark.parametrize("moves", [True, False], ids=["moving", "at rest"])
def test_watchers_see_the_same_ages_and_densities(
    opengl: Device, random_numbers: np.random.Generator, moves: bool, compiled_only: None
) -> None:
    """Old samples, some dead, some waiting to travel, and pixels that accumulated."""
    twins, source = Twins(plate_before_wall(AWAY, BEFORE), SEEN), Noise(random_numbers, 3000)
    for k in range(5):
        event = event_at(k if moves else 0, SEEN, scene_time=0.25 * k if moves else 0.0)
        samples = source.of(twins, event)
        samples["change"] = 0.0
        twins.refresh(event, START + 0.05 * k)
        twins.insert(samples, START + 0.05 * k, event)
    on_cpu, on_gpu = (statistics_of_store(image, START + 0.3) for image in (twins.cpu, twins.gpu))
    assert np.count_nonzero(on_cpu[0]) >= 34, "all tiles but a corner of one pixel"
    assert_allclose(on_gpu[0].astype(int), on_cpu[0].astype(int), rtol=0, atol=1)
    assert_allclose(on_gpu[1], on_cpu[1], rtol=0.02)
    twins.agree(decided=DECIDED_BY_ROUNDING)


def test_an_empty_image_has_nothing_to_statistics_image(opengl: Device) -> None:
    twins = Twins(plate_before_wall(AWAY), SEEN)
    age, density = statistics_of_store(twins.gpu, START)
    assert age.shape == density.shape == (5, 7)
    assert not age.any()
    assert not density.any()
