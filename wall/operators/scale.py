"""`scale`: resample a framelet to more or fewer pixels.

Filters are separable and normalised, so constants stay; for fewer pixels their support grows with the step, so nothing
aliases. Unlike with Pillow's resize, any region of the output equals that region of the whole, pixels without weight
may be NaN, and variances are filtered by squared weights.

Sources: Mitchell and Netravali, SIGGRAPH 1988 (Catmull-Rom is their B = 0, C = 1/2); Duchon, J. Applied Meteorology 18,
1979 (Lanczos).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import Field

from wall.core.data import Float32, Float64, Framelet, Rect
from wall.core.fields import Number
from wall.operators.base import Extent, Input, Operator
from wall.operators.kernels import resample as kernels
from wall.operators.regions import MIXED, copy_nearest, corner_of, pixels_of

Filter = Literal["box", "triangle", "catmull_rom", "lanczos3"]
Factor = Annotated[Number, Ge(1 / 256), Le(256.0)]


class Scale(Operator):
    """The frame scaled about its origin, so that neighbours stay neighbours.

    box: the mean of the area that a pixel covers; triangle: linear interpolation; catmull_rom: sharper, overshoots at
    edges; lanczos3: sharpest, overshoots more. Alpha is clipped to 0..1. Depth, time and object are those of the pixel
    at the new one's centre: a mean of two surfaces would be of neither.
    """

    op: Literal["scale"] = Field(description="more or fewer pixels")
    input: Input
    factor: Factor | tuple[Factor, Factor] | None = Field(default=None, description="of both axes, or across and down")
    size: tuple[Extent, Extent] | None = Field(default=None, description="width and height, pixels; or a factor")
    filter: Filter = Field(description="box, triangle, catmull_rom or lanczos3")

    ONE_OF: ClassVar[tuple[str, str, str] | None] = ("factor", "size", "factor: 0.5 or size: [width, height]")
    KEEPS_RAYS: ClassVar[bool] = False

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The scaled rectangle, rounded to whole pixels."""
        rect = inputs[0]
        across, down = self._factors(rect)
        width, height = self.size or (_rounded(rect.width * across), _rounded(rect.height * down))
        return Rect(x=_rounded(rect.x * across), y=_rounded(rect.y * down), width=max(1, width), height=max(1, height))

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """The pixels whose filter reaches into `rect`."""
        whole, out = inputs[0], self.rect(inputs)
        x, right = _reached(rect.x - whole.x, rect.right - whole.x, whole.width, out.width, self.filter)
        y, bottom = _reached(rect.y - whole.y, rect.bottom - whole.y, whole.height, out.height, self.filter)
        return Rect(x=out.x + x, y=out.y + y, width=right - x, height=bottom - y)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the resampled pixels of a region."""
        source = inputs[0]
        (x, y), size = corner_of(out, region), (source.rect, out.rect)
        across = _taps(size[0].width, size[1].width, self.filter).cut(x, x + region.width)
        down = _taps(size[0].height, size[1].height, self.filter).cut(y, y + region.height)
        for name in out.channels & MIXED:
            here = pixels_of(out, name, region)
            filtered = _filtered(source.channel(name), across, down, squared=name == "variance")
            here[...] = np.clip(filtered, 0.0, 1.0) if name == "alpha" else filtered
        copy_nearest(source, out, region, down.nearest[:, None], across.nearest)

    def _factors(self, rect: Rect) -> tuple[float, float]:
        if self.size is not None:
            return self.size[0] / rect.width, self.size[1] / rect.height
        return self.factor if isinstance(self.factor, tuple) else (self.factor or 1.0, self.factor or 1.0)


def _rounded(value: float) -> int:
    return math.floor(value + 0.5)


def _catmull_rom(x: Float64) -> Float64:
    x = np.abs(x)
    inner, outer = (1.5 * x - 2.5) * x * x + 1.0, ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    return np.where(x < 1.0, inner, np.where(x < 2.0, outer, 0.0))


SHAPES: dict[str, tuple[float, Callable[[Float64], Float64]]] = {  # radius in pixels, and the filter
    "triangle": (1.0, lambda x: np.maximum(0.0, 1.0 - np.abs(x))),
    "catmull_rom": (2.0, _catmull_rom),
    "lanczos3": (3.0, lambda x: np.where(np.abs(x) < 3.0, np.sinc(x) * np.sinc(x / 3.0), 0.0)),
}


class Taps(NamedTuple):
    """Which pixels of a row make each pixel of the scaled row."""

    first: NDArray[np.int64]  # (n,) the first of them
    weights: Float32  # (n, taps) weights of it and the following, rows sum to 1; 0 behind the last
    nearest: NDArray[np.int64]  # (n,) the one at the new pixel's centre

    def cut(self, start: int, end: int) -> Taps:
        """Those of the new pixels from `start` to before `end`."""
        return Taps(self.first[start:end], self.weights[start:end], self.nearest[start:end])


@lru_cache(maxsize=64)
def _taps(old: int, new: int, shape: str) -> Taps:
    """Of `old` pixels in a row to `new` ones; filters are cut off at the ends and normalised again."""
    step = old / new
    centre = (np.arange(new) + 0.5) * step
    radius = _radius(step, shape)
    first = np.clip(np.floor(centre - radius), 0, old - 1).astype(np.int64)
    count = int(np.ceil(2 * radius)) + 1
    at = first[:, None] + np.arange(count)
    if shape == "box":
        left, right = centre[:, None] - step / 2, centre[:, None] + step / 2
        weights = np.clip(np.minimum(at + 1, right) - np.maximum(at, left), 0.0, None)
    else:
        weights = SHAPES[shape][1]((at + 0.5 - centre[:, None]) / max(1.0, step))
    weights[at >= old] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    return Taps(first, weights.astype(np.float32), np.minimum(centre.astype(np.int64), old - 1))


def _radius(step: float, shape: str) -> float:
    """How far a new pixel's centre is from the farthest edge of a pixel that it may take from; old pixels."""
    return step / 2 if shape == "box" else SHAPES[shape][0] * max(1.0, step) + 0.5


def _reached(start: int, end: int, old: int, new: int, shape: str) -> tuple[int, int]:
    """New pixels that take from old ones from `start` to before `end`."""
    step = old / new
    radius = _radius(step, shape)
    low, high = math.floor((start - radius) / step - 0.5), math.ceil((end + radius) / step + 0.5)
    low = min(max(low, 0), new - 1)
    return low, max(low + 1, min(high, new))


def _filtered(values: NDArray[Any], across: Taps, down: Taps, *, squared: bool) -> Float32:
    """(h, w) or (h, w, 3) float32 through both filters; with squared weights for variances."""
    planes = values[..., None] if values.ndim == 2 else values
    wide, high = ((t.weights**2 if squared else t.weights) for t in (across, down))
    top, bottom = int(down.first.min()), min(int(down.first.max()) + high.shape[1], values.shape[0])
    rows = np.empty((bottom - top, len(wide), planes.shape[2]), np.float32)
    kernels.filter_rows(planes, top, across.first, wide, rows)
    out = np.empty((len(high), len(wide), planes.shape[2]), np.float32)
    kernels.filter_columns(rows, down.first - top, high, out)
    return out[..., 0] if values.ndim == 2 else out
