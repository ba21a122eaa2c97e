"""Points of every format become the same spheres; what a file lacks is said with what it has."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from wall.config.scene import SceneConfig
from wall.core.color_maps import ColorMap
from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.core.errors import SceneError
from wall.scene.build import Scene, build
from wall.scene.points import LEAST_ORDERED, sphere_points

ROWS = np.array([[0.0, 1.0, 2.0, 0.5, 10.0], [4.0, -1.0, 0.0, 0.25, 20.0], [2.0, 0.0, 6.0, 0.125, 30.0]])
NAMES = ("x", "y", "z", "mass", "heat")


def _npy(path: Path) -> None:
    np.save(path, ROWS)


def _structured(path: Path) -> None:
    np.save(path, np.rec.fromarrays(ROWS.T, names=",".join(NAMES)))


def _npz(path: Path) -> None:
    np.savez(path, time=3.5, positions=ROWS[:, :3], mass=ROWS[:, 3], heat=ROWS[:, 4])


def _csv(path: Path) -> None:
    np.savetxt(path, ROWS, delimiter=",", header="made by hand\n" + ", ".join(NAMES), comments="# ")


def _xyz(path: Path) -> None:
    path.write_text("".join("  ".join(map(str, row)) + "\n" for row in ROWS.tolist()))


def _ply(path: Path) -> None:
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(ROWS)}"]
    text = "\n".join([*head, *(f"property float {name}" for name in NAMES), "end_header", ""])
    path.write_bytes(text.encode() + ROWS.astype("<f4").tobytes())


def scene_with(folder: Path, **keys: Any) -> Scene:
    return build(SceneConfig.model_validate({"data": [{"type": "points", "radius": 0.1, **keys}]}), folder)


def spheres_of(scene: Scene) -> Float64:
    """(n, 4) of the only object, world."""
    (mesh,), (instance,) = scene.meshes, scene.instances
    assert mesh.spheres is not None
    matrix = instance.world_from_object
    centres = mesh.spheres[:, :3] @ matrix[:3, :3].T + matrix[:3, 3]
    return np.column_stack([centres, mesh.spheres[:, 3] * np.cbrt(np.linalg.det(matrix[:3, :3]))])


@pytest.mark.parametrize(
    ("name", "write", "mass"),
    [
        ("a.npy", _npy, 3),
        ("b.npy", _structured, "mass"),
        ("a.npz", _npz, "mass"),
        ("a.csv", _csv, "mass"),
        ("a.xyz", _xyz, 3),
        ("a.ply", _ply, "mass"),
    ],
)
def test_every_format_gives_the_same_spheres(
    tmp_path: Path, name: str, write: Callable[[Path], None], mass: str | int
) -> None:
    write(tmp_path / name)
    radius, color_by = {"column": mass, "factor": 2.0}, {"column": mass, "color_map": {"range": [0.0, 1.0]}}
    scene = scene_with(tmp_path, file=name, radius=radius, color_by=color_by)
    assert spheres_of(scene) == pytest.approx(np.column_stack([ROWS[:, :3], 2.0 * ROWS[:, 3]]))
    assert scene.instances[0].name == scene.materials[0].name == name[0]
    np.testing.assert_array_equal(scene.meshes[0].colors, ColorMap(range=(0.0, 1.0)).colors(ROWS[:, 3]))


def test_points_are_turned_scaled_and_moved(tmp_path: Path) -> None:
    _npy(tmp_path / "a.npy")
    scene = scene_with(tmp_path, file="a.npy", up="z", scale=10.0, position=(1.0, 2.0, 3.0), radius=0.5)
    x, y, z = ROWS[:, :3].T
    assert spheres_of(scene) == pytest.approx(
        np.column_stack([10.0 * x + 1.0, 10.0 * z + 2.0, -10.0 * y + 3.0, np.full(3, 5.0)])
    )


@pytest.mark.parametrize(("most", "kind"), [(255, np.uint8), (1.0, np.float32)])
def test_colours_of_the_file_are_srgb(tmp_path: Path, most: float, kind: type) -> None:
    shares = np.array([[1.0, 0.0, 0.2], [0.4, 1.0, 0.6], [0.0, 0.8, 1.0]])
    values = (most * shares).astype(kind)
    rows = np.rec.fromarrays([*ROWS.T[:3], *values.T], names="x,y,z,red,green,blue")
    np.save(tmp_path / "a.npy", rows)
    found = scene_with(tmp_path, file="a.npy").meshes[0].colors
    assert found == pytest.approx(srgb_decoded(shares), abs=1e-6)
    assert scene_with(tmp_path, file="a.npy", color=(0.1, 0.2, 0.3)).meshes[0].colors is None


def test_points_that_cannot_be_drawn_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = ROWS.copy()
    rows[0, 1], rows[1, 3] = np.nan, 0.0
    np.save(tmp_path / "a.npy", rows)
    scene = scene_with(tmp_path, file="a.npy", radius={"column": 3}, color_by={"column": 4})
    assert spheres_of(scene) == pytest.approx(rows[2:, :4])
    assert scene.meshes[0].colors is not None
    assert len(scene.meshes[0].colors) == 1
    assert "a: 2 points have no finite coordinates or no radius above 0, and are left out" in scene.notes
    rows[2, 0] = np.inf
    np.save(tmp_path / "a.npy", rows)
    with pytest.raises(SceneError, match="3 points, none with finite coordinates"):
        scene_with(tmp_path, file="a.npy", radius={"column": 3})


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"file": "a.csv", "color_by": {"column": "heta"}}, "'heta': a.csv has no such column; did you mean 'heat'?"),
        ({"file": "a.csv", "radius": {"column": 5}}, r"scene.data\[0\].radius.column = 5: .* there are x, y, z, mass"),
        ({"file": "none.csv"}, "none.csv: there is no such file"),
        (
            {"file": "a.las"},
            "no known kind of points, known are .ply, .npy, .npz, .csv, .txt, .xyz, and built in galaxy",
        ),
        ({"file": "text.npy"}, "text.npy: cannot be read as npy, it holds no arrays of numbers"),
        ({"file": "half.npz"}, "half.npz: cannot be read as npz, it is damaged or cut short"),
        ({"file": "words.xyz"}, "words.xyz: cannot be read as xyz, ValueError: no row of numbers"),
        ({"file": "pickles.csv"}, "pickles.csv: cannot be read as csv, ValueError: could not convert string 'pickle'"),
        ({"file": "flat.npy"}, "flat.npy: has the columns 0, 1; wanted at least three"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    _csv(tmp_path / "a.csv")
    (tmp_path / "a.las").write_bytes(b"LASF")
    (tmp_path / "text.npy").write_text("no array")
    np.savez(tmp_path / "whole.npz", x=ROWS[:, 0], y=ROWS[:, 1], z=ROWS[:, 2])
    (tmp_path / "half.npz").write_bytes((tmp_path / "whole.npz").read_bytes()[:200])
    (tmp_path / "words.xyz").write_text("some words\n")
    (tmp_path / "pickles.csv").write_text("x,y,z\n1,2,3\n1,2,pickle\n")
    np.save(tmp_path / "flat.npy", ROWS[:, :2])
    with pytest.raises(SceneError, match=said):
        scene_with(tmp_path, **keys)


def test_a_scene_shows_something_and_points_have_one_colour() -> None:
    with pytest.raises(ValidationError, match="names nothing to show"):
        SceneConfig()
    with pytest.raises(ValidationError, match="both a color and a color_by"):
        scene_with(Path(), file="galaxy", color=(1.0, 1.0, 1.0), color_by={"column": "speed"})


def test_many_points_lie_along_a_curve_with_their_colours() -> None:
    """Neighbours in memory are neighbours in space: far nearer than points of a cloud are to each other."""
    chance = np.random.default_rng(5)
    spheres = chance.random((4 * LEAST_ORDERED, 4)) + 1.0
    mesh = sphere_points(spheres, material=0, colors=spheres[:, :3])
    found: Float32 | None = mesh.spheres
    assert found is not None
    np.testing.assert_allclose(mesh.vertices + np.array(mesh.origin), mesh.colors, atol=1e-6)
    np.testing.assert_allclose(np.sort(found[:, 3]), np.sort(spheres[:, 3]), rtol=1e-6)
    assert np.linalg.norm(np.diff(mesh.vertices, axis=0), axis=1).mean() < 0.1  # 0.66 of random points
