"""`blend_mask`: what a calibration says that each pixel of a projector keeps of its light, as an image.

The mask holds display values: a projector that emits value^gamma and is sent a v in place of v emits the share a^gamma
of its light. So calibration systems write masks as they are to be multiplied (MPCDI's alpha map with its embedded
gamma, for a projector of that gamma). This operator works before the encoding E: it gives D(a E(L)) of the light L.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, ClassVar, Literal

import numpy as np
from PIL import Image
from pydantic import Field

from wall.core.colour import srgb_decoded, srgb_encoded
from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import Text
from wall.core.files import open_file
from wall.operators.base import Input, Operator
from wall.operators.regions import bands, copy, pixels_of


class BlendMask(Operator):
    """Each display value times that of an image, which is as large as the input; light is clipped to 0..1 first."""

    op: Literal["blend_mask"] = Field(description="display values times those of an image")
    input: Input
    file: Text = Field(description="PNG of 8 or 16 bits, grey or RGB: white keeps a pixel as it is")

    LOSES: ClassVar[Channels] = frozenset({"variance"})  # it is not linear

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Float32:
        """(h, w, 3 or 1) float32, 0..1. Raises ConfigError: the file cannot be read, or has another size."""
        kept = read_mask(folder / self.file)
        came, wanted = kept.shape[1::-1], (inputs[0].width, inputs[0].height)
        if came != wanted:
            raise ConfigError(
                f"{folder / self.file}: is {came[0]} x {came[1]} pixels, wanted {wanted[0]} x {wanted[1]}, as the "
                f"image of '{self.id}'"
            )
        return kept

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Float32) -> None:
        """Copy a region, darkened by the mask."""
        source = inputs[0]
        copy(source, out, region)
        for band in bands(region):
            kept = np.broadcast_to(prepared[band.inside(source.rect)], (band.height, band.width, 3))
            darker = (kept < 1.0).any(axis=2)
            if darker.any():
                here = pixels_of(out, "colour", band)
                here[darker] = srgb_decoded(srgb_encoded(here[darker]) * kept[darker])


def read_mask(path: Path) -> Float32:
    """(h, w, 3 or 1) float32, 0..1: the values of a PNG as they stand. Raises ConfigError."""
    try:
        with open_file(path) as file:
            return mask_values(file)
    except FileNotFoundError:
        raise ConfigError(f"{path}: there is no such file") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path}: cannot be read as a PNG, {error}") from error
    except MemoryError as error:
        raise ConfigError(f"{path}: has more pixels than there is memory for") from error


def mask_values(file: BinaryIO) -> Float32:
    """As read_mask. Raises what Pillow raises: OSError, ValueError, SyntaxError, DecompressionBombError."""
    with Image.open(file, formats=["PNG"]) as image:
        if image.mode.startswith("I"):  # 16 bits, grey
            return np.asarray(image, np.float32)[..., None] / np.float32(65535.0)
        grey = image.mode in ("L", "1", "LA")
        values: Float32 = np.asarray(image.convert("L" if grey else "RGB"), np.float32) / np.float32(255.0)
    return values[..., None] if grey else values
