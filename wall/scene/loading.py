from __future__ import annotations

from pathlib import Path

from wall.scene.model import Source


def load(path: Path) -> Source:
    raise NotImplementedError
