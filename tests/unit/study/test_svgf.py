"""SVGF and plain accumulation: what they make of noise at rest, of edges, of textures and of what moves."""

from __future__ import annotations

import numpy as np
import pytest

from wall.config.loading import load
from wall.core.data import SAMPLE, Float32
from wall.core.kernels.albedo import pack_albedo
from wall.roles.plan import make_layout, make_plan
from wall.study.quality import methods_progressive, methods_svgf
from wall.study.quality.kernels import svgf as kernels
from wall.study.quality.kernels import warp as kernels_warp
from wall.study.quality.method import Method, Setup
from wall.tracing.tracer_scene import make_tracer_scene

SIZE = 24
REFRESH_HZ = 60.0
ROUNDING = 1e-5  # a few float32 operations on values near 1
SPACING = np.ones(2, np.float32)
UNLIMITED = np.float32(1e9)


def plane(columns: int = SIZE, objects: Float32 | None = None) -> kernels.Surfaces:
    """A wall at depth 1 that faces the eye, a unit a pixel; of object 1, or `objects` by column."""
    y, x = np.mgrid[:SIZE, :columns].astype(np.float32)
    ids = np.ones_like(x) if objects is None else np.broadcast_to(objects, x.shape)
    position = np.stack([x + 0.5, y + 0.5, np.ones_like(x), ids], axis=-1).astype(np.float32)
    normal = np.zeros((SIZE, columns, 3), np.float32)
    normal[:, :, 2] = 1.0
    return kernels.Surfaces(position, np.ones((SIZE, columns), np.float32), normal)


def sideways(pixels: float) -> Float32:
    """(3, 12) panel_from_object of objects 1 and 2: a point (x, y, 1) lies at pixel (x + pixels, y)."""
    table = np.zeros((3, 12), np.float32)
    table[1:] = [0, 0, 1, 0, 1, 0, pixels, 0, 0, 1, 0, 0]
    return table


def frame(surfaces: kernels.Surfaces) -> np.ndarray:
    raster = np.zeros(surfaces.depth.shape, SAMPLE)
    raster["xy"] = surfaces.position[:, :, :2]
    return raster


def history_of(light: Float32, frames: float = 8.0) -> Float32:
    history = np.zeros((*light.shape[:2], kernels.PLANES), np.float32)
    history[:, :, :3] = light
    history[:, :, kernels.FRAMES] = frames
    return history


def followed(now: kernels.Surfaces, before: kernels.Surfaces, history: Float32, pixels: float) -> Float32:
    out = np.zeros_like(history)
    kernels.follow(frame(now), now, before, history, sideways(pixels), SPACING, out)
    return out


def levels(surfaces: kernels.Surfaces, integrated: Float32) -> Float32:
    """(h, w, 3): all levels of the filter, as the display runs them."""
    shape = surfaces.depth.shape
    light, out = np.ascontiguousarray(integrated[:, :, :3]), np.zeros((*shape, 3), np.float32)
    variance, other = np.zeros((2, *shape), np.float32)
    kernels.estimate_variance(surfaces, integrated, variance)
    for level in range(5):
        kernels.filter_level(surfaces, light, variance, 1 << level, methods_svgf.SIGMA, out, other)
        light, out, variance, other = out, light, other, variance
    return light


def integrated_of(light: Float32) -> Float32:
    fresh = np.zeros((*light.shape[:2], kernels.PLANES), np.float32)
    kernels.integrate(light, fresh, UNLIMITED)
    return fresh


def noise(columns: int, rng: np.random.Generator) -> Float32:
    """Grey light of mean 1 as single paths have it: each with equal chance dark or twice as bright."""
    return np.repeat(rng.integers(0, 2, (SIZE, columns, 1)) * np.float32(2.0), 3, axis=2)


def test_light_times_albedo_is_the_radiance_again(random_numbers: np.random.Generator) -> None:
    raster = np.zeros((2, 3), SAMPLE)
    raster["radiance"] = random_numbers.random((2, 3, 3))
    for k, share in enumerate((0.1, 0.3, 0.5, 0.7, 0.9, 1.0)):
        code = pack_albedo(np.float32(share), np.float32(0.5), np.float32(0.2))
        raster["albedo"][k // 3, k % 3] = code
    light, normal = np.zeros((2, 2, 3, 3), np.float32)
    again = raster.copy()
    kernels.demodulate(raster, normal, light)
    kernels.remodulate(light, again)
    np.testing.assert_allclose(again["radiance"], raster["radiance"], rtol=ROUNDING)


def test_history_is_the_mean_of_its_frames_until_its_limit() -> None:
    h = np.zeros((1, 1, kernels.PLANES), np.float32)
    for value in (1.0, 2.0, 6.0):
        kernels.integrate(np.full((1, 1, 3), value, np.float32), h, UNLIMITED)
    np.testing.assert_allclose(h[0, 0, [0, 3, 4, 5]], (3.0, 3.0, 41.0 / 3.0, 3.0), rtol=ROUNDING)
    kernels.integrate(np.full((1, 1, 3), 8.0, np.float32), h, np.float32(1.0 / 0.2 - 1.0))
    assert h[0, 0, 0] == pytest.approx(3.0 + 5.0 / 4.0)
    for _ in range(9):
        kernels.integrate(np.full((1, 1, 3), 8.0, np.float32), h, np.float32(1.0 / 0.2 - 1.0))
    assert h[0, 0, 5] == pytest.approx(5.0)  # alpha 0.2


@pytest.mark.usefixtures("compiled_only")
def test_most_noise_of_one_frame_on_a_flat_wall_is_removed(random_numbers: np.random.Generator) -> None:
    light = noise(SIZE, random_numbers)
    shown = levels(plane(), integrated_of(light))
    assert shown.std() < 0.2 * light.std()
    assert shown.mean() == pytest.approx(light.mean(), abs=0.1)


@pytest.mark.usefixtures("compiled_only")
def test_light_does_not_cross_the_edge_of_an_object(random_numbers: np.random.Generator) -> None:
    objects = np.where(np.arange(SIZE) < SIZE // 2, 1.0, 2.0).astype(np.float32)
    light = noise(SIZE, random_numbers) * np.where(objects == 1.0, 1.0, 0.0)[None, :, None].astype(np.float32)
    shown = levels(plane(objects=objects), integrated_of(light))
    assert (shown[:, objects == 2.0] == 0.0).all()
    assert shown[:, objects == 1.0].mean() == pytest.approx(light[:, objects == 1.0].mean(), abs=0.1)


def test_an_edge_of_light_that_is_known_well_stays() -> None:
    light = np.zeros((SIZE, SIZE, 3), np.float32)
    light[:, SIZE // 2 :] = 1.0
    known = np.zeros((SIZE, SIZE, kernels.PLANES), np.float32)
    for _ in range(4):  # the variance in time is 0
        kernels.integrate(light, known, UNLIMITED)
    np.testing.assert_allclose(levels(plane(), known), light, atol=ROUNDING)


@pytest.mark.parametrize("pixels", [0.0, 2.0, 2.5])
def test_history_follows_what_moves(pixels: float) -> None:
    ramp = np.repeat(np.arange(SIZE, dtype=np.float32)[None, :, None], SIZE, axis=0).repeat(3, axis=2)
    found = followed(plane(), plane(), history_of(ramp), -pixels)
    inner = slice(4, SIZE - 4)
    np.testing.assert_allclose(found[inner, inner, 0], ramp[inner, inner, 0] - pixels, rtol=ROUNDING)
    np.testing.assert_allclose(found[inner, inner, 5], 8.0, rtol=ROUNDING)


@pytest.mark.parametrize("change", ["object", "depth", "normal"])
def test_what_was_uncovered_has_no_history(change: str) -> None:
    now, before = plane(), plane()
    if change == "object":
        before.position[:, :, 3] = 2.0
    elif change == "depth":
        before.depth[:] = 1.2
    else:
        before.normal[:] = (1.0, 0.0, 0.0)
    assert not followed(now, before, history_of(np.ones((SIZE, SIZE, 3), np.float32)), 0.0).any()


@pytest.mark.usefixtures("compiled_only")
def test_history_is_given_up_where_light_changed_and_kept_where_it_is_noise(
    random_numbers: np.random.Generator,
) -> None:
    light = noise(2 * SIZE, random_numbers)
    light[:, SIZE:] *= 4.0
    surfaces = plane(2 * SIZE)
    history = history_of(np.ones((SIZE, 2 * SIZE, 3), np.float32), frames=19.0)
    room = np.zeros((2, SIZE, 2 * SIZE, 4), np.float32)
    kernels.judge_history(surfaces, light, history, np.array((6.0, 10.0), np.float32), *room)
    assert np.median(history[:, :8, 5]) == 19.0
    assert np.median(history[:, -8:, 5]) < 2.0


def test_a_hole_shows_what_is_behind_and_not_the_rim_beside_it() -> None:
    image = np.ones((25, 16, 4), np.float32)
    depth = np.full((25, 16), 10.0, np.float32)
    image[:, :5, :3], depth[:, :5] = 0.0, 1.0  # near and black, then the hole, a grey rim, and white behind
    image[:, 5:8] = 0.0
    image[:, 8:10, :3] = 0.5
    kernels_warp.fill_from_behind(image, depth)
    assert (image[:, :5, :3] == 0.0).all()
    np.testing.assert_allclose(image[12, 5:, :3], 1.0, atol=ROUNDING)  # far from the borders, where directions are lone


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """A Cornell box in which nothing moves, 24 x 24 pixels, 52 frames a second."""
    config = tmp_path_factory.mktemp("svgf") / "scene.yaml"
    config.write_text(
        f"""version: 1
scene: {{source: cornell}}
wall:
  grid: {{columns: 1, rows: 1, pixels: [{SIZE}, {SIZE}], size: [0.3, 0.3]}}
views:
  - camera: {{position: [2.78, 2.73, -8], target: [2.78, 2.73, 0], fov: 39.3}}
sampling: {{method: frameless}}
graph: {{preset: sort-first, sinks: [png]}}
""",
        encoding="utf-8",
    )
    plan = make_plan(make_layout(load(config)))
    return Setup(plan=plan, tracer_scene=make_tracer_scene(plan.scene), rate=30_000.0, refresh_hz=REFRESH_HZ, seed=1)


def run(method: Method, seconds: float) -> Float32:
    for refresh in range(1, round(seconds * REFRESH_HZ) + 1):
        method.advance(refresh / REFRESH_HZ)
        shown = method.show(refresh / REFRESH_HZ)
    return np.minimum(shown, 1.0)


@pytest.fixture(scope="module")
def many(setup: Setup) -> Float32:
    """The mean of 2000 samples a pixel."""
    return run(methods_progressive.accumulating(setup), 40.0)


@pytest.mark.usefixtures("compiled_only")
def test_at_rest_images_approach_the_plain_mean(setup: Setup, many: Float32) -> None:
    for make in (methods_progressive.accumulating, methods_svgf.METHODS["svgf"], methods_svgf.METHODS["svgf_half"]):
        method = make(setup)
        early = np.sqrt(np.mean((run(method, 0.1) - many) ** 2))
        method.advance(8.0)
        late = np.sqrt(np.mean((np.minimum(method.show(8.0), 1.0) - many) ** 2))
        assert late < 0.5 * early
        assert late < 0.05


@pytest.mark.usefixtures("compiled_only")
def test_after_one_frame_it_shows_less_noise_than_plain_means(setup: Setup, many: Float32) -> None:
    plain, shown = (
        np.minimum(make(setup).show(0.0), 1.0)
        for make in (methods_progressive.accumulating, methods_svgf.METHODS["svgf"])
    )
    assert np.mean((shown - many) ** 2) < 0.5 * np.mean((plain - many) ** 2)
