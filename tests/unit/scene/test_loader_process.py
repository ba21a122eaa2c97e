"""Models are read by a process of their own, which has a limit of time and one of memory, and ends with its parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from wall.config.scene import SceneConfig
from wall.core.errors import SceneError
from wall.scene import loading
from wall.scene.build import build
from wall.scene.data import loading as data_loading
from wall.scene.loader_process import LEAST_S, S_PER_MB, Request, load_apart, load_models, seconds_for

WAIT_S = 20.0
END_S = 10.0  # at once, on a busy machine


def children_of(pid: int) -> set[int]:
    tasks = Path(f"/proc/{pid}/task")
    return {int(child) for task in tasks.iterdir() for child in (task / "children").read_text(encoding="ascii").split()}


def ball(folder: Path, name: str = "ball.obj", subdivisions: int = 2) -> Path:
    trimesh.creation.icosphere(subdivisions=subdivisions).export(folder / name)
    return folder / name


def slow(folder: Path) -> Path:
    """A model that takes a minute: 200,000 objects of one triangle."""
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"
    path = folder / "slow.obj"
    path.write_text("".join(f"o part{k}\n{triangle}" for k in range(200_000)), encoding="utf-8")
    return path


def request(path: Path, *, seconds: float = 60.0, memory: int | None = None) -> Request:
    return Request(path=path, reader=("wall.scene.loading", "load"), arguments=(path,), seconds=seconds, memory=memory)


def test_models_are_what_they_are_without_a_process_of_their_own(tmp_path: Path) -> None:
    paths = [ball(tmp_path), ball(tmp_path, "ball.glb", 1), ball(tmp_path, "z.stl", 1)]

    found = load_models(paths, "z")

    for path, source in zip(paths, found, strict=True):
        wanted = loading.load(path, "z")
        assert source.notes == wanted.notes
        assert source.materials == wanted.materials
        for one, other in zip(source.meshes, wanted.meshes, strict=True):
            np.testing.assert_array_equal(one.vertices, other.vertices)
            np.testing.assert_array_equal(one.triangles, other.triangles)
        np.testing.assert_array_equal(source.instances[0].world_from_object, wanted.instances[0].world_from_object)


def test_one_that_is_refused_is_refused_in_the_same_words_and_names_the_right_file(tmp_path: Path) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF\x02\x00\x00\x00")
    with pytest.raises(SceneError) as there:
        loading.load(broken)
    with pytest.raises(SceneError) as here:
        load_models([ball(tmp_path), broken, tmp_path / "missing.obj"])
    assert str(here.value) == str(there.value)


def test_one_that_takes_too_long_is_refused(tmp_path: Path) -> None:
    path = slow(tmp_path)
    with pytest.raises(SceneError, match=r"slow\.obj: reading it takes more than 1 s of processor time; wanted: fewer"):
        load_apart([request(ball(tmp_path)), request(path, seconds=1.0)])


def test_one_that_takes_too_much_memory_is_refused(tmp_path: Path) -> None:
    small, large = ball(tmp_path), ball(tmp_path, "large.obj", 6)
    with pytest.raises(SceneError, match=r"large\.obj: reading it takes more than the 0\.04 GB of memory that are"):
        load_apart([request(small), replace(request(large), memory=40_000_000)])


def test_a_process_that_dies_is_told_of(tmp_path: Path) -> None:
    def kill() -> None:
        end = time.monotonic() + WAIT_S
        while not (found := children_of(os.getpid()) - before) and time.monotonic() < end:
            time.sleep(0.05)
        for pid in found:
            os.kill(pid, signal.SIGKILL)

    before, path = children_of(os.getpid()), slow(tmp_path)
    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(SceneError, match=r"slow\.obj: cannot be read; what reads it ended with signal 9, Killed after"):
        load_models([path])
    killer.join()


def test_data_that_ends_a_reader_is_refused_and_ends_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """VTK ends its process where it gets no memory: an image of so many points is asked for by its header alone."""
    pytest.importorskip("vtkmodules")
    monkeypatch.setattr(data_loading, "LOADED_APART", frozenset({".vti"}))
    path = tmp_path / "field.vti"
    extent = "0 200000 0 200000 0 200000"
    path.write_text(
        f'<VTKFile type="ImageData"><ImageData WholeExtent="{extent}"><Piece Extent="{extent}"><PointData Scalars="a">'
        '<DataArray type="Float32" Name="a" format="ascii">1 2 3</DataArray></PointData></Piece></ImageData></VTKFile>'
    )
    config = SceneConfig.model_validate({"data": [{"type": "isosurface", "file": path.name, "value": 1.0}]})
    with pytest.raises(SceneError, match=r"field\.vti: (cannot be read; what reads it ended|.*memory)"):
        build(config, tmp_path)


def test_what_lies_in_the_current_folder_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ball(tmp_path)
    for name in ("trimesh.py", "random.py", "wall.py"):
        (tmp_path / name).write_text("raise SystemExit('this file is not meant')")
    monkeypatch.chdir(tmp_path)
    assert load_models([path])[0].meshes


def test_it_reads_where_standard_streams_are_closed(tmp_path: Path) -> None:
    code = "import sys; from pathlib import Path; from wall.scene.loader_process import load_models; "
    code += "Path(sys.argv[2]).write_text(str(len(load_models([Path(sys.argv[1])]))))"
    command = ["sh", "-c", 'exec "$0" -c "$1" "$2" "$3" <&- >&-', sys.executable, code]
    subprocess.run([*command, str(ball(tmp_path)), str(tmp_path / "found")], timeout=60, check=True)
    assert (tmp_path / "found").read_text() == "1"


def test_it_ends_with_its_parent(tmp_path: Path) -> None:
    code = "import sys; from pathlib import Path; from wall.scene.loader_process import load_models; "
    parent = subprocess.Popen([sys.executable, "-c", code + "load_models([Path(sys.argv[1])])", str(slow(tmp_path))])
    end = time.monotonic() + WAIT_S
    while not (found := children_of(parent.pid)) and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(0.5)  # it may be about to ask to end with its parent

    parent.kill()
    parent.wait()

    assert found
    end = time.monotonic() + END_S
    while any(Path(f"/proc/{pid}/cmdline").exists() and running(pid) for pid in found):
        assert time.monotonic() < end, f"{found} goes on"
        time.sleep(0.05)


def running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_large_models_have_longer_with_the_files_beside_a_gltf(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_bytes(bytes(3_000_000))
    (tmp_path / "m.gltf").write_bytes(bytes(1_000_000))
    assert seconds_for(tmp_path / "m.obj") == LEAST_S + 3 * S_PER_MB
    assert seconds_for(tmp_path / "m.gltf") == LEAST_S + 4 * S_PER_MB
    assert seconds_for(tmp_path / "none.obj") == seconds_for(tmp_path / "none" / "none.gltf") == LEAST_S
