"""Curves of wall.core.tone_mapping, which names their sources."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

NONE, REINHARD, ACES, NEUTRAL = range(4)
ZERO, ONE, FOUR = np.float32(0.0), np.float32(1.0), np.float32(4.0)
BRIGHTEST = np.float32(1e6)  # what is brighter, infinity too, is mapped as this
A, B, C, D, E = (np.float32(x) for x in (2.51, 0.03, 2.43, 0.59, 0.14))  # of ACES
FRESNEL, KNEE, DESATURATION = np.float32(0.04), np.float32(0.76), np.float32(0.15)  # of Khronos; 0.76 = 0.8 - 0.04
SHOULDER = np.float32(0.24)  # 1 - 0.76
FOOT = np.float32(6.25)  # below 0.08, twice 0.04, so much times the square of light is left of a grey


@kernel
def map_row(values, curve):
    """Bring exposed light into [0, 1], in place; NaN becomes 0. NONE changes nothing.

    values : (3 n,) float32, red, green and blue of n pixels; curve : int
    """
    if curve != NONE:
        for k in range(values.shape[0]):
            values[k] = min(values[k], BRIGHTEST) if values[k] > ZERO else ZERO
    if curve == REINHARD:
        for k in range(values.shape[0]):
            values[k] = values[k] / (ONE + values[k])
    elif curve == ACES:
        for k in range(values.shape[0]):
            values[k] = aces(values[k])
    elif curve == NEUTRAL:
        for k in range(0, values.shape[0] - 2, 3):
            values[k], values[k + 1], values[k + 2] = neutral(values[k], values[k + 1], values[k + 2])


@inline_kernel
def aces(x):
    """One channel."""
    return min(x * (A * x + B) / (x * (C * x + D) + E), ONE)


@inline_kernel
def neutral(r, g, b):
    """One pixel, whose channels are 0 or more."""
    least = min(r, g, b)
    offset = least - FOOT * least * least if least < FRESNEL + FRESNEL else FRESNEL
    r, g, b = r - offset, g - offset, b - offset
    peak = max(r, g, b)
    if peak < KNEE:
        return r, g, b
    new = ONE - SHOULDER * SHOULDER / (peak + SHOULDER - KNEE)
    scale, white = new / peak, ONE - ONE / (DESATURATION * (peak - new) + ONE)
    return (
        r * scale + (new - r * scale) * white,
        g * scale + (new - g * scale) * white,
        b * scale + (new - b * scale) * white,
    )


@kernel
def map_tiles(colour, alpha, dirty, tile, curve):
    """Map the dirty tiles of exposed light, in place. Colours come times alpha; their light is mapped without it.

    colour : (h, w, 3) float32; alpha : (h, w) float32 | None, 1 everywhere; dirty : (rows, columns) bool
    tile : int, edge in pixels; curve : int
    """
    height, width = colour.shape[:2]
    pixel = np.empty(3, np.float32)
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for y in range(row * tile, min((row + 1) * tile, height)):
                for x in range(column * tile, min((column + 1) * tile, width)):
                    share = ONE if alpha is None else alpha[y, x]
                    if share > ZERO:
                        for c in range(3):
                            pixel[c] = colour[y, x, c] / share
                        map_row(pixel, curve)
                        for c in range(3):
                            colour[y, x, c] = pixel[c] * share


@inline_kernel
def shown_grey(x, curve):
    """What grey light of 0 or more is mapped to; of NONE too, in [0, 1]."""
    x = min(x, BRIGHTEST)
    if curve == REINHARD:
        return x / (ONE + x)
    if curve == ACES:
        return aces(x)
    if curve == NEUTRAL:
        x = FOOT * x * x if x < FRESNEL + FRESNEL else x - FRESNEL
        return x if x < KNEE else ONE - SHOULDER * SHOULDER / (x + SHOULDER - KNEE)
    return min(x, ONE)


@inline_kernel
def slope_of_grey(x, curve):
    """How fast `shown_grey` grows at x, 0 or more."""
    x = min(x, BRIGHTEST)
    if curve == REINHARD:
        return ONE / ((ONE + x) * (ONE + x))
    if curve == ACES:
        below = x * (C * x + D) + E
        slope = ((A + A) * x + B) * below - x * (A * x + B) * ((C + C) * x + D)
        return slope / (below * below) if aces(x) < ONE else ZERO
    if curve == NEUTRAL and x >= KNEE + FRESNEL:
        left = x - FRESNEL + SHOULDER - KNEE
        return SHOULDER * SHOULDER / (left * left)
    if curve == NEUTRAL and x < FRESNEL + FRESNEL:
        return (FOOT + FOOT) * x
    return ONE if curve == NEUTRAL or x < ONE else ZERO


@inline_kernel
def slope_of_display(light, curve):
    """Square of how fast the value shown, about sqrt(mapped light), grows with exposed light above 0, up to white.

    Under NEUTRAL the steeper of a grey's and of a pure colour's, which loses nothing to the foot.
    """
    if curve == NONE:
        return ONE / (FOUR * min(light, ONE))
    slope = slope_of_grey(light, curve)
    squared = slope * slope / (FOUR * shown_grey(light, curve))
    return max(squared, ONE / (FOUR * light)) if curve == NEUTRAL and light < KNEE else squared
