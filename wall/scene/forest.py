"""Two million triangles: a few trees, placed often."""

from __future__ import annotations

from wall.scene.model import Source


def forest() -> Source:
    raise NotImplementedError
