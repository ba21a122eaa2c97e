"""Rectangles and discs that shine: as meshes of the scene, and by their light against closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scenes import BLACK, BLACK_SKY, instance, keyframes, quad, traced_image, view, with_every_feature

from wall.config.scene import SceneConfig
from wall.core.data import Float64
from wall.scene.area_lights import area_light
from wall.scene.build import Scene, assemble, build
from wall.scene.lights import scaled
from wall.scene.model import AreaLight, Light, Material, PointLight, Source, SpotLight
from wall.scene.needs import needs
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import LEAST_POINTS, LEAST_SPOTS, make_tracer_scene

RECTANGLE = {"type": "rectangle", "center": (0.0, 1.0, 0.0), "edges": ((2.0, 0.0, 0.0), (0.0, 0.0, 2.0)),
             "radiance": (3.0, 2.0, 1.0)}  # fmt: skip
DISC = {
    "type": "disc",
    "center": (0.0, 1.0, 0.0),
    "normal": (0.0, -2.0, 0.0),
    "radius": 0.5,
    "radiance": (3.0, 2.0, 1.0),
}
BELOW: tuple[float, float, float] = (0.0, -9.0, 0.0)
DARK = [PointLight(position=BELOW, intensity=BLACK)] * LEAST_POINTS + [
    SpotLight(position=BELOW, direction=BELOW, intensity=BLACK, inner_angle=10.0, outer_angle=20.0)
] * LEAST_SPOTS


def light_of(described: dict[str, Any]) -> AreaLight:
    (config,) = SceneConfig.model_validate({"source": "courtyard", "lights": (described,)}).lights or ()
    assert config.type in ("rectangle", "disc")
    return area_light(config)


def floor_under(*lights: Light, depth: int | None = 1, **more: Any) -> Scene:
    """A grey floor at y = 0."""
    return assemble(
        Source(
            meshes=(quad(100.0, 100.0),),
            materials=(Material(name="floor", base_color=(0.5, 0.5, 0.5)),),
            instances=(instance(0, turn=("x", -90.0)),),
            lights=lights,
            sky=BLACK_SKY,
            path_depth=depth,
            **more,
        )
    )


def floor_lit_by(described: dict[str, Any]) -> Scene:
    """That floor under an area light, for a tracer that other tests compile too: with every feature, or, where a tree
    chooses among a disc's many triangles, with trees of all lights, as in tracing/test_light_tree.py."""
    light = light_of(described)
    return floor_under(light, *DARK) if described["type"] == "disc" else with_every_feature(floor_under(light))


def floor_light(scene: Scene, sweeps: int = 16) -> Float64:
    """Mean radiance of the floor at the origin."""
    seen = view((0.0, 0.3, 0.001), (0.0, 0.0, 0.0), pixels=(64, 64), fov=0.1)
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5), axis=-1).reshape(-1, 2).astype(np.float32)
    got = [tracer.trace(xy, 0.0, number)[0]["radiance"].astype(np.float64) for number in range(sweeps)]
    return np.asarray(np.mean(got, axis=(0, 1)), np.float64)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize(("width", "depth"), [(2.0, 2.0), (0.3, 3.0)])
def test_a_rectangle_gives_the_light_of_its_form_factor(width: float, depth: float) -> None:
    """Four times the form factor of a patch to a parallel rectangle with a corner above it:
    (A atan B + C atan D) / 2 pi, with x = w / 2h, y = d / 2h."""
    x, y = width / 2, depth / 2
    a, c = x / math.sqrt(1 + x * x), y / math.sqrt(1 + y * y)
    quarter = (a * math.atan(y / math.sqrt(1 + x * x)) + c * math.atan(x / math.sqrt(1 + y * y))) / (2 * math.pi)
    edges = ((width, 0.0, 0.0), (0.0, 0.0, depth))  # x to z: its front is below
    got = floor_light(floor_lit_by({**RECTANGLE, "edges": edges}))
    np.testing.assert_allclose(got, 0.5 * 4 * quarter * np.array([3.0, 2.0, 1.0]), rtol=0.01)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("radius", [0.1, 1.0, 5.0])
def test_a_disc_gives_the_light_of_its_form_factor(radius: float) -> None:
    """A patch below the middle of a parallel disc at height h: r^2 / (r^2 + h^2)."""
    got = floor_light(floor_lit_by({**DISC, "radius": radius}))
    np.testing.assert_allclose(got, 0.5 * radius**2 / (radius**2 + 1) * np.array([3.0, 2.0, 1.0]), rtol=0.01)


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize("described", [RECTANGLE, DISC])
def test_front_and_both_sides(described: dict[str, Any]) -> None:
    turned = {"edges": ((0.0, 0.0, 2.0), (2.0, 0.0, 0.0))} if described is RECTANGLE else {"normal": (0.0, 1.0, 0.0)}
    down, up, both = (
        floor_light(floor_lit_by({**described, **more}), 1)[0] for more in ({}, turned, {**turned, "sides": "both"})
    )
    assert up == 0.0
    assert down > 0.05
    assert both == pytest.approx(down, rel=0.2)


def test_a_disc_is_a_polygon_of_its_area_about_its_normal() -> None:
    light = light_of({**DISC, "normal": (1.0, 2.0, -2.0), "radius": 3.0})
    normal = sum(np.cross(a, b) / 2 for a, b in zip(light.corners, np.roll(light.corners, -1, axis=0), strict=True))
    np.testing.assert_allclose(normal, 9 * math.pi * np.array([1.0, 2.0, -2.0]) / 3.0, rtol=1e-12)
    assert np.abs(np.linalg.norm(light.corners, axis=1) / 3.0 - 1.0).max() < 0.001


def test_area_lights_are_objects_seen_under_direct_light_too(tmp_path: Path) -> None:
    scene = build(SceneConfig.model_validate({"source": "cornell", "lights": (RECTANGLE, DISC)}), tmp_path)
    plain = build(SceneConfig.model_validate({"source": "cornell", "lights": ()}), tmp_path)
    assert [i.name for i in scene.instances[-2:]] == ["light 0", "light 1"]
    assert len(scene.instances) == len(plain.instances) + 2
    assert (scene.radius, scene.center.tolist()) == (plain.radius, plain.center.tolist())  # cameras frame the model
    direct = floor_under(light_of(RECTANGLE), depth=None)
    image = traced_image(direct, view((0.0, -3.0, 0.001), (0.0, 0.0, 0.0), pixels=(4, 4), fov=1.0))
    assert (image.objects == 1).all()
    below = traced_image(direct, view((0.0, 0.5, 0.001), (0.0, 2.0, 0.0), pixels=(4, 4), fov=1.0))
    np.testing.assert_allclose(below.radiance, np.broadcast_to((3.0, 2.0, 1.0), (4, 4, 3)))
    assert (below.objects == 2).all()
    assert not needs(direct).emitters
    assert needs(floor_under(light_of(RECTANGLE))).emitters


def test_an_animation_names_lights_by_their_number_and_moves_those_with_an_area() -> None:
    lights = (PointLight(position=(5.0, 5.0, 5.0), intensity=(1.0, 1.0, 1.0)), light_of(RECTANGLE), light_of(DISC))
    moves = (keyframes((0.0, 1.0, 0.0), (2.0, 3.0, 4.0), light=2), keyframes((5.0, 5.0, 5.0), (6.0, 7.0, 8.0), light=0))
    moment = floor_under(*lights, animation=moves).at(1.0)
    np.testing.assert_allclose(moment.world_from_object[2][:3, 3], (2.0, 3.0, 4.0))
    np.testing.assert_allclose(moment.world_from_object[1][:3, 3], (0.0, 1.0, 0.0))
    np.testing.assert_allclose(moment.point_positions, [(6.0, 7.0, 8.0)])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({**RECTANGLE, "edges": ((1.0, 0.0, 0.0), (2.0, 0.0, 0.0))}, "the edges span no area"),
        ({**RECTANGLE, "edges": ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))}, "the edges span no area"),
        ({**DISC, "radius": 0.0}, "greater than 0"),
        ({**DISC, "normal": (0.0, 0.0, 0.0)}, "has no direction"),
    ],
)
def test_wrong_area_lights_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        light_of(wrong)


def test_an_area_light_in_a_scaled_world_grows_with_it_and_keeps_its_radiance() -> None:
    before = light_of(RECTANGLE)
    after = scaled(before, 3.0)
    assert isinstance(after, AreaLight)
    np.testing.assert_allclose(after.corners + after.position, 3.0 * (before.corners + before.position))
    assert after.radiance == before.radiance
