"""Relighting under the lights of its own moment gives a sample the radiance that was traced.

What a stored sample keeps is its surface colour, radiance / light. The light is worked out by one kernel when a sample
comes and by another, vector code, when it is lit anew; they round differently. No term of either is larger than what
that light gives a surface that faces it, so with ROUNDINGS that do not cancel in both together

    |relit / traced - 1| <= ROUNDINGS 2^-24 A,   A = (light if every unhidden light were faced) / light

which is 1e-5 up to A = 10: a surface grazed by all of its lights, no sky to speak of.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import START, event_at, image_of, traced
from numpy.testing import assert_array_equal
from small_scenes import instance, material, quad, sphere_mesh, view

from wall.config.scene import OrbitConfig
from wall.core.data import SAMPLE, Float64
from wall.core.jit import kernel
from wall.deepbuffer.kernels.lights import demodulate, pack_normal
from wall.deepbuffer.lights import Diffuse, ObjectLights
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.relight import relight
from wall.scene.build import Scene, assemble
from wall.scene.model import DirectionalLight, PointLight, Sky, Source
from wall.scene.sky import sky_irradiance

ROUNDINGS = 16  # eight of each: four of the cosine, four of the distance and of the sum; the worst measured is 4.7
GRAZING = 10.0
TOLERANCE = 1e-5
OBJECTS, PARALLEL, POINTS = 6, 2, 3
COUNT = 200_000


@kernel
def demodulate_all(samples, lights, diffuse, store):  # type: ignore[no-untyped-def]
    """Write the albedo of every sample."""
    for k in range(samples.shape[0]):
        store.normal[k] = pack_normal(samples[k]["normal"][0], samples[k]["normal"][1])
        demodulate(samples[k], lights, diffuse, store, k)


def unit(rng: np.random.Generator, *shape: int) -> Float64:
    d = rng.normal(size=(*shape, 3))
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


@pytest.mark.parametrize("brightness", [1.0, 0.1, 0.0])
def test_the_two_ways_to_work_light_out_agree_to_rounding(brightness: float, compiled_only: None) -> None:
    """Any normal, any lights hidden, colours from black to glowing, lights of a thousandfold range, down to no sky."""
    rng = np.random.default_rng(7)
    tints = np.array([(0.3, 0.5, 0.9), (0.6, 0.6, 0.6), (0.2, 0.1, 0.1)]) * brightness
    sky = sky_irradiance(Sky(zenith=tuple(tints[0]), horizon=tuple(tints[1]), ground=tuple(tints[2])))
    rows = np.zeros((OBJECTS, PARALLEL + POINTS, 6), np.float32)
    rows[:, :, :3] = unit(rng, OBJECTS, PARALLEL + POINTS) * np.repeat([1.0, 3.0], [PARALLEL, POINTS])[None, :, None]
    rows[:, :, 3:] = 10 ** rng.uniform(-1, 2, (OBJECTS, PARALLEL + POINTS, 1)) * rng.uniform(
        0.3, 1, (*rows.shape[:2], 3)
    )
    up = unit(rng, OBJECTS).astype(np.float32)
    samples = np.zeros(COUNT, SAMPLE)
    samples["normal"], samples["light_visibility"] = rng.integers(-127, 128, (COUNT, 2)), rng.integers(0, 32, COUNT)
    samples["radiance"] = 10 ** rng.uniform(-4, 1, (COUNT, 1)) * rng.uniform(0.1, 1, (COUNT, 3))
    position = rng.uniform(-1.5, 1.5, (3, COUNT)).astype(np.float32)
    ids = np.sort(rng.integers(0, OBJECTS, COUNT)).astype(np.uint32)
    samples["object_id"] = ids
    store = SampleStore.of(COUNT, lit=True)._replace(
        position=position, object_id=ids, light_visibility=samples["light_visibility"].copy()
    )
    lights, every = ObjectLights(rows, PARALLEL, up), np.ones(OBJECTS, np.uint8)

    demodulate_all(samples, lights, Diffuse(every, sky), store)
    relight(store, 0, COUNT, every, lights, sky)

    albedo, colour = store.albedo, store.radiance
    known = albedo[0] >= 0
    traced_radiance = np.float64(samples["radiance"][known])
    off = np.abs(colour[known, :3] / traced_radiance - 1.0)
    light = traced_radiance / albedo.T[known]
    faced = faced_light(rows[ids[known]], position.T[known], samples["light_visibility"][known]) + sky.max(axis=0)
    grazing = faced / light
    assert known.mean() > 0.7
    assert (off <= ROUNDINGS * 2.0**-24 * grazing).all()
    assert (off > 0.2 * ROUNDINGS * 2.0**-24 * grazing).any(), "near the worst case"
    assert (off[grazing <= GRAZING] <= TOLERANCE).all()
    assert ((grazing > 0.9 * GRAZING) & (grazing <= GRAZING)).any()


def faced_light(rows: np.ndarray, position: np.ndarray, visible: np.ndarray) -> Float64:
    """(n, 3) float64: what unhidden lights (n, lights, 6) would give if each were faced."""
    total = np.zeros((len(position), 3))
    for k in range(PARALLEL + POINTS):
        square = ((np.float64(rows[:, k, :3]) - position) ** 2).sum(axis=1)
        weight = (1.0 if k < PARALLEL else 1.0 / square) * (visible >> k & 1)
        total += weight[:, None] * np.float64(rows[:, k, 3:])
    return total


def hall() -> Scene:
    """A floor and balls of dark, coloured and white material, one that turns, under two lights that travel."""
    colours = ((0.5, 0.5, 0.5), (0.02, 0.03, 0.02), (0.9, 0.1, 0.05), (0.98, 0.98, 0.98))
    balls = tuple(
        replace(instance(k, at=(1.5 * k - 3.0, 0.6, 0.2 * k), scale=0.6), name=f"ball {k}") for k in (1, 2, 3)
    )
    around = {"type": "orbit", "center": (0.0, 0.0, 0.0), "period_s": 5.0}
    moving = ({"light": 0}, {"light": 1}, {"object": "ball 2"})
    return assemble(
        Source(
            meshes=(quad(12.0, 12.0, material=0), *(sphere_mesh(k, segments=16) for k in (1, 2, 3))),
            materials=tuple(material(*colour) for colour in colours),
            instances=(replace(instance(0, turn=("x", -90.0)), name="floor"), *balls),
            lights=(
                DirectionalLight(direction=(0.48, 0.64, 0.6), irradiance=(2.0, 1.9, 1.7)),
                PointLight(position=(-2.0, 0.7, 2.0), intensity=(6.0, 6.0, 8.0)),
            ),
            sky=Sky(zenith=(0.01, 0.02, 0.03), horizon=(0.03, 0.03, 0.03), ground=(0.01, 0.01, 0.01)),
            animation=tuple(OrbitConfig.model_validate({**around, **what}) for what in moving),
        )
    )  # fmt: skip


def test_lights_that_go_and_come_back_leave_the_radiance_that_was_traced(compiled_only: None) -> None:
    """Traced at time 0, lit for a second later, lit for time 0 again."""
    seen = view((0.0, 3.0, 5.0), (0.2, 0.8, 0.0), pixels=(64, 48))
    scene, begin, later = hall(), event_at(0, seen), event_at(1, seen, scene_time=1.0)
    shown = image_of(scene, seen)
    shown.insert(traced(scene, begin, seen=seen), START, begin)
    shown.refresh(begin, START)
    n, store = shown.count, shown.buffer.store
    order, were = store.position[:, :n].copy(), store.radiance[:n, :3].astype(np.float64)
    for k, event in enumerate((later, replace(begin, scene_event=2))):
        shown.refresh(event, START + 1e-3 * (k + 1))
        assert shown.count == n
        assert_array_equal(shown.buffer.store.position[:, :n], order)
        if k == 0:
            moved = np.abs(shown.buffer.store.radiance[:n, :3] / were - 1.0).max(axis=1) > 0.1
    store = shown.buffer.store
    relit = store.radiance[:n, :3][moved]

    assert set(np.unique(store.object_id[:n][moved])) == {1, 2, 3, 4}, "every material, the floor among them"
    assert moved.sum() > 1000
    assert np.abs(relit / were[moved] - 1.0).max() <= TOLERANCE
