"""What is wrong with a model's file is told by its line or size, where a parser has words of its own for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.core.errors import SceneError
from wall.scene.loading import load


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4, 'f 1 2 9': there is no v 9; wanted: 1 to 3"),
        ("word.obj", b"v 0 x 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1, 'v 0 x 0': x is no number"),
        ("cut.glb", b"glTF\x02\0\0\0\x40\0\0\0\x08\0\0\0JSON{", "ends after 21 of the 64 bytes"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / name)
    assert name in str(caught.value)
    assert told in str(caught.value)
