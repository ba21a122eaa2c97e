"""Read PNG and EXR files as linear light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from wall.core.colour import LUMINANCE, srgb_decoded
from wall.core.data import Float32
from wall.core.errors import ConfigError


@dataclass(frozen=True, slots=True, eq=False)
class ImageFile:
    """The image of a file: colour, alpha and, of an EXR, depth."""

    colour: Float32  # (h, w, 3) linear, times alpha
    alpha: Float32  # (h, w) 0..1; 1 if the file has none
    depth: Float32 | None  # (h, w) the EXR channel Z

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.colour.shape[1], self.colour.shape[0]

    def luminance(self) -> Float32:
        """(h, w) float32 linear, of the colour times alpha."""
        light: Float32 = self.colour @ np.array(LUMINANCE, np.float32)
        return light


def read_image(path: Path) -> ImageFile:
    """Read a PNG (8 bits a channel, sRGB) or an EXR (linear, premultiplied). Raises ConfigError naming the file."""
    readers = {".png": _read_png, ".exr": _read_exr}
    if path.suffix.lower() not in readers:
        raise ConfigError(f"{path}: cannot read '{path.suffix}', wanted {' or '.join(readers)}")
    if not path.is_file():
        raise ConfigError(f"{path}: there is no such file")
    try:
        return readers[path.suffix.lower()](path)
    except (OSError, ValueError, SyntaxError, RuntimeError, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path}: cannot be read as {path.suffix.lower()[1:]}, {error}") from error
    except MemoryError as error:
        raise ConfigError(f"{path}: has more pixels than there is memory for") from error


def _read_png(path: Path) -> ImageFile:
    with Image.open(path, formats=["PNG"]) as image:
        values = np.asarray(image.convert("RGBA"), np.float32) / np.float32(255.0)
    alpha = np.ascontiguousarray(values[..., 3])
    return ImageFile(srgb_decoded(values[..., :3]) * alpha[..., None], alpha, None)


def _read_exr(path: Path) -> ImageFile:
    import OpenEXR  # here, so that walls without such images do not load it

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: np.asarray(channel.pixels, np.float32) for name, channel in file.channels().items()}
    names = ["R", "G", "B"] if "R" in channels else ["Y"] * 3
    if missing := sorted(set(names) - set(channels)):
        raise ValueError(f"it has the channels {', '.join(sorted(channels))}, not {', '.join(missing)}")
    size = channels[names[0]].shape
    return ImageFile(
        np.ascontiguousarray(np.stack([channels[name] for name in names], axis=-1)),
        np.clip(channels.get("A", np.ones(size, np.float32)), 0.0, 1.0),
        channels.get("Z"),
    )
