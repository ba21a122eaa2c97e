"""What is wrong with data, where someone treats it otherwise than other errors."""

from __future__ import annotations

from wall.core.errors import SceneError


class NoSurfaceError(SceneError):
    """A field nowhere has the value of an isosurface: an error, but in the midst of a series."""
