"""Spot lights: the falloff that glTF's KHR_lights_punctual gives, under direct light and on paths."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    directions,
    instance,
    keyframes,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
    with_every_feature,
)

from wall.config.scene import SceneConfig
from wall.core.errors import ConfigError
from wall.scene.build import assemble
from wall.scene.model import Material, PointLight, Source, SpotLight
from wall.scene.needs import needs

SPOT = SpotLight(
    position=(0.3, 0.2, 2.0), direction=(0.0, 0.6, -0.8), intensity=(3.0, 2.0, 1.0), inner_angle=15.0, outer_angle=40.0
)
SEEN = view((0, 0, 5), (0, 0.9, 0), pixels=(48, 48), fov=50.0)


def khr_share(angle: float, inner: float, outer: float) -> float:
    """The reference code of the extension."""
    scale = 1.0 / max(0.001, math.cos(inner) - math.cos(outer))
    attenuation = min(max(math.cos(angle) * scale - math.cos(outer) * scale, 0.0), 1.0)
    return attenuation * attenuation


@pytest.mark.parametrize(("inner", "outer"), [(15.0, 40.0), (0.0, 90.0), (0.0, 5.0), (30.0, 30.5)])
@pytest.mark.parametrize("depth", [None, 1])
def test_spots_fade_as_gltf_says(compiled_only: None, inner: float, outer: float, depth: int | None) -> None:
    """L = albedo / pi * I share(angle) cos / r^2 on a plane, at every pixel's own point; no light outside the cone."""
    spot = replace(SPOT, inner_angle=inner, outer_angle=outer)
    scene = replace(scene_of([quad(50.0, 50.0)], lights=[spot]), path_depth=depth)
    got = traced_image(with_every_feature(scene), SEEN)
    rays = directions(SEEN)
    hit = np.array([0.0, 0.0, 5.0]) + rays * (5.0 / -rays[..., 2:3])
    away = hit - spot.position
    r = np.linalg.norm(away, axis=-1)
    angles = np.arccos(away @ np.array(spot.direction) / r)
    share = np.vectorize(khr_share)(angles, math.radians(inner), math.radians(outer))
    expected = 0.5 / math.pi * share * 2.0 / r**3
    tolerance = 2e-5 / max(0.001, math.cos(math.radians(inner)) - math.cos(math.radians(outer)))
    np.testing.assert_allclose(got.radiance, expected[..., None] * np.array(spot.intensity), atol=tolerance)
    assert (got.radiance[..., 0] > 0.01 * expected.max()).any()
    if outer < 90.0:
        assert (got.radiance[np.degrees(angles) > outer + 0.1] == 0.0).all()
        assert got.cost.shadow < 48 * 48  # none is traced to where it does not shine


def test_a_spot_casts_the_shadow_of_a_point_and_paths_agree(compiled_only: None) -> None:
    """Within its inner angle a spot is the point light; its shadows are the same ones."""
    wide = replace(SPOT, direction=(0.0, 0.0, -1.0), inner_angle=80.0, outer_angle=85.0)
    point = PointLight(position=wide.position, intensity=wide.intensity)
    meshes, placed = [quad(6.0, 6.0), sphere_mesh()], [instance(0), instance(1, at=(0.0, 0.0, 0.8), scale=0.3)]
    scenes = [with_every_feature(scene_of(meshes, placed, lights=[light])) for light in (wide, point)]
    direct = [traced_image(scene, SEEN).radiance for scene in scenes]
    np.testing.assert_allclose(direct[0], direct[1], rtol=1e-6)
    path = traced_image(replace(scenes[0], path_depth=1), SEEN)
    np.testing.assert_allclose(path.radiance, direct[0], rtol=2e-5, atol=1e-6)


def test_an_animation_moves_a_spot_and_leaves_its_direction() -> None:
    source = Source(
        meshes=(quad(50.0, 50.0),),
        materials=(Material(name="grey", base_color=(0.5, 0.5, 0.5)),),
        instances=(instance(0),),
        lights=(PointLight(position=(9.0, 9.0, 9.0), intensity=(1.0, 1.0, 1.0)), SPOT),
        animation=(keyframes((0.3, 0.2, 2.0), (1.3, -0.8, 3.0), light=1),),
    )
    scene = assemble(source)
    np.testing.assert_allclose(scene.at(1.0).spot_positions, [(1.3, -0.8, 3.0)])
    np.testing.assert_allclose(scene.at(1.0).point_positions, [(9.0, 9.0, 9.0)])
    later = replace(SEEN, event=replace(SEEN.event, scene_time=1.0))
    still = assemble(replace(source, animation=(), lights=(source.lights[0], replace(SPOT, position=(1.3, -0.8, 3.0)))))
    np.testing.assert_allclose(traced_image(scene, later).radiance, traced_image(still, SEEN).radiance, rtol=1e-6)
    assert not needs(scene).relighting
    assert needs(
        assemble(replace(source, lights=source.lights[:1], animation=(keyframes((0, 0, 0), light=0),)))
    ).relighting


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"inner_angle": 45.0}, "is not below outer_angle, 45"),
        ({"inner_angle": 30.0, "outer_angle": 20.0}, "is not below outer_angle, 20"),
        ({"outer_angle": 91.0}, "less than or equal to 90"),
        ({"direction": (0.0, 0.0, 0.0)}, "has no direction"),
    ],
)
def test_wrong_spots_are_refused(wrong: dict[str, object], said: str) -> None:
    spot = {"type": "spot", "position": (0.0, 1.0, 0.0), "direction": (0.0, -1.0, 0.0), "intensity": (1.0, 1.0, 1.0)}
    with pytest.raises((ValueError, ConfigError), match=said):
        SceneConfig.model_validate({"source": "courtyard", "lights": ({**spot, **wrong},)})
