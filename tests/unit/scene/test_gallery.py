"""The measuring scenes are sound: solids are solid, nothing runs into anything, the camera rests when it is said to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import load
from wall.core.data import Float64
from wall.geometry.cameras import View, resolve_view
from wall.geometry.expanding import expand
from wall.scene.build import Scene, build
from wall.scene.builtin.gallery import gallery, gallery_mirrors
from wall.scene.model import Mesh

FOLDER = Path(__file__).parents[3] / "configs" / "measure"
SECONDS, STEP_S = 4.0, 0.05
CLOSEST_M = 0.02  # more than the sagging of any mesh's facets
SOLIDS = {"column", "knot", "ball", "vase", "globe", "crate", "ring"}


def shown(name: str) -> tuple[Scene, View]:
    loaded = load(FOLDER / f"{name}.yaml")
    scene = build(loaded.config.scene, FOLDER)
    return scene, resolve_view(loaded, expand(loaded.config.wall), scene.center, scene.radius)


def speeds(view: View, times: Float64) -> Float64:
    """Metres a second of the eye over the 0.1 ms after each time."""
    eyes = [[view.camera_at(t + ahead).position for ahead in (0.0, 1e-4)] for t in times.tolist()]
    return np.asarray(np.linalg.norm(np.diff(np.array(eyes), axis=1)[:, 0], axis=1) / 1e-4)


def placed_vertices(scene: Scene, time: float) -> dict[str, Float64]:
    poses = scene.at(time).world_from_object
    return {
        one.name: scene.meshes[one.mesh].vertices @ pose[:3, :3].T + pose[:3, 3]
        for one, pose in zip(scene.instances, poses, strict=True)
    }


def globe_middle(scene: Scene, time: float) -> Float64:
    """(3,) world: the sphere is modelled about its object's origin (the mean of vertices counts its seam twice)."""
    row = next(k for k, one in enumerate(scene.instances) if one.name == "globe")
    found: Float64 = scene.at(time).world_from_object[row, :3, 3]
    return found


def volume(mesh: Mesh) -> float:
    """Signed, by the divergence theorem: positive where triangles wind counter-clockwise seen from outside."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


def test_solids_wind_outwards() -> None:
    volumes = {mesh.name: volume(mesh) for mesh in gallery().meshes if mesh.name in SOLIDS}

    assert set(volumes) == SOLIDS
    assert {name for name, found in volumes.items() if found <= 0.0} == set()


def test_what_stands_touches_the_floor() -> None:
    scene, _ = shown("orbit")
    lowest = {name: points[:, 1].min() for name, points in placed_vertices(scene, 0.0).items()}

    for name in ("railing", "column 0", "globe", "ball", "vase", "crate"):
        assert lowest[name] == pytest.approx(0.0, abs=1e-6), name


def test_four_objects_are_mirrors_in_one_scene_and_none_in_the_other() -> None:
    def mirrors(source):  # type: ignore[no-untyped-def]
        return {i.name for i in source.instances if source.materials[source.meshes[i.mesh].material].mirror > 0.0}

    assert mirrors(gallery()) == set()
    assert mirrors(gallery_mirrors()) == {"ball", "knot", "vase", "ring"}


def test_gallery_has_some_ten_thousand_triangles_and_is_the_same_every_time() -> None:
    one, two = gallery(), gallery()

    assert 10_000 < sum(len(mesh.triangles) for mesh in one.meshes) < 60_000
    for mesh, again in zip(one.meshes, two.meshes, strict=True):
        np.testing.assert_array_equal(mesh.vertices, again.vertices)
    for texture, same in zip(one.textures, two.textures, strict=True):
        np.testing.assert_array_equal(texture.texels, same.texels)


@pytest.mark.parametrize("name", ["shadows", "mirrors"])
def test_moving_objects_run_into_nothing(name: str) -> None:
    scene, _ = shown(name)
    for time in np.arange(0.0, SECONDS + STEP_S, STEP_S).tolist():
        points = placed_vertices(scene, time)
        del points["floor"]
        globe = points.pop("globe")
        middle = globe_middle(scene, time)
        radius = np.linalg.norm(globe - middle, axis=1).max()
        for other, theirs in points.items():
            gap = np.linalg.norm(theirs - middle, axis=1).min() - radius
            assert other == "crate" or gap > CLOSEST_M, (other, time, gap)
        crate = points.pop("crate")
        low, high = crate.min(axis=0), crate.max(axis=0)
        assert np.linalg.norm(np.clip(middle, low, high) - middle) > radius + CLOSEST_M, time  # sphere and box
        for other, theirs in points.items():
            assert not ((theirs > low) & (theirs < high)).all(axis=1).any(), (other, time)


def test_globe_keeps_to_its_circle_while_it_spins() -> None:
    scene, _ = shown("shadows")
    middles = np.array([globe_middle(scene, t) for t in np.linspace(0.0, SECONDS, 17).tolist()])
    radii = np.hypot(middles[:, 0], middles[:, 2])

    np.testing.assert_allclose(radii, np.hypot(1.35, 0.65), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "rests", "moves"),
    [
        ("orbit", [(1.501, 2.499), (3.201, 6.0)], [(0.0, 1.49, 60.0), (2.5, 3.19, 90.0)]),
        ("mirrors", [(1.501, 2.499), (4.0, 6.0)], [(0.0, 1.49, 45.0), (2.5, 3.99, 45.0)]),
    ],
)
def test_camera_rests_and_moves_as_the_file_says(
    name: str, rests: list[tuple[float, float]], moves: list[tuple[float, float, float]]
) -> None:
    _, view = shown(name)
    across = float(np.hypot(*np.array(view.camera_at(0.0).position)[[0, 2]]))

    for start, end in rests:
        assert speeds(view, np.linspace(start, end - 2e-4, 60)).max() == 0.0, (start, end)
    for start, end, degrees in moves:
        wanted = np.radians(degrees) * across
        np.testing.assert_allclose(speeds(view, np.linspace(start, end, 60)), wanted, rtol=0.04)  # a cubic's circle


@pytest.mark.parametrize("name", ["orbit", "shadows", "light", "mirrors"])
def test_only_what_the_file_names_moves(name: str) -> None:
    scene, view = shown(name)
    early, late = scene.at(0.3), scene.at(0.9)
    changed = (early.world_from_object != late.world_from_object).any(axis=(1, 2))
    moving = {one.name for one, moved in zip(scene.instances, changed, strict=True) if moved}

    assert moving == ({"globe", "knot", "crate"} if name in ("shadows", "mirrors") else set())
    assert np.array_equal(early.point_positions, late.point_positions) == (name != "light")
    assert (view.camera_at(0.3) == view.camera_at(0.9)) == (name in ("shadows", "light"))


def test_the_walker_keeps_its_pace_and_meets_no_column() -> None:
    scene, view = shown("walk")
    columns = {one.name: one.world_from_object[[0, 2], 3] for one in scene.instances if one.name.startswith("column")}
    times = np.linspace(0.0, SECONDS - 1e-3, 200)
    eyes = np.array([view.camera_at(t).position for t in times.tolist()])[:, [0, 2]]

    assert len(columns) == 114
    assert speeds(view, times).mean() == pytest.approx(1.4, rel=0.05)
    assert min(np.linalg.norm(eyes - at, axis=1).min() for at in columns.values()) > 0.3
