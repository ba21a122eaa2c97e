"""Paths against closed forms: furnaces, form factors, interreflection, and direct light where they see no more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    BLACK_SKY,
    View,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
    with_every_feature,
)

from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Instance, Light, Material, Mesh, PointLight, Sky
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE = (1.0, 1.0, 1.0)
WHITE_SKY = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
PLAIN = Material(name="white", base_color=WHITE)
EDGE = 64  # pixels of views whose pixels all show the same: paths of one pixel and number have the same random numbers
AHEAD = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1)


def paths_of(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    *,
    depth: int,
    placed: Sequence[Instance] | None = None,
    sky: Sky = BLACK_SKY,
    lights: Sequence[Light] = (),
) -> Scene:
    return with_every_feature(plain_paths_of(meshes, materials, depth=depth, placed=placed, sky=sky, lights=lights))


def plain_paths_of(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    *,
    depth: int,
    placed: Sequence[Instance] | None = None,
    sky: Sky = BLACK_SKY,
    lights: Sequence[Light] = (),
) -> Scene:
    """For a tracer that has no feature but those of the scene."""
    return replace(scene_of(meshes, placed, materials=materials, sky=sky, lights=lights), path_depth=depth)


def mean(scene: Scene, seen: View, sweeps: int) -> Float64:
    """Mean radiance, RGB, of so many samples of every pixel."""
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1).reshape(-1, 2)
    batches = [tracer.trace(xy.astype(np.float32), 0.0, number)[0]["radiance"] for number in range(sweeps)]
    return np.concatenate(batches).astype(np.float64).mean(axis=0)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.1, 0.25, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_a_white_surface_under_a_white_sky_loses_nothing(metallic: float, roughness: float) -> None:
    """Seen from straight above to nearly along it; what the table and its interpolation cost is in the bound."""
    white = replace(PLAIN, metallic=metallic, roughness=roughness, specular=1.0)
    for turn in (0.0, 50.0, 75.0, 86.0):
        placed = [instance(0, turn=("y", turn))]
        scene = plain_paths_of([quad(90.0, 9.0)], [white], depth=2, placed=placed, sky=WHITE_SKY)
        got = mean(scene, AHEAD, 16)
        np.testing.assert_allclose(got, 1.0, atol=0.005)


@pytest.mark.usefixtures("compiled_only")
def test_features_left_out_give_the_same_paths_as_features_unused() -> None:
    """Each kind of light has its own random numbers: path by path the same light, to the rounding of other machine
    code. A path that meets the far object, or that rounding sends elsewhere, may differ: one in a thousand."""
    white = replace(PLAIN, metallic=0.5, roughness=0.5, specular=1.0)
    sky, placed = Sky(), [instance(0, turn=("y", 50.0))]
    plain = plain_paths_of([quad(90.0, 9.0)], [white], depth=2, placed=placed, sky=sky)
    scenes = plain, with_every_feature(plain)
    near, seen = [], view((0.0, 0.0, 40.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=40.0)
    for scene in scenes:
        tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
        tracer.set_event(seen.event)
        xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1).reshape(-1, 2)
        near.append(tracer.trace(xy.astype(np.float32), 0.0, 3)[0]["radiance"])
    assert float(np.ptp(near[0])) > 0.1
    assert np.isclose(near[0], near[1], rtol=1e-4, atol=1e-6).all(axis=-1).mean() > 0.999


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.1, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("segments", [12, 64])
def test_clear_glass_keeps_what_falls_on_it(segments: int, roughness: float) -> None:
    """Fine and coarse meshes, whose smooth normals send much to the wrong side of their triangles; the bound is five
    standard errors or more."""
    glass = replace(PLAIN, transmission=1.0, roughness=roughness)
    scene = paths_of([sphere_mesh(segments=segments)], [glass], depth=64, sky=WHITE_SKY)
    np.testing.assert_allclose(mean(scene, AHEAD, 64), 1.0, atol=0.005)


@pytest.mark.usefixtures("compiled_only")
def test_a_slab_of_glass_absorbs_by_the_way_inside() -> None:
    """Seen straight on, R of each interface and t = color^(thickness / distance) of each way through, reflections
    between both added up: T = (1 - R)^2 t / (1 - R^2 t^2) of the light behind and R (1 + T t) of that before it."""
    thickness, distance, color = 0.75, 0.5, (0.9, 0.5, 0.04)
    glass = replace(
        PLAIN, transmission=1.0, roughness=0.0, ior=2.0, attenuation_color=color, attenuation_distance=distance
    )
    placed = [instance(0), instance(0, at=(0.0, 0.0, -thickness), turn=("y", 180.0))]
    scene = paths_of([quad(90.0, 90.0)], [glass], depth=40, placed=placed, sky=WHITE_SKY)
    left = np.array(color) ** (thickness / distance)
    one = ((glass.ior - 1.0) / (glass.ior + 1.0)) ** 2
    through = (1.0 - one) ** 2 * left / (1.0 - (one * left) ** 2)
    np.testing.assert_allclose(mean(scene, AHEAD, 16), one * (1.0 + through * left) + through, atol=0.005)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.4, 1.0])
def test_thin_glass_keeps_what_falls_on_it(roughness: float) -> None:
    sheet = replace(PLAIN, transmission=1.0, thin=True, roughness=roughness)
    for turn in (0.0, 50.0, 75.0, 130.0):
        scene = paths_of([quad(90.0, 9.0)], [sheet], depth=2, placed=[instance(0, turn=("y", turn))], sky=WHITE_SKY)
        np.testing.assert_allclose(mean(scene, AHEAD, 16), 1.0, atol=0.005)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("degrees", [0.0, 40.0, 60.0, 80.0])
def test_thin_glass_mirrors_what_both_its_surfaces_do_and_the_rest_goes_straight_on(degrees: float) -> None:
    """A pane on the ground, seen at an angle a: the sky is red above and green below, as bright as cos(a) both ways.
    Fresnel in the form of sines and tangents; each bound is five standard errors or more."""
    color, ior = (0.2, 0.7, 0.4), 1.8
    sheet = replace(PLAIN, base_color=color, transmission=1.0, thin=True, roughness=0.0, ior=ior)
    sky = Sky(zenith=(1.0, 0.0, 0.0), horizon=(0.0, 0.0, 0.0), ground=(0.0, 1.0, 0.0))
    for turn in (-90.0, 90.0):  # its front up, then its back
        scene = paths_of([quad(90.0, 90.0)], [sheet], depth=2, placed=[instance(0, turn=("x", turn))], sky=sky)
        a = math.radians(degrees) + 1e-4
        b = math.asin(math.sin(a) / ior)
        once = ((math.sin(a - b) / math.sin(a + b)) ** 2 + (math.tan(a - b) / math.tan(a + b)) ** 2) / 2
        back = once + (1.0 - once) ** 2 * once / (1.0 - once**2)
        eye = (9.0, 4.0 * math.cos(a), 4.0 * math.sin(a))  # beside what lies far below
        seen = view(eye, (9.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1, up=(0.0, 0.0, -1.0))
        wanted = back, color[1] * (1.0 - back), 0.0
        np.testing.assert_allclose(mean(scene, seen, 16) / math.cos(a), wanted, atol=0.01)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("depth", [1, 2, 5, 12])
def test_a_closed_room_of_shining_grey_walls_is_a_geometric_series(depth: int) -> None:
    """Radiance 1 on every wall, albedo a: the sum of a^k over k = 0..depth, whatever the room's shape."""
    albedo = 0.6
    walls = Material(name="walls", base_color=(albedo,) * 3, emission=WHITE)
    scene = paths_of([sphere_mesh(segments=16, smooth=False)], [walls], depth=depth)
    got = mean(scene, view((0.1, 0.2, 0.3), (0.0, 0.0, -1.0), pixels=(EDGE, EDGE)), 16)
    np.testing.assert_allclose(got, (1 - albedo ** (depth + 1)) / (1 - albedo), rtol=0.01)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("size", [0.2, 2.0, 20.0])
def test_a_square_lamp_above_a_floor_gives_the_light_of_its_form_factor(size: float) -> None:
    """The floor below the middle of a square of edge a at height h: radiance E F / pi... with F the form factor of a
    small patch to a parallel square above it, four times that of the quarter with edges a / 2."""
    height, albedo = 1.0, 0.5
    x = size / 2 / height
    quarter = x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    floor = Material(name="floor", base_color=(albedo,) * 3)
    lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=(3.0, 2.0, 1.0), emits_behind=False)
    scene = paths_of(
        [quad(100.0, 100.0), quad(size, size, material=1)],
        [floor, lamp],
        depth=1,
        placed=[instance(0, turn=("x", -90.0)), instance(1, at=(0.0, height, 0.0), turn=("x", 90.0))],
    )
    seen = view((0.0, 0.3, 0.001), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1)
    got = mean(scene, seen, 16)
    np.testing.assert_allclose(got, albedo * 4 * quarter * np.array([3.0, 2.0, 1.0]), rtol=0.01)


@pytest.mark.usefixtures("compiled_only")
def test_lamps_shine_to_the_side_that_they_say() -> None:
    floor = Material(name="floor", base_color=WHITE)
    got = []
    for behind in (True, False):
        lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=WHITE, emits_behind=behind)
        placed = [instance(0, turn=("x", -90.0)), instance(1, at=(0.0, 1.0, 0.0), turn=("x", -90.0))]  # facing up
        scene = paths_of([quad(100.0, 100.0), quad(1.0, 1.0, material=1)], [floor, lamp], depth=1, placed=placed)
        got.append(mean(scene, view((0.0, 0.3, 0.9), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=1.0), 1)[0])
    assert got[0] > 0.1
    assert got[1] == 0.0


@pytest.mark.usefixtures("compiled_only")
def test_a_mirrored_lamp_shines_to_the_mirrored_side() -> None:
    """A lamp flipped in y lights the floor as much as one that was made facing down; not where it faced before."""
    floor = Material(name="floor", base_color=WHITE)
    lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=WHITE, emits_behind=False)
    got = []
    for turn, scale in ((90.0, (1.0, 1.0, 1.0)), (-90.0, (1.0, 1.0, -1.0)), (90.0, (1.0, 1.0, -1.0))):
        placed = [instance(0, turn=("x", -90.0)), instance(1, at=(0.0, 1.0, 0.0), turn=("x", turn), scale=scale)]
        scene = paths_of([quad(100.0, 100.0), quad(1.0, 1.0, material=1)], [floor, lamp], depth=1, placed=placed)
        seen = view((0.0, 0.3, 0.9), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=1.0)
        got.append(float(mean(scene, seen, 4)[0]))
    assert got[1] == pytest.approx(got[0], rel=0.01)
    assert got[0] > 0.1
    assert got[2] == 0.0


@pytest.mark.usefixtures("compiled_only")
def test_paths_of_one_surface_see_what_direct_light_sees() -> None:
    """Diffuse surfaces in the light of a sun and a lamp, with shadows: no random number decides anything."""
    lights = [
        DirectionalLight(direction=(0.6, 0.64, 0.48), irradiance=(1.0, 2.0, 3.0)),
        PointLight(position=(1.5, 2.0, 2.5), intensity=(4.0, 3.0, 2.0)),
    ]
    meshes, placed = [sphere_mesh(), quad(8.0, 8.0)], [instance(0), instance(1, at=(0.0, -1.0, 0.0), turn=("x", -90.0))]
    scene = scene_of(meshes, placed, materials=[material(0.7, 0.5, 0.3)], lights=lights)
    seen = view((1.0, 2.0, 5.0), (0.0, 0.0, 0.0), pixels=(64, 48))
    direct = traced_image(scene, seen)
    path = traced_image(with_every_feature(replace(scene, path_depth=1)), seen)
    np.testing.assert_allclose(path.radiance, direct.radiance, rtol=2e-5, atol=1e-6)
    np.testing.assert_array_equal(path.depth, direct.depth)
    np.testing.assert_array_equal(path.objects, direct.objects)


@pytest.mark.usefixtures("compiled_only")
def test_aiming_at_lamps_and_finding_them_agree() -> None:
    """A rough metal floor before a large lamp: with other shares of both, a wrong weight would show in the mean."""
    lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=WHITE)
    got = []
    for lamps in (1, 16):  # the same light as one square, and cut into 16
        metal = Material(name="metal", base_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.3)
        edge = round(math.sqrt(lamps))
        part = quad(2.0 / edge, 2.0 / edge, material=1)
        middles = (np.arange(edge) + 0.5) * 2.0 / edge - 1.0
        placed = [instance(0, turn=("x", -90.0))]
        placed += [instance(1, at=(float(x), float(y) + 1.0, -2.0)) for x in middles for y in middles]
        scene = paths_of([quad(20.0, 20.0), part], [metal, lamp], depth=1, placed=placed)
        got.append(mean(scene, view((0.0, 1.0, 4.0), (0.0, 0.0, 0.5), pixels=(EDGE, EDGE), fov=5.0), 32))
    np.testing.assert_allclose(got[1], got[0], rtol=0.01)
    assert got[0][0] > 0.05


def test_every_sample_can_be_traced_again_alone() -> None:
    """Random numbers are those of the pixel and the sample's number, whatever else is in the batch."""
    scene = paths_of(
        [sphere_mesh(segments=16)], [Material(name="m", base_color=WHITE, specular=1.0)], depth=6, sky=Sky()
    )
    tracer = Tracer(make_tracer_scene(scene), AHEAD.panel, AHEAD.eye, coherent=False)
    tracer.set_event(AHEAD.event)
    xy = np.random.default_rng(1).uniform(0.0, 64.0, (60, 2)).astype(np.float32)
    together = tracer.trace(xy, 1.0, 7)[0].copy()
    for k in (0, 17, 59):
        alone = tracer.trace(xy[k : k + 1], 1.0, 7)[0]
        np.testing.assert_array_equal(alone[0], together[k])


@pytest.mark.usefixtures("compiled_only")
def test_error_falls_as_samples_grow_and_faster_than_by_chance() -> None:
    """Sobol's points: 64 samples of a smooth scene are as near as 110 independent ones or more."""
    floor = Material(name="floor", base_color=(0.7, 0.7, 0.7))
    lamp = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=WHITE)
    placed = [instance(0, turn=("x", -90.0)), instance(1, at=(0.0, 1.0, 0.0), turn=("x", 90.0))]
    scene = paths_of([quad(50.0, 50.0), quad(2.0, 2.0, material=1)], [floor, lamp], depth=1, placed=placed)
    seen = view((0.0, 0.5, 3.0), (0.0, 0.0, 0.0), pixels=(16, 16), fov=20.0)
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(16) + 0.5, np.arange(16) + 0.5), axis=-1).reshape(-1, 2).astype(np.float32)

    def error(numbers: Sequence[int], truth: Float32) -> float:
        got = np.mean([tracer.trace(xy, 0.0, number)[0]["radiance"] for number in numbers], axis=0)
        return float(np.sqrt(((got - truth) ** 2).mean()))

    truth = np.mean([tracer.trace(xy, 0.0, number)[0]["radiance"] for number in range(4096)], axis=0)
    chance = np.random.default_rng(2).integers(1 << 20, 1 << 30, 110).tolist()
    assert error(range(64), truth) < error(chance, truth)
