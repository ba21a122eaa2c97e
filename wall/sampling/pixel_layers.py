"""What offline images may hold beside the colour of each pixel: depth, object, variance, albedo and normal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import BLANK, Float32, Float64, Rect, Samples
from wall.core.errors import ConfigError
from wall.sampling.kernels import pixel_layers as kernels
from wall.sampling.pixel_means import PixelMeans

LAYERS = ("albedo", "normal", "depth", "variance", "object_id")
SURFACE_LAYERS = frozenset({"albedo", "normal"})  # which need samples of their own
WIDTHS = {"colour": 3, "albedo": 3, "normal": 3, "depth": 1, "variance": 1, "object_id": 1}
Layer = NDArray[Any]  # (h, w, 3) or (h, w) float32; object_id: (h, w) uint32


def checked_layers(names: Iterable[str], *, where: str) -> tuple[str, ...]:
    """Layers by name, each once. Raises ConfigError, which begins with `where`, for a name that is none."""
    found = tuple(dict.fromkeys(names))
    for name in found:
        if name not in LAYERS:
            raise ConfigError(f"{where}: {name!r} is no layer; accepted: {', '.join(LAYERS)}")
    return found


class PixelLayers:
    """The layers of one band: `add` samples as they are traced, `stacked` at the end."""

    def __init__(self, rect: Rect, layers: Sequence[str]) -> None:
        size = rect.height, rect.width
        self._rect, self._layers = rect, layers
        self._squares = np.zeros((*size, 3))
        self._depth, self._object_id = np.full(size, np.inf, np.float32), np.zeros(size, np.uint32)
        self._albedo, self._normal = np.zeros((*size, 3)), np.zeros((*size, 3))
        self._counts = np.zeros(size, np.int64)  # of samples of surfaces

    def add(self, samples: Samples) -> None:
        """Add the samples that make the colour."""
        x, y = self._rect.x, self._rect.y
        kernels.accumulate_layers(samples, x, y, self._squares, self._depth, self._object_id)

    def add_surfaces(self, samples: Samples, world_from_normal: Float32) -> None:
        """Add samples that bring albedos and normals; `world_from_normal`: see normal_matrices."""
        rect, sums = self._rect, (self._albedo, self._normal, self._counts)
        kernels.accumulate_surfaces(samples, rect.x, rect.y, world_from_normal, *sums)

    def stacked(self, means: PixelMeans) -> Float32:
        """(h, w, columns) float32: colour and layers side by side, object ids by their bits; see unstacked."""
        mean, counts = means.mean(), np.maximum(self._counts, 1)[:, :, None]
        normal = self._normal / np.maximum(np.linalg.norm(self._normal, axis=2, keepdims=True), 1e-30)
        made: dict[str, NDArray[Any]] = {
            "colour": mean,
            "albedo": self._albedo / counts,
            "normal": normal,
            "depth": self._depth,
            "variance": self._variance(mean, means.counts),
            "object_id": self._object_id.view(np.float32),
        }
        columns = [made[name].astype(np.float32, copy=False) for name in ("colour", *self._layers)]
        return np.dstack(columns)

    def _variance(self, mean: Float64, counts: NDArray[np.int64]) -> Float64:
        """(h, w) of each pixel's mean, mean of the three channels; infinite where there is only one sample."""
        n = np.maximum(counts, 1)[:, :, None]
        squares = np.maximum(self._squares - n * mean * mean, 0.0) / (np.maximum(n - 1, 1) * n)
        found: Float64 = np.where(counts > 1, squares.mean(axis=2), np.inf)
        return found


def unstacked(image: Float32, layers: Sequence[str]) -> dict[str, Layer]:
    """The colour and the layers of a stacked image, each an array of its own."""
    found, first = dict[str, Layer](), 0
    for name in ("colour", *layers):
        part = np.ascontiguousarray(image[:, :, first : first + WIDTHS[name]])
        first += WIDTHS[name]
        found[name] = part if WIDTHS[name] == 3 else part[:, :, 0].copy()
    if "object_id" in found:
        found["object_id"] = found["object_id"].view(np.uint32)
    return found


def blank_columns(layers: Sequence[str]) -> Float32:
    """(columns,) of a stacked image where nothing was rendered: black, infinitely far."""
    values = [BLANK.get(name, (0.0, np.float32))[0] for name in ("colour", *layers) for _ in range(WIDTHS[name])]
    return np.array(values, np.float32)


def normal_matrices(world_from_object: Float64) -> Float32:
    """(n, 9) float32 rows of the matrices that turn normals of objects (n, 4, 4) to the world's axes.

    They are the inverses' transposes times the size of their determinants, which also hold where there is no inverse.
    """
    m = world_from_object[:, :3, :3]
    cofactors = np.stack([np.cross(m[:, (k + 1) % 3], m[:, (k + 2) % 3]) for k in range(3)], axis=1)
    sign = np.where((cofactors[:, 0] * m[:, 0]).sum(axis=1) < 0.0, -1.0, 1.0)
    size = np.maximum(np.abs(cofactors).max(axis=(1, 2)), 1e-300)
    matrices: Float32 = (cofactors * (sign / size)[:, None, None]).reshape(-1, 9).astype(np.float32)
    return matrices
