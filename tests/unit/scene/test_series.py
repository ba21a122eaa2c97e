"""Steps of series are found, timed, loaded ahead of their time and dropped behind it; what is missing is said."""

from __future__ import annotations

import json
from pathlib import Path
from threading import get_ident
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from wall.config.scene import SceneConfig
from wall.core.data import Float64
from wall.core.errors import SceneError
from wall.scene.build import Scene, build
from wall.scene.picking import Picking
from wall.scene.series import KEPT, StepMeshes

STEPS = np.arange(60.0).reshape(5, 4, 3)  # positions of 4 points at 5 steps


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The same steps as files of a pattern, every 10 from 20 on, as lists of ParaView's, and as one array."""
    for number, step in enumerate(STEPS):
        np.save(tmp_path / f"p_{20 + 10 * number:04}.npy", step)
    names, times = [f"p_{20 + 10 * k:04}.npy" for k in range(5)], (0.5, 0.75, 1.5, 2.0, 3.0)
    rows = "".join(f'<DataSet timestep="{time}" file="{name}"/>' for name, time in zip(names, times, strict=True))
    (tmp_path / "all.pvd").write_text(f'<VTKFile type="Collection"><Collection>{rows}</Collection></VTKFile>')
    files = [{"name": name, "time": time} for name, time in zip(names, times, strict=True)]
    (tmp_path / "p.npy.series").write_text(json.dumps({"file-series-version": "1.0", "files": files}))
    np.save(tmp_path / "whole.npy", STEPS)
    return tmp_path


def scene_with(folder: Path, **keys: Any) -> Scene:
    return build(SceneConfig.model_validate({"data": [{"type": "points", "radius": 0.1, **keys}]}), folder)


def points_shown(scene: Scene, time: float) -> Float64:
    """(n, 3) world positions of the points of the only step that has an extent."""
    moment = scene.at(time)
    (row,) = np.flatnonzero(np.abs(np.linalg.det(moment.world_from_object[:, :3, :3])) > 0.0)
    (step,), matrix = moment.steps, moment.world_from_object[row]
    assert row == step
    vertices = scene.meshes[0].vertices if step == 0 else scene.series[0].meshes.mesh(step).vertices
    return np.asarray(vertices @ matrix[:3, :3].T + matrix[:3, 3])


@pytest.mark.parametrize(
    ("file", "series", "shown"),
    [
        ("p_*.npy", {"step_s": 0.5}, [(0.0, 0), (0.49, 0), (0.5, 1), (1.9, 3), (99.0, 4)]),
        ("whole.npy", {"step_s": 0.5, "start_s": 2.0, "loop": True}, [(0.0, 1), (2.0, 0), (4.4, 4), (4.5, 0)]),
        ("all.pvd", {}, [(0.0, 0), (0.25, 1), (0.99, 1), (1.0, 2), (1.5, 3), (2.5, 4), (9.0, 4)]),
        ("p.npy.series", {"loop": True}, [(2.5, 4), (3.49, 4), (3.5, 0), (3.75, 1)]),
        ("all.pvd", {"step_s": 1.0}, [(0.99, 0), (1.0, 1)]),
    ],
)
def test_a_step_is_shown_where_its_file_says_from_its_time_on(
    folder: Path, file: str, series: dict[str, Any], shown: list[tuple[float, int]]
) -> None:
    scene = scene_with(folder, file=file, series=series, scale=2.0, position=(1.0, 0.0, 0.0))
    for time, step in shown:
        np.testing.assert_allclose(points_shown(scene, time), 2.0 * STEPS[step] + [1.0, 0.0, 0.0], rtol=1e-6)


def test_steps_are_one_object_to_whoever_looks_at_the_scene(folder: Path) -> None:
    """It has a name without the number, is picked where its step is, and is as many spheres as one step."""
    scene = scene_with(folder, file="p_*.npy", series={"step_s": 1.0})
    assert {instance.name for instance in scene.instances} == {"p"}
    assert scene.triangles == 4
    picking, ahead = Picking(scene), np.array([0.0, 0.0, -1.0])
    for time, step in ((0.0, 0), (3.0, 3), (1.0, 1)):
        found = picking.first(scene.at(time), STEPS[step, 2] - 5.0 * ahead, ahead)
        assert found == (pytest.approx(4.9, abs=1e-5), step)


def test_the_next_step_is_loaded_ahead_and_those_behind_are_dropped() -> None:
    """The last three of many; a step that was asked for before is not loaded twice; nothing is loaded by who asks."""
    loaded: list[int] = []

    def load(step: int) -> Any:
        assert get_ident() != here
        loaded.append(step)
        return step

    here, meshes = get_ident(), StepMeshes(load, 100, loops=True)
    for step in (1, 2, 3, 3, 4, 99):
        assert meshes.mesh(step) == step
        assert len(meshes.kept) <= KEPT
    assert meshes.kept == (5, 99)  # ahead of 99 is the first, which the scene has
    assert meshes.mesh(50) == 50
    assert meshes.kept == (50, 51)
    assert loaded[:6] == [1, 2, 3, 4, 5, 99]
    meshes.times = 2
    for step in (10, 60, 11, 61):
        assert meshes.mesh(step) == step
    assert meshes.kept == (11, 12, 61, 62)
    assert loaded.count(11) == loaded.count(61) == 1, "of two times, neither drops what is ahead of the other"


def test_an_error_of_a_later_step_names_its_file(folder: Path) -> None:
    (folder / "p_0040.npy").write_bytes(b"no array")
    scene = scene_with(folder, file="p_*.npy", series={"step_s": 1.0})
    with pytest.raises(SceneError, match=r"p_0040\.npy: cannot be read as npy"):
        points_shown(scene, 2.0)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"file": "q_*.npy", "series": {"step_s": 1.0}}, r"scene.data\[0\].file: no file is called .*q_\*.npy"),
        ({"file": "p_*.npy", "series": {"step_s": 1.0}}, r"lacks the numbers 40; there are 4, from 20 to 60"),
        ({"file": "whole.npy", "series": {}}, r"data\[0\].series.step_s: absent"),
        ({"file": "all.pvd", "series": {}}, r"all.pvd: names files that are not there: p_0040.npy \(time 1.5\)"),
        ({"file": "whole.npy", "radius": {"column": 7}, "series": {"step_s": 1.0}}, r"7: whole.npy has no such column"),
        ({"file": "p_0020.npy", "series": {"step_s": 1.0}}, r"p_0020.npy is 4x3, wanted \(steps, points, columns\)"),
        ({"file": "a.csv", "series": {"step_s": 1.0}}, r"file = 'a.csv': no series of steps; wanted a pattern"),
        ({"file": "none.pvd", "series": {}}, r"none.pvd: there is no such file"),
        ({"file": "bad.pvd", "series": {}}, r"bad.pvd: cannot be read as a list of steps, ParseError"),
    ],
)
def test_what_is_wrong_with_a_series_is_said(folder: Path, keys: dict[str, Any], said: str) -> None:
    (folder / "p_0040.npy").unlink()
    (folder / "bad.pvd").write_text("<VTKFile>")
    with pytest.raises(SceneError, match=said):
        scene_with(folder, **keys)


def test_colours_of_a_series_need_a_range(folder: Path) -> None:
    with pytest.raises(ValidationError, match=r"is absent, and a series is not read whole to find it"):
        scene_with(folder, file="p_*.npy", series={"step_s": 1.0}, color_by={"column": 0})
