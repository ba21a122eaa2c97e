"""Animations of glTF files: where objects are at a time, against the file's own transforms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import data_uri, document, loaded

from wall.core.data import Float64
from wall.scene.build import assemble
from wall.scene.model import Source

HALF = 0.5**0.5


def animated(folder: Path, nodes: list[dict[str, Any]], channels: list[dict[str, Any]], **more: Any) -> Source:
    """One triangle for each node with a mesh; channels with their times and values."""
    found = document([{"name": "plain", "pbrMetallicRoughness": {"metallicFactor": 0}}], nodes=nodes, **more)
    found["scenes"] = [{"nodes": [0]}]
    data, samplers = b"", []
    for channel in channels:
        for values, kind in ((channel["times"], "SCALAR"), (channel["values"], f"VEC{len(channel['values'][0])}")):
            raw = np.asarray(values, np.float32).tobytes()
            found["bufferViews"].append({"buffer": 1, "byteOffset": len(data), "byteLength": len(raw)})
            found["accessors"].append(
                {
                    "bufferView": len(found["bufferViews"]) - 1, "componentType": 5126,
                    "count": len(values), "type": kind,
                }
            )  # fmt: skip
            data += raw
        count = len(found["accessors"])
        samplers.append({"input": count - 2, "output": count - 1, "interpolation": channel.get("how", "LINEAR")})
    found["buffers"].append({"byteLength": len(data), "uri": data_uri(data)})
    targets = [{"sampler": k, "target": {"node": c["node"], "path": c["path"]}} for k, c in enumerate(channels)]
    found["animations"] = [{"channels": targets, "samplers": samplers}]
    return loaded(folder, found)


def pose(source: Source, time: float, instance: int = 0) -> Float64:
    return assemble(source).at(time).world_from_object[instance]


def corner(source: Source, time: float, instance: int = 0) -> Float64:
    """(3,) where the file's vertex (1, 0, 0) is then."""
    mesh = source.meshes[source.instances[instance].mesh]
    own = mesh.vertices[np.argmax(mesh.vertices[:, 0])].astype(np.float64)
    found: Float64 = (pose(source, time, instance) @ [*own, 1.0])[:3]
    return found


SPIN = [[0, 0, 0, 1], [0, 0, HALF, HALF], [0, 0, 1, 0], [0, 0, HALF, -HALF], [0, 0, 0, -1]]  # about z, a turn


def test_a_wheel_turns_about_its_axle_on_a_moving_car(tmp_path: Path) -> None:
    nodes = [
        {"children": [1]},
        {"translation": [0, 0, 5], "children": [2]},
        {"mesh": 0, "scale": [2, 2, 2]},
    ]
    source = animated(
        tmp_path, nodes,
        [
            {"node": 0, "path": "translation", "times": [0, 4], "values": [[0, 0, 0], [8, 0, 0]]},
            {"node": 2, "path": "rotation", "times": [0, 1, 2, 3, 4], "values": SPIN},
        ],
    )  # fmt: skip
    assert source.notes == ()
    for time in (0.0, 0.5, 1.7, 3.9):
        angle = math.pi / 2 * time
        wanted = np.array([2 * time, 0, 5]) + 2 * np.array([math.cos(angle), math.sin(angle), 0.0])
        np.testing.assert_allclose(corner(source, time), wanted, atol=2e-3)
    np.testing.assert_allclose(corner(source, 4.0 + 0.5), corner(source, 0.5), atol=1e-9)  # over and over


def test_what_turns_about_a_far_point_goes_round(tmp_path: Path) -> None:
    """Two keys a quarter turn apart: between them the object is on the arc, within the chord of a thirtieth second."""
    nodes = [{"children": [1]}, {"mesh": 0, "translation": [10, 0, 0]}]
    turn = {"node": 0, "path": "rotation", "times": [0, 1], "values": SPIN[:2]}
    source = animated(tmp_path, nodes, [turn])
    for time in np.linspace(0.0, 0.99, 23):
        assert math.hypot(*corner(source, float(time))) == pytest.approx(11.0, rel=4e-4)


@pytest.mark.parametrize(
    ("how", "values", "wanted"),
    [
        ("STEP", [[0, 0, 0], [1, 2, 3]], [0, 0, 0]),
        ("LINEAR", [[0, 0, 0], [1, 2, 3]], [0.25, 0.5, 0.75]),
        # value, tangent 4 behind the first key: h00 p0 + h10 m0 = 0 + (1/64 - 2/16 + 1/4) 4 = 9/16
        ("CUBICSPLINE", [[9, 9, 9], [0, 0, 0], [4, 0, 0], [0, 0, 0], [0, 0, 0], [9, 9, 9]], [9 / 16, 0, 0]),
    ],
)
def test_keys_are_interpolated_as_the_file_says(tmp_path: Path, how: str, values: Any, wanted: Any) -> None:
    move = {"node": 0, "path": "translation", "times": [0, 1], "values": values, "how": how}
    source = animated(tmp_path, [{"mesh": 0}], [move])
    np.testing.assert_allclose(corner(source, 0.25) - [1, 0, 0], wanted, atol=2e-3)


def test_an_object_that_is_stretched_stays_and_is_noted(tmp_path: Path) -> None:
    grow = {"node": 0, "path": "scale", "times": [0, 1], "values": [[1, 1, 1], [2, 1, 1]]}
    source = animated(tmp_path, [{"mesh": 0, "name": "balloon"}], [grow])
    assert source.notes == ("model.gltf: its animation stretches 'balloon', which stays as it is",)
    assert not source.motions


def test_two_wheels_of_one_mesh_turn_each_about_its_own_axle(tmp_path: Path) -> None:
    nodes = [{"children": [1, 2]}, {"mesh": 0, "translation": [-5, 0, 0]}, {"mesh": 0, "translation": [5, 0, 0]}]
    spins = [{"node": k, "path": "rotation", "times": [0, 1, 2, 3, 4], "values": SPIN} for k in (1, 2)]
    source = animated(tmp_path, nodes, spins)
    x = sorted(float(corner(source, 1.0, k)[0]) for k in (0, 1))
    np.testing.assert_allclose(x, [-5, 5], atol=1e-6)


@pytest.mark.parametrize("times", [[0, 0], [1, 0], [0, math.nan]])
def test_times_that_do_not_grow_are_noted(tmp_path: Path, times: list[float]) -> None:
    move = {"node": 0, "path": "translation", "times": times, "values": [[0, 0, 0], [1, 2, 3]]}
    source = animated(tmp_path, [{"mesh": 0}], [move])
    assert not source.motions
    assert (
        "its animation cannot be read (ValueError: 2 values for 2 times, wanted one each, at times that grow)"
        in source.notes[0]
    )
