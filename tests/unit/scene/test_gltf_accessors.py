"""Vertices of glTF files as integers, and meshes that one node places many times."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import TRIANGLE, data_uri, document, loaded
from numpy.typing import NDArray
from PIL import Image

from wall.core.data import Float64
from wall.core.errors import SceneError
from wall.scene.build import assemble
from wall.scene.model import Source

KINDS = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "f": 5126}  # glTF's numbers of dtypes
PLAIN = {"name": "plain", "pbrMetallicRoughness": {"metallicFactor": 0}}
HALF = 0.5**0.5


def pixel() -> str:
    """A grey image of one pixel, as a URI."""
    data = io.BytesIO()
    Image.new("RGB", (1, 1), (128, 128, 255)).save(data, "PNG")
    return data_uri(data.getvalue(), "image/png")


def added(found: dict[str, Any], rows: NDArray[Any], **more: Any) -> int:
    """The number of a new accessor of these rows; each row begins at a multiple of four bytes, as glTF wants it."""
    stride = -(-rows.shape[1] * rows.itemsize // 4) * 4
    data = b"".join(row.tobytes().ljust(stride, b"\0") for row in rows)
    found["buffers"].append({"byteLength": len(data), "uri": data_uri(data)})
    found["bufferViews"].append({"buffer": len(found["buffers"]) - 1, "byteLength": len(data), "byteStride": stride})
    accessor = {"bufferView": len(found["bufferViews"]) - 1, "componentType": KINDS[rows.dtype.char]}
    found["accessors"].append({**accessor, "count": len(rows), "type": f"VEC{rows.shape[1]}", **more})
    return len(found["accessors"]) - 1


def corners(source: Source) -> Float64:
    """(instances, 3, 3) of the triangle of each instance in the world."""
    scene = assemble(source)
    vertices = [scene.meshes[instance.mesh].vertices.astype(np.float64) for instance in scene.instances]
    poses = scene.at(0.0).world_from_object
    return np.array([own @ pose[:3, :3].T + pose[:3, 3] for own, pose in zip(vertices, poses, strict=True)])


@pytest.mark.parametrize("material", [True, False])
@pytest.mark.parametrize(("dtype", "normalized"), [("b", True), ("B", True), ("h", True), ("H", True), ("h", False)])
def test_positions_of_integers_are_as_large_as_they_stand_for(
    tmp_path: Path, dtype: str, normalized: bool, material: bool
) -> None:
    """c / (2^bits - 1), of signed ones c / (2^(bits - 1) - 1); those that are not normalized stand for themselves."""
    whole = np.iinfo(dtype).max
    found = document([PLAIN], extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    positions = (TRIANGLE[0] * whole).astype(dtype)
    number = added(found, positions, normalized=normalized, min=[0, 0, 0], max=[int(whole), int(whole), 0])
    primitive = found["meshes"][0]["primitives"][0]
    primitive["attributes"]["POSITION"] = number
    if not material:
        del primitive["material"], found["materials"]
    source = loaded(tmp_path, found)
    np.testing.assert_allclose(corners(source)[0], TRIANGLE[0] * (1 if normalized else whole), rtol=1e-6, atol=1e-6)
    assert source.notes == ()


def test_normals_of_bytes_are_directions_and_no_number_is_below_minus_one(tmp_path: Path) -> None:
    """Both -127 and -128 are -1: the first two normals are one direction, (-1, 0, -1) over its length."""
    found = document([PLAIN])
    normals = np.array([[-128, 0, -127], [-127, 0, -127], [0, 127, 0]], np.int8)
    found["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = added(found, normals, normalized=True)
    (mesh,) = loaded(tmp_path, found).meshes
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, [[-HALF, 0, -HALF], [-HALF, 0, -HALF], [0, 1, 0]], atol=1e-7)


@pytest.mark.parametrize(("normalized", "whole"), [(True, 65535.0), (False, 1.0)])
def test_texture_coordinates_of_integers_are_normalized_where_the_file_says_so(
    tmp_path: Path, normalized: bool, whole: float
) -> None:
    found = document([{**PLAIN, "normalTexture": {"index": 0}}], images=[{"uri": pixel()}], textures=[{"source": 0}])
    rows = np.array([[0, 3], [65535, 0], [2, 1]], np.uint16)
    found["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = added(found, rows, normalized=normalized)
    (mesh,) = loaded(tmp_path, found).meshes
    assert mesh.uvs is not None
    np.testing.assert_allclose(mesh.uvs, np.stack([rows[:, 0] / whole, 1.0 - rows[:, 1] / whole], 1), rtol=1e-6)


def instanced(folder: Path, values: dict[str, NDArray[Any]], **node: Any) -> Source:
    """A triangle that its node places many times."""
    found = document([PLAIN], extensionsUsed=["EXT_mesh_gpu_instancing"])
    given = {
        name: added(found, rows, **({} if rows.dtype == np.float32 else {"normalized": True}))
        for name, rows in values.items()
    }
    found["nodes"][0] |= {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": given}}, **node}
    return loaded(folder, found)


def test_every_instance_of_a_node_is_drawn_within_it(tmp_path: Path) -> None:
    """Corner c of instance k stands at the node's 2 (translation + rotation (scale c)) + (0, 0, 5)."""
    translations = np.array([[0, 0, 0], [10, 0, 0], [0, 7, 0]], np.float32)
    quarter = np.array([[0, 0, 0, 127], [0, 0, 90, 90], [0, 0, 0, 127]], np.int8)  # about z
    scales = np.array([[1, 1, 1], [1, 1, 1], [3, 2, 1]], np.float32)
    source = instanced(
        tmp_path, {"TRANSLATION": translations, "ROTATION": quarter, "SCALE": scales},
        name="tree", translation=[0, 0, 5], scale=[2, 2, 2],
    )  # fmt: skip
    turned = TRIANGLE[0][:, [1, 0, 2]] * (-1, 1, 1)
    within = np.array([TRIANGLE[0], turned, TRIANGLE[0] * (3, 2, 1)]) + translations[:, None]
    np.testing.assert_allclose(corners(source), 2 * within + (0, 0, 5), atol=1e-6)
    assert [instance.name for instance in source.instances] == ["tree"] * 3
    assert len(source.meshes) == 1
    assert source.notes == ()


def test_an_instance_that_is_squashed_flat_is_left_out_alone(tmp_path: Path) -> None:
    source = instanced(tmp_path, {"SCALE": np.array([[1, 1, 1], [0, 1, 1], [1, math.nan, 1]], np.float32)}, name="tree")
    assert len(source.instances) == 1
    assert source.notes == ("object 'tree': its placement squashes it flat or is not finite; left out",)


def test_instances_of_different_counts_are_refused(tmp_path: Path) -> None:
    values = {"TRANSLATION": np.zeros((3, 3), np.float32), "SCALE": np.ones((2, 3), np.float32)}
    with pytest.raises(SceneError, match=r"the instances of node 'tree' have \[2, 3\] values, wanted one each"):
        instanced(tmp_path, values, name="tree")
