"""Write a linear image to a file: 8-bit sRGB PNG, or float32 EXR and NPY."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.core.colour import srgb_codes
from wall.core.data import Float32
from wall.display.files import check_target, replaced

SUFFIXES = (".png", ".exr", ".npy")


def check_suffix(path: Path) -> None:
    """Refuse a file whose kind cannot be written. Raises ConfigError."""
    check_target(path, SUFFIXES)


def display_values(linear: Float32, *, stops: float = 0.0) -> NDArray[np.uint8]:
    """8-bit sRGB (IEC 61966-2-1) of linear light, exposed by so many stops and clipped to 0..1; the same shape."""
    return srgb_codes(2.0**stops * linear.astype(np.float64))


def write_image(path: Path, image: Float32, *, stops: float = 0.0) -> None:
    """Write (h, w, 3) float32 linear RGB: EXR and NPY as it is, PNG as display values, exposed. Raises RunError."""
    check_suffix(path)
    with replaced(path) as part:
        if path.suffix.lower() == ".npy":
            np.save(part, image)
        elif path.suffix.lower() == ".exr":
            import OpenEXR  # here, so that walls do not load it

            header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
            OpenEXR.File(header, {"RGB": np.ascontiguousarray(image)}).write(str(part))
        else:
            Image.fromarray(display_values(image, stops=stops)).save(part)
