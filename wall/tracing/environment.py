"""Tables of an environment for kernels: chances of texels for paths, irradiance by normal for direct light."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import LUMINANCE, Real
from wall.core.data import Float32, Float64
from wall.scene import model
from wall.tracing.kernels.values import ONE, Environment

STEPS = 128  # of the octahedron that normals are unfolded to: irradiance within 1.5 % of a single distant light's
COARSE = 64  # rows of cells that light is gathered in for irradiance, each at its own middle
FINEST = 256  # rows that a smaller image is refined to before that
EVEN = 1e-4  # of its mean: an image that is nowhere brighter by more has nothing to aim at
CHUNK = 2048  # normals at once


def environment_tables(environment: model.Environment, *, paths: bool) -> Environment:
    """What kernels read of an environment; chances for `paths`, else irradiance."""
    texels, middle = environment.texels, environment.middle
    if paths:
        row_sums, column_sums = chances(texels)
        return Environment(texels, middle, row_sums, column_sums, np.zeros((0, 0, 3), np.float32), ONE)
    none = np.zeros(0, np.float32), np.zeros((0, 0), np.float32)
    return Environment(texels, middle, *none, irradiance_by_normal(environment), ONE)


def chances(texels: Float32) -> tuple[Float32, Float32]:
    """Sums of the chances of rows (h + 1,) and of the texels of each row (h, w + 1), from 0 to 1.

    texels : (h, w, 3). A texel's chance is its solid angle times what the mean luminance of the bilinear image over it,
    3/4 its own and 1/8 each neighbour's along both axes, has above that of the whole image: rays that scatter find the
    rest well enough (O. Karlik et al., "MIS Compensation", 2019). In an even image all directions have the same.
    """
    light = texels.astype(np.float64) @ LUMINANCE
    for axis in (1, 0):
        light = 0.75 * light + 0.125 * (_beside(light, -1, axis) + _beside(light, 1, axis))
    size = solid_angles(*light.shape)[:, None]
    mean = (light * size).sum() / (4.0 * math.pi)
    light = np.maximum(light - mean, 0.0)
    light = (light if light.max() > EVEN * mean else np.ones_like(light)) * size
    rows = light.sum(axis=1)
    return _sums(rows), _sums(np.where(rows[:, None] > 0.0, light, 1.0))


def _sums(chances: Float64) -> Float32:
    """(..., n + 1) float32 sums along the last axis of (..., n), from 0 to 1 exactly."""
    sums = np.cumsum(chances, axis=-1)
    sums = np.concatenate([np.zeros_like(sums[..., :1]), sums / sums[..., -1:]], axis=-1)
    return np.ascontiguousarray(sums, np.float32)


def solid_angles(height: int, width: int) -> Float64:
    """(h,) float64: of a texel of each row of a lat-long image, sr."""
    edges = np.cos(np.arange(height + 1) * (math.pi / height))
    return np.asarray((edges[:-1] - edges[1:]) * (2.0 * math.pi / width), np.float64)


def texel_directions(height: int, width: int, middle: float) -> Float64:
    """(h, w, 3) float64 unit directions of the texels' centres; middle : u of the direction -z."""
    polar = (np.arange(height) + 0.5)[:, None] * (math.pi / height)
    turn = ((np.arange(width) + 0.5)[None] / width - middle) * (2.0 * math.pi)
    sine = np.sin(polar)
    return np.stack([sine * np.sin(turn), np.cos(polar) + 0.0 * turn, -sine * np.cos(turn)], axis=-1)


def irradiance_by_normal(environment: model.Environment) -> Float32:
    """(STEPS + 1, STEPS + 1, 3) irradiance over pi, by the normal on an octahedron unfolded about +y.

    The light of each coarse cell comes from the mean direction of its light, which leaves the sum over cells that a
    normal sees whole exact.
    """
    cells, directions = gathered(environment)
    normals = octahedron_normals(STEPS)
    table = np.empty((len(normals), 3), np.float32)
    for first in range(0, len(normals), CHUNK):
        cosines = np.maximum(normals[first : first + CHUNK] @ directions.T, 0.0)
        table[first : first + CHUNK] = cosines @ cells
    return (table / np.float32(math.pi)).reshape(STEPS + 1, STEPS + 1, 3)


def gathered(environment: model.Environment) -> tuple[Float32, Float32]:
    """Light of coarse cells (k, 3), radiance times sr, and the mean direction (k, 3) of each cell's luminance."""
    texels = refined(environment.texels)
    height, width = texels.shape[:2]
    directions = texel_directions(height, width, float(environment.middle))
    light = texels * solid_angles(height, width)[:, None, None]
    weight = (light @ LUMINANCE)[..., None]
    row = np.arange(height) * COARSE // height
    column = np.arange(width) * 2 * COARSE // width
    cell = (row[:, None] * (2 * COARSE) + column).ravel()

    def summed(values: Float64) -> Float64:
        parts = [np.bincount(cell, values[..., c].ravel(), minlength=2 * COARSE**2) for c in range(values.shape[-1])]
        return np.stack(parts, axis=-1)

    weights = summed(weight)
    lit = weights[:, 0] > 0.0
    return summed(light)[lit].astype(np.float32), (summed(weight * directions)[lit] / weights[lit]).astype(np.float32)


def refined(texels: Float32) -> Float32:
    """The bilinear image of texels (h, w, 3) in FINEST rows or more, a whole number of times as many."""
    for axis in (0, 1):
        times = -(-FINEST * (1 + axis) // texels.shape[axis])
        if times == 1:
            continue
        parts = []
        for k in range(times):
            off = (k + 0.5) / times - 0.5
            other = _beside(texels, -1 if off < 0.0 else 1, axis)
            parts.append((1.0 - abs(off)) * texels + abs(off) * other)
        texels = np.stack(parts, axis=axis + 1).reshape(*texels.shape[:axis], -1, *texels.shape[axis + 1 :])
    return texels.astype(np.float32)


def _beside(values: NDArray[Real], step: int, axis: int) -> NDArray[Real]:
    """What texels have `step` further along an axis of the image: round the turn, not over the poles."""
    numbers = np.arange(values.shape[axis]) + step
    return values.take(numbers, axis, mode="wrap" if axis == 1 else "clip")


def octahedron_normals(steps: int) -> Float32:
    """((steps + 1)^2, 3) float32 unit normals, row after row of the octahedron unfolded about +y."""
    s, t = np.meshgrid(np.linspace(-1.0, 1.0, steps + 1), np.linspace(-1.0, 1.0, steps + 1))
    y = 1.0 - np.abs(s) - np.abs(t)
    below = np.maximum(-y, 0.0)
    x, z = s - np.copysign(below, s), t - np.copysign(below, t)
    normals = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    unit: Float32 = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    return unit
