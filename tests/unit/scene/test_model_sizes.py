"""Model files of every kind may have so many bytes and no more."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from wall.core.errors import SceneError
from wall.scene import gltf, loading
from wall.scene.loading import load


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "PLY", "stl"])
def test_a_file_that_is_too_large_is_refused_and_one_that_is_not_keeps_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    path = tmp_path / f"box.{kind}"
    trimesh.creation.box().export(path, file_type=kind.lower())
    size = path.stat().st_size
    for module in (gltf, loading):
        monkeypatch.setattr(module, "MOST_BYTES", size)
    (instance,) = load(path).instances
    assert instance.name == path.name or kind in ("glb", "obj"), "these name their objects themselves"
    for module in (gltf, loading):
        monkeypatch.setattr(module, "MOST_BYTES", size - 1)
    with pytest.raises(SceneError) as refused:
        load(path)
    assert f"{path}: cannot be read as {kind.lower()}" in str(refused.value)
    assert f"it has more than {size - 1} bytes" in str(refused.value)
