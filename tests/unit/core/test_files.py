"""Files that others name are read, and pipes, devices and huge ones are not waited for."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from pathlib import Path

import pytest
from gltf_documents import document, loaded

from wall.config.loading import load
from wall.core.errors import ConfigError, SceneError
from wall.core.files import read_file
from wall.operators.blend_mask import read_mask
from wall.operators.lut import read_lut
from wall.operators.pyramid import open_pyramid, opened, read_descriptor, size_of
from wall.operators.warp import read_mesh
from wall.scene.data.vtk_files import read_data_set

ENDLESS = Path("/dev/zero")


def test_as_many_bytes_are_read_as_are_allowed(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with pytest.raises(OSError, match="more than 4 bytes"):
        read_file(path, 4)


def test_no_more_memory_is_taken_than_a_file_needs(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(bytes(1000))
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (1 << 26), hard))
    try:
        assert read_file(tmp_path / "file", 1 << 32) == bytes(1000)
        assert b"VmPeak" in read_file(Path("/proc/self/status"), 1 << 32)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@pytest.mark.parametrize("read", [read_lut, read_mesh, load, read_mask, size_of, opened, read_descriptor])
def test_pipes_and_devices_are_refused_at_once(read: Callable[[Path], object], tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    for path in (pipe, ENDLESS):
        with pytest.raises(ConfigError, match=r"(pipe\.yaml|zero).*it is a pipe or a device, wanted a file"):
            read(path)


def test_a_pipe_beside_a_model_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "data.bin")
    found = document([{}])
    found["buffers"][0]["uri"] = "data.bin"
    with pytest.raises(SceneError, match="it is a pipe or a device"):
        loaded(tmp_path, found)


def test_pipes_as_tiles_and_as_numbers_of_a_header_are_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "i_files/5").mkdir(parents=True)
    os.mkfifo(tmp_path / "i_files/5/0_0.png")
    image = '<Image TileSize="256" Overlap="0" Format="png"><Size Width="32" Height="32"/></Image>'
    (tmp_path / "i.dzi").write_text(image)
    with pytest.raises(ConfigError, match=r"0_0\.png.*it is a pipe or a device"):
        open_pyramid(tmp_path / "i.dzi")

    os.mkfifo(tmp_path / "numbers.raw")
    for text in ("ElementDataFile = numbers.raw\n", "ElementDataFile = LIST\nnumbers.raw\n"):
        (tmp_path / "field.mhd").write_text("ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\n" + text)
        with pytest.raises(SceneError, match=r"numbers\.raw, which is a pipe"):
            read_data_set(tmp_path / "field.mhd")


def test_a_mesh_nested_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mesh.yaml"
    path.write_text("[" * 5000)
    with pytest.raises(ConfigError, match=r"mesh\.yaml: lists are nested too deeply"):
        read_mesh(path)
