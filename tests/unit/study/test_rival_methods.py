"""Every baseline through the interface of methods: what it spends, what it counts, what it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Camera, Float32, Float64
from wall.deepbuffer.kernels.reproject import pixel_of, position_of
from wall.geometry.frusta import project
from wall.roles.plan import make_layout, make_plan
from wall.study.quality import (
    methods_afr,
    methods_reduced,
    methods_render_cache,
    methods_shading_cache,
    methods_taa,
    methods_tapestry,
)
from wall.study.quality.baseline import FramedMethod, FramelessMethod, world_maps
from wall.study.quality.method import INPUT_STEP_S, Inputs, Method, Setup
from wall.tracing.tracer_scene import make_tracer_scene

FRAMED = {**methods_taa.METHODS, **methods_reduced.METHODS}
MESHES = {**methods_tapestry.METHODS, **methods_shading_cache.METHODS}
FRAMELESS = {**methods_render_cache.METHODS, **methods_afr.METHODS, **MESHES}
CROSSHAIR = 6  # rays that are chosen together
REFRESH_HZ = 60.0
WIDTH, HEIGHT = 48, 32
CAMERA_ORBITS = ("", "    path: {type: orbit, period_s: 6}\n")
THE_FLOOR_TURNS = ("  animation: [{type: spin, object: floor, period_s: 4}]\n", "")
NOTHING_MOVES = ("", "")

MakeSetup = Callable[..., Setup]


@lru_cache
def setup_of(folder: Path, moves: tuple[str, str]) -> Setup:
    animation, path = moves
    config = folder / "scene.yaml"
    config.write_text(
        f"""version: 1
scene:
  source: gallery
{animation}wall:
  grid: {{columns: 1, rows: 1, pixels: [{WIDTH}, {HEIGHT}], size: [0.3, 0.2]}}
views:
  - camera: {{position: [2.6, 3, 7.1], target: [0, 0.6, -0.3], fov: 42}}
{path}sampling: {{method: frameless}}
graph: {{preset: sort-first, sinks: [png]}}
""",
        encoding="utf-8",
    )
    plan = make_plan(make_layout(load(config)))
    return Setup(plan=plan, tracer_scene=make_tracer_scene(plan.scene), rate=20_000.0, refresh_hz=REFRESH_HZ, seed=1)


@pytest.fixture(scope="session")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    kinds = (CAMERA_ORBITS, THE_FLOOR_TURNS, NOTHING_MOVES)
    return {moves: tmp_path_factory.mktemp("baselines") for moves in kinds}


@pytest.fixture
def setup(folders: dict[tuple[str, str], Path]) -> MakeSetup:
    return lambda moves, rate=20_000.0: replace(setup_of(folders[moves], moves), rate=rate)


def run(method: Method, seconds: float) -> Float32:
    """Every refresh up to `seconds`, then what is shown."""
    shown = method.show(0.0)
    for refresh in range(1, round(seconds * REFRESH_HZ) + 1):
        method.advance(refresh / REFRESH_HZ)
        shown = method.show(refresh / REFRESH_HZ)
    return shown.copy()


def error(setup: Setup, shown: Float32, at: float) -> float:
    """RMSE of linear radiance, clipped at 1, against 64 samples a pixel."""
    reference = render(setup.plan, spp=64, seed=7, at=at)
    assert reference is not None
    return float(np.sqrt(np.mean((np.minimum(shown, 1.0) - np.minimum(reference, 1.0)) ** 2)))


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", FRAMED)
def test_a_framed_method_under_a_moving_camera_has_spent_exactly_its_rays(name: str, setup: MakeSetup) -> None:
    given = setup(CAMERA_ORBITS)
    method = FRAMED[name](given)
    run(method, 0.25)
    idle = 0 if "taa" in name else given.rate * INPUT_STEP_S + 1  # until the first new input
    assert 5000 - idle <= method.rays <= 5000
    assert method.secondary > 0
    assert method.bytes > 0


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", FRAMELESS)
def test_a_frameless_method_owes_less_than_a_crosshair_of_its_rays(name: str, setup: MakeSetup) -> None:
    method = FRAMELESS[name](setup(CAMERA_ORBITS))
    for refresh in range(1, 16):
        method.advance(refresh / REFRESH_HZ)
        method.show(refresh / REFRESH_HZ)
        spent = int(20_000.0 * refresh / REFRESH_HZ + 1e-6)
        assert spent - CROSSHAIR < method.rays <= spent
    assert method.bytes > 0


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", FRAMED | FRAMELESS)
def test_equal_setups_show_equal_images_of_finite_light(name: str, setup: MakeSetup) -> None:
    given = setup(CAMERA_ORBITS)
    first, second = (run((FRAMED | FRAMELESS)[name](given), 0.1) for _ in range(2))
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.float32
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, second)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["taa_half", "reduced_64", "render_cache", "afr2005", "tapestry", "shading_cache"])
def test_a_method_told_how_many_rays_to_spend_spends_those(name: str, setup: MakeSetup) -> None:
    method = (FRAMED | FRAMELESS)[name](setup(CAMERA_ORBITS))
    method.advance(0.1, rays=700)
    assert 700 - 10 <= method.rays <= 700  # reduced_64 waits 0.5 ms for its first new input, that is 4 rays


@pytest.mark.usefixtures("compiled_only")
def test_a_frame_is_shown_from_its_last_ray_on(setup: MakeSetup) -> None:
    given = setup(CAMERA_ORBITS, rate=WIDTH * HEIGHT / 0.1)  # a frame takes 0.1 s, begun at the first new input
    display = methods_reduced.EnlargingDisplay(given.size, given.size)
    method = FramedMethod(given, given.size, display)
    free = method.show(0.0).copy()
    method.advance(0.1)
    np.testing.assert_array_equal(method.show(0.1), free)
    method.advance(0.1 + INPUT_STEP_S)
    assert not np.array_equal(method.show(0.1 + INPUT_STEP_S), free)


@pytest.mark.usefixtures("compiled_only")
def test_a_plain_frame_of_a_still_scene_costs_no_more_rays(setup: MakeSetup) -> None:
    method = FRAMED["framed_warp"](setup(NOTHING_MOVES))
    run(method, 0.25)
    assert method.rays == 0


@pytest.mark.usefixtures("compiled_only")
def test_temporal_antialiasing_of_a_still_scene_converges(setup: MakeSetup) -> None:
    given = setup(NOTHING_MOVES, rate=WIDTH * HEIGHT * REFRESH_HZ)
    method = FRAMED["taa_full"](given)
    one, many = error(given, method.show(0.0), 0.0), error(given, run(method, 0.6), 0.0)
    assert many < one / 2.5  # of a first frame that is filtered already


@pytest.mark.usefixtures("compiled_only")
def test_half_resolution_frames_of_a_still_scene_grow_sharper_than_one_full_frame(setup: MakeSetup) -> None:
    given = setup(NOTHING_MOVES, rate=WIDTH * HEIGHT * REFRESH_HZ / 4)
    one = error(given, FRAMED["framed_warp"](given).show(0.0), 0.0)
    assert error(given, run(FRAMED["taa_half"](given), 0.6), 0.0) < one


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("moves", [CAMERA_ORBITS, THE_FLOOR_TURNS], ids=["camera", "object"])
def test_the_warp_takes_away_most_of_a_frames_lateness(moves: tuple[str, str], setup: MakeSetup) -> None:
    given = setup(moves, rate=1.0)  # no frame is ever complete: only the free one, 0.1 s old
    late = methods_reduced.reduced(methods_reduced.FULL_ROWS, given)
    warped = FRAMED["framed_warp"](given)
    late.advance(0.1)
    warped.advance(0.1)
    assert error(given, warped.show(0.1), 0.1) < 0.75 * error(given, late.show(0.1), 0.1)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["render_cache", "afr2005", "tapestry"])
def test_points_of_objects_follow_them_and_points_of_the_world_do_not(name: str, setup: MakeSetup) -> None:
    given, errors = setup(THE_FLOOR_TURNS), {}
    for space in (name, f"{name}_object"):
        method = FRAMELESS[space](given)
        method.advance(0.1, rays=0)  # only the free image's samples, 0.1 s old
        errors[space] = error(given, method.show(0.1), 0.1)
    assert errors[f"{name}_object"] < 0.9 * errors[name]  # the filters blur either; 0.84 and 0.86


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["render_cache_object", "afr2005_object"])
def test_where_only_the_camera_moves_points_of_objects_gain_nothing(name: str, setup: MakeSetup) -> None:
    given = setup(CAMERA_ORBITS)
    near = run(FRAMELESS[name.removesuffix("_object")](given), 0.2)
    ours = run(FRAMELESS[name](given), 0.2)
    assert abs(error(given, near, 0.2) - error(given, ours, 0.2)) < 0.1 * error(given, ours, 0.2)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["tapestry", "shading_cache_untextured"])
def test_a_mesh_of_a_still_scene_converges(name: str, setup: MakeSetup) -> None:
    given = setup(NOTHING_MOVES, rate=WIDTH * HEIGHT * REFRESH_HZ)
    method = MESHES[name](given)
    one, many = error(given, method.show(0.0), 0.0), error(given, run(method, 0.2), 0.0)
    assert many < 0.7 * one


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["tapestry_object", "shading_cache"])
@pytest.mark.parametrize("moves", [CAMERA_ORBITS, THE_FLOOR_TURNS], ids=["camera", "object"])
def test_a_mesh_is_seen_from_where_the_camera_is_now(name: str, moves: tuple[str, str], setup: MakeSetup) -> None:
    given = setup(moves)
    late = methods_reduced.reduced(methods_reduced.FULL_ROWS, setup(moves, rate=1.0))
    method = MESHES[name](given)
    late.advance(0.1)
    method.advance(0.1, rays=0)  # only the free image's samples, 0.1 s old
    assert error(given, method.show(0.1), 0.1) < 0.9 * error(given, late.show(0.1), 0.1)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("name", ["tapestry_object", "shading_cache"])
def test_a_mesh_of_a_view_without_objects_shows_the_sky(name: str, setup: MakeSetup) -> None:
    given = setup(NOTHING_MOVES)
    view, far = given.plan.view, np.array([1e5, 0.0, 0.0])
    away = replace(view, still=shifted(view.still, far), target=view.target + far)
    there = replace(given, plan=replace(given.plan, views=(away,)))
    method = MESHES[name](there)
    shown = run(method, 0.1)
    assert 2000 - CROSSHAIR < method.rays <= 2000
    assert np.isfinite(shown).all()
    np.testing.assert_allclose(shown, MESHES[name](there).show(0.0), atol=0.02)
    assert error(there, shown, 0.0) < 0.01


@pytest.mark.usefixtures("compiled_only")
def test_a_full_shading_cache_starts_over_from_the_scenes_own_vertices(
    setup: MakeSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = setup(NOTHING_MOVES)
    monkeypatch.setattr(methods_shading_cache, "FULL", 1e-6)  # every image finds it full
    cache = methods_shading_cache.ShadingCache(given)
    method = FramelessMethod(given, cache)
    roots = len(cache._patches.turn)
    method.advance(0.1, rays=2000)
    assert cache._patches.counts[0] > roots
    shown = method.show(0.1)
    assert cache._patches.counts[0] == roots
    assert (cache._patches.child[:roots] == -1).all()
    assert np.isfinite(shown).all()


def test_world_points_far_from_the_origin_are_projected_as_exactly_as_near_ones(setup: MakeSetup) -> None:
    given = setup(CAMERA_ORBITS)
    far = np.array([4e6, -1e6, 2e6])
    panel, view = given.panel, given.plan.view
    moved = replace(view, still=shifted(view.still, far), target=view.target + far)
    there = replace(given, plan=replace(given.plan, views=(moved,)))
    first, later = (Inputs(there.plan).event_at(time) for time in (0.0, 0.1))
    before, after = world_maps(there, first), world_maps(there, later)
    for x, y, distance in ((3.5, 4.5, 5.0), (40.0, 20.0, 9.0), (24.0, 31.0, 3.0)):
        ray = before.frame[0] + x * before.frame[1] + y * before.frame[2]
        hit = first.camera.origin() + distance * ray / np.linalg.norm(ray)
        at = np.float32(x), np.float32(y), np.float32(distance)
        a, b, c = position_of(*at, 1, before.frame, before.object_from_eye)
        found = pixel_of(a, b, c, 1, after.panel_from_object)[:2]
        expected = project(panel, view.eye, later.camera, hit)[0][0]
        np.testing.assert_allclose(found, expected, atol=0.01)  # pixels; float32 of world places would be off by 10


def shifted(camera: Camera, by: Float64) -> Camera:
    x, y, z = (camera.origin() + by).tolist()
    return replace(camera, position=(x, y, z))
