"""What is wrong with data, where someone treats it otherwise than other errors."""

from __future__ import annotations

from zipfile import BadZipFile

from wall.core.errors import SceneError


class NoSurfaceError(SceneError):
    """A field nowhere has the value of an isosurface: an error, but in the midst of a series."""


def parser_says(error: Exception) -> str:
    """What a parser of tables and arrays says of a file; NumPy takes what it does not know for pickled objects, and
    tells how to load these unsafely."""
    if "allow_pickle" in str(error):
        return "it holds no arrays of numbers"
    if isinstance(error, BadZipFile | EOFError):
        return f"it is damaged or cut short: {error}"
    return f"{type(error).__name__}: {error}"
