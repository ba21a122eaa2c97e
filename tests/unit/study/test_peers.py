"""`wall measure peers`: what all renderers draw, what was shown at which moment, and what is compared."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import load
from wall.core.colour import srgb_decoded
from wall.core.errors import ConfigError, RunError
from wall.roles.plan import make_layout, make_plan
from wall.scene.build import assemble
from wall.scene.model import Instance, Material, Mesh, Source
from wall.study.peers import process, sweep
from wall.study.peers.command import wanted_of
from wall.study.peers.cpu_meter import rate
from wall.study.peers.drawing import AMBIENT, DIRECT, TOWARDS_LIGHT, at_rest, drawn, triangles_of
from wall.study.peers.held import Held
from wall.study.peers.renderers import PEERS, Pose
from wall.study.peers.runs import blocks_rmse

CONFIG = """\
version: 1
scene: {source: spheres}
wall: {grid: {columns: 2, rows: 1, pixels: [16, 12], size: [0.4, 0.3]}}
views: [{camera: {position: [2.6, 3, 7.1], target: [0, 0.6, -0.3]}, path: {type: orbit, period_s: 8}}]
"""
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def picture(code: int) -> np.ndarray:
    return np.full((2, 3, 3), code, np.uint8)


def test_a_picture_is_shown_from_its_completion_to_that_of_the_next():
    held = Held([0.1, 0.2, 0.3, 0.4, 0.9], (3, 2))
    held.take(picture(1), 0.15)
    held.take(picture(2), 0.3)
    held.take(picture(3), 0.35)
    held.end()
    assert [int(image[0, 0, 0]) for image in held.shown] == [0, 1, 2, 3, 3]
    assert held.completed == [0.15, 0.3, 0.35]


class Still:
    """A renderer that draws nothing, and remembers from where."""

    device = "none"

    def draw(self, pose: Pose) -> np.ndarray:
        return picture(7)


@pytest.mark.parametrize("ahead", [False, True])
def test_pictures_are_drawn_until_the_time_is_over(ahead):
    held, asked = Held([0.0, 10.0], (3, 2)), []
    job = {"seconds": 0.02, "refresh_hz": 1000.0}
    process._draw(Still(), held, time.monotonic(), job, ahead=ahead, pose=asked.append)
    assert [int(image[0, 0, 0]) for image in held.shown] == [0, 7]
    assert len(held.completed) == len(asked) > 0
    assert asked == sorted(asked)


def test_blocks_see_colours_and_not_where_edges_fall():
    fine = np.indices((8, 8)).sum(axis=0)[..., None] % 2 * np.full(3, 255)
    one, other = fine.astype(np.uint8), (255 - fine).astype(np.uint8)
    assert blocks_rmse(one, other, 1) == 1.0
    assert blocks_rmse(one, other, 8) == 0.0
    assert blocks_rmse(np.full((9, 8, 3), 10, np.uint8), np.full((9, 8, 3), 61, np.uint8), 8) == pytest.approx(0.2)


def test_cpu_time_is_that_between_two_moments():
    rows = [(10.0, 1.0), (11.0, 3.0), (13.0, 3.0)]
    assert rate(rows, 10.5, 11.0) == pytest.approx(2.0)
    assert rate(rows, 10.0, 13.0) == pytest.approx(2.0 / 3.0)
    assert rate([], 0.0, 1.0) == 0.0


@pytest.mark.parametrize(("turn", "light"), [(1.0, AMBIENT + DIRECT * TOWARDS_LIGHT[2]), (-1.0, AMBIENT)])
def test_light_is_in_the_colours_of_corners(turn, light):
    mesh = Mesh(name="one", vertices=CORNERS, triangles=np.array([[0, 1, 2]], np.uint32), material=0)
    pose = np.diag([turn, 1.0, turn, 1.0])  # half a turn about y shows the light its back
    scene = assemble(
        Source(
            meshes=(mesh,), materials=(Material(name="grey", base_color=(0.5,) * 3),), textures=(),
            instances=(Instance(name="one", mesh=0, world_from_object=pose),),
        )
    )  # fmt: skip
    found = triangles_of(scene)
    assert found.positions.tolist() == (CORNERS * [turn, 1, turn]).tolist()
    assert srgb_decoded(found.codes / 255.0) == pytest.approx(np.full((3, 3), 0.5 * light), abs=0.005)


def test_what_is_drawn_is_a_scene_of_the_same_triangles_from_the_same_camera(tmp_path: Path):
    path = tmp_path / "wall.yaml"
    path.write_text(CONFIG, encoding="utf-8")
    loaded, triangles = drawn(load(path), (32, 24), tmp_path)
    plan, before = make_plan(make_layout(loaded)), make_plan(make_layout(load(path)))
    assert plan.scene.triangles == len(triangles.corners) == before.scene.triangles
    assert not plan.scene.lights
    assert not plan.scene.animated
    mesh = plan.scene.meshes[0]
    assert mesh.colors == pytest.approx(srgb_decoded(triangles.codes.astype(np.float32) / 255.0), abs=1e-6)
    camera, same = plan.view.camera_at(1.3), before.view.camera_at(1.3)
    assert camera.origin() == pytest.approx(same.origin())
    still = make_plan(make_layout(at_rest(loaded, 1.3))).view
    for at in (0.0, 5.0):
        assert still.camera_at(at).origin() == pytest.approx(camera.origin())
        assert still.camera_at(at).rotation() == pytest.approx(camera.rotation(), abs=1e-6)


def test_renderers_are_named_or_refused_and_missing_ones_named(tmp_path: Path, monkeypatch):
    path = tmp_path / "wall.yaml"
    path.write_text(CONFIG, encoding="utf-8")
    wanted = wanted_of([path], "adaptive,*_ahead", (32, 24))
    assert wanted.renderers == ("adaptive", "mitsuba_ahead", "open3d_ahead", "pyvista_ahead")
    monkeypatch.setattr(sweep, "find_spec", lambda module: None if module == "open3d" else object())
    assert sweep.missing(wanted.renderers) == {"open3d_ahead": "open3d"}
    with pytest.raises(ConfigError, match=r"--renderers blender: unknown.*accepted: "):
        wanted_of([path], "blender", (32, 24))


def test_points_are_refused():
    spheres = np.array([[0, 0, 0, 1.0]], np.float32)
    mesh = Mesh(
        name="dots", vertices=spheres[:, :3], triangles=np.zeros((0, 3), np.uint32), material=0, spheres=spheres
    )
    scene = assemble(
        Source(
            meshes=(mesh,), materials=(Material(name="grey"),), textures=(),
            instances=(Instance(name="dots", mesh=0, world_from_object=np.eye(4)),),
        )
    )  # fmt: skip
    with pytest.raises(RunError, match="'dots': points are not drawn"):
        triangles_of(scene)


def test_peers_are_in_the_extra():
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    assert all(f'"{known.package}>=' in text for known in PEERS.values())
