"""Gamma: dithered black and bright pixels have a known mean light whatever the display's curve is.

From afar, the patch that is as bright as the dither around it tells the display's curve: the one marked sRGB on a
display that is right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded, srgb_encoded
from wall.core.data import Float64
from wall.display.patterns.draw import BRIGHT, blank, draw_text, fitting_size

CURVES: dict[str, float] = {"1.8": 1.8, "2.0": 2.0, "2.2": 2.2, "sRGB": 0.0, "2.4": 2.4, "2.6": 2.6, "2.8": 2.8}
ROWS = ((0.25, (1, 1, 1)), (0.5, (1, 1, 1)), (0.75, (1, 1, 1)), (0.5, (1, 0, 0)), (0.5, (0, 1, 0)), (0.5, (0, 0, 1)))


def gamma(width: int, height: int) -> NDArray[np.uint8]:
    """(h, w, 3) uint8 sRGB: a smooth ramp and a dithered one, above rows of patches in dithers of known light."""
    image, values = blank((width, height)), np.linspace(0, 1, width)
    tops = np.linspace(0, height, 3 + len(ROWS) + 1).astype(int)
    image[: tops[1]] = np.rint(255 * values)[None, :, None]
    image[tops[1] : tops[2]] = dither(np.broadcast_to(srgb_decoded(values), (tops[2] - tops[1], width)))[..., None]
    edges = np.linspace(0, width, len(CURVES) + 1)
    size = fitting_size("sRGB", (0.6 * width / len(CURVES), 0.6 * (tops[3] - tops[2])))
    for k, name in enumerate(CURVES):
        draw_text(image, name, ((edges[k] + edges[k + 1]) / 2, (tops[2] + tops[3]) / 2), size, BRIGHT, anchor="mm")
    for k, (share, colour) in enumerate(ROWS):
        _row(image[tops[3 + k] : tops[4 + k]], share, np.array(colour, np.uint8), edges)
    return image


def dither(light: Float64) -> NDArray[np.uint8]:
    """(h, w) uint8 of 0 and 255 whose mean over each 8 x 8 pixels is the light, (h, w) of 0..1, to a 64th."""
    height, width = light.shape
    order = np.zeros((1, 1))
    for _ in range(3):  # each pixel becomes four, lit one after the other, diagonals first
        order = np.block([[4 * order, 4 * order + 2], [4 * order + 3, 4 * order + 1]])
    thresholds = np.tile((order + 0.5) / order.size, (-(-height // 8), -(-width // 8)))[:height, :width]
    return (light > thresholds).astype(np.uint8) * np.uint8(255)


def _row(image: NDArray[np.uint8], share: float, colour: NDArray[np.uint8], edges: Float64) -> None:
    """A dither of which `share` is lit, and in it, for each curve, a patch of the value that gives the same light."""
    height, width = image.shape[:2]
    image[:] = dither(np.full((height, width), share))[..., None] * colour
    for k, exponent in enumerate(CURVES.values()):
        value = share ** (1 / exponent) if exponent else float(srgb_encoded(np.array([share]))[0])
        left, right = edges[k] + (edges[k + 1] - edges[k]) * np.array([0.2, 0.8])
        image[round(0.2 * height) : round(0.8 * height), round(left) : round(right)] = round(255 * value) * colour
