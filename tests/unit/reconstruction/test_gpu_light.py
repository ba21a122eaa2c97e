"""Lights and objects that move light stored samples anew on a GPU as on the CPU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import GREEN, START, centres, event_at, glowing, hits
from gpu_twins import DECIDED_BY_ROUNDING, ROUNDING, Noise, Twins
from numpy.testing import assert_allclose
from small_scenes import instance, keyframes, material, quad, sphere_mesh, view

from wall.config.scene import OrbitConfig, SpinConfig
from wall.core.data import Edits, Event
from wall.reconstruction.gpu.device import Device
from wall.reconstruction.gpu.store import LIT_WORDS, WORDS
from wall.scene.build import Scene, assemble
from wall.scene.model import DirectionalLight, PointLight, Sky, Source

SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(97, 65))
SKY = Sky(zenith=(0.1, 0.2, 0.3), horizon=(0.3, 0.3, 0.2), ground=(0.2, 0.1, 0.05))
GLOW = (0.4, 0.2, 0.1)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A wall, a sphere that spins, a plate that glows; moving, standing and turning lights."""
    return assemble(
        Source(
            meshes=(quad(40.0, 40.0), sphere_mesh(1), quad(0.5, 0.5, material=2)),
            materials=(material(0.8, 0.6, 0.4), material(0.3, 0.7, 0.9), glowing(GLOW)),
            instances=(
                replace(instance(0, at=(0.0, 0.0, -0.5)), name="wall"),
                replace(instance(1, at=(-0.5, 0.0, 0.7), scale=0.5), name="sphere"),
                replace(instance(2, at=(0.9, 0.4, 0.5)), name="plate"),
            ),
            lights=(
                PointLight(position=(-1.0, 1.0, 2.0), intensity=(2.0, 1.5, 1.0)),
                PointLight(position=(1.0, -1.0, 2.0), intensity=(0.2, 0.3, 0.6)),
                DirectionalLight(direction=(0.0, 0.6, 0.8), irradiance=(0.3, 0.3, 0.2)),
            ),
            animation=(
                keyframes((-1.0, 1.0, 2.0), (1.5, 0.5, 1.5), light=0),
                SpinConfig(type="spin", object="sphere", axis=(0.6, 0.8, 0.0), period_s=3.0),
                OrbitConfig(type="orbit", light=2, center=(0.0, 0.0, 0.0), period_s=8.0),
            ),
            sky=SKY,
        )
    )


def at_refresh(k: int) -> Event:
    """The point light goes on while the eye stands, everything rests for three refreshes, then both move."""
    number = k if k < 8 else max(8, k - 3)
    return event_at(number, SEEN, scene_time=0.05 * number, position=(0.01 * max(number - 8, 0), 0.0, 4.0))


def test_under_lights_that_move_the_image_is_the_same_at_every_refresh(
    opengl: Device, random_numbers: np.random.Generator, scene: Scene, compiled_only: None
) -> None:
    twins, source = Twins(scene, SEEN), Noise(random_numbers, 900)
    for k in range(16):
        event = at_refresh(k)
        for batch in range(2):
            twins.insert(source.of(twins, event), START + k / 60 + 0.005 * batch, event)
        twins.refresh(event, START + (k + 1) / 60)
        twins.agree(decided=DECIDED_BY_ROUNDING)


def test_without_new_samples_stored_ones_follow_the_lights_but_for_those_that_glow(
    opengl: Device, random_numbers: np.random.Generator, scene: Scene, compiled_only: None
) -> None:
    """Every second pixel's worth of samples once; then only the scene's time goes on, by 0.05 s a refresh."""
    twins, source = Twins(scene, SEEN), Noise(random_numbers, 6000)
    samples = source.of(twins, event_at(0, SEEN))
    samples["change"] = 0.0
    samples["radiance"][samples["object_id"] == 3] = GLOW
    assert set(np.unique(samples["object_id"])) == {1, 2, 3}
    twins.insert(samples, START, event_at(0, SEEN))
    twins.refresh(event_at(0, SEEN), START)
    before = twins.gpu.radiance.copy()
    for k in range(1, 11):
        event = event_at(k, SEEN, scene_time=0.05 * k)
        twins.refresh(event, START + 0.02 * k)
        twins.agree(decided=DECIDED_BY_ROUNDING)
    relit = np.abs(twins.gpu.radiance - before).max(axis=2)
    assert np.median(relit) > 50 * ROUNDING, "the lights' way would not be noticed"
    assert_allclose(twins.gpu.radiance[21:26, 66:71], np.broadcast_to(GLOW, (5, 5, 3)), rtol=0, atol=ROUNDING)


def test_samples_of_another_light_are_lit_though_no_light_moves_any_more(
    opengl: Device, random_numbers: np.random.Generator, scene: Scene, compiled_only: None
) -> None:
    """Traced while the light stood elsewhere, heard after it came to rest; then only the eye moves."""
    twins, source = Twins(scene, SEEN), Noise(random_numbers, 6000)
    elsewhere, rest = event_at(0, SEEN), event_at(1, SEEN, scene_time=0.5)
    twins.insert(source.of(twins, rest), START, rest)
    twins.refresh(rest, START)
    late = source.of(twins, elsewhere)
    late["change"] = 0.0
    twins.insert(late, START + 0.01, elsewhere)
    twins.refresh(event_at(2, SEEN, scene_time=0.5, position=(0.01, 0.0, 4.0)), START + 0.02)
    twins.agree(decided=DECIDED_BY_ROUNDING)


def test_a_light_at_a_sample_spoils_no_pixel(opengl: Device, compiled_only: None) -> None:
    """The light moves into the very point that the middle sample hit: it is 1 / 0 of 0 there."""
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
    scene = assemble(
        Source(
            meshes=(quad(40.0, 40.0),), materials=(material(0.8, 0.6, 0.4),), instances=(instance(0),), sky=SKY,
            lights=(PointLight(position=(0.0, 0.0, 2.0), intensity=(2.0, 1.5, 1.0)),),
            animation=(keyframes((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), light=0),),
        )
    )  # fmt: skip
    twins, begin, end = Twins(scene, seen), event_at(0, seen), event_at(1, seen, scene_time=1.0)
    samples = hits([*centres((48, 32)), (24.0, 16.0)], GREEN)  # 4 before the eye: the middle one at the origin, exactly
    samples["light_visibility"] = 2**32 - 1
    twins.insert(samples, START, begin)
    twins.refresh(begin, START)
    twins.refresh(end, START + 0.01)
    twins.agree(decided=DECIDED_BY_ROUNDING)  # which also asserts that every pixel is finite


def test_memory_for_surfaces_is_taken_only_where_lights_or_objects_move(opengl: Device, scene: Scene) -> None:
    lit = Twins(scene, view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8))).gpu._store
    sizes = {name: array.size for name, array in lit.arrays.items()}
    assert sizes == {name: 4 * words * lit.capacity for name, words in (WORDS | LIT_WORDS).items()}


def edited_at_refresh(k: int) -> Event:
    """The eye stands; at refreshes 4, 6 and 8 a light, the wall's colour and the sky are edited, then all rests."""
    values = (
        {"lights.1.intensity": (2.0, 0.1, 0.1)},
        {"materials.material.color": (0.2, 0.9, 0.4)},
        {"sky.strength": (2.0,)},
    )
    number = sum(k >= at for at in (4, 6, 8))
    merged = {name: value for each in values[:number] for name, value in each.items()}
    event = event_at(number, SEEN)
    return replace(event, edits=Edits(number, tuple(sorted(merged.items()))))


def test_edits_doubt_and_light_the_same_samples(
    opengl: Device, random_numbers: np.random.Generator, scene: Scene, compiled_only: None
) -> None:
    """Some samples come before the image shows their edits, some after newer ones are shown."""
    twins, source = Twins(scene, SEEN), Noise(random_numbers, 900)
    for k in range(14):
        event = edited_at_refresh(k)
        for batch, traced_under in enumerate((edited_at_refresh(max(0, k - 1)), event, edited_at_refresh(k + 1))):
            twins.insert(source.of(twins, traced_under), START + k / 60 + 0.004 * batch, traced_under)
        twins.refresh(event, START + (k + 1) / 60)
        twins.agree(decided=DECIDED_BY_ROUNDING)
