"""Relit samples against the tracer: same surface points, traced at one time and lit for another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from adaptive_images import START, event_at, image_of, traced
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from small_scenes import instance, keyframes, material, quad, sphere_mesh, view

from wall.config.scene import OrbitConfig, SpinConfig
from wall.core.data import SAMPLE, Event, Float32, Float64, Samples
from wall.core.jit import kernel
from wall.deepbuffer.kernels import lights as kernels_lights
from wall.deepbuffer.lights import Diffuse, ObjectLights
from wall.deepbuffer.store import SampleStore
from wall.packets.kernels.normals import normal_code, normal_of
from wall.reconstruction.kernels.relight import relight
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.scene.build import Scene, assemble
from wall.scene.model import DirectionalLight, Instance, Light, Material, Mesh, PointLight, Sky, Source
from wall.scene.sky import sky_irradiance

SEEN = view((0.0, 3.0, 5.0), (0.2, 0.8, 0.0), pixels=(48, 36))
LATER = 1.0  # seconds of the animation
OCTAHEDRAL = np.sqrt(18.0)  # radians a normal turns at most, per unit that both its components are off
TRACED = OCTAHEDRAL * 0.5 / 127
SENT = OCTAHEDRAL * 2.5 / 127  # two steps more on the wire
ROUNDING = 2e-4  # relative: float32, and the same point found by another ray
SKY = Sky(zenith=(0.3, 0.5, 0.9), horizon=(0.6, 0.6, 0.6), ground=(0.2, 0.1, 0.1))
DIRECTIONAL = DirectionalLight(direction=(0.48, 0.64, 0.6), irradiance=(2.0, 1.9, 1.7))
POINT = PointLight(position=(-2.0, 2.5, 2.0), intensity=(6.0, 6.0, 8.0))
FLOOR, BALL = 1, 2  # object ids
ALBEDOS = np.array([[0.0, 0.0, 0.0], [0.8, 0.7, 0.5], [0.3, 0.5, 0.9]])


def yard(
    *,
    ball: Material | None = None,
    scale: float | tuple[float, float, float] = 1.2,
    lights: tuple[Light, ...] = (DIRECTIONAL, POINT),
    moving: bool = True,
) -> Scene:
    """A floor and a turning ball of flat triangles, under a directional and a point light that travel.

    A small mirror that glows lies far below: the mirrored and the glowing ball need no kernels of their own.
    """
    floor = replace(instance(0, turn=("x", -90.0)), name="floor")
    turning = Instance(
        name="ball", mesh=1, world_from_object=instance(1, at=(0.4, 1.3, 0.0), scale=scale).world_from_object
    )
    tracks = (
        SpinConfig(type="spin", object="ball", axis=(0.2, 1.0, 0.1), period_s=9.0),
        OrbitConfig(type="orbit", light=0, center=(0.0, 0.0, 0.0), period_s=14.0),
        keyframes(POINT.position, (1.5, 2.0, 3.0), light=1),
    )
    below = instance(2, at=(0.0, -500.0, 0.0), turn=("x", 90.0), scale=0.1)
    meshes: tuple[Mesh, ...] = (
        quad(12.0, 12.0, material=0), sphere_mesh(1, segments=10, smooth=False), quad(1.0, 1.0, material=2)
    )  # fmt: skip
    bright = replace(material(*ALBEDOS[0], mirror=0.5), emission=(1e-9, 0.0, 0.0))
    return assemble(
        Source(
            meshes=meshes, materials=(material(*ALBEDOS[1]), ball or material(*ALBEDOS[2]), bright),
            instances=(floor, turning, below), lights=lights, sky=SKY,
            animation=tracks[: 1 + len(lights)] if moving else (),
        )
    )  # fmt: skip


EVERY_LIGHT = 2**32 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Stored:
    xy: Float32  # (n, 2) in the image
    depth: Float32
    object_id: NDArray[np.uint32]
    radiance: Float32  # (n, 3)
    hidden: NDArray[np.uint32]  # lights
    albedo: Float32  # (n, 3); (0, 3) if nothing is ever relit


def stored(shown: Reconstruction) -> Stored:
    """What an image holds and shows."""
    s, n = shown.buffer.store, shown.count
    kept = s.screen_position[2, :n] > 0
    return Stored(
        xy=s.screen_position[:2, :n].T[kept], depth=s.screen_position[2, :n][kept], object_id=s.object_id[:n][kept],
        radiance=s.radiance[:n, :3][kept],
        hidden=~s.light_visibility[:n][kept[: len(s.light_visibility)]],
        albedo=s.albedo[:, :n].T[kept[: s.albedo.shape[1]]],
    )  # fmt: skip


def later(scene: Scene, samples: Samples, event: Event) -> tuple[Reconstruction, Stored]:
    """The image at another time, made of samples that were traced at time 0."""
    shown = image_of(scene, SEEN)
    return shown, through_time(shown, samples, event)


def through_time(shown: Reconstruction, samples: Samples, event: Event) -> Stored:
    begin = event_at(0, SEEN)
    shown.insert(samples, START, begin)
    shown.refresh(begin, START)
    shown.refresh(event, START + 0.001)
    return stored(shown)


def twins(scene: Scene, relit: Stored, event: Event) -> tuple[Samples, NDArray[np.bool_]]:
    """Samples traced where stored ones are now, and which of them hit the same surface points."""
    fresh = traced(scene, event, relit.xy.astype(np.float32), SEEN)
    z = fresh["depth"] * cosines(fresh["xy"])
    return fresh, (fresh["object_id"] == relit.object_id) & (np.abs(z / relit.depth - 1.0) < 1e-4)


def cosines(xy: Float32) -> Float64:
    """Depth along the view, in eye distances, of a ray of length 1: the eye stands before the panel's middle."""
    w, h = SEEN.panel.pixels
    off = (np.float64(xy) - (w / 2, h / 2)) / h
    d = float(np.linalg.norm(SEEN.eye))
    return np.asarray(1.0 / np.sqrt(d * d + (off**2).sum(axis=1)), np.float64)


def steepness(scene: Scene, places: Float64, time: float) -> Float64:
    """(n, 3) float64: how much light changes at most per radian that the normal turns, surface colour 1."""
    table = np.float64(sky_irradiance(scene.sky))
    most = np.broadcast_to(np.abs(np.diff(table, axis=0)).max(axis=0) * 128, places.shape).copy()
    most += sum(np.array(s.irradiance) / np.pi for s in scene.directional_lights)
    for p, light in zip(scene.at(time).point_positions, scene.point_lights, strict=True):
        most += np.array(light.intensity) / np.pi / ((p - places) ** 2).sum(axis=1, keepdims=True)
    return np.asarray(most, np.float64)


def places_of(scene: Scene, samples: Samples, event: Event) -> Float64:
    """(n, 3) float64 hits in the world."""
    (w, h), d = SEEN.panel.pixels, float(np.linalg.norm(SEEN.eye))
    x, y = (np.float64(samples["xy"]) - (w / 2, h / 2)).T / h
    rays = np.stack([x, -y, np.full(len(x), -d)], axis=1) @ event.camera.rotation().T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return np.asarray(event.camera.origin() + rays * np.float64(samples["depth"])[:, None], np.float64)


def as_sent(samples: Samples) -> Samples:
    """With normals as packets bring them."""
    sent = samples.copy()
    sent["normal"] = [[normal_of(normal_code(c)) for c in pair] for pair in samples["normal"].tolist()]
    return sent


def comparable(scene: Scene, relit: Stored, event: Event) -> tuple[Samples, NDArray[np.bool_]]:
    """Samples traced where stored ones are now, and which of them hit the same points of objects, in full light."""
    fresh, same = twins(scene, relit, event)
    return fresh, same & (relit.hidden == 0) & (fresh["light_visibility"] == EVERY_LIGHT) & (relit.object_id > 0)


@pytest.mark.parametrize(("wire", "turn"), [(False, TRACED), (True, SENT)])
def test_surface_colours_are_known_as_well_as_normals_are(wire: bool, turn: float, compiled_only: None) -> None:
    """A normal off by `turn` changes light E by at most S turn: L / E' is off by at most albedo S turn / E'."""
    scene, event = yard(), event_at(0, SEEN)
    samples = traced(scene, event, seen=SEEN)
    _, held = later(scene, as_sent(samples) if wire else samples, event)

    fresh, same = twins(scene, held, event)
    known = same & (held.object_id > 0) & (held.albedo[:, 0] >= 0)
    albedo, found = ALBEDOS[held.object_id[known]], np.float64(held.albedo[known])
    light = np.float64(fresh["radiance"][known]) / found
    bound = albedo * turn * steepness(scene, places_of(scene, fresh[known], event), 0.0) / light
    assert known.sum() > 1000
    assert (held.hidden[known] > 0).sum() > 50
    assert (np.abs(found - albedo) <= bound + ROUNDING * albedo).all()
    assert (np.abs(found - albedo) > 0.1 * bound).any()


@pytest.mark.parametrize(("wire", "turn"), [(False, TRACED), (True, SENT)])
def test_samples_lit_for_another_time_are_those_traced_then(wire: bool, turn: float, compiled_only: None) -> None:
    """Beside what the colour is off, c: at most c E' + albedo S turn, with E' the light for the normal that is off."""
    scene, event = yard(), event_at(1, SEEN, scene_time=LATER)
    samples = traced(scene, event_at(0, SEEN), seen=SEEN)
    _, relit = later(scene, as_sent(samples) if wire else samples, event)

    fresh, good = comparable(scene, relit, event)
    albedo, found = ALBEDOS[relit.object_id[good]], np.float64(relit.albedo[good])
    radiance, truth = np.float64(relit.radiance[good]), np.float64(fresh["radiance"][good])
    bound = np.abs(found - albedo) * radiance / found
    bound += albedo * turn * steepness(scene, places_of(scene, fresh[good], event), LATER)
    assert (np.bincount(relit.object_id[good], minlength=3)[1:] > (500, 100)).all()
    assert (np.abs(radiance - truth) <= bound + ROUNDING * truth).all()


def test_relighting_is_much_nearer_the_truth_than_what_was_traced(compiled_only: None) -> None:
    scene, event = yard(), event_at(1, SEEN, scene_time=LATER)
    samples = traced(scene, event_at(0, SEEN), seen=SEEN)
    errors = []
    for relighting in (True, False):
        shown = Reconstruction(
            SEEN.panel, SEEN.eye, scene, detects_change=False, ingredients=Ingredients(relighting=relighting)
        )
        held = through_time(shown, samples, event)
        if relighting:
            fresh, good = comparable(scene, held, event)
            order = np.lexsort(held.xy.T)
            good, truth = good[order], np.float64(fresh["radiance"][order])
        radiance = np.float64(held.radiance[np.lexsort(held.xy.T)])
        errors.append(np.sqrt(((radiance - truth)[good] ** 2).mean()))
    assert errors[0] < 0.02 * errors[1]


def test_a_shadowed_sample_stays_without_its_light(compiled_only: None) -> None:
    """Only the point light moves, towards the floor's shadowed points; they keep the light of the others."""
    scene, event = yard(), event_at(1, SEEN, scene_time=LATER)
    samples = traced(scene, event_at(0, SEEN), seen=SEEN)
    _, relit = later(scene, samples, event)
    dark = (relit.hidden == 3) & (relit.object_id == FLOOR)
    ambient = ALBEDOS[FLOOR] * np.float64(sky_irradiance(SKY))[-1]
    assert dark.sum() > 1
    assert_allclose(relit.radiance[dark], np.broadcast_to(ambient, (int(dark.sum()), 3)), rtol=2 * TRACED)


@pytest.mark.parametrize(
    "case",
    [
        {"ball": material(0.3, 0.5, 0.9, mirror=0.5)},
        {"ball": replace(material(0.3, 0.5, 0.9), emission=(0.2, 0.1, 0.0))},
        {"scale": (1.2, 1.0, 1.2)},
    ],
    ids=["mirror", "glowing", "stretched"],
)
def test_what_the_model_does_not_hold_for_is_left_as_it_was_traced(case: dict[str, Any], compiled_only: None) -> None:
    scene, event = yard(**case), event_at(1, SEEN, scene_time=LATER)
    samples = traced(scene, event_at(0, SEEN), seen=SEEN)
    _, relit = later(scene, samples, event)
    for name, changes in ((0, False), (FLOOR, True), (BALL, False)):
        held, were = relit.radiance[relit.object_id == name], samples["radiance"][samples["object_id"] == name]
        nearest = np.abs(held[:, None] - were[None]).max(axis=2).min(axis=1)
        assert len(held) > 100
        left = (nearest < 1e-6).mean()  # to float32: radiance is about 1
        assert left < 0.5 if changes else left == 1.0  # the floor in the point light's shadow keeps its light


@pytest.mark.parametrize("count", [32, 33])
def test_more_than_thirty_two_lights_turn_it_off(count: int, compiled_only: None) -> None:
    lights = (DIRECTIONAL, POINT, *(replace(POINT, position=(k - 8.0, 6.0, 0.0)) for k in range(count - 2)))
    scene, event = yard(lights=lights), event_at(1, SEEN, scene_time=LATER)
    shown, relit = later(scene, traced(scene, event_at(0, SEEN), seen=SEEN), event)
    assert len(relit.albedo) == (len(relit.object_id) if count == 32 else 0)
    assert shown.poses.lit == (count == 32)


def test_a_scene_in_which_nothing_moves_stores_no_surfaces() -> None:
    shown = image_of(yard(moving=False), SEEN)
    assert shown.buffer.store.albedo.shape == (3, 0)
    assert shown.buffer.store.normal.shape == shown.buffer.store.light_visibility.shape == (0,)


@pytest.mark.parametrize(("radiance_of", "known"), [(0.9, False), (1.1, True)])
def test_light_below_the_darkest_says_nothing_about_a_colour(radiance_of: float, known: bool) -> None:
    """A point light straight above a point: its light is intensity / (pi distance^2)."""
    scene = assemble(
        Source(
            meshes=(quad(1.0, 1.0),), materials=(material(0.5, 0.5, 0.5),), instances=(instance(0),),
            lights=(PointLight(position=(0.0, 0.0, 2.0), intensity=(np.pi * 4 * 1e-4 * radiance_of,) * 3),),
            sky=Sky(zenith=(0, 0, 0), horizon=(0, 0, 0), ground=(0, 0, 0)),
        )
    )  # fmt: skip
    lights, store = ObjectLights.at(scene, scene.at(0.0)), SampleStore.of(1, lit=True)
    store.light_visibility[0] = EVERY_LIGHT
    sample = np.zeros(1, SAMPLE)
    sample["radiance"], sample["object_id"] = 1e-5, 1
    demodulated(sample, lights, Diffuse.of(scene), store)
    assert (store.albedo[0, 0] >= 0) == known
    if known:
        assert_allclose(store.albedo[:, 0], 1e-5 / (1e-4 * radiance_of), rtol=1e-5)


@kernel
def demodulated(sample, lights, diffuse, store):  # type: ignore[no-untyped-def]
    """Write the albedo of a point at the origin of object 1, facing +z."""
    kernels_lights.demodulate(sample[0], lights, diffuse, store, 0)


def test_grazing_light_never_makes_light_negative_or_infinite(compiled_only: None) -> None:
    """All int8 normals under a directional light in the plane: light is at least the sky's and at most the sum."""
    scene = yard()
    lights, sky = ObjectLights.at(scene, scene.at(0.0)), sky_irradiance(SKY)
    u, v = (k.ravel() for k in np.meshgrid(np.arange(-127, 128), np.arange(-127, 128)))
    n = len(u)
    store = SampleStore.of(n, lit=True)
    store.normal[:], store.light_visibility[:] = (u & 255) | ((v & 255) << 8), EVERY_LIGHT
    store.albedo[:], store.object_id[:] = 1.0, FLOOR
    relight(store, 0, n, np.ones(3, np.uint8), lights, sky)
    point = np.array(POINT.intensity) / np.pi / float((np.array(POINT.position) ** 2).sum())
    top = sky.max(axis=0) + np.array(DIRECTIONAL.irradiance) / np.pi + point
    assert (store.radiance[:, :3] >= sky.min(axis=0) * (1 - 1e-5)).all()
    assert (store.radiance[:, :3] <= top * (1 + 1e-5)).all()


def test_the_sky_and_mirrors_are_not_diffuse() -> None:
    scene = yard(ball=material(0.3, 0.5, 0.9, mirror=0.5))
    assert_array_equal(Diffuse.of(scene).objects, [0, 1, 0, 0])
