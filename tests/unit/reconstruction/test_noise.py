"""Noise: light is filtered over surfaces and no further, change is told from noise, images at rest converge."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from adaptive_images import centres
from small_scenes import View, view

from wall.core.data import Float32, Samples
from wall.core.kernels.albedo import FLOOR, WHITE, pack_albedo, unpack_albedo
from wall.deepbuffer.kernels.lights import unpack_normal
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels import edge_filter as filters
from wall.reconstruction.kernels import light_change as changes
from wall.reconstruction.kernels import light_field as fields
from wall.reconstruction.kernels.surfaces import rows_of_surfaces
from wall.reconstruction.lighting import Lighting
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.scene.build import Scene, assemble
from wall.scene.builtin.cornell import cornell
from wall.study.quality.metrics import display_values
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SIZE = 12  # pixels
TILES = (4, 4)
ROOM = view((2.78, 2.73, -8.0), (2.78, 2.73, 0.0), pixels=(32, 32), fov=39.3)


# --- albedo


def test_an_albedo_comes_back_within_half_a_code() -> None:
    shares = np.concatenate([np.linspace(0.0, 1.0, 4001), (np.arange(255) + 0.5) ** 2 / 255.0**2]).astype(np.float32)
    for share in shares:
        red, green, blue = unpack_albedo(pack_albedo(share, np.float32(1.0), np.float32(0.0)))
        assert abs(math.sqrt(red) - math.sqrt(max(share, FLOOR))) <= 0.5 / 255.0 + 1e-6
        assert (green, blue) == (1.0, pytest.approx(FLOOR, rel=0.02))
    assert unpack_albedo(WHITE) == (1.0, 1.0, 1.0)
    assert min(unpack_albedo(np.uint32(0))) > 0.0  # of packets whose sender is mistaken: nothing is divided by 0


# --- the filter


def lighting(light: Float32, *, variance: float, count: float = 1.0) -> Lighting:
    """Of pixels of object 1 in the plane z = 0, a unit apart, their light (SIZE, SIZE) grey."""
    made = Lighting(SIZE, SIZE, np.zeros(3, np.uint8))
    pixels = made.field.pixels
    pixels[fields.OBJECT], pixels[fields.NORMAL_Z], pixels[fields.VARIANCE] = 1.0, 1.0, variance
    pixels[fields.POSITION_Y], pixels[fields.POSITION_X] = np.mgrid[:SIZE, :SIZE]
    made.field.light[:3], made.field.light[fields.L_COUNT] = light, count
    return made


def filtered(made: Lighting) -> Float32:
    filters.filter_light(made._padded)
    return np.array(made.field.filtered[fields.L_RED])


def test_noise_goes_where_light_is_the_same(compiled_only: None, random_numbers: np.random.Generator) -> None:
    noisy = 1.0 + random_numbers.normal(0.0, 0.5, (SIZE, SIZE)).astype(np.float32)
    shown = filtered(lighting(noisy, variance=0.25))
    assert shown.std() < 0.25 * noisy.std()
    assert shown.mean() == pytest.approx(noisy.mean(), abs=0.02)


@pytest.mark.parametrize("apart", ["object", "normal", "plane"])
def test_light_does_not_cross_the_edge_of_a_surface(apart: str) -> None:
    light = np.ones((SIZE, SIZE), np.float32)
    light[:, SIZE // 2 :] = 3.0
    made = lighting(light, variance=100.0)  # so much noise that luminance stops nothing
    beyond = np.s_[:, SIZE // 2 :]
    if apart == "object":
        made.field.pixels[fields.OBJECT][beyond] = 2.0
    elif apart == "normal":
        made.field.pixels[fields.NORMAL_Z][beyond], made.field.pixels[fields.NORMAL_X][beyond] = 0.0, 1.0
    else:
        made.field.pixels[fields.POSITION_Z][beyond] = 50.0
    assert np.abs(filtered(made) - light).max() < (3e-6 if apart != "plane" else 0.1)


def test_the_filter_closes_as_light_becomes_known(compiled_only: None) -> None:
    """An edge of light on one surface: blurred where a sample is hardly known, left alone after many."""
    light = np.ones((SIZE, SIZE), np.float32)
    light[:, SIZE // 2 :] = 2.0
    errors = [np.abs(filtered(lighting(light, variance=1.0, count=n)) - light).max() for n in (1.0, 100.0, 10_000.0)]
    assert errors[0] > 0.2
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 0.002


def test_pixels_without_samples_take_the_light_of_their_surface(compiled_only: None) -> None:
    made = lighting(np.full((SIZE, SIZE), 2.0, np.float32), variance=1.0)
    made.field.light[:, 4:8, 4:8] = 0.0
    assert np.allclose(filtered(made), 2.0, rtol=1e-5)


def test_variance_is_that_of_samples_inside_pixels(random_numbers: np.random.Generator) -> None:
    """Edges between pixels are no noise: 3 samples in each of variance 0.09, around means from 0 to 15."""
    made = lighting(np.repeat(np.arange(SIZE, dtype=np.float32)[:, None], SIZE, 1), variance=0.0)
    samples = random_numbers.normal(0.0, 0.3, (SIZE, SIZE, 3))
    made.field.spread[fields.DEVIATION_SUM] = samples.var(axis=2) * 3.0
    made.field.spread[fields.FREEDOM] = 2.0
    filters.pool_variance(made._padded)
    assert made.field.pixels[fields.VARIANCE].mean() == pytest.approx(0.09, rel=0.1)


# --- change


def probed(random: np.random.Generator, *, change: float, noise: float, probes: int) -> Float32:
    """(*TILES, 4) what is made of so many probes a tile, of light that was 1 and is 1 + change."""
    sums = np.zeros((*TILES, changes.COLUMNS), np.float32)
    differences = change + noise * random.normal(size=(*TILES, probes))
    sums[..., changes.DIFFERENCE : changes.DIFFERENCE + 3] = differences.sum(axis=2)[..., None]
    sums[..., changes.FILTERED : changes.FILTERED + 3] = sums[..., changes.PROBES] = probes
    sums[..., changes.FILTERED : changes.FILTERED + 3] = probes
    sums[..., changes.PROBE_VARIANCE] = probes * noise**2
    sums[..., changes.FILTER_VARIANCE] = probes * noise**2 / 50.0
    found = np.ones((*TILES, 4), np.float32)
    changes.find_changes(sums, found)
    return found


def test_noise_alone_changes_little(random_numbers: np.random.Generator) -> None:
    """Beyond twice the squared standard error lie 16 % of means; what is then corrected is small on average."""
    found = np.concatenate([probed(random_numbers, change=0.0, noise=1.0, probes=16) for _ in range(50)])
    assert (found[..., 0] != 1.0).mean() < 0.25
    assert abs(found[..., 0].mean() - 1.0) < 0.01


def test_change_is_found_in_noise_that_is_larger(random_numbers: np.random.Generator) -> None:
    found = np.concatenate([probed(random_numbers, change=0.5, noise=1.0, probes=16) for _ in range(20)])
    assert found[..., 0].mean() == pytest.approx(1.4, abs=0.1)  # drawn towards 1 by its own uncertainty
    assert found[..., 3].mean() < 0.8  # older samples are doubted too


@pytest.mark.parametrize("change", [-0.99, 30.0])
def test_one_correction_is_bounded(random_numbers: np.random.Generator, change: float) -> None:
    found = probed(random_numbers, change=change, noise=0.01, probes=16)[..., :3]
    assert np.allclose(found, changes.LEAST if change < 0.0 else changes.MOST)


def test_what_an_animated_object_finds_changes_neither_the_sky_nor_what_stands(
    random_numbers: np.random.Generator,
) -> None:
    """A wheel before the sky and a body, all in every tile: samples of the wheel find twice the light shown."""
    made = Lighting(8 * TILES[0], 8 * TILES[1], np.array([0, 0, 1], np.uint8))
    made.field.pixels[fields.OBJECT], made.field.pixels[fields.VARIANCE] = 2.0, 0.1
    made.field.filtered[:] = 1.0
    n = 3 * 64
    store = SampleStore.of(2 * n, lit=False, noisy=True)
    store.object_id[:], store.confidence[:], store.light[:n], store.light[n:] = np.arange(2 * n) % 3, 1.0, 1.0, 2.0
    store.screen_position[:2] = random_numbers.uniform(0.0, 32.0, (2, 2 * n))
    store.screen_position[2], store.position[:2], store.position[2] = 1.0, store.screen_position[:2], 1.0
    made._table[:, [0, 5, 10]] = 1.0  # panel_from_object: x and y over z are pixels
    made.probe(store, n, 2 * n)
    made.correct(store, n, np.float32(1.0))
    for object_id, shown in ((0, 1.0), (1, 1.0), (2, 2.0)):
        assert store.light[:n][store.object_id[:n] == object_id].mean() == pytest.approx(shown, rel=0.05), object_id
        assert (store.confidence[:n][store.object_id[:n] == object_id] == 1.0).all() == (object_id < 2)


# --- the image


def rays(scene: Scene, seen: View, sweeps: int, *, first: int = 0) -> list[Samples]:
    """Samples of every pixel, so many times, each with other random numbers."""
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    return [tracer.trace(centres(seen.panel.pixels), number=first + k)[0].copy() for k in range(sweeps)]


def mean_of(batches: list[Samples]) -> Float32:
    """(h, w, 3) of samples that all lie in the same order; pixels that were missed count as black."""
    total = np.zeros((32, 32, 3))
    for samples in batches:
        x, y = samples["xy"].astype(int).T
        total[y, x] += samples["radiance"]
    return np.asarray(total / len(batches), np.float32)


@cache
def converged() -> tuple[Scene, Float32]:
    """The Cornell box, and its image of 1,024 samples a pixel."""
    scene = assemble(cornell())
    return scene, mean_of(rays(scene, ROOM, 1024, first=1 << 20))


@pytest.fixture
def room(compiled_only: None) -> tuple[Scene, Float32]:
    return converged()


@pytest.mark.parametrize(("refresh_s", "parts", "sweeps"), [(0.2, 1, 256), (1 / 240, 4, 64)])
def test_at_rest_no_image_is_worse_than_the_mean_of_its_samples(
    room: tuple[Scene, Float32], refresh_s: float, parts: int, sweeps: int
) -> None:
    """Samples come at once, or a quarter a refresh, while the schedule lets light be filtered ten times a second."""
    scene, truth = room
    shown = Reconstruction(ROOM.panel, ROOM.eye, scene, detects_change=False)
    batches, now = rays(scene, ROOM, sweeps), 100.0
    for k, samples in enumerate(batches, start=1):
        for part in range(parts):
            now += refresh_s
            shown.insert(samples[part::parts], now, ROOM.event)
            shown.refresh(ROOM.event, now)
        if k in (1, 2, 3, 4, 6, 8, 16, 32, 64, 128, 256):
            mean = mean_of(batches[:k])
            for values in (np.asarray, display_values):
                own, other = (np.sqrt(((values(x) - values(truth)) ** 2).mean()) for x in (shown.radiance, mean))
                assert own <= 1.02 * other, f"after {k} samples a pixel: {own} against {other}"
                assert k > 4 or parts > 1 or own < 0.7 * other
    assert shown.radiance.mean() == pytest.approx(mean.mean(), rel=0.004)


def test_textures_are_not_blurred(room: tuple[Scene, Float32]) -> None:
    """Stripes of albedo, a pixel wide, in noisy light: the image keeps their contrast."""
    scene, _ = room
    batch = rays(scene, ROOM, 1)[0]
    wall = batch["object_id"] == 3  # the back wall
    stripe = wall & (batch["xy"][:, 0].astype(int) % 2 == 0)
    for samples, share in ((stripe, 1.0), (wall & ~stripe, 0.25)):
        code = pack_albedo(*np.float32([share] * 3))
        light = np.random.default_rng(4).exponential(0.5, samples.sum())
        batch["albedo"][samples], batch["radiance"][samples] = code, (unpack_albedo(code)[0] * light)[:, None]
    shown = Reconstruction(ROOM.panel, ROOM.eye, scene, detects_change=False)
    shown.insert(batch, 100.0, ROOM.event)
    shown.refresh(ROOM.event, 100.0)
    x, y = batch["xy"].astype(int).T
    bright, dark = (shown.radiance[y[m], x[m], 0].mean() for m in (stripe, wall & ~stripe))
    assert bright / dark == pytest.approx(4.0, rel=0.15)


def test_light_that_changes_is_followed(room: tuple[Scene, Float32]) -> None:
    """All light falls to a third while a quarter of a sample a pixel comes each refresh."""
    scene, truth = room
    errors = {}
    for corrects in (True, False):
        shown = Reconstruction(
            ROOM.panel, ROOM.eye, scene, detects_change=False, ingredients=Ingredients(change_test=corrects)
        )
        now, squares = 100.0, []
        for k, samples in enumerate(rays(scene, ROOM, 40)):
            event, now = replace(ROOM.event, scene_event=k, scene_time=0.03 * k), now + 0.03
            part = samples[k % 4 :: 4].copy()
            light = 1.0 if k < 20 else 1.0 / 3.0
            part["radiance"] *= light
            shown.insert(part, now, event)
            shown.refresh(event, now)
            if k >= 24:
                squares.append(((shown.radiance - light * truth) ** 2).mean())
        errors[corrects] = math.sqrt(np.mean(squares))
    assert errors[True] < 0.6 * errors[False]


# --- albedos and normals for a denoiser


def test_normals_turn_with_their_objects(random_numbers: np.random.Generator) -> None:
    """Against the transpose of a matrix that scales each axis otherwise; the sky has none."""
    store, n = SampleStore.of(40, lit=False, noisy=True), 40
    store.object_id[:] = random_numbers.integers(0, 3, n)
    store.normal[:], store.albedo[:] = random_numbers.integers(0, 1 << 16, n), random_numbers.random((3, n))
    table = random_numbers.normal(size=(3, 12)).astype(np.float32)
    weight = random_numbers.choice(np.float32([0.0, 0.5]), n)
    albedo, normal = np.full((2, n, 4), 7.0, np.float32)
    rows_of_surfaces(store, weight, n, table, albedo, normal)
    for k in range(n):
        own = np.array(unpack_normal(store.normal[k])) @ table[store.object_id[k]].reshape(3, 4)[:, :3]
        wanted = own / np.linalg.norm(own) if store.object_id[k] > 0 else np.zeros(3)
        seen = bool(weight[k] > 0.0)
        np.testing.assert_allclose(normal[k, :3], wanted if seen else 7.0, atol=1e-5)
        np.testing.assert_array_equal(albedo[k, :3], store.albedo[:, k] if seen else 7.0)


def test_images_of_albedos_and_normals_are_means_of_samples(room: tuple[Scene, Float32]) -> None:
    """Where pixels show one surface; the image that a denoiser takes is then the mean of each pixel's own samples."""
    scene, _ = room
    plain, described = (Reconstruction(ROOM.panel, ROOM.eye, scene, detects_change=False) for _ in range(2))
    described.describe_surfaces()
    assert plain.bytes < described.bytes
    for image in (plain, described, plain, described):
        image.refresh(ROOM.event, 99.0)  # at rest
    batches, now = rays(scene, ROOM, 5), 100.0
    for samples in batches:
        now += 0.2
        for image in (plain, described):
            image.insert(samples, now, ROOM.event)
            image.refresh(ROOM.event, now)
    assert plain.surfaces is None
    assert described.surfaces is not None
    albedo, normal = np.zeros((2, 32, 32, 3), np.float32)
    described.surfaces.write(albedo, normal)
    x, y = batches[0]["xy"].astype(int).T
    codes = np.zeros((32, 32), np.uint32)
    codes[y, x] = batches[0]["albedo"]
    np.testing.assert_allclose(albedo, [[unpack_albedo(code) for code in row] for row in codes], atol=1e-5)
    back, floor = albedo[10, 10], albedo[29, 16]
    np.testing.assert_allclose(normal[10, 10], (0.0, 0.0, -1.0), atol=0.01)
    np.testing.assert_allclose(normal[29, 16], (0.0, 1.0, 0.0), atol=0.01)
    assert back == pytest.approx(floor)  # both are white
    np.testing.assert_allclose(described.radiance, mean_of(batches), atol=1e-4)
    assert np.abs(plain.radiance - mean_of(batches)).max() > 0.01  # filtered
