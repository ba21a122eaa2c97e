"""Images of the albedos and normals that noisy samples bring: what a denoiser may know beside the colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.splat import splat
from wall.reconstruction.kernels.surfaces import rows_of_surfaces
from wall.reconstruction.pyramid import Pyramid

BOX = np.float32(1e6)  # sharpness of splats: pixels at rest show means of their own samples, surfaces are to fit them
NO_IRRADIANCE: Float32 = np.zeros((0, 0, 2), np.float32)


class SurfaceImages:
    """Means of each pixel's samples, weighted as those of the image; only where a graph asks for them."""

    def __init__(self, height: int, width: int, capacity: int) -> None:
        self._rows = np.zeros((2, capacity, 4), np.float32)
        self._sums = np.zeros((2, height + 2, width + 2, 4), np.float32)
        self._bounds = np.full((3, height, width), BOX, np.float32)
        self._pyramid = Pyramid(height, width)

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return self._pyramid.bytes + sum(array.nbytes for array in (self._rows, self._sums, self._bounds))

    def splat(
        self, store: SampleStore, weight: Float32, count: int, tiles: NDArray[np.bool_], object_from_eye: Float32
    ) -> None:
        """Sum up the samples of all tiles; see kernels.splat."""
        rows_of_surfaces(store, weight, count, object_from_eye, *self._rows)
        for rows, sums in zip(self._rows, self._sums, strict=True):
            splat(store._replace(radiance=rows), weight, count, self._bounds, tiles, sums, NO_IRRADIANCE, None)

    def write(self, albedo: Float32, normal: Float32) -> None:
        """Write both images, (h, w, 3) float32; holes are filled."""
        for sums, out in zip(self._sums, (albedo, normal), strict=True):
            self._pyramid.resolve(sums, out)
