"""Write a linear picture to a file: 8-bit sRGB PNG, or float32 EXR and NPY."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from wall.core.colour import srgb_encoded
from wall.core.data import Float32
from wall.core.errors import ConfigError, RunError

SUFFIXES = (".png", ".exr", ".npy")


def check_suffix(path: Path) -> None:
    """Refuse a file whose kind cannot be written, before anything is rendered for it."""
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"-o {path}: cannot write '{path.suffix}'; accepted: {', '.join(SUFFIXES)}")
    if path.parent != Path() and not path.parent.is_dir():
        raise ConfigError(f"-o {path}: there is no folder {path.parent}")


def write_picture(path: Path, picture: Float32) -> None:
    """Write (h, w, 3) float32 linear RGB. The file appears whole or not at all.

    PNG: clipped to 0..1, sRGB curve (IEC 61966-2-1), rounded to 8 bits. EXR and NPY: as it is.
    """
    check_suffix(path)
    temporary = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        _write(temporary, picture)
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise RunError(f"cannot write {path}: {error.strerror or error}") from error


def _write(path: Path, picture: Float32) -> None:
    if path.suffix.lower() == ".npy":
        np.save(path, picture)
    elif path.suffix.lower() == ".exr":
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(picture)}).write(str(path))
    else:
        encoded = srgb_encoded(picture.astype(np.float64))
        Image.fromarray(np.round(encoded * 255).astype(np.uint8)).save(path)
