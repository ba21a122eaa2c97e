"""What an image of reprojected samples shows: the samples themselves, moved with camera and objects, and no ghosts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import (
    EVENT_S,
    FRONT,
    GREEN,
    RED,
    SIZE,
    START,
    centres,
    event_at,
    hits,
    image,
    image_of,
    plate_before_wall,
    traced,
)
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from small_scenes import View, traced_image, view

from wall.core.data import Float32, Rect
from wall.geometry.cameras import look_at
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene

CENTRE = (0.0, 0.0, 2.0)
AWAY = (9.0, 0.0, 2.0)  # outside the image
ROUNDING = 1e-5  # of a radiance of 0.5: sums of few float32


def test_samples_at_all_pixel_centres_of_a_still_scene_are_shown_as_they_are(
    tiny_scene: Scene, tiny_view: View, compiled_only: None
) -> None:
    shown = image_of(tiny_scene, tiny_view)
    event = event_at(0, tiny_view)
    samples = traced(tiny_scene, event, seen=tiny_view)

    shown.insert(samples, START, event)
    shown.refresh(event, START)

    # a hit comes back to within 3e-4 pixels, so so much of a neighbour's radiance (4 at most) is mixed in
    assert_allclose(shown.radiance, image(samples, tiny_view.panel.pixels), rtol=0, atol=4 * 2 * 3e-4)


def test_after_the_camera_turned_the_image_is_that_of_the_new_camera(tiny_scene: Scene, compiled_only: None) -> None:
    """96 x 72 pixels, 4 stratified samples a pixel, a turn of 3 degrees and a step aside of 0.15.

    Away from edges of objects, shadows and the border, radiance differs between neighbours by less than SMOOTH, and
    samples spread over less than 1.5 pixels; so the tolerance is a few times SMOOTH.
    """
    smooth = 0.02
    seen = view((0.0, 2.2, 5.0), (0.0, 0.6, 0.0), pixels=(96, 72))
    turned = replace(event_at(1, seen), camera=look_at((0.15, 2.2, 5.0), (0.25, 0.6, 0.0), (0, 1, 0)))
    shown = image_of(tiny_scene, seen)
    quarter = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]], np.float32)
    xy = (centres(seen.panel.pixels)[:, None] + quarter).reshape(-1, 2)
    shown.insert(traced(tiny_scene, event_at(0, seen), xy, seen), START, event_at(0, seen))

    shown.refresh(turned, START + EVENT_S)

    truth = traced_image(tiny_scene, replace(seen, event=turned))
    before = traced_image(tiny_scene, seen)
    compared = calm(truth.radiance, truth.objects, smooth)
    assert compared.mean() > 0.4
    error = np.abs(shown.radiance - truth.radiance).max(axis=2)[compared]
    assert np.quantile(error, 0.99) < 2 * smooth
    standing = np.abs(before.radiance - truth.radiance).max(axis=2)[compared]
    assert np.sqrt((error**2).mean()) < 0.25 * np.sqrt((standing**2).mean()), "no better than not moving at all"


def calm(radiance: Float32, objects: NDArray[np.uint32], smooth: float) -> NDArray[np.bool_]:
    """Pixels whose 5 x 5 neighbours show the same object in nearly the same radiance, 6 pixels from the border."""
    kept = np.zeros(objects.shape, bool)
    kept[6:-6, 6:-6] = True
    for di in range(-2, 3):
        for dj in range(-2, 3):
            near = np.roll(radiance, (di, dj), (0, 1))
            kept &= np.abs(near - radiance).max(axis=2) < smooth * max(abs(di), abs(dj), 1)
            kept &= np.roll(objects, (di, dj), (0, 1)) == objects
    return kept


def test_what_an_object_uncovers_is_filled_from_around_it_and_never_from_the_object() -> None:
    scene = plate_before_wall(CENTRE, AWAY)
    shown = image_of(scene)
    first, second = event_at(0), event_at(1, scene_time=1.0)
    samples = traced(scene, first)
    assert (samples["radiance"] == np.array(RED, np.float32)).all(axis=1).mean() > 0.1

    shown.insert(samples, START, first)
    shown.refresh(first, START)
    shown.refresh(second, START + EVENT_S)

    assert_allclose(shown.radiance, np.broadcast_to(GREEN, shown.radiance.shape), rtol=0, atol=ROUNDING)


def test_a_moved_object_is_shown_where_it_is_now_and_hides_what_is_behind() -> None:
    """By 0.5 at 2 from the eye. The plate was sampled once a pixel and has not grown, so it has no hole inside."""
    scene = plate_before_wall(CENTRE, (0.5, 0.0, 2.0))
    shown = image_of(scene)
    first, second = event_at(0), event_at(1, scene_time=1.0)
    shown.insert(traced(scene, first), START, first)
    shown.refresh(first, START)

    shown.refresh(second, START + EVENT_S)

    truth = image(traced(scene, second), SIZE)
    red = truth[..., 0] > 0
    inside = red & np.roll(red, 1, 0) & np.roll(red, -1, 0) & np.roll(red, 1, 1) & np.roll(red, -1, 1)
    assert inside.sum() > 100
    assert_allclose(shown.radiance[inside], np.broadcast_to(RED, (inside.sum(), 3)), rtol=0, atol=ROUNDING)


def test_what_was_hidden_comes_out_again_if_it_is_young() -> None:
    """A plate comes over the wall and leaves: samples of the wall under it were too old to wait, or not yet."""
    scene = plate_before_wall(AWAY, CENTRE, AWAY)
    for age, wanted in ((0.6, False), (0.1, True), (0.01, True)):
        shown = image_of(scene)
        first, second, third = (event_at(k, scene_time=float(k)) for k in range(3))
        shown.insert(traced(scene, first), START, first)
        shown.insert(traced(scene, second), START, second)
        shown.refresh(second, START + age)
        plate = image(traced(scene, second), SIZE)[..., 0] > 0
        inside = plate & np.roll(plate, 1, 0) & np.roll(plate, -1, 0) & np.roll(plate, 1, 1) & np.roll(plate, -1, 1)

        shown.refresh(third, START + age + EVENT_S)

        weight = shown.splat_sums[1:-1, 1:-1, 3]
        assert (weight[inside] > 0.1).all() == wanted
        assert (weight[inside] > 0.0).any() == wanted
        assert (weight[~plate] > 0.1).all(), "hidden without anything before it"


def test_a_nearer_surface_hides_a_deeper_one_of_the_same_object() -> None:
    """Hits by hand: one object at depth 4 and, in the middle, at depth 2; a rest of the deeper one would be seen."""
    scene = plate_before_wall(AWAY)
    shown = image_of(scene)
    event = event_at(0)
    xy = centres(SIZE)
    middle = np.abs(xy - (24, 16)).max(axis=1) < 8
    shown.insert(hits(xy, GREEN), START, event)
    shown.insert(hits(xy[middle], RED, depth=2.0), START, event)

    shown.refresh(event, START + EVENT_S)

    shown_middle = shown.radiance[8:24, 16:32]
    assert_allclose(shown_middle, np.broadcast_to(RED, shown_middle.shape), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("rect", [Rect(x=0, y=0, width=48, height=9), Rect(x=5, y=7, width=17, height=21)])
def test_a_part_of_a_panel_shows_what_the_whole_shows_there(rect: Rect) -> None:
    scene = plate_before_wall(CENTRE)
    event = event_at(0)
    whole = image_of(scene)
    part = Reconstruction(FRONT.panel, FRONT.eye, scene, detects_change=False, rect=rect)
    samples = traced(scene, event)
    for shown in (whole, part):
        shown.insert(samples, START, event)
        shown.refresh(event, START)
    cut = whole.radiance[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width]
    assert len(np.unique(cut[..., 0])) >= 2, "shows the plate and the wall"
    assert_allclose(part.radiance, cut, rtol=0, atol=1e-3)


def test_the_same_moments_later_on_the_clock_give_the_same_image() -> None:
    """A machine that has been up for months: float32 seconds since then would step by 1."""
    scene = plate_before_wall(CENTRE, (0.2, 0.0, 2.0), (0.4, 0.1, 2.0))
    images = []
    for start in (START, 2.0**24):
        shown = image_of(scene)
        for k in range(3):
            event = event_at(k, scene_time=float(k))
            shown.refresh(event, start + k / 64)
            shown.insert(traced(scene, event), start + k / 64, event)
        shown.refresh(event_at(3, scene_time=2.0), start + 4 / 64)
        images.append(shown.splat_sums.copy())
    assert_array_equal(images[0], images[1])
