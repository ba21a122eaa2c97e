"""Still tiles: what changes is in none of them, what had changed there is forgotten, and pixels there are complete."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import START, centres, event_at, traced
from adaptive_images import image as image_of
from numpy.typing import NDArray
from small_scenes import BLACK_SKY, Triple, View, instance, keyframes, material, quad, sphere_mesh, view

from wall.core.data import Event, Float32
from wall.deepbuffer.kernels.columns import COUNT
from wall.deepbuffer.still_tiles import HOLD_S, MOST_PAIRS, StillTiles
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene, assemble
from wall.scene.model import AlphaMode, DirectionalLight, Instance, Light, PointLight, Source, SpotLight

SIZE = (160, 96)
ABOVE = view((0.0, 3.0, 6.0), (0.0, 0.4, 0.0), pixels=SIZE)
STEP_S = 1 / 20
SUN = DirectionalLight(direction=(0.48, 0.8, 0.36), irradiance=(2.0, 2.0, 2.0))
LAMP = PointLight(position=(0.5, 2.5, 1.0), intensity=(6.0, 6.0, 6.0))
SPOT = SpotLight(
    position=(-2.5, 2.0, 2.0), direction=(0.7, -0.5, -0.51), intensity=(9.0, 9.0, 9.0), inner_angle=20.0,
    outer_angle=40.0,
)  # fmt: skip
TO_AND_FRO: tuple[Triple, ...] = ((-1.6, 0.5, 0.3), (-1.1, 0.8, 0.6), (-1.6, 0.5, 0.3))
MIRROR, MOVER = 3, 4  # objects


def court(
    *lights: Light, path: tuple[Triple, ...] = TO_AND_FRO, times: tuple[float, ...] = (0.0, 0.5, 1.0),
    mirror: float = 0.0, loop: bool = True, light_path: int | None = None, movers: int = 1,
    beside: tuple[Triple, ...] = (), mode: AlphaMode = "opaque",
) -> Scene:  # fmt: skip
    """A floor with a post and a ball, which may be a mirror, and a small ball that moves, or several in one place.

    beside : where another one moves in nine seconds
    """
    ball = replace(material(0.2, 0.3, 0.7, mirror=mirror), alpha_mode=mode)
    places: tuple[Instance, ...] = (
        replace(instance(0, turn=("x", -90.0)), name="floor"),
        replace(instance(1, at=(0.3, 0.7, -0.4), scale=(0.1, 0.7, 0.1)), name="post"),
        replace(instance(2, at=(1.5, 0.5, 0.5), scale=0.5), name="ball"),
    )
    mover = instance(1, at=path[0], turn=("z", 20.0), scale=(0.3, 0.15, 0.2))
    places += tuple(replace(mover, name=f"mover {k}") for k in range(movers))
    moving = [keyframes(*path, times=times, loop=loop, object="mover *")]
    if beside:
        places += (replace(instance(1, at=beside[0], scale=0.2), name="other"),)
        moving.append(keyframes(*beside, times=np.linspace(0.0, 9.0, len(beside)).tolist(), object="other"))
    if light_path is not None:
        moving.append(keyframes(*TO_AND_FRO, times=(0.0, 0.5, 1.0), light=light_path))
    return assemble(
        Source(
            meshes=(quad(8.0, 8.0), sphere_mesh(1), sphere_mesh(2)),
            materials=(
                material(0.6, 0.6, 0.6),
                material(0.7, 0.3, 0.2),
                ball,
            ),
            instances=places,
            lights=lights,
            sky=BLACK_SKY,
            animation=tuple(moving),
        )
    )


def image_that_settles(scene: Scene, seen: View = ABOVE) -> Reconstruction:
    return Reconstruction(seen.panel, seen.eye, scene, detects_change=True, settles=True)


def moment(k: int, seen: View = ABOVE, **camera: Triple) -> Event:
    return replace(event_at(k, seen, scene_time=k * STEP_S, **camera), input_time=START + k * STEP_S)


def show(
    image: Reconstruction, scene: Scene, k: int, seen: View = ABOVE, *, share: float = 1.0, late_s: float = 0.0,
    **camera: Triple,
) -> None:  # fmt: skip
    """Trace pixels' centres under the event of step k, a share of them drawn by chance, and show it `late_s` later."""
    event, xy = moment(k, seen, **camera), centres(seen.panel.pixels)
    samples = traced(scene, event, xy[np.random.default_rng(k).random(len(xy)) < share], seen)
    image.insert(samples, event.input_time + late_s, event)
    image.refresh(event, event.input_time + late_s)


def radiance(scene: Scene, k: int, seen: View = ABOVE) -> Float32:
    return image_of(traced(scene, moment(k, seen), seen=seen), seen.panel.pixels)


def changes(
    image: Reconstruction, scene: Scene, steps: range, seen: View = ABOVE, *, share: float = 1.0, late_s: float = 0.0
) -> Iterator[NDArray[np.bool_]]:
    """Show these steps: of each the pixels (h, w) bool that differ from the one before. None of them may be settled."""
    before = radiance(scene, steps.start - 1, seen)
    for k in steps:
        show(image, scene, k, seen, share=share, late_s=late_s)
        now = radiance(scene, k, seen)
        differs, before = (np.abs(now - before) > 1e-6).any(axis=-1), now
        assert not (differs & image.buffer.history.settled).any(), f"at step {k}"
        yield differs


@pytest.mark.parametrize(
    ("lights", "mirror"), [((SUN,), 0.0), ((SPOT,), 0.6), ((SUN, LAMP), 0.6)], ids=["sun", "spot", "sun and lamp"]
)
def test_no_pixel_that_changes_is_settled(lights: tuple[Light, ...], mirror: float, compiled_only: None) -> None:
    scene = court(*lights, mirror=mirror)
    image, changed, shares = image_that_settles(scene), 0, []
    for differs in changes(image, scene, range(1, 45)):
        changed += int(differs.sum())
        shares.append(image.buffer.history.settled.mean())
    assert changed > 2000, "the test would see it"
    assert not any(shares[: int(HOLD_S / STEP_S) - 1]), "held at first"
    assert 0.3 < shares[-1] < 0.97, "and the rest is"


def test_after_a_pause_what_moves_again_is_in_no_settled_pixel(compiled_only: None) -> None:
    scene = court(SUN)
    image = image_that_settles(scene)
    for k in range(1, 25):
        show(image, scene, k)
    for pause in range(1, 21):
        image.refresh(moment(24), START + (24 + pause) * STEP_S)
    assert image.nothing_moves
    for _ in changes(image, scene, range(25, 40), late_s=20 * STEP_S):
        assert image.buffer.history.settled.mean() > 0.3


def test_the_place_that_an_object_leaves_at_once_after_it_stood_is_reached(compiled_only: None) -> None:
    """While another one moves: else nothing would, and all would be at rest."""
    path: tuple[Triple, ...] = (TO_AND_FRO[0], TO_AND_FRO[0], (1.4, 0.6, 1.9), (1.4, 0.6, 1.9))
    scene = court(SUN, path=path, times=(0.0, 1.5, 1.51, 9.0), loop=False, beside=((2.4, 0.3, -2.0), (2.6, 0.3, -2.0)))
    image = image_that_settles(scene)
    assert any(differs.any() for differs in list(changes(image, scene, range(1, 45))))
    assert image.buffer.history.settled.mean() > 0.3


def test_what_came_to_rest_between_depths_seen_before_is_shaded_by_what_moves_later(compiled_only: None) -> None:
    """A board comes near and goes back to where it rests before a wall; what the view does not show then shades it."""
    aside, near, rest, above = (14.0, 0.0, 3.0), (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 3.0
    swing: tuple[Triple, ...] = ((-3.0, above, 1.2), (3.0, above, 1.2), (-3.0, above, 1.2))
    scene = assemble(
        Source(
            meshes=(quad(40.0, 40.0), quad(5.0, 4.0), sphere_mesh()),
            materials=(material(0.6, 0.6, 0.6),),
            instances=(
                replace(instance(0, at=(0.0, 0.0, -6.0)), name="wall"),
                replace(instance(1, at=aside), name="board"),
                replace(instance(2, at=swing[0], scale=0.3), name="ball"),
            ),
            lights=(PointLight(position=(0.0, 5.0, 2.0), intensity=(40.0, 40.0, 40.0)),),
            sky=BLACK_SKY,
            animation=(
                keyframes(aside, near, rest, times=(0.3, 0.5, 1.0), loop=False, object="board"),
                keyframes(*swing, times=(2.0, 4.0, 6.0), loop=False, object="ball"),
            ),
        )
    )
    seen = view((0.0, 0.0, 6.0), (0.0, 0.0, 0.0), pixels=SIZE)
    differs = list(changes(image_that_settles(scene, seen), scene, range(1, 90), seen))
    assert sum(each.sum() for each in differs[40:]) > 500, "of the steps after 40"


def test_a_mover_reaches_where_it_is_seen_and_shades_and_the_rest_settles() -> None:
    """Of few pixels, also in plain Python; the mirror is one of them."""
    seen, scene = view((0.0, 3.0, 6.0), (0.0, 0.4, 0.0), pixels=(64, 36)), court(SUN, LAMP, mirror=0.5)
    image = image_that_settles(scene, seen)
    for k in range(1, 15):
        show(image, scene, k, seen)
        nearest = image.find_nearest().object_id
        assert not image.buffer.history.settled[(nearest == MIRROR) | (nearest == MOVER)].any()
    assert 0.05 < image.buffer.history.settled.mean() < 0.9


def test_a_scene_with_surfaces_that_let_light_through_has_none() -> None:
    assert StillTiles.can_have(court(SUN))
    assert not StillTiles.can_have(court(SUN, mode="blend"))


@pytest.mark.parametrize("size", [(149, 91), (13, 9), (160, 97)])
def test_images_of_any_size_settle(size: tuple[int, int], compiled_only: None) -> None:
    seen, scene = view((0.0, 3.0, 6.0), (0.0, 0.4, 0.0), pixels=size), court(SUN)
    image = image_that_settles(scene, seen)
    for k in range(1, 20):
        show(image, scene, k, seen)
    assert image.buffer.history.settled.any() == (size != (13, 9)), "one tile is all of the smallest"


def test_a_mirror_never_settles_and_what_surrounds_it_does(compiled_only: None) -> None:
    scene, plain = court(SUN, mirror=0.6), court(SUN)
    settled = []
    for each in (scene, plain):
        image = image_that_settles(each)
        for k in range(1, 25):
            show(image, each, k)
        settled.append(image.buffer.history.settled)
        nearest = image.find_nearest().object_id
    ball = nearest == MIRROR
    assert ball.sum() > 200
    assert not settled[0][ball].any()
    assert settled[1][ball].all()
    assert (settled[0] ^ settled[1])[~ball].mean() < 0.01


def test_what_a_mover_left_behind_is_forgotten_though_few_samples_come(compiled_only: None) -> None:
    far_away: tuple[Triple, ...] = (
        (-1.6, 0.5, 0.3), (-1.1, 0.8, 0.6), (1.2, 0.6, 1.6), (1.4, 0.6, 1.6), (1.2, 0.6, 1.6), (1.4, 0.6, 1.6),
    )  # fmt: skip
    scene = court(SUN, path=far_away, times=(0.0, 2.0, 2.5, 4.5, 6.5, 8.5), loop=False)
    image = image_that_settles(scene)
    for k in range(1, 160):
        show(image, scene, k, share=0.2)
    settled, expected = image.buffer.history.settled, radiance(scene, 159)
    was = (np.abs(radiance(scene, 5) - expected) > 1e-3).any(axis=-1) & settled
    assert was.sum() > 50, "pixels that it covered or shaded are settled now"
    error = np.abs(image.radiance - expected).max(axis=-1)
    assert error[was].max() < 0.01
    assert error[settled & (image.accumulated_counts() >= 4)].max() < 0.01


def test_settled_pixels_show_the_mean_of_all_that_came(compiled_only: None) -> None:
    scene = court(SUN)
    image = image_that_settles(scene)
    for k in range(1, 60):
        show(image, scene, k)
    history = image.buffer.history
    inside = history.settled & (history.accumulation[..., COUNT] > 30)
    assert inside.mean() > 0.5
    assert np.abs(image.radiance - radiance(scene, 59))[inside].max() < 1e-5, "pixels' middles say all the same"


def test_samples_that_differ_from_a_settled_pixel_are_noise_and_elsewhere_contradict_it(compiled_only: None) -> None:
    scene = court(SUN)
    image = image_that_settles(scene)
    for k in range(1, 30):
        show(image, scene, k)
    settled, event = image.buffer.history.settled.copy(), moment(29)
    samples = traced(scene, event, seen=ABOVE)
    samples["sqrt_irradiance"] += 0.5
    image.insert(samples, event.input_time, event)
    x, y = samples["xy"].astype(int).T
    assert not samples["change"][settled[y, x]].any()
    assert (samples["change"][~settled[y, x]] > 0.0).mean() > 0.5


@pytest.mark.parametrize("why", ["camera", "light moves", "too many"])
def test_where_all_may_change_nothing_settles(why: str, compiled_only: None) -> None:
    scene = court(SUN, movers=MOST_PAIRS + 1 if why == "too many" else 1)
    if why == "light moves":
        scene = court(SUN, LAMP, light_path=1)
    assert StillTiles.can_have(scene) == (why != "light moves")
    image = image_that_settles(scene)
    for k in range(1, 25):
        camera: dict[str, Triple] = {"position": (0.0, 3.0, 6.0 + 0.001 * k)} if why == "camera" else {}
        show(image, scene, k, **camera)
    assert not image.buffer.history.settled.any()


def test_when_the_camera_moves_all_that_was_known_is_forgotten_and_found_anew(compiled_only: None) -> None:
    scene = court(SUN)
    image = image_that_settles(scene)
    for k in range(1, 20):
        show(image, scene, k)
    history = image.buffer.history
    assert history.settled.mean() > 0.5
    show(image, scene, 20, position=(0.2, 3.0, 6.0))
    assert not history.settled.any()
    assert not history.still.any()
    for k in range(21, 40):
        show(image, scene, k, position=(0.2, 3.0, 6.0))
    assert history.settled.mean() > 0.5
