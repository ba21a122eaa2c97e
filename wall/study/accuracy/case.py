"""What a hard case is: how it is measured, its bound, and why the bound is that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wall.core.colour import srgb_codes

DIFFERENCE_GAIN = 16  # of differences of 8-bit codes in pictures


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """An image for the report."""

    title: str
    rgb: NDArray[np.uint8]  # (h, w, 3) sRGB


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What one measurement found."""

    figure: float
    pictures: tuple[Picture, ...] = ()
    note: str = ""  # where the worst was, or what was counted


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One hard case. It is inside its bound if its figure is at most the bound; NaN never is."""

    name: str
    family: str  # heading of the table it stands in
    scene: str  # what is there, and what is done to it
    unit: str  # of figure and bound
    bound: float
    reason: str  # for the bound
    measure: Callable[[int], Found]  # at a size: pixels an edge, rays, steps; larger is harder and slower
    size: int  # of `wall measure accuracy`
    small: int | None  # of the test command; None: it takes too long for that
    long: int | None = None  # of --long; None: as `size`

    def ok(self, figure: float) -> bool:
        """Whether a figure is inside the bound."""
        return figure <= self.bound


def picture(title: str, radiance: ArrayLike) -> Picture:
    """Linear radiance (h, w, 3), or one number a pixel (h, w), as a picture; what is not a number is magenta."""
    linear = np.asarray(radiance, np.float32)
    if linear.ndim == 2:
        linear = np.repeat(linear[..., None], 3, axis=2)
    codes = srgb_codes(np.nan_to_num(linear))
    codes[~np.isfinite(linear).all(axis=2)] = (255, 0, 255)
    return Picture(title=title, rgb=codes)


def difference(title: str, first: ArrayLike, second: ArrayLike) -> Picture:
    """The absolute difference of two linear images' 8-bit codes, times DIFFERENCE_GAIN."""
    a, b = (picture("", image).rgb.astype(int) for image in (first, second))
    return Picture(
        title=f"{title}, times {DIFFERENCE_GAIN}", rgb=np.clip(DIFFERENCE_GAIN * abs(a - b), 0, 255).astype(np.uint8)
    )
