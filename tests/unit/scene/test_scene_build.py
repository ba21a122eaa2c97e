"""Building: defaults, what a configuration replaces, names, bounds, moments in time."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import trimesh

from wall.config.scene import SceneConfig
from wall.core.errors import SceneError
from wall.scene.bounds import framing_sphere
from wall.scene.build import Scene, build
from wall.scene.lights import STUDIO_SKY, default_lights
from wall.scene.needs import Needs, needs

HERE = Path(".")
DIRECTIONAL = {"type": "directional", "direction": (0.0, 2.0, 0.0), "irradiance": (3.0, 3.0, 3.0)}
POINT = {"type": "point", "position": (1.0, 0.0, 0.0), "intensity": (5.0, 5.0, 5.0)}


def configured(folder: Path, **keys: object) -> Scene:
    return build(SceneConfig.model_validate(keys), folder)


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """Two boxes as objects of one OBJ: a door about (5, 0, 0) in two parts, a sill about the origin."""
    parts = {"door_wood": (5.0, 0.5, 0.0), "door_glass": (5.0, -0.5, 0.0), "sill": (0.0, 0.0, 0.0)}
    lines, first = [], 1
    for name, middle in parts.items():
        shape = trimesh.creation.box()
        lines += [f"o {name}"] + ["v {} {} {}".format(*v) for v in shape.vertices + middle]
        lines += ["f {} {} {}".format(*(f + first)) for f in shape.faces]
        first += len(shape.vertices)
    (tmp_path / "house.obj").write_text("\n".join(lines) + "\n")
    return tmp_path


def test_model_gets_the_default_key_light_and_studio_sky(house: Path) -> None:
    scene = configured(house, source="house.obj")
    assert (scene.directional_lights, scene.point_lights, scene.sky) == (default_lights(), (), STUDIO_SKY)
    assert not scene.animated


def test_configuration_replaces_lights_sky_and_animation() -> None:
    sky = {"zenith": (1, 2, 3), "horizon": (4, 5, 6), "ground": (7, 8, 9)}
    sky = {key: tuple(float(v) for v in value) for key, value in sky.items()}
    scene = configured(HERE, source="courtyard", lights=(DIRECTIONAL, POINT), sky=sky, animation=())
    assert scene.sky.horizon == (4.0, 5.0, 6.0)
    assert scene.directional_lights[0].direction == (0.0, 1.0, 0.0)  # given as (0, 2, 0)
    assert scene.point_lights[0].position == (1.0, 0.0, 0.0)
    assert not scene.animated


def test_no_lights_at_all_is_a_choice() -> None:
    scene = configured(HERE, source="courtyard", lights=(), animation=())
    assert (scene.point_lights, scene.directional_lights) == ((), ())
    assert scene.at(1.0).directions.shape == (0, 3)


def test_parts_in_one_frame_turn_about_their_common_centre(house: Path) -> None:
    spin = {"object": "door*", "type": "spin", "axis": (0.0, 0.0, 1.0), "period_s": 4.0}
    scene = configured(house, source="house.obj", animation=(spin,))
    moment = scene.at(2.0)  # half a turn about (5, 0, 0): the parts change places
    middles = {i.name: m[:3, 3] for i, m in zip(scene.instances, moment.world_from_object, strict=True)}
    np.testing.assert_allclose(middles["door_wood"], [5.0, -0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(middles["door_glass"], [5.0, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(middles["sill"], [0.0, 0.0, 0.0], atol=1e-9)


def test_lights_are_animated_by_their_index_in_the_configuration() -> None:
    around = {"type": "orbit", "center": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0), "period_s": 4.0}
    tracks = ({"light": 0, **around}, {"light": 1, **around})
    moment = configured(HERE, source="courtyard", lights=(DIRECTIONAL, POINT), animation=tracks).at(1.0)
    np.testing.assert_allclose(moment.directions, [[-1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(moment.point_positions, [[0.0, 1.0, 0.0]], atol=1e-12)


def test_unknown_object_is_refused_with_the_nearest_name(house: Path) -> None:
    spin = {"object": "door_wod", "type": "spin", "period_s": 4.0}
    with pytest.raises(SceneError, match=r"animation\[0\]\.object = 'door_wod'.*did you mean 'door_wood'"):
        configured(house, source="house.obj", animation=(spin,))


def test_light_that_is_not_there_is_refused(house: Path) -> None:
    orbit = {"light": 3, "type": "orbit", "center": (0.0, 0.0, 0.0), "period_s": 4.0}
    with pytest.raises(SceneError, match=r"animation\[0\]\.light = 3: the scene has 1 lights"):
        configured(house, source="house.obj", animation=(orbit,))


def test_moments_do_not_disturb_each_other() -> None:
    scene = configured(HERE, source="courtyard")
    first = scene.at(1.0).world_from_object.copy()
    assert not np.array_equal(scene.at(2.0).world_from_object, first)
    np.testing.assert_array_equal(scene.at(1.0).world_from_object, first)


def test_bounds_hold_every_vertex_and_touch_one(house: Path) -> None:
    scene = configured(house, source="house.obj")
    np.testing.assert_allclose(scene.center, [2.5, 0.0, 0.0], atol=1e-7)
    assert scene.radius == pytest.approx(math.sqrt(3.0**2 + 1.0 + 0.25), abs=1e-6)


def test_very_many_vertices_are_bounded_by_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = configured(HERE, source="courtyard")
    exact = framing_sphere(scene.meshes, scene.instances)
    monkeypatch.setattr("wall.scene.bounds.EXACT_VERTICES", 10)
    boxes = framing_sphere(scene.meshes, scene.instances)
    assert exact[1] <= boxes[1] < 1.5 * exact[1]


@pytest.mark.parametrize("scale", [1e-30, 1e-9, 1e9, 1e30])
def test_model_of_extreme_size_becomes_radius_one_with_a_note(tmp_path: Path, scale: float) -> None:
    shape = trimesh.creation.icosphere(subdivisions=1).apply_scale(scale)
    rows = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in shape.vertices]
    (tmp_path / "a.obj").write_text("\n".join(rows + ["f {} {} {}".format(*(f + 1)) for f in shape.faces]))
    scene = configured(tmp_path, source="a.obj")
    assert scene.radius == pytest.approx(1.0, abs=1e-6)
    assert any("scaled" in note for note in scene.notes)
    assert np.isfinite(scene.at(0.0).world_from_object).all()


def test_model_a_million_units_away_is_placed_there_in_float64(tmp_path: Path) -> None:
    shape = trimesh.creation.icosphere(subdivisions=1)
    rows = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in shape.vertices + np.array([1e6, 0, -1e6])]
    (tmp_path / "a.obj").write_text("\n".join(rows + ["f {} {} {}".format(*(f + 1)) for f in shape.faces]))
    scene = configured(tmp_path, source="a.obj")
    np.testing.assert_allclose(scene.center, [1e6, 0.0, -1e6], atol=1e-6)
    assert scene.radius == pytest.approx(1.0, abs=1e-6)
    assert np.abs(scene.meshes[0].vertices).max() < 1.1
    assert scene.meshes[0].origin == (0.0, 0.0, 0.0)


def test_courtyard_is_small_lively_and_the_same_every_time() -> None:
    one, two = (configured(HERE, source="courtyard") for _ in range(2))
    stored = sum(len(mesh.triangles) for mesh in one.meshes)
    assert 20_000 < stored < 60_000
    assert one.radius < 7.0
    moving = (one.at(0.0).world_from_object != one.at(1.0).world_from_object).any(axis=(1, 2)).sum()
    assert moving >= 15
    for mesh, again in zip(one.meshes, two.meshes, strict=True):
        np.testing.assert_array_equal(mesh.vertices, again.vertices)
    np.testing.assert_array_equal(one.at(7.3).world_from_object, two.at(7.3).world_from_object)


def test_forest_has_more_than_two_million_triangles_from_few_stored_ones() -> None:
    scene = configured(HERE, source="forest")
    assert scene.triangles > 2_000_000
    assert sum(len(mesh.triangles) for mesh in scene.meshes) < 100_000
    assert len(scene.instances) > 1_000
    assert needs(scene).instancing


def test_needs_of_the_courtyard_and_of_a_plain_model(house: Path) -> None:
    assert needs(configured(HERE, source="courtyard")) == Needs(
        textures=True,
        metallic_roughness_textures=False,
        emission_textures=False,
        normal_textures=False,
        texture_edges=False,
        uv_sets=False,
        alpha=False,
        vertex_colors=True,
        points=False,
        curves=False,
        point_colors=False,
        smooth_normals=True,
        mirrors=True,
        point_lights=True,
        spot_lights=False,
        directional_lights=True,
        suns=False,
        environment=False,
        instancing=True,
        animation=True,
        emission=True,
        change_detection=True,
        paths=False,
        occlusion=False,
        thin_glass=False,
        solid_glass=False,
        absorption=False,
        interfaces=False,
        emitters=False,
        relighting=True,
        cuts=False,
    )
    plain = needs(configured(house, source="house.obj"))
    assert [each.name for each in fields(plain) if getattr(plain, each.name)] == ["directional_lights"]


def display(radiance: float) -> float:
    """sRGB value of a linear one, IEC 61966-2-1."""
    return 12.92 * radiance if radiance <= 0.0031308 else 1.055 * min(radiance, 1.0) ** (1 / 2.4) - 0.055


def sky_share(up: float) -> float:
    """Irradiance over pi of the studio sky (green) on a normal whose y is `up`, by summing a million directions."""
    chance = np.random.default_rng(1).normal(size=(1_000_000, 3))
    directions = chance / np.linalg.norm(chance, axis=1, keepdims=True)
    horizon, zenith, ground = STUDIO_SKY.horizon[1], STUDIO_SKY.zenith[1], STUDIO_SKY.ground[1]
    y = directions[:, 1]
    radiance = horizon + (zenith - horizon) * np.maximum(y, 0) + (ground - horizon) * np.maximum(-y, 0)
    cosine = np.maximum(directions @ [math.sqrt(1 - up**2), up, 0.0], 0.0)
    return float((radiance * cosine).mean() * 4.0)  # 4 pi / pi


@pytest.mark.parametrize(
    ("up", "cosine", "expected"), [(1.0, 0.0, 0.47), (-1.0, 0.0, 0.36), (0.75, 1.0, 0.85), (0.3, 0.5, 0.69)]
)
def test_default_light_exposes_white_surfaces_as_its_docstring_says(up: float, cosine: float, expected: float) -> None:
    key = default_lights()[0].irradiance[1] / math.pi
    assert display(0.8 * (key * cosine + sky_share(up))) == pytest.approx(expected, abs=0.01)
