"""An image at rest is made of samples of the moment that it shows: of no view, and no time, before."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import FRONT, GREEN, RED, SIZE, START, centres, event_at, hits, image_of, plate_before_wall, traced
from numpy.testing import assert_allclose, assert_array_equal
from small_scenes import Triple

from wall.core.data import Event, Float32, Samples
from wall.deepbuffer.kernels.accumulation import MEAN_ALONE
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.sampling.kernels.scores import BELIEVED
from wall.scene.build import Scene

SKY = 0
BLUE: Triple = (0.0, 0.0, 0.5)
REFRESH_S = 1.0 / 30.0
ASIDE, BEFORE_THE_EYE = (9.0, 0.0, 2.0), (0.0, 0.0, 2.0)


@pytest.fixture(params=["cpu", "gpu"])
def backend(request: pytest.FixtureRequest) -> str:
    if request.param == "gpu":
        request.getfixturevalue("opengl")
    return str(request.param)


class Shown:
    """An image that is refreshed every REFRESH_S."""

    def __init__(self, scene: Scene, backend: str) -> None:
        make = {"cpu": lambda: image_of(scene), "gpu": lambda: GpuReconstruction(FRONT.panel, FRONT.eye, scene)}
        self.image: Reconstruction | GpuReconstruction = make[backend]()
        self.now = START

    def refresh(self, event: Event) -> None:
        self.now += REFRESH_S
        self.image.refresh(event, self.now)

    def insert(self, event: Event, *batches: Samples) -> None:
        for batch in batches:
            self.image.insert(batch.copy(), self.now, event)

    def rest(self, event: Event, *batches: Samples) -> None:
        """Show an event twice, then a batch a refresh."""
        self.refresh(event)
        self.refresh(event)
        for batch in batches:
            self.insert(event, batch)
            self.refresh(event)

    @property
    def counts(self) -> Float32:
        return self.image.accumulated_counts()


def everywhere(color: Triple, *, object_id: int) -> Samples:
    return hits(centres(SIZE), color, object_id=object_id)


def test_where_the_sky_comes_back_after_a_zoom_nothing_of_the_zoomed_view_stays(backend: str) -> None:
    """The sky does not move with the eye: by the sky alone its pixels would seem to have stood still."""
    shown = Shown(plate_before_wall(ASIDE), backend)
    first, zoomed, back = event_at(0), event_at(1, position=(0.0, 0.0, 3.0)), event_at(2)
    shown.rest(first, everywhere(BLUE, object_id=SKY))

    shown.rest(zoomed, *9 * [everywhere(RED, object_id=2)])
    shown.rest(back)

    assert_array_equal(shown.counts, 0.0)
    shown.rest(back, *4 * [everywhere(BLUE, object_id=SKY)])
    assert_allclose(shown.image.radiance, np.broadcast_to(BLUE, (*SIZE[::-1], 3)), rtol=1e-5)


def test_where_an_object_was_that_moves_away_nothing_of_it_stays(backend: str, compiled_only: None) -> None:
    """What shows there then, the wall, has not moved."""
    scene = plate_before_wall(ASIDE, BEFORE_THE_EYE, ASIDE)
    shown = Shown(scene, backend)
    away, before, away_again = (event_at(k, scene_time=float(k)) for k in range(3))
    shown.rest(away, traced(scene, away))

    shown.rest(before, *9 * [traced(scene, before)])
    assert (shown.image.radiance[SIZE[1] // 2, SIZE[0] // 2, 0]) > 0.4, "the plate is seen"
    shown.refresh(away_again)

    assert_allclose(shown.image.radiance[..., 0], 0.0, atol=1e-6)


def test_samples_of_the_view_before_that_come_late_are_no_part_of_the_mean(backend: str) -> None:
    """They come after the first refresh of a view, which has just moved, and before the second."""
    shown = Shown(plate_before_wall(ASIDE), backend)
    old, new = event_at(0, position=(0.0, 0.0, 3.0)), event_at(1)
    shown.rest(old, everywhere(RED, object_id=2))

    shown.refresh(new)
    shown.insert(old, everywhere(RED, object_id=2), everywhere(RED, object_id=2))
    shown.insert(new, everywhere(GREEN, object_id=1))
    shown.insert(old, everywhere(RED, object_id=2))
    shown.refresh(new)

    assert_array_equal(shown.counts, 1.0)
    shown.rest(new, *3 * [everywhere(GREEN, object_id=1)])
    assert_allclose(shown.image.radiance, np.broadcast_to(GREEN, (*SIZE[::-1], 3)), rtol=1e-5)


def test_where_time_stops_every_pixel_is_looked_at_again(backend: str) -> None:
    """The eye rests: pixels keep their means while something else moves. Where it stopped no sample has told yet."""
    scene = plate_before_wall(ASIDE, (8.0, 0.0, 2.0), (7.0, 0.0, 2.0))
    shown = Shown(scene, backend)
    shown.rest(event_at(0), *9 * [everywhere(GREEN, object_id=1)])
    moving, stopped = event_at(1, scene_time=0.5), event_at(2, scene_time=1.0)

    shown.refresh(moving)
    shown.refresh(stopped)
    assert_array_equal(shown.counts, 9.0)
    shown.refresh(stopped)

    assert_array_equal(shown.counts, MEAN_ALONE - 1)
    assert_allclose(shown.image.radiance, np.broadcast_to(GREEN, (*SIZE[::-1], 3)), rtol=1e-5)
    shown.refresh(stopped)
    shown.rest(stopped, everywhere(GREEN, object_id=1))
    assert_array_equal(shown.counts, MEAN_ALONE, err_msg="once only")


def test_a_pixel_that_the_sampler_is_done_with_shows_its_own_samples_alone() -> None:
    assert BELIEVED >= MEAN_ALONE
