"""Whatever comes in: no NaN, no more memory than was allocated, and the newest samples stay."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import EVENT_S, GREEN, SIZE, START, centres, event_at, hits, image_of, plate_before_wall
from numpy.testing import assert_allclose
from small_scenes import view

from wall.core.data import SAMPLE, Float32, Samples
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene

AREA = SIZE[0] * SIZE[1]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return plate_before_wall((9.0, 0.0, 2.0))  # outside the image


def arrays_of(image: Reconstruction) -> set[tuple[str, int]]:
    """Every array an image owns, in whatever it keeps them, with its size."""
    found: set[tuple[str, int]] = set()
    for name, value in [*vars(image).items(), *vars(image.buffer).items()]:
        parts = value if isinstance(value, list | tuple) else [value]
        found |= {(name, part.nbytes) for part in parts if isinstance(part, np.ndarray)}
    return found


def shown_after(scene: Scene, samples: Samples, *, rest: bool = False) -> Float32:
    """The image of these samples, at rest or after one more event."""
    image = image_of(scene)
    image.refresh(event_at(0), START)
    image.insert(samples, START, event_at(0))
    image.refresh(event_at(0 if rest else 1), START + EVENT_S)
    return image.radiance


def test_an_empty_image_is_black(scene: Scene) -> None:
    assert (shown_after(scene, np.zeros(0, SAMPLE)) == 0.0).all()


@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize("at", [(0.0, 0.0), (24.3, 9.9), (47.99, 31.99)])
def test_one_sample_is_finite_and_in_motion_colours_the_whole_image(
    scene: Scene, at: tuple[float, float], rest: bool
) -> None:
    shown = shown_after(scene, hits(at, GREEN), rest=rest)
    assert np.isfinite(shown).all()
    if not rest:  # nothing else is known; at rest the reconstruction is from before it came
        assert_allclose(shown, np.broadcast_to(GREEN, shown.shape), rtol=1e-4)
    x, y = int(at[0]), int(at[1])
    assert shown[y, x, 1] >= 0.75 * 0.5 * 0.999, "1 - 1 / (1 + 1)^2 of the sample's own"


@pytest.mark.parametrize("object_id", [3, 4, 1000, 2**31, 2**32 - 1])
def test_samples_of_objects_that_the_scene_does_not_have_are_left_out(scene: Scene, object_id: int) -> None:
    both = np.concatenate([hits(centres(SIZE), (9.0, 9.0, 9.0), object_id=object_id), hits(centres(SIZE), GREEN)])
    shown = shown_after(scene, both)
    assert_allclose(shown, np.broadcast_to(GREEN, shown.shape), rtol=0, atol=1e-5)


@pytest.mark.parametrize("depth", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e-45, 3e38])
def test_impossible_depths_spoil_no_other_pixel(scene: Scene, depth: float) -> None:
    wrong = hits(centres(SIZE)[::7], GREEN, depth=depth)
    shown = shown_after(scene, np.concatenate([hits(centres(SIZE), GREEN), wrong]))
    assert_allclose(shown, np.broadcast_to(GREEN, shown.shape), rtol=0, atol=1e-5)


@pytest.mark.parametrize("at", [(-0.01, 5.0), (48.01, 5.0), (5.0, 32.01), (1e9, 1e9), (np.nan, 5.0), (np.inf, 5.0)])
def test_samples_beside_the_panel_are_not_shown(scene: Scene, at: tuple[float, float]) -> None:
    assert (shown_after(scene, hits(at, GREEN)) == 0.0).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (17, 1), (33, 16)])
def test_images_of_any_size_show_their_samples(scene: Scene, size: tuple[int, int]) -> None:
    image = image_of(scene, view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=size))
    image.insert(hits(centres(size), GREEN), START, event_at(0))
    image.refresh(event_at(0), START)
    assert image.radiance.shape == (size[1], size[0], 3)
    assert_allclose(image.radiance, np.broadcast_to(GREEN, image.radiance.shape), rtol=0, atol=1e-5)


def test_between_two_refreshes_no_array_grows_and_the_newest_samples_stay(scene: Scene, compiled_only: None) -> None:
    """40 rounds of all pixels, each of its own brightness: the darkest one shown tells the oldest that is left."""
    image = image_of(scene, kept=4.0)
    before = arrays_of(image)
    image.refresh(event_at(0), START)
    for k in range(40):
        image.insert(hits(centres(SIZE), (0.0, float(k), 0.0)), START + 0.001 * k, event_at(1))
    assert arrays_of(image) == before

    image.refresh(event_at(1), START + 0.04)

    room = int(4.5 * AREA) + 4096
    assert image.count <= room
    assert image.resolved[..., 1].min() >= 40 - room // AREA - 1
    assert image.resolved[..., 1].max() <= 39.0001


@pytest.mark.parametrize("kept", [1.0, 2.0, 4.0])
def test_from_refresh_to_refresh_so_many_samples_a_pixel_stay_the_newest(
    scene: Scene, kept: float, compiled_only: None
) -> None:
    """Four rounds a second: what is older than `kept` rounds, and the half that the slack allows, has gone."""
    image = image_of(scene, kept=kept)
    for k in range(20):
        image.insert(hits(centres(SIZE), (0.0, float(k), 0.0)), START + 0.25 * k, event_at(k))
        image.refresh(event_at(k), START + 0.25 * k)
    assert image.resolved[..., 1].min() > 19 - kept - 1
    assert (image.splat_sums[1:-1, 1:-1, 3] > 0.99).all(), "the newest round weighs 1"


def test_a_batch_larger_than_the_whole_store_is_taken_in_and_judged(scene: Scene, compiled_only: None) -> None:
    """Batches have 65,536 samples at most; a store of 3 x 2 pixels has room for 4,000."""
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(3, 2))
    image = image_of(scene, seen, detects_change=True)
    many = np.tile(hits(centres((3, 2)), GREEN), 10923)[:65536]
    many["sqrt_irradiance"] = 0.5
    image.refresh(event_at(0, seen), START)
    image.insert(many, START, event_at(0, seen))
    image.refresh(event_at(1, seen), START + EVENT_S)
    many["sqrt_irradiance"], many["change"] = 1.0, np.nan
    image.insert(many, START + EVENT_S, event_at(2, seen))
    assert (many["change"][:6] == 1.0).all(), "the first contradict"
    assert np.isfinite(many["change"]).all(), "one was never judged"
    image.refresh(event_at(2, seen), START + 2 * EVENT_S)
    assert_allclose(image.radiance, np.broadcast_to(GREEN, (2, 3, 3)), rtol=0, atol=1e-5)


def test_a_cleared_image_remembers_nothing(scene: Scene) -> None:
    image = image_of(scene)
    for k in range(3):
        image.insert(hits(centres(SIZE), GREEN), START, event_at(0))
        image.refresh(event_at(0), START + k)
    image.clear()
    image.refresh(event_at(0), START + 3)
    assert (image.radiance == 0.0).all()
    assert image.take_dirty().all(), "it must be shown that all is gone"


def test_the_eye_amid_samples_gives_finite_pixels(scene: Scene) -> None:
    """The camera walks through the wall: points beside, at and behind the eye."""
    image = image_of(scene)
    image.insert(hits(centres(SIZE), GREEN), START, event_at(0))
    for k, z in enumerate((1.0, 1e-3, 0.0, -1e-3, -1.0)):
        event = event_at(k, position=(0.0, 0.0, z))
        image.refresh(event, START + k * EVENT_S)
        assert np.isfinite(image.radiance).all()
    assert (image.splat_sums[..., 3] == 0.0).all(), "the wall is behind the eye"
