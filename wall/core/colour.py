"""Convert between linear light and display values: sRGB, IEC 61966-2-1."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Real = TypeVar("Real", np.float32, np.float64)

LUMINANCE = (0.2126, 0.7152, 0.0722)  # shares of linear red, green and blue (Rec. 709)
CURVE_STEPS = 4096  # of a table of codes by the square root of light: looking up by it keeps dark steps fine


def light_of_code(code: str) -> list[float]:
    """Linear RGB of #rrggbb."""
    return [float(x) for x in srgb_decoded(np.array(list(bytes.fromhex(code[1:]))) / 255.0)]


def srgb_encoded(linear: NDArray[Real]) -> NDArray[Real]:
    """Display values in [0, 1] of linear light, which is clipped to [0, 1]; the same shape and float type."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(linear.dtype, copy=False)


def srgb_codes(linear: NDArray[Real]) -> NDArray[np.uint8]:
    """The nearest 8-bit codes of linear light, which is clipped to [0, 1]; the same shape."""
    return np.round(srgb_encoded(linear) * 255).astype(np.uint8)


def srgb_decoded(values: NDArray[Real]) -> NDArray[Real]:
    """Linear light of display values in [0, 1]; the same shape and float type."""
    light = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return light.astype(values.dtype, copy=False)


def srgb_curve() -> NDArray[np.uint8]:
    """(4097,) uint8: the sRGB code (IEC 61966-2-1) of linear light (k / 4096)^2.

    Looking up the nearest k is at most one code from the exact rounding: the curve moves 0.08 codes a step at most.
    """
    linear = (np.arange(CURVE_STEPS + 1) / CURVE_STEPS) ** 2
    return srgb_codes(linear)
