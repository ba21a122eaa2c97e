"""Environments against closed forms: furnaces, irradiance, densities, and paths with and without aiming."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
from small_scenes import (
    BLACK,
    TracedImage,
    View,
    directions,
    instance,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
)

from wall.core.colour import LUMINANCE
from wall.core.data import NO_EDITS, Edits, Float64
from wall.geometry.frusta import ray_frame
from wall.reconstruction.channels import blank_framelet, show_sky
from wall.scene.build import Scene
from wall.scene.kernels.environment import image_position, radiance_at
from wall.scene.model import Environment, Material
from wall.scene.parameters import parameters_of
from wall.tracing import environment as tables
from wall.tracing.kernels.environment import aim_at_environment, density_of_environment
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE = (1.0, 1.0, 1.0)
EDGE = 64
AHEAD = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1)
COUNT = 400_000  # directions of the chi-square test


def constant(r: float = 1.0, g: float = 1.0, b: float = 1.0, *, height: int = 8) -> Environment:
    return Environment(name="constant", texels=np.full((height, 2 * height, 3), (r, g, b), np.float32))


def spotted(height: int = 16, *, rotation: float = 0.0) -> Environment:
    """Dim noise and one very bright texel, with a black band."""
    texels = np.random.default_rng(3).uniform(0.0, 1.0, (height, 2 * height, 3)).astype(np.float32)
    texels[height // 2 : height // 2 + 3] = 0.0
    texels[height // 4, height // 3] = 200.0, 150.0, 100.0
    return Environment(name="spotted", texels=texels, rotation=rotation)


def in_environment(scene: Scene, environment: Environment, depth: int | None = None) -> Scene:
    return replace(scene, environment=environment, path_depth=depth)


def with_shared_features(scene: Scene) -> Scene:
    """With a metallic mirror far below: all of these tests share one tracer for direct light, and one for paths."""
    mirror = Material(name="far below", base_color=BLACK, mirror=0.5, metallic=0.5)
    meshes = [*scene.meshes, quad(0.01, 0.01, material=len(scene.materials))]
    placed = [*scene.instances, instance(len(scene.meshes), at=(0.0, -500.0, 0.0))]
    whole = scene_of(meshes, placed, materials=[*scene.materials, mirror])
    return replace(whole, environment=scene.environment, path_depth=scene.path_depth)


def image_of(scene: Scene, seen: View) -> TracedImage:
    return traced_image(with_shared_features(scene), seen)


def mean(scene: Scene, seen: View, sweeps: int) -> Float64:
    """Mean radiance, RGB, of so many samples of every pixel."""
    return np.asarray(values(scene, seen, sweeps).mean(axis=(0, 1)), np.float64)


def values(scene: Scene, seen: View, sweeps: int) -> Float64:
    """(sweeps, pixels, 3) radiance."""
    tracer = Tracer(make_tracer_scene(with_shared_features(scene)), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1).reshape(-1, 2)
    batches = [tracer.trace(xy.astype(np.float32), 0.0, number)[0]["radiance"] for number in range(sweeps)]
    return np.stack(batches).astype(np.float64)


def looked_up(environment: Environment, ways: Float64) -> Float64:
    """Bilinear lookup in float64, a second derivation: (n, 3) of unit directions (n, 3)."""
    h, w = environment.texels.shape[:2]
    turned = np.radians(environment.rotation)
    u = 0.5 + (np.arctan2(ways[:, 0], -ways[:, 2]) + turned) / (2 * np.pi)
    x, y = (u * w - 0.5) % w, np.clip(np.arccos(np.clip(ways[:, 1], -1, 1)) / np.pi * h - 0.5, 0, h - 1)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - i)[:, None], (y - j)[:, None]
    texel = environment.texels.astype(np.float64)
    below, right = np.minimum(j + 1, h - 1), (i + 1) % w
    upper = texel[j, i] * (1 - fx) + texel[j, right] * fx
    return np.asarray(upper * (1 - fy) + (texel[below, i] * (1 - fx) + texel[below, right] * fx) * fy, np.float64)


@pytest.mark.parametrize("rotation", [0.0, 70.0])
def test_rays_that_leave_see_the_image_as_it_is_turned(rotation: float) -> None:
    environment = spotted(4, rotation=rotation)
    scene = in_environment(scene_of([quad(0.01, 0.01)], [instance(0, at=(0.0, -50.0, 0.0))]), environment)
    for target in ((0.0, 0.0, -1.0), (1.0, 0.7, 0.1), (-0.4, -0.5, 1.0)):
        seen = view((0.0, 0.0, 0.0), target, pixels=(12, 8), fov=60.0)
        image = image_of(scene, seen)
        expected = looked_up(environment, directions(seen).reshape(-1, 3)).reshape(8, 12, 3)
        np.testing.assert_allclose(image.radiance, expected, rtol=2e-4, atol=2e-4)


def test_a_layer_of_sky_shows_the_same_environment() -> None:
    scene = in_environment(scene_of([quad(0.01, 0.01)], [instance(0, at=(0.0, -50.0, 0.0))]), spotted(8, rotation=20.0))
    seen = view((0.0, 0.0, 0.0), (1.0, 0.4, 0.3), pixels=(16, 12), fov=60.0)
    layer = blank_framelet(seen.panel, frozenset({"colour"}), encoded=False, order=0)
    show_sky(scene.sky, scene.environment, ray_frame(seen.panel, seen.eye, seen.event.camera), np.zeros(2), layer)
    np.testing.assert_allclose(layer.colour, image_of(scene, seen).radiance, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("depth", [None, 3])
def test_an_edited_strength_is_a_factor_of_all_of_its_light(depth: int | None) -> None:
    """On surfaces and behind them, by the same rays: to the rounding of float32."""
    environment = replace(spotted(8), strength=1.5)
    scene = in_environment(scene_of([quad(1.0, 1.0)]), environment, depth)
    assert parameters_of(scene)["environment.strength"].default == (1.5,)
    assert "sky.strength" not in parameters_of(scene)
    assert "environment.strength" not in parameters_of(in_environment(scene, replace(environment, strength=0.0)))
    seen = view((0.0, 1.0, 2.0), (0.0, 0.0, 0.0), pixels=(16, 12), fov=60.0)
    tracer = Tracer(make_tracer_scene(with_shared_features(scene)), seen.panel, seen.eye, coherent=False)
    xy = np.stack(np.meshgrid(np.arange(16) + 0.5, np.arange(12) + 0.5), axis=-1).reshape(-1, 2).astype(np.float32)

    def light(edits: Edits) -> Float64:
        tracer.set_event(replace(seen.event, edits=edits))
        return tracer.trace(xy, 0.0, 0)[0]["radiance"].astype(np.float64)

    before, edited = light(NO_EDITS), Edits(1, (("environment.strength", (4.5,)),))
    assert before.mean() > 0.1
    np.testing.assert_allclose(light(edited), 3.0 * before, rtol=1e-5)
    np.testing.assert_array_equal(light(NO_EDITS), before)
    layer, frame = blank_framelet(seen.panel, frozenset({"colour"}), encoded=False, order=0), np.eye(3)
    show_sky(scene.sky, environment, frame, np.zeros(2), layer, strength=4.5)
    sky = layer.colour.copy()
    show_sky(scene.sky, environment, frame, np.zeros(2), layer)
    np.testing.assert_allclose(sky, 3.0 * layer.colour, rtol=1e-6)


def test_the_middle_lies_ahead_and_the_right_half_to_the_right() -> None:
    texels = np.zeros((4, 8, 3), np.float32)
    texels[:, 3:5, 0], texels[:, 5:7, 1], texels[0, :, 2] = 1.0, 1.0, 1.0
    for rotation, ahead, right in ((0.0, (0, 0, -1), (1, 0, 0)), (90.0, (-1, 0, 0), (0, 0, -1))):
        middle = Environment(name="e", texels=texels, rotation=rotation).middle
        red, green, up = (
            radiance_at(texels, *image_position(*(np.float32(c) for c in way), middle))
            for way in (ahead, right, (0, 1, 0))
        )
        assert red[0] > 0.9
        assert green[1] > 0.9
        assert up[2] == 1.0


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 1.0), (1.0, 0.02), (1.0, 0.3), (0.5, 0.6)])
def test_a_white_surface_in_a_constant_environment_loses_nothing(metallic: float, roughness: float) -> None:
    """A furnace: aiming and finding together give exactly the light there is, from above and at 75 degrees."""
    white = Material(name="white", base_color=WHITE, metallic=metallic, roughness=roughness, specular=1.0)
    for turn in (0.0, 75.0):
        scene = scene_of([quad(90.0, 9.0)], [instance(0, turn=("y", turn))], materials=[white])
        got = mean(in_environment(scene, constant(1.0, 2.0, 3.0), 2), AHEAD, 32)
        np.testing.assert_allclose(got, (1.0, 2.0, 3.0), rtol=0.006)


@pytest.mark.parametrize("turn", [("x", 0.0), ("x", 90.0), ("x", -90.0), ("y", 35.0)])
def test_irradiance_of_a_constant_environment_is_pi_times_its_radiance(turn: tuple[str, float]) -> None:
    """Under direct light: radiance albedo E / pi, to the width of a coarse cell."""
    scene = scene_of([quad(9.0, 9.0)], [instance(0, turn=turn)])
    toward = {("x", 90.0): (0.0, -4.0, 0.001), ("x", -90.0): (0.0, 4.0, 0.001)}.get(turn, (0.0, 0.0, 4.0))
    seen = view(toward, (0.0, 0.0, 0.0), pixels=(4, 4), fov=1.0)
    image = image_of(in_environment(scene, constant(1.0, 2.0, 3.0)), seen)
    np.testing.assert_allclose(image.radiance, np.broadcast_to(0.5 * np.array([1.0, 2.0, 3.0]), (4, 4, 3)), rtol=1e-3)


@pytest.mark.usefixtures("compiled_only")
def test_irradiance_by_normal_is_within_its_bound_for_a_single_distant_light() -> None:
    """max(0, n . d) for one bright texel of 512, wherever it stands: 1.5 % of what faces it; the worst is the edge."""
    for row, column in ((128, 100), (60, 300), (3, 17), (250, 511)):
        texels = np.zeros((256, 512, 3), np.float32)
        texels[row, column] = 1e4
        environment = Environment(name="sun", texels=texels)
        light = 1e4 * tables.solid_angles(256, 512)[row] / math.pi
        way = tables.texel_directions(256, 512, 0.5)[row, column]
        normals = tables.octahedron_normals(4 * tables.STEPS).astype(np.float64)  # at the table's nodes, and between
        table = tables.irradiance_by_normal(environment)[..., 0].astype(np.float64)
        node = np.arange(4 * tables.STEPS + 1) / 4.0
        i = np.minimum(node.astype(int), tables.STEPS - 1)
        f = node - i
        rows = table[i] * (1 - f)[:, None] + table[i + 1] * f[:, None]
        found = (rows[:, i] * (1 - f) + rows[:, i + 1] * f).ravel()
        wrong = np.abs(found - light * np.maximum(normals @ way, 0.0)).max() / light
        assert wrong < 0.015


def test_irradiance_of_a_smooth_environment_by_normal_is_close() -> None:
    """L = 1 + d.y: E(n) = pi + 2 pi / 3 n.y."""
    way = tables.texel_directions(32, 64, 0.5)
    texels = np.repeat((1.0 + way[..., 1:2]), 3, axis=2).astype(np.float32)
    table = tables.irradiance_by_normal(Environment(name="e", texels=texels)).reshape(-1, 3)
    expected = 1.0 + 2.0 / 3.0 * tables.octahedron_normals(tables.STEPS)[:, 1:2]
    np.testing.assert_allclose(table, np.repeat(expected, 3, axis=1), atol=2e-3)


@numba.njit
def drawn(environment: Any, numbers: Any, to: Any) -> None:
    for k in range(len(numbers)):
        way, light, density = aim_at_environment(environment, numbers[k, 0], numbers[k, 1])
        to[k, 0], to[k, 1], to[k, 2], to[k, 3] = way[0], way[1], way[2], density
        to[k, 4] = density_of_environment(environment, way[0], way[1], way[2])
        to[k, 5], to[k, 6], to[k, 7] = light[0], light[1], light[2]


@numba.njit
def densities(environment: Any, ways: Any, found: Any) -> None:
    for k in range(len(ways)):
        found[k] = density_of_environment(environment, ways[k, 0], ways[k, 1], ways[k, 2])


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("rotation", [0.0, 70.0])
def test_directions_are_drawn_with_their_density(rotation: float) -> None:
    """Chi-square over cells equal in (u, v) that no texel's edge fits, at the 1e-6 level; the densities sum to 1."""
    environment = tables.environment_tables(spotted(rotation=rotation), paths=True)
    to = np.zeros((COUNT, 8), np.float32)
    drawn(environment, np.random.default_rng(1).random((COUNT, 2)).astype(np.float32), to)
    np.testing.assert_allclose(np.linalg.norm(to[:, :3], axis=1), 1.0, atol=1e-6)
    assert (np.abs(to[:, 4] - to[:, 3]) > 1e-3 * to[:, 3]).mean() < 1e-3  # but for what float32 puts beyond an edge
    expected_light = looked_up(spotted(rotation=rotation), to[:, :3].astype(np.float64))
    np.testing.assert_allclose(to[:, 5:8], expected_light, rtol=2e-3, atol=2e-3)
    rings, sectors, fine = 12, 22, 32
    polar = (np.arange(rings * fine) + 0.5) * np.pi / (rings * fine)
    turn = (np.arange(sectors * fine) + 0.5) * 2 * np.pi / (sectors * fine)
    sine = np.sin(polar)[:, None]
    ways = np.stack([sine * np.sin(turn), np.cos(polar)[:, None] + 0 * turn, -sine * np.cos(turn)], axis=-1)
    found = np.zeros(ways.shape[0] * ways.shape[1], np.float32)
    densities(environment, ways.reshape(-1, 3).astype(np.float32), found)
    area = sine * np.pi / (rings * fine) * 2 * np.pi / (sectors * fine)
    chance = (found.reshape(ways.shape[:2]) * area).reshape(rings, fine, sectors, fine).sum(axis=(1, 3))
    assert chance.sum() == pytest.approx(1.0, abs=0.002)
    ring = np.minimum((np.arccos(np.clip(to[:, 1], -1, 1)) / np.pi * rings).astype(int), rings - 1)
    around = (np.arctan2(to[:, 0], -to[:, 2]) / (2 * np.pi)) % 1.0
    sector = np.minimum((around * sectors).astype(int), sectors - 1)
    counts = np.bincount(ring * sectors + sector, minlength=rings * sectors).reshape(rings, sectors)
    wanted = chance / chance.sum() * COUNT
    often = wanted > 20
    square = ((counts - wanted)[often] ** 2 / wanted[often]).sum()
    freedom = int(often.sum()) - 1
    assert square < freedom + 4.9 * math.sqrt(2 * freedom) + 11


@pytest.mark.parametrize("light", [0.0, 1.0, 3.7])
def test_even_images_are_aimed_at_evenly(light: float) -> None:
    rows, columns = tables.chances(np.full((8, 16, 3), light, np.float32))
    np.testing.assert_allclose(rows, (1.0 - np.cos(np.arange(9) * np.pi / 8)) / 2, atol=1e-6)
    np.testing.assert_allclose(columns, np.broadcast_to(np.arange(17) / 16, (8, 17)), atol=1e-6)


def test_only_what_is_brighter_than_the_whole_is_aimed_at() -> None:
    """Two texels of a row, one three times as bright: chances go by what each has above the image's mean."""
    texels = np.zeros((32, 64, 3), np.float32)
    texels[10, 20], texels[10, 40] = 30.0, 90.0
    rows, columns = tables.chances(texels)
    assert np.diff(rows)[[9, 10, 11]].sum() == pytest.approx(1.0, abs=1e-6)
    chance = np.diff(columns[10])
    mean = 120.0 * tables.solid_angles(32, 64)[10] / (4 * np.pi)
    wanted = (0.75**2 * 90.0 - mean) / (0.75**2 * 30.0 - mean)
    assert chance[40] / chance[20] == pytest.approx(wanted, rel=0.01)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 1.0), (1.0, 0.3)])
def test_aiming_at_an_environment_leaves_the_mean_and_takes_noise(metallic: float, roughness: float) -> None:
    """Against the integral of radiance times BSDF by 65,536 directions for diffuse surfaces; for metal against paths
    with chances that aim nearly evenly."""
    surface = Material(name="m", base_color=(0.8, 0.8, 0.8), metallic=metallic, roughness=roughness)
    scene = scene_of([quad(90.0, 90.0)], [instance(0, turn=("x", -70.0))], materials=[surface])
    environment = spotted()
    lit = in_environment(scene, environment, 1)
    got = values(lit, AHEAD, 16)
    if metallic == 0.0:
        normal = np.array([0.0, math.sin(math.radians(70.0)), math.cos(math.radians(70.0))])
        expected = 0.8 * irradiance(environment, normal) / math.pi
        np.testing.assert_allclose(got.mean(axis=(0, 1)), expected, rtol=0.01)
    flat = make_tracer_scene(with_shared_features(lit))
    assert flat.environment is not None
    rows, columns = tables.chances(np.zeros_like(environment.texels))
    even = replace(flat, environment=flat.environment._replace(row_sums=rows, column_sums=columns))
    tracer = Tracer(even, AHEAD.panel, AHEAD.eye, coherent=False)
    tracer.set_event(AHEAD.event)
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1).reshape(-1, 2).astype(np.float32)
    other = np.stack([tracer.trace(xy, 0.0, n)[0]["radiance"] for n in range(64)]).astype(np.float64)
    np.testing.assert_allclose(got.mean(axis=(0, 1)), other.mean(axis=(0, 1)), rtol=0.02)
    assert (got @ LUMINANCE).var() < 0.2 * (other @ LUMINANCE).var()


def irradiance(environment: Environment, normal: Float64) -> Float64:
    """(3,) by the midpoint rule on 512 x 1024 directions."""
    ways = tables.texel_directions(512, 1024, 0.5).reshape(-1, 3)
    weight = np.repeat(tables.solid_angles(512, 1024), 1024) * np.maximum(ways @ normal, 0.0)
    return np.asarray(weight @ looked_up(environment, ways), np.float64)


def test_a_mirror_shows_the_environment_as_paths_and_direct_light_see_it() -> None:
    environment = spotted(8)
    mirror = Material(name="mirror", base_color=WHITE, mirror=1.0)
    seen = view((0.0, 0.3, 3.0), (0.0, 0.0, 0.0), pixels=(16, 12), fov=30.0)
    scene = scene_of([sphere_mesh(segments=12, smooth=False)], materials=[mirror])
    direct, path = (image_of(in_environment(scene, environment, depth), seen) for depth in (None, 2))
    np.testing.assert_allclose(path.radiance, direct.radiance, rtol=1e-3, atol=1e-4)


def test_memory_of_the_tables_is_counted() -> None:
    scene = scene_of([quad(1.0, 1.0)])
    without = make_tracer_scene(scene).bytes
    environment = constant(height=64)
    assert (
        make_tracer_scene(in_environment(scene, environment)).bytes - without >= environment.texels.nbytes + 129**2 * 12
    )
    more = (
        make_tracer_scene(in_environment(scene, environment, 3)).bytes
        - make_tracer_scene(replace(scene, path_depth=3)).bytes
    )
    assert more >= environment.texels.nbytes * 4 // 3
