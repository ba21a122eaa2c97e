"""Reads Radiance pictures (.hdr): RGB with a common exponent, 4 bytes a pixel.

G. Ward, "Real Pixels", Graphics Gems II, 1991; the scanlines that every program writes today, and the older flat ones.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.scene.kernels.rgbe import unpack_scanlines

MAGIC = (b"#?RADIANCE", b"#?RGBE")
LONGEST_HEADER = 1 << 16  # bytes
MOST_PIXELS = 1 << 27
RESOLUTION = re.compile(rb"-Y ([0-9]{1,6}) \+X ([0-9]{1,6})")
EXPONENT_BIAS = 128 + 8  # of the shared exponent, and of the eight bits of a mantissa


def read_hdr(data: bytes) -> Float32:
    """(h, w, 3) linear RGB, row 0 at the top. Raises ValueError: what is wrong with the bytes."""
    lines, start = _header(data)
    if lines[0] not in MAGIC:
        raise ValueError("it does not begin with #?RADIANCE")
    exposure = 1.0
    for line in lines[1:-2]:
        if line.startswith(b"FORMAT=") and line[7:].strip() != b"32-bit_rle_rgbe":
            raise ValueError(f"its format is {line[7:].decode('latin-1')!r}, wanted '32-bit_rle_rgbe'")
        if line.startswith(b"EXPOSURE="):
            exposure *= _positive(line[9:])
    found = RESOLUTION.fullmatch(lines[-1])
    if found is None:
        raise ValueError(f"its size is given as {lines[-1].decode('latin-1')!r}, wanted '-Y HEIGHT +X WIDTH'")
    height, width = int(found[1]), int(found[2])
    if not 0 < height * width <= MOST_PIXELS:
        raise ValueError(f"it has {width}x{height} pixels, wanted 1 to {MOST_PIXELS:,} in all")
    if 8 * height * min(width // 254, 1) > len(data) - start:  # the shortest scanlines that there are
        raise ValueError(f"it ends after {len(data)} bytes, too few for {width}x{height} pixels")
    rgbe = np.zeros((height, width, 4), np.uint8)
    whole = unpack_scanlines(np.frombuffer(data, np.uint8), start, rgbe)
    if whole < height:
        raise ValueError(f"scanline {whole} of {height} is broken or cut off")
    return _floats(rgbe, exposure)


def _header(data: bytes) -> tuple[list[bytes], int]:
    """The lines of the header with the empty one and that of the resolution, and where the scanlines start."""
    text = data[:LONGEST_HEADER]
    end = text.find(b"\n\n")
    last = text.find(b"\n", end + 2) if end >= 0 else -1
    if last < 0:
        raise ValueError("its header has no end")
    return text[:last].split(b"\n"), last + 1


def _positive(text: bytes) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-30 < value < 1e30:
        raise ValueError(f"its exposure is {text.decode('latin-1').strip()!r}, wanted a positive number")
    return value


def _floats(rgbe: NDArray[np.uint8], exposure: float) -> Float32:
    exponent = rgbe[..., 3:].astype(np.int32)
    with np.errstate(over="ignore"):
        scale = np.ldexp(np.float32(1.0), exponent - EXPONENT_BIAS) / np.float32(exposure)
        light: Float32 = np.where(exponent == 0, np.float32(0.0), rgbe[..., :3] * scale).astype(np.float32)
    return light
