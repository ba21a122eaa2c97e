"""What encoder and decoder must agree on: the order of a tile's pixels, the curve of colour codes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64

TOP_CODE = 1535  # of a colour channel: 65,536
CODES_OF_DISPLAY = 255  # up to 1
CODES_AN_OCTAVE = 80  # above 1, where the sRGB curve has 78: no step grows
FINEST_EXPONENT = 115  # float32 exponent of 2^-12; what is darker lies below code 1
BUCKET_BITS = 7  # mantissa bits of a bucket: no bucket holds more than one code's beginning
BUCKETS = (127 + 16 - FINEST_EXPONENT) << BUCKET_BITS


class Tables(NamedTuple):
    place_on_curve: NDArray[np.uint8]  # (256,): of pixel 16 y + x of a tile
    pixel_on_curve: NDArray[np.uint8]  # (256,): its inverse
    colour_of_code: Float32  # (TOP_CODE + 2, 2): linear radiance of whole codes, codes for each unit above it
    code_of_bucket: NDArray[np.int16]  # (BUCKETS,): of the smallest colour with that exponent and those leading bits


def colour_curve() -> Float64:
    """(TOP_CODE + 2,), linear radiance of every whole code: sRGB up to 1 (IEC 61966-2-1), then octaves."""
    encoded = np.arange(CODES_OF_DISPLAY + 1) / CODES_OF_DISPLAY
    above = 2.0 ** (np.arange(1, TOP_CODE + 2 - CODES_OF_DISPLAY) / CODES_AN_OCTAVE)
    return np.concatenate([srgb_decoded(encoded), above])


def hilbert_curve() -> NDArray[np.uint8]:
    """(256,) uint8: the pixels 16 y + x of a tile in the order of Hilbert's curve.

    Each quadrant is the curve of half the size; the first and the last are mirrored at a diagonal (Hilbert 1891).
    """
    x = y = np.zeros(1, np.int64)
    for side in (1, 2, 4, 8):
        x, y = (
            np.concatenate([y, x, x + side, 2 * side - 1 - y]),
            np.concatenate([x, y + side, y + side, side - 1 - x]),
        )
    return (16 * y + x).astype(np.uint8)


def make_tables() -> Tables:
    pixels, places = hilbert_curve(), np.empty(256, np.uint8)
    places[pixels] = np.arange(256, dtype=np.uint8)
    curve = colour_curve().astype(np.float32)
    steps = 1.0 / np.diff(np.float64(curve), append=np.inf)
    firsts = (np.arange(BUCKETS, dtype=np.int32) << (23 - BUCKET_BITS)) + (FINEST_EXPONENT << 23)
    firsts[0] = 0
    codes = np.searchsorted(curve, firsts.view(np.float32), side="right") - 1
    return Tables(
        place_on_curve=places,
        pixel_on_curve=pixels,
        colour_of_code=np.stack([curve, steps], axis=1).astype(np.float32),
        code_of_bucket=codes.astype(np.int16),
    )
