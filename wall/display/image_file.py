"""Write a linear image to a file: 8-bit sRGB PNG, or float32 EXR and NPY; with layers as an EXR of many channels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.core.colour import srgb_codes
from wall.core.data import Float32
from wall.core.tone_mapping import AS_IT_IS, Tone, tone_mapped
from wall.display.files import check_target, replaced

Over: TypeAlias = Callable[[NDArray[Any]], None]
Display: TypeAlias = Callable[[Float32], NDArray[np.uint8]]

SUFFIXES = (".png", ".exr", ".npy")
CHANNELS = {  # of layers in an EXR, as renderers name them
    "colour": ("R", "G", "B"),
    "albedo": ("albedo.R", "albedo.G", "albedo.B"),
    "normal": ("N.X", "N.Y", "N.Z"),
    "depth": ("Z",),
    "variance": ("variance",),
    "object_id": ("id",),
}


def check_suffix(path: Path, *, layers: bool = False) -> None:
    """Refuse a file whose kind cannot be written; only EXR holds `layers`. Raises ConfigError."""
    check_target(path, (".exr",) if layers else SUFFIXES)


def display_values(linear: Float32, *, tone: Tone = AS_IT_IS) -> NDArray[np.uint8]:
    """8-bit sRGB (IEC 61966-2-1) of linear light (..., 3), exposed, mapped and clipped to 0..1; the same shape."""
    exposed = 2.0**tone.stops * linear.astype(np.float64)
    return srgb_codes(exposed if tone.mapping == "none" else tone_mapped(exposed, tone.mapping))


def write_image(path: Path, image: Float32, *, display: Display = display_values, over: Over | None = None) -> None:
    """Write (h, w, 3) float32 linear RGB: EXR and NPY as it is, PNG as display values. Raises RunError.

    display : makes them
    over : draws over what is written, float32 light or uint8 display values
    """
    check_suffix(path)
    shown = path.suffix.lower() not in (".npy", ".exr")
    pixels: NDArray[Any] = display(image) if shown else image
    if over is not None:
        pixels = pixels.copy()
        over(pixels)
    with replaced(path) as part:
        if path.suffix.lower() == ".npy":
            np.save(part, pixels)
        elif path.suffix.lower() == ".exr":
            _write_exr(part, {"RGB": np.ascontiguousarray(pixels)})
        else:
            Image.fromarray(pixels).save(part)


def write_layers(path: Path, layers: Mapping[str, NDArray[Any]]) -> None:
    """Write an image and its layers, by the names of CHANNELS, to an EXR: float32, but `id`, which is uint32.

    Raises ConfigError where the file cannot hold them, and RunError.
    """
    check_suffix(path, layers=True)
    planes: dict[str, NDArray[Any]] = {}
    for layer, image in layers.items():
        names = CHANNELS[layer]
        for k, name in enumerate(names):
            planes[name] = np.ascontiguousarray(image if len(names) == 1 else image[:, :, k])
    with replaced(path) as part:
        _write_exr(part, planes)


def _write_exr(path: Path, planes: Mapping[str, NDArray[Any]]) -> None:
    import OpenEXR  # here, so that walls do not load it

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, dict(planes)).write(str(path))
