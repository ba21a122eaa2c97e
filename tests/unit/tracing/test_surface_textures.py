"""What textures do besides colour: normals, emission, roughness, metalness, edges, and surfaces not there in places."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import small_scenes
from numpy.typing import NDArray
from small_scenes import BLACK_SKY, Triple, View, instance, quad, traced_image, view, with_every_feature

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import (
    NO_TEXTURES,
    DirectionalLight,
    Instance,
    Light,
    Material,
    Mesh,
    Sky,
    Texture,
    TextureSet,
    Wrap,
)
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
BEHIND = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
SQUARE = quad(2.0, 2.0, uvs=True)
EDGE = 48  # pixels of views; the square is as large as the picture
AHEAD = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=math.degrees(2 * math.atan(0.25)))
BLACK_WALL = Material(name="wall", base_color=BLACK)


def scene_of(
    meshes: Sequence[Mesh],
    placed: Sequence[Instance] | None = None,
    *,
    materials: Sequence[Material],
    textures: Sequence[Texture] = (),
    lights: Sequence[Light] = (),
    sky: Sky = BLACK_SKY,
) -> Scene:
    """A scene for the tracer that has every feature: one kernel for all of these tests."""
    return with_every_feature(
        small_scenes.scene_of(meshes, placed, materials=materials, textures=textures, lights=lights, sky=sky)
    )


def plain(*values: int) -> NDArray[np.uint8]:
    """(2, 2, 3) texels, all alike."""
    return np.full((2, 2, 3), values, np.uint8)


def radiance(scene: Scene, seen: View = AHEAD) -> Float32:
    return traced_image(scene, seen).radiance


def looked_up(values: Float64, wrap: tuple[Wrap, Wrap], u: Float64, v: Float64) -> Float64:
    """Bilinear means of (h, w, 3) values at texture coordinates, by what each wrap mode says: a second derivation."""
    height, width = values.shape[:2]

    def index(k: NDArray[np.int64], size: int, how: Wrap) -> NDArray[np.int64]:
        if how == "repeat":
            return k % size
        if how == "clamp":
            return np.clip(k, 0, size - 1)
        turned = k % (2 * size)
        return np.where(turned < size, turned, 2 * size - 1 - turned)

    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - i)[..., None], (y - j)[..., None]
    columns = [index(i + k, width, wrap[0]) for k in (0, 1)]
    rows = [index(j + k, height, wrap[1]) for k in (0, 1)]
    a, b, c, d = (values[row, column] for row in rows for column in columns)
    mean: Float64 = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
    return mean


@pytest.mark.parametrize("wrap", [("repeat", "mirror"), ("mirror", "clamp"), ("clamp", "repeat")])
def test_textures_go_on_beyond_their_edges_as_their_sampler_says(wrap: tuple[Wrap, Wrap]) -> None:
    texels = np.random.default_rng(3).integers(0, 256, (5, 4, 3)).astype(np.uint8)
    texture = Texture(name="noise", texels=texels, wrap=wrap)
    low, high = np.array([-1.6, -1.3]), np.array([2.4, 2.7])  # texture coordinates of the square's corners
    tiled = replace(SQUARE, uvs=(low + (high - low) * np.asarray(SQUARE.uvs)).astype(np.float32))
    shining = Material(name="noise", base_color=BLACK, emission=WHITE, textures=TextureSet(emission=0))
    tracer = Tracer(
        make_tracer_scene(scene_of([tiled], materials=[shining], textures=[texture])),
        AHEAD.panel, AHEAD.eye, coherent=True,
    )  # fmt: skip
    tracer.set_event(AHEAD.event)
    xy = np.random.default_rng(4).random((256, 2)) * EDGE
    samples, _ = tracer.trace(xy.astype(np.float32), 0.0)
    u, v = (low + (high - low) * [1.0, -1.0] * (xy / EDGE - [0.0, 1.0])).T
    wanted = looked_up(srgb_decoded(texels / 255.0), wrap, u, v)
    np.testing.assert_allclose(samples["radiance"], wanted, atol=1e-4)


def shaded(normal: tuple[int, int, int], *, scale: float = 1.0, turn: float = 0.0, flip: float = 1.0) -> float:
    """Radiance of a white square with one normal everywhere, under light from (3, 2, 6)."""
    light = DirectionalLight(direction=(3 / 7, 2 / 7, 6 / 7), irradiance=(math.pi,) * 3)
    bumps = Texture(name="bumps", texels=plain(*normal), linear=True)
    look = Material(name="bumpy", base_color=WHITE, textures=TextureSet(normal=0), normal_scale=scale)
    placed = [instance(0, turn=("y", turn), scale=(flip, 1.0, 1.0))]
    scene = scene_of([SQUARE], placed, materials=[look], textures=[bumps], lights=[light])
    values = radiance(scene)
    assert float(np.ptp(values)) < 1e-5
    return float(values.mean())


def cosine(normal: Float64) -> float:
    return float(normal @ np.array([3.0, 2.0, 6.0]) / 7 / np.linalg.norm(normal))


BUMP = np.array([204, 76, 230]) / 127.5 - 1.0  # along u, along v, off the surface


def test_a_normal_texture_turns_the_normal_along_u_and_v() -> None:
    assert shaded((204, 76, 230)) == pytest.approx(cosine(BUMP), abs=1e-5)
    assert shaded((204, 76, 230), scale=0.5) == pytest.approx(cosine(BUMP * [0.5, 0.5, 1.0]), abs=1e-5)


def test_a_bump_is_a_dent_from_behind() -> None:
    """Turned half way round about y, u goes the other way; the normal of the other side is the negative one."""
    front = BUMP * [-1.0, 1.0, -1.0]  # in the world, of the side that looks away
    assert shaded((204, 76, 230), turn=180.0) == pytest.approx(cosine(-front), abs=1e-5)


def test_a_mirrored_object_mirrors_its_bumps() -> None:
    assert shaded((204, 76, 230), flip=-1.0) == pytest.approx(cosine(BUMP * [-1.0, 1.0, 1.0]), abs=1e-5)


def test_a_flat_normal_texture_changes_nothing() -> None:
    """128 is the closest byte to 0: a turn by 0.3 degrees."""
    assert shaded((128, 128, 255)) == pytest.approx(6 / 7, abs=0.004)


def test_a_triangle_without_extent_in_the_texture_keeps_its_normal() -> None:
    light = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi,) * 3)
    bumps = Texture(name="bumps", texels=plain(204, 76, 230), linear=True)
    look = Material(name="bumpy", base_color=WHITE, textures=TextureSet(normal=0))
    nowhere = replace(SQUARE, uvs=np.zeros_like(np.asarray(SQUARE.uvs)))
    scene = scene_of([nowhere], materials=[look], textures=[bumps], lights=[light])
    np.testing.assert_allclose(radiance(scene), 1.0, atol=1e-6)


def test_emission_is_multiplied_by_its_texture() -> None:
    glow = Texture(name="glow", texels=plain(255, 0, 255))
    look = Material(name="lamp", base_color=BLACK, emission=(2.0, 3.0, 4.0), textures=TextureSet(emission=0))
    values = radiance(scene_of([SQUARE], materials=[look], textures=[glow]))
    np.testing.assert_allclose(values, np.broadcast_to([2.0, 0.0, 4.0], values.shape), rtol=1e-6)


def on_paths(scene: Scene, sweeps: int, seen: View = AHEAD, depth: int = 2) -> Float64:
    """(h, w, 3) mean of so many paths a pixel, off the diagonal, where a ray meets both triangles of the square."""
    tracer = Tracer(make_tracer_scene(replace(scene, path_depth=depth)), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.3, np.arange(EDGE) + 0.6), axis=-1).reshape(-1, 2)
    batches = [tracer.trace(xy.astype(np.float32), 0.0, number)[0]["radiance"] for number in range(sweeps)]
    return np.mean(batches, axis=0, dtype=np.float64).reshape(EDGE, EDGE, 3)


@pytest.mark.usefixtures("compiled_only")
def test_a_textured_lamp_lights_as_two_plain_ones_do() -> None:
    """A lamp above, half of it red and half of it dark, against its red half alone: aimed at in other proportions."""
    halves = np.zeros((8, 8, 3), np.uint8)
    halves[:, :4, 0] = 255
    floor = Material(name="floor", base_color=(0.7, 0.7, 0.7))
    lamp = Material(name="lamp", base_color=BLACK, emission=(9.0, 9.0, 9.0), textures=TextureSet(emission=0))
    above = instance(1, at=(0.0, 0.0, 2.5), turn=("x", 180.0))
    hidden = view((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=40.0)
    texture = Texture(name="halves", texels=halves, wrap=("clamp", "clamp"))
    textured = scene_of(
        [SQUARE, replace(SQUARE, material=1)], [instance(0), above], materials=[floor, lamp], textures=[texture]
    )
    half = replace(quad(1.0, 2.0), material=1)
    red = Material(name="red", base_color=BLACK, emission=(9.0, 0.0, 0.0))
    beside = instance(1, at=(-0.5, 0.0, 2.5), turn=("x", 180.0))
    split = scene_of([SQUARE, half], [instance(0), beside], materials=[floor, red])
    got, wanted = on_paths(textured, 200, hidden, 1), on_paths(split, 200, hidden, 1)
    assert got[..., 1:].max() == 0.0
    blocks = (4, EDGE // 4, 4, EDGE // 4)
    np.testing.assert_allclose(
        got[..., 0].reshape(blocks).mean(axis=(1, 3)), wanted[..., 0].reshape(blocks).mean(axis=(1, 3)), rtol=0.02
    )


@pytest.mark.usefixtures("compiled_only")
def test_textures_of_metalness_and_roughness_are_factors() -> None:
    """One texel everywhere is the same material as its numbers, path by path."""
    factors = Texture(name="rust", texels=plain(0, 51, 153), linear=True)
    textured = Material(
        name="rust", base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.9, specular=1.0,
        textures=TextureSet(metallic_roughness=0),
    )  # fmt: skip
    numbers = replace(textured, metallic=0.6, roughness=0.18, textures=NO_TEXTURES)
    lights = [DirectionalLight(direction=(0.6, 0.0, 0.8), irradiance=(3.0, 3.0, 3.0))]
    got, wanted = (
        on_paths(scene_of([SQUARE], materials=[look], textures=[factors], lights=lights, sky=BEHIND), 8)
        for look in (textured, numbers)
    )
    np.testing.assert_allclose(got, wanted, rtol=2e-4)


FIRST, SECOND = (
    (np.asarray(SQUARE.uvs) @ np.array(turn) + shift).astype(np.float32)
    for turn, shift in (([[1.3, 0.4], [-0.2, 0.8]], 0.1), ([[-0.5, 9.0], [7.0, 2.0]], 0.3))
)  # of the corners; the second is so dense that its texels are averaged


def looked_up_by(slot: str, uvs: Float32, uv_set: int) -> Scene:
    """The square with one texture in a slot, with alpha for base colour, and beside it a wall that it may light."""
    chance, values = np.random.default_rng(8), slot in ("normal", "metallic_roughness")
    texels = chance.integers(0, 256, (16, 16, 3)).astype(np.uint8)
    texels[..., 2] |= 192 if slot == "normal" else 0
    alpha = chance.integers(0, 256, (16, 16)).astype(np.uint8) if slot == "base_color" else None
    texture = Texture(name="noise", texels=texels, alpha=alpha, linear=values, uv_set=uv_set)
    look = Material(
        name="noise", base_color=WHITE, emission=WHITE if slot == "emission" else BLACK, metallic=1.0,
        alpha_mode="opaque" if alpha is None else "mask", textures=TextureSet(**{slot: 0}),
    )  # fmt: skip
    sun = DirectionalLight(direction=(0.6, 0.0, 0.8), irradiance=(3.0, 3.0, 3.0))
    meshes = [replace(SQUARE, uvs=uvs), replace(SQUARE, material=1)]
    placed = [instance(0), instance(1, at=(0.9, 0.0, 1.0), turn=("y", -90.0))]
    return scene_of(meshes, placed, materials=[look, Material(name="wall")], textures=[texture], lights=[sun])


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("slot", TextureSet._fields)
def test_a_texture_is_looked_up_by_its_own_texture_coordinates(slot: str) -> None:
    """Footprints, tangents, holes, and emission where it is aimed at: all as if the mesh had that set alone."""
    both = looked_up_by(slot, np.hstack([FIRST, SECOND]), 1)
    alone, other = looked_up_by(slot, SECOND, 0), looked_up_by(slot, FIRST, 0)
    got, wanted, unlike = (on_paths(scene, 2) for scene in (both, alone, other))
    np.testing.assert_array_equal(got, wanted)
    assert float(np.abs(got - unlike).mean()) > 0.01
    np.testing.assert_array_equal(radiance(both), radiance(alone))  # with footprints


def test_textures_of_one_material_have_each_its_set() -> None:
    """Light that is reflected and light that is emitted add up."""
    texels = np.random.default_rng(9).integers(0, 256, (2, 8, 8, 3)).astype(np.uint8)
    textures = [Texture(name="noise", texels=texels[k], uv_set=k) for k in range(2)]
    sun = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi,) * 3)
    mesh = replace(SQUARE, uvs=np.hstack([FIRST, SECOND]))

    def shown(base: Triple, glow: Triple) -> Float32:
        look = Material(name="noise", base_color=base, emission=glow, textures=TextureSet(0, None, 1))
        return radiance(scene_of([mesh], materials=[look], textures=textures, lights=[sun]))

    base, glow = shown(WHITE, BLACK), shown(BLACK, WHITE)
    np.testing.assert_allclose(shown(WHITE, WHITE), base + glow, atol=1e-6)
    assert min(float(np.std(base)), float(np.std(glow))) > 0.05


def holes() -> Texture:
    """White; alpha is 0 in the left half and 255 in the right one."""
    alpha = np.zeros((8, 8), np.uint8)
    alpha[:, 4:] = 255
    return Texture(name="holes", texels=np.full((8, 8, 3), 255, np.uint8), alpha=alpha, wrap=("clamp", "clamp"))


@pytest.mark.parametrize("mode", ["mask", "blend"])
def test_a_surface_is_not_there_where_its_alpha_is_0(mode: str) -> None:
    look = Material(name="leaf", base_color=BLACK, textures=TextureSet(0), alpha_mode=mode)  # type: ignore[arg-type]
    image = traced_image(scene_of([SQUARE], materials=[look], textures=[holes()], sky=BEHIND), AHEAD)
    edge = EDGE // 16  # half a texel on both sides of the middle is a ramp
    np.testing.assert_array_equal(image.radiance[:, : EDGE // 2 - edge], 1.0)
    np.testing.assert_array_equal(image.objects[:, : EDGE // 2 - edge], 0)
    np.testing.assert_array_equal(image.radiance[:, EDGE // 2 + edge :], 0.0)
    np.testing.assert_array_equal(image.objects[:, EDGE // 2 + edge :], 1)


@pytest.mark.parametrize(("cutoff", "there"), [(0.39, True), (0.41, False)])
def test_a_mask_without_texture_goes_by_its_factor(cutoff: float, there: bool) -> None:
    look = Material(name="leaf", base_color=BLACK, alpha_mode="mask", alpha=0.4, alpha_cutoff=cutoff)
    image = traced_image(scene_of([SQUARE], materials=[look], sky=BEHIND), AHEAD)
    assert (image.objects == int(there)).all()


def test_light_falls_through_what_is_not_there() -> None:
    """The shadow of a half mask: light from above, the mask between it and the wall, behind the eye."""
    white = Material(name="wall", base_color=WHITE)
    leaf = Material(name="leaf", base_color=WHITE, textures=TextureSet(0), alpha_mode="mask")
    sun = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(math.pi,) * 3)
    near = view((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=2 * math.degrees(math.atan(0.5)))
    scene = scene_of(
        [SQUARE, replace(SQUARE, material=1)], [instance(0), instance(1, at=(0.0, 0.0, 3.0))],
        materials=[white, leaf], textures=[holes()], lights=[sun], sky=BLACK_SKY,
    )  # fmt: skip
    values = radiance(scene, near)
    np.testing.assert_allclose(values[:, : EDGE // 2 - 1], 1.0, atol=1e-6)
    np.testing.assert_array_equal(values[:, EDGE // 2 + 1 :], 0.0)


@pytest.mark.parametrize("alpha", [0.25, 0.9])
def test_blending_is_right_in_the_mean(alpha: float) -> None:
    """Two panes of black glass before a white sky: (1 - alpha)^2 is left, within four standard errors."""
    pane = Material(name="pane", base_color=BLACK, alpha_mode="blend", alpha=alpha)
    scene = scene_of([SQUARE], [instance(0), instance(0, at=(0.0, 0.0, -0.5), scale=2.0)], materials=[pane], sky=BEHIND)
    values = radiance(scene)[..., 0]
    left = (1.0 - alpha) ** 2
    assert values.mean() == pytest.approx(left, abs=4 * math.sqrt(left * (1 - left) / values.size))
    assert set(np.unique(values)) == {0.0, 1.0}


@pytest.mark.usefixtures("compiled_only")
def test_blending_changes_from_path_to_path() -> None:
    """The same place again and again, by other numbers: each pixel's mean is the blend, not one decision."""
    pane = Material(name="pane", base_color=BLACK, alpha_mode="blend", alpha=0.5)
    values = on_paths(scene_of([SQUARE], materials=[pane], sky=BEHIND), 64)[..., 0]
    assert values.min() > 0.15
    assert values.max() < 0.85
    assert values.mean() == pytest.approx(0.5, abs=0.01)


def test_an_alpha_mode_that_never_hides_anything_costs_nothing() -> None:
    look = Material(name="pane", base_color=WHITE, alpha_mode="blend", alpha=1.0)
    image = traced_image(scene_of([SQUARE], materials=[look], sky=BEHIND), AHEAD)
    assert (image.objects == 1).all()
