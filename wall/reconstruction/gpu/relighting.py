"""Stored samples in the light of a new moment, on the GPU, as `reconstruction.kernels_relight` says it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.reconstruction.gpu.device import LAMP_WORDS, Device
from wall.reconstruction.gpu.store import GpuStore, reserve
from wall.reconstruction.lamps import Lamps

UP_WORDS = 4  # the world's y axis, and whether the object's light changed


class Relighting:
    """What samples are lit anew by: the sky, and lamps in the frames of all objects."""

    def __init__(self, device: Device, irradiance: Float32, *, objects: int, lamps: int) -> None:
        """`irradiance` (k, 3) float32, of the sky by the normal's height. Raises GpuError where memory ends."""
        self._device, self._steps = device, len(irradiance) - 1
        self._sky = device.context.buffer(np.ascontiguousarray(irradiance))
        self._up = reserve(device, UP_WORDS * objects)
        self._lamps = reserve(device, LAMP_WORDS * objects * lamps)

    def run(self, store: GpuStore, now: Lamps, changed: NDArray[np.bool_]) -> None:
        """Light the samples of `changed` objects (n + 1,) anew."""
        if store.count == 0 or not changed.any():
            return
        self._up.write(np.column_stack([now.up, changed]).astype(np.float32))
        self._lamps.write(np.ascontiguousarray(now.lamps))
        a = store.arrays
        buffers = (a["place"], a["name"], a["colour"], a["surface"], a["albedo"], self._up, self._lamps, self._sky)
        self._device.compute(
            "relight", store.count, buffers, lights=now.lamps.shape[1], suns=now.suns, steps=self._steps
        )
