"""Reads images that surround a scene: lat-long, Radiance (.hdr) or OpenEXR, or 8-bit sRGB."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from wall.core.colour import srgb_decoded
from wall.core.data import Float32
from wall.core.errors import ConfigError, SceneError
from wall.core.fields import BRIGHTEST
from wall.core.files import read_file
from wall.operators.image_file import read_image
from wall.scene.model import Environment
from wall.scene.radiance_file import read_hdr

FORMATS = (".hdr", ".exr", ".png", ".jpg", ".jpeg")
MOST_BYTES = 1 << 31  # of a .hdr file
WIDEST_PX = 4096  # 96 MiB of texels; wider images are reduced until they fit
BROKEN = (OSError, ValueError, SyntaxError, RuntimeError, MemoryError, Image.DecompressionBombError)


def read_environment(path: Path, *, rotation: float, strength: float) -> tuple[Environment, list[str]]:
    """The environment of a file, and notes of what was changed. rotation : degrees about +y; strength : factor.

    Raises SceneError: missing, unreadable, not twice as wide as high, or with values that are no radiance.
    """
    kind = path.suffix.lower()
    where = f"scene.environment.file = {str(path)!r}"
    if kind not in FORMATS:
        raise SceneError(f"{where}: cannot read '{path.suffix}', wanted {', '.join(FORMATS)}")
    if not path.is_file():
        raise SceneError(f"{where}: there is no such file")
    try:
        light = _decoded(path, kind)
    except BROKEN as error:
        raise SceneError(f"{where}: cannot be read as {kind[1:]}, {error}") from error
    except ConfigError as error:
        raise SceneError(f"{where}: {error}") from error
    height, width = light.shape[:2]
    if width != 2 * height:
        raise SceneError(f"{where}: is {width}x{height} pixels, wanted a lat-long image, twice as wide as high")
    if not np.isfinite(light).all():
        wrong = int((~np.isfinite(light)).any(axis=-1).sum())
        raise SceneError(f"{where}: {wrong} of its pixels are NaN or infinite, wanted finite radiance")
    notes = []
    if (negative := int((light < 0.0).any(axis=-1).sum())) > 0:
        notes.append(f"{path.name}: {negative} of its pixels have negative light, which counts as none")
    light = np.clip(light, 0.0, BRIGHTEST)
    if width > WIDEST_PX:
        light = _reduced(light, (WIDEST_PX, WIDEST_PX // 2))
        notes.append(f"{path.name}: its {width}x{height} pixels are reduced to {WIDEST_PX}x{WIDEST_PX // 2}")
    texels = np.ascontiguousarray(light * np.float32(strength), np.float32)
    return Environment(name=path.name, texels=texels, rotation=rotation, strength=strength), notes


def _reduced(light: Float32, size: tuple[int, int]) -> Float32:
    """An image (h, w, 3) of fewer pixels, width and height: each is the mean of what it covers."""
    channels = [Image.fromarray(light[..., c]).resize(size, Image.Resampling.BOX) for c in range(3)]
    return np.stack([np.asarray(channel, np.float32) for channel in channels], axis=-1)


def _decoded(path: Path, kind: str) -> Float32:
    """(h, w, 3) linear RGB."""
    if kind == ".hdr":
        return read_hdr(read_file(path, MOST_BYTES))
    if kind == ".exr":
        return read_image(path).colour
    with Image.open(path, formats=["PNG", "JPEG"]) as image:
        return srgb_decoded(np.asarray(image.convert("RGB"), np.float32) / np.float32(255.0))
