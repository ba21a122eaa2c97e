"""The curve of colour codes in compact packets: sRGB for display values up to 1, logarithmic above."""

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


class ColourCurve(NamedTuple):
    """Tables to find the code of a colour and the colour of a code."""

    colour_of_code: Float32  # (TOP_CODE + 2, 2): linear radiance of whole codes, codes for each unit above it
    code_of_bucket: NDArray[np.int16]  # (BUCKETS,): of the smallest colour with that exponent and those leading bits


def linear_colours() -> Float64:
    """(TOP_CODE + 2,), linear radiance of every whole code: sRGB up to 1 (IEC 61966-2-1), then octaves."""
    encoded = np.arange(CODES_OF_DISPLAY + 1) / CODES_OF_DISPLAY
    above = 2.0 ** (np.arange(1, TOP_CODE + 2 - CODES_OF_DISPLAY) / CODES_AN_OCTAVE)
    return np.concatenate([srgb_decoded(encoded), above])


def make_colour_curve() -> ColourCurve:
    """The tables of linear_colours(), which encoder and decoder share."""
    curve = linear_colours().astype(np.float32)
    steps = 1.0 / np.diff(np.float64(curve), append=np.inf)
    firsts = (np.arange(BUCKETS, dtype=np.int32) << (23 - BUCKET_BITS)) + (FINEST_EXPONENT << 23)
    firsts[0] = 0
    codes = np.searchsorted(curve, firsts.view(np.float32), side="right") - 1
    return ColourCurve(
        colour_of_code=np.stack([curve, steps], axis=1).astype(np.float32), code_of_bucket=codes.astype(np.int16)
    )
