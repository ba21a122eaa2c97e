"""What unit tests share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from wall.scene import loading, sources
from wall.scene.data import loading as data_loading


@pytest.fixture(autouse=True, scope="module")
def files_are_read_here() -> Iterator[None]:
    """Not by a process of their own, which takes a second of each test; test_loader_process.py is about that."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sources, "load_models",
            lambda paths, up="auto", *, textures_given=False: [
                loading.load(path, up, textures_given=textures_given) for path in paths
            ],
        )  # fmt: skip
        patch.setattr(data_loading, "LOADED_APART", frozenset())
        yield
