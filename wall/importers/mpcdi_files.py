"""The warps and masks that an MPCDI archive holds, as arrays and files of a configuration."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from wall.core.data import Float64
from wall.operators.blend_mask import mask_values

GAMMA = 2.2  # of projectors, which MPCDI does not say: light = value ^ gamma


def read_pfm(data: bytes, pixels: tuple[int, int]) -> Float64:
    """(h, w, 3) float64, the first row at the top: the vector of each of a projector's `pixels`, width and height.

    A file of as many pixels holds those of their centres; one of fewer a grid from edge to edge, linear between. NaN
    where the file has none. Raises ValueError for what is no colour PFM (Debevec's format; MPCDI begins at the top).
    """
    parts = data.split(maxsplit=3)[:3] if data[:2] == b"PF" else []
    if len(parts) < 3:
        raise ValueError("is no colour PFM")
    width, height = int(parts[1]), int(parts[2])
    rest = data[data.index(parts[2], data.index(parts[1], 2) + len(parts[1])) + len(parts[2]) :].lstrip()
    scale, _, values = rest.partition(b"\n")
    if not 2 <= width <= 1 << 14 or not 2 <= height <= 1 << 14 or len(values) < 12 * width * height:
        raise ValueError(f"has {len(values)} bytes for {width} x {height} vectors")
    kind = np.dtype("<f4" if float(scale) < 0.0 else ">f4")
    grid = np.frombuffer(values, kind, 3 * width * height).reshape(height, width, 3).astype(np.float64)
    grid[~np.isfinite(grid[..., :2]).all(axis=2)] = np.nan
    return grid if (width, height) == pixels else _between(grid, pixels)


def _between(grid: Float64, pixels: tuple[int, int]) -> Float64:
    """The grid at the centres of pixels, linear between its nodes, which stand from edge to edge."""
    for axis, count in ((1, pixels[0]), (0, pixels[1])):
        last = grid.shape[axis] - 1
        at = (np.arange(count) + 0.5) / count * last
        first = np.minimum(at.astype(int), last - 1)
        share = (at - first).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        grid = np.take(grid, first, axis) * (1.0 - share) + np.take(grid, first + 1, axis) * share
    return grid


def npy(values: Float64) -> bytes:
    """A .npy file of single precision: 1/100 pixel of 16,384."""
    out = io.BytesIO()
    np.save(out, values.astype(np.float32))
    return out.getvalue()


def mask(data: bytes, pixels: tuple[int, int], gamma: float) -> bytes:
    """A PNG of the factors of display values: of `pixels`, for a projector of GAMMA. `data`: share ^ (1 / gamma).

    Raises ValueError for what is no PNG.
    """
    try:
        values = mask_values(io.BytesIO(data))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"is no PNG ({error})") from None
    if values.shape[1::-1] == pixels and gamma == GAMMA:
        return data
    channels = [Image.fromarray(channel) for channel in np.moveaxis(values, 2, 0)]
    resized = [np.asarray(channel.resize(pixels, Image.Resampling.BILINEAR)) for channel in channels]
    factors = [np.clip(channel, 0.0, 1.0) ** (gamma / GAMMA) for channel in resized]
    out = io.BytesIO()
    if len(factors) == 1:
        Image.fromarray(np.round(factors[0] * 65535.0).astype(np.uint16)).save(out, "PNG")
    else:
        Image.fromarray(np.round(np.stack(factors, axis=-1) * 255.0).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()
