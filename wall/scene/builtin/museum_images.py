"""Textures of the museum, by formula: parquet, woven cloth, paintings. All (h, w, 3) uint8 sRGB, row 0 at the top.

Textures that repeat on a surface have no seam.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_codes
from wall.core.data import Float64
from wall.scene.animation import Vector

Texels = NDArray[np.uint8]
PLANK_CELLS = 5  # length of a plank over its width
PARQUET_CELLS = 40  # widths of a plank across the texture: a multiple of twice PLANK_CELLS, so that it repeats


def parquet(cell: int, color: Vector) -> Texels:
    """Oak in herringbone, a plank `cell` texels wide: every plank its own tone and grain, dark joints."""
    chance = np.random.default_rng(21)
    j, i = np.mgrid[0:PARQUET_CELLS, 0:PARQUET_CELLS]
    step = (i - j) % (2 * PLANK_CELLS)
    lies = step < PLANK_CELLS  # planks that lie along x; the others stand
    done = np.where(lies, step, 2 * PLANK_CELLS - 1 - step)  # cells of the plank before this one
    plank = np.where(
        lies, j * PARQUET_CELLS + (i - step) % PARQUET_CELLS, i * PARQUET_CELLS + (j - done) % PARQUET_CELLS
    )
    number = _each(2 * plank + lies, cell)
    at = ((np.arange(cell * PARQUET_CELLS) + 0.5) / cell % 1.0).astype(np.float32)
    x, y = np.meshgrid(at, at)
    lying = _each(lies, cell)
    along, across = np.where(lying, x, y) + _each(done.astype(np.float32), cell), np.where(lying, y, x)
    tone, warm = chance.uniform(0.74, 1.2, 2 * PARQUET_CELLS**2), chance.uniform(-0.06, 0.06, 2 * PARQUET_CELLS**2)
    start = chance.integers(0, 256, 2 * PARQUET_CELLS**2)[number]
    grain = smooth_noise(chance, 256, (48, 1)).astype(np.float32)
    light = (
        0.80 + 0.40 * grain[(start + 40 * along).astype(np.int32) & 255, (start + 60 * across).astype(np.int32) & 255]
    )
    light *= np.where(
        np.minimum(np.minimum(across, 1 - across), np.minimum(along, PLANK_CELLS - along)) < 0.022, 0.35, 1.0
    )
    tint = np.array(color) * np.stack([1.0 + warm, np.ones_like(warm), 1.0 - 1.6 * warm], -1) * tone[:, None]
    return encoded(tint.astype(np.float32)[number] * light[..., None])


def weave(size: int, warp: Vector, weft: Vector, threads: int) -> Texels:
    """Twill: two colours of threads, each passing over two of the other and under two."""
    chance = np.random.default_rng(5)
    at = (np.arange(size) + 0.5) * threads / size
    x, y = np.meshgrid(at, at)
    over = ((x.astype(int) + y.astype(int)) % 4 < 2)[..., None]
    crown = 0.72 + 0.28 * np.where(over[..., 0], np.sin(np.pi * (x % 1)), np.sin(np.pi * (y % 1)))
    slub = np.where(
        over[..., 0],
        chance.uniform(0.88, 1.1, threads)[x.astype(int)],
        chance.uniform(0.88, 1.1, threads)[y.astype(int)],
    )
    return encoded(np.where(over, warp, weft) * (crown * slub)[..., None])


def hills(width: int, height: int) -> Texels:
    """A landscape at sunrise: ridges behind ridges, paler and bluer with distance, mist between them."""
    chance = np.random.default_rng(12)
    x, y = (np.arange(width) + 0.5) / height, ((np.arange(height) + 0.5) / height)[:, None]
    sky = _blend(y / 0.62, ((0.16, 0.27, 0.42), (0.50, 0.50, 0.48), (0.95, 0.66, 0.34)))
    far = np.hypot(x - 0.64 * width / height, y - 0.40)
    image = sky + np.exp(-((far / 0.16) ** 2))[..., None] * [0.42, 0.26, 0.08]
    image = np.where((far < 0.052)[..., None], (1.0, 0.90, 0.66), image)
    layers = 6
    for k in range(layers):
        near = k / (layers - 1)
        crest = 0.46 + 0.40 * near**1.1 - (0.075 + 0.03 * near) * _ridge(chance, x, 2.0 + 1.6 * near)
        below = np.clip((y - crest) / (0.20 + 0.10 * near), 0.0, 1.0)[..., None]
        color = _blend(np.array(near), ((0.62, 0.46, 0.38), (0.20, 0.27, 0.31), (0.015, 0.04, 0.045)))
        mist = _blend(np.array(near), ((0.95, 0.68, 0.42), (0.52, 0.50, 0.46), (0.05, 0.085, 0.08)))
        image = np.where((y > crest)[..., None], color + (mist - color) * 0.75 * below, image)
    return encoded(image * _canvas(chance, height, width))


def fields(width: int, height: int, ground: Vector, blocks: tuple[tuple[float, float, Vector], ...]) -> Texels:
    """Soft-edged fields of colour on a ground; blocks of (top, bottom, colour), 0 to 1 from the top."""
    chance = np.random.default_rng(8)
    x, y = (np.arange(width) + 0.5) / width, ((np.arange(height) + 0.5) / height)[:, None]
    cloud = smooth_noise(chance, 256, (20, 20))[
        np.ix_(np.arange(height) * 256 // height, np.arange(width) * 256 // width)
    ]
    image = np.array(ground) * (0.85 + 0.3 * cloud[..., None])
    for top, bottom, color in blocks:
        edge = np.minimum(np.minimum(y - top, bottom - y), np.minimum(x - 0.09, 0.91 - x) * width / height)
        share = np.clip((edge + 0.03 * (cloud - 0.5)) / 0.028 + 0.5, 0.0, 1.0)[..., None]
        image += share * (np.array(color) * (0.75 + 0.5 * cloud[::-1][..., None]) - image)
    return encoded(image * _canvas(chance, height, width))


def discs(size: int) -> Texels:
    """Rings about four centres, cut by quarters, each piece a colour of its own."""
    chance = np.random.default_rng(31)
    palette = np.array(
        [
            (0.72, 0.16, 0.07),
            (0.88, 0.52, 0.10),
            (0.03, 0.22, 0.33),
            (0.85, 0.76, 0.58),
            (0.10, 0.07, 0.10),
            (0.12, 0.35, 0.30),
        ]
    )
    at = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(at, at)
    image = np.broadcast_to(np.array((0.80, 0.70, 0.52)), (size, size, 3)).copy()
    for cx, cy, radius in ((0.36, 0.40, 0.30), (0.70, 0.66, 0.25), (0.74, 0.24, 0.15), (0.24, 0.80, 0.13)):
        ring = (np.hypot(x - cx, y - cy) / radius * 5).astype(int)
        quarter = (x > cx).astype(int) + 2 * (y > cy)
        color = palette[chance.integers(0, len(palette), (5, 4))[np.minimum(ring, 4), quarter]]
        image = np.where((ring < 5)[..., None], color, image)
    return encoded(image * _canvas(chance, size, size))


def smooth_noise(chance: np.random.Generator, size: int, reach: tuple[int, int]) -> Float64:
    """Noise (size, size) in 0..1 without a seam, each axis blurred over about `reach` texels."""
    spectrum = np.fft.rfft2(chance.standard_normal((size, size)))
    low = np.exp(-((np.fft.fftfreq(size)[:, None] * reach[0]) ** 2) - (np.fft.rfftfreq(size) * reach[1]) ** 2)
    noise = np.fft.irfft2(spectrum * low, (size, size))
    return np.asarray(np.clip(0.5 + noise / (4.0 * noise.std()), 0.0, 1.0))


def _each(cells: NDArray[Any], size: int) -> NDArray[Any]:
    """Every cell of a grid as size by size texels."""
    return cells.repeat(size, axis=0).repeat(size, axis=1)


def encoded(linear: Float64) -> Texels:
    """Linear light as sRGB bytes."""
    return srgb_codes(np.asarray(linear, np.float32))


def _blend(at: Float64, colors: tuple[Vector, ...]) -> Float64:
    """Colours (..., 3) along a row of colours that stand evenly from 0 to 1."""
    steps = np.linspace(0.0, 1.0, len(colors))
    channels = [np.interp(at, steps, [color[k] for color in colors]) for k in range(3)]
    return np.stack(channels, -1)


def _ridge(chance: np.random.Generator, x: Float64, frequency: float) -> Float64:
    """Heights along x, -1 to 1: octaves of waves."""
    height = np.zeros_like(x)
    for octave in range(7):
        phase = chance.uniform(0.0, 2.0 * np.pi)
        height += 0.55**octave * np.sin(frequency * 2.1**octave * x + phase)
    return height / 2.0


def _canvas(chance: np.random.Generator, height: int, width: int) -> Float64:
    """(h, w, 1) factor: brushwork and linen."""
    return np.asarray(chance.normal(1.0, 0.035, (height, width, 1)))
