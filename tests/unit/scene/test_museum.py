"""The museum is sound: solids are closed and turned outward, nothing floats, and the sun comes in as it is said to."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.builtin import museum as built
from wall.scene.builtin.museum import museum
from wall.scene.builtin.museum_images import PARQUET_CELLS, parquet, weave
from wall.scene.model import DirectionalLight, Mesh, Source, SpotLight

SHEETS = {"floor", "laylight", "tablecloth", "hills", "sea", "discs", "dawn"}  # with one side, or cloth


@pytest.fixture(scope="module")
def source() -> Source:
    return museum()


def is_sheet(name: str) -> bool:
    return name in SHEETS or name.startswith("curtain")


def corners(mesh: Mesh) -> Float64:
    """(t, 3, 3) float64, object space."""
    return mesh.vertices.astype(np.float64)[mesh.triangles]


def world(source: Source, name: str) -> Float64:
    """(v, 3) of an object."""
    instance = next(one for one in source.instances if one.name == name)
    matrix = instance.world_from_object
    return np.asarray(source.meshes[instance.mesh].vertices @ matrix[:3, :3].T + matrix[:3, 3])


def test_solids_are_closed(source: Source) -> None:
    """Edges by position: as often one way as the other. Boxes that touch share edges of four triangles."""
    for mesh in source.meshes:
        if is_sheet(mesh.name):
            continue
        _, place = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)
        a = place.reshape(-1)[mesh.triangles].astype(np.int64)
        edges = np.concatenate([a[:, [0, 1]], a[:, [1, 2]], a[:, [2, 0]]])
        count = len(mesh.vertices)
        there, back = np.sort(edges @ [count, 1]), np.sort(edges @ [1, count])
        assert np.array_equal(there, back), mesh.name


def test_solids_are_turned_outward(source: Source) -> None:
    for mesh in source.meshes:
        if not is_sheet(mesh.name):
            a, b, c = corners(mesh).transpose(1, 0, 2)
            assert float((a * np.cross(b, c)).sum()) > 0.0, mesh.name


def test_no_triangle_is_without_area_and_normals_have_unit_length(source: Source) -> None:
    for mesh in source.meshes:
        a, b, c = corners(mesh).transpose(1, 0, 2)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-12, mesh.name
        if mesh.normals is not None:
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)


def test_it_is_the_same_every_time(source: Source) -> None:
    again = museum()
    for mesh, other in zip(source.meshes, again.meshes, strict=True):
        np.testing.assert_array_equal(mesh.vertices, other.vertices)
    for texture, same in zip(source.textures, again.textures, strict=True):
        np.testing.assert_array_equal(texture.texels, same.texels)


def test_everything_is_in_the_room_and_what_stands_touches_the_floor(source: Source) -> None:
    thick = built.WALL
    for instance in source.instances:
        points = world(source, instance.name)
        assert (points >= np.array([built.LEFT, 0.0, built.BACK]) - thick - 1e-5).all(), instance.name
        assert (points <= np.array([built.RIGHT, built.CEILING, built.FRONT]) + thick + 1e-5).all(), instance.name
    for name in ("plinth", "bench frame"):
        assert world(source, name)[:, 1].min() == pytest.approx(0.0, abs=1e-6), name
    table = world(source, "tablecloth")[:, 1].max()
    for name in ("vase", "glass ball"):
        assert 0.0 < world(source, name)[:, 1].min() - table < 0.004, name


def test_things_are_made_of_what_the_picture_needs(source: Source) -> None:
    of = {one.name: source.materials[source.meshes[one.mesh].material] for one in source.instances}

    assert of["knot"].metallic == 1.0
    assert of["vase"].transmission == of["glass ball"].transmission == 1.0
    assert max(of["globe 0"].emission) > 0.0
    assert all(of[name].textures.base_color is not None for name in ("floor", "tablecloth", "curtain 0 left", "hills"))
    assert source.path_depth == built.PATH_DEPTH


def test_light_0_is_the_sun_and_nothing_moves(source: Source) -> None:
    assert source.lights is not None
    sun, *others = source.lights

    assert isinstance(sun, DirectionalLight)
    assert sun.angular_diameter > 0.0
    assert np.linalg.norm(sun.direction) == pytest.approx(1.0)
    assert all(isinstance(light, SpotLight) for light in others)
    assert source.animation == ()


def test_the_window_lets_the_sun_in_between_its_bars(source: Source) -> None:
    """Of rays from an opening's plane towards the sun, none meets anything but bars, which cover a fifth at most."""
    towards = np.array(built.SUN_DIRECTION)
    y, z = np.meshgrid(np.linspace(0.6, 3.2, 40), np.linspace(-0.5, 0.7, 40) + built.WINDOWS_Z[1])
    origins = np.stack([np.full(y.size, built.LEFT + 0.01), y.ravel(), z.ravel()], 1)
    stopped = np.zeros(len(origins), bool)
    for instance in source.instances:
        points = world(source, instance.name)
        if points[:, 0].min() > built.LEFT + 0.01:
            continue
        hit = hits(origins, towards, points[source.meshes[instance.mesh].triangles])
        assert instance.name.startswith("window ") or not hit.any(), instance.name
        stopped |= hit

    assert 0.02 < stopped.mean() < 0.2


def test_the_polished_knot_stands_in_the_shade_of_the_window_wall(source: Source) -> None:
    pier = next(mesh for mesh in source.meshes if mesh.name == "window wall")

    assert hits(world(source, "knot")[::16], np.array(built.SUN_DIRECTION), corners(pier)).all()


def hits(origins: Float64, direction: Float64, triangles: Float64) -> NDArray[np.bool_]:
    """(n,) bool: which rays meet any of the triangles (t, 3, 3); Moeller and Trumbore 1997."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(direction, f)
    det = (e * p).sum(1)
    kept = np.abs(det) > 1e-12
    a, e, f, p, det = a[kept], e[kept], f[kept], p[kept], det[kept]
    s = origins[:, None] - a
    u = (s * p).sum(2) / det
    q = np.cross(s, e)
    v, t = q @ direction / det, (q * f).sum(2) / det
    return ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6)).any(axis=1)


def test_textures_that_repeat_have_no_seam() -> None:
    """A plank of parquet goes on over the edge: neighbours across it are as alike as neighbours elsewhere."""
    planks = parquet(8, (0.4, 0.3, 0.2)).astype(float)
    threads = weave(64, (0.9, 0.1, 0.1), (0.2, 0.1, 0.6), 16).astype(float)

    assert planks.shape == (8 * PARQUET_CELLS, 8 * PARQUET_CELLS, 3)
    for texels in (planks, threads):
        for axis in (0, 1):
            steps = np.abs(np.roll(texels, -1, axis) - texels).mean(axis=2)
            seam, rest = (
                np.take(steps, -1, axis).mean(),
                np.take(steps, range(7, steps.shape[axis] - 1, 8), axis).mean(),
            )
            assert seam < 1.5 * rest
