"""Light stored samples anew on the GPU, as `reconstruction.kernels.relight` does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.lights import ObjectLights
from wall.reconstruction.gpu.device import LIGHT_WORDS, Device
from wall.reconstruction.gpu.store import GpuStore

UP_WORDS = 4  # the world's y axis, and whether the object's light changed


class Relighting:
    """The sky and the lights in the frames of all objects, in the GPU's memory."""

    def __init__(self, device: Device, irradiance: Float32, *, objects: int, lights: int) -> None:
        """`irradiance` (k, 3) float32, of the sky by the normal's height. Raises GpuError where memory ends."""
        self._device, self._steps = device, len(irradiance) - 1
        self._sky, self._irradiance = device.buffer(irradiance), irradiance
        self._up = device.reserve(UP_WORDS * objects)
        self._lights = device.reserve(LIGHT_WORDS * objects * lights)

    def run(self, store: GpuStore, now: ObjectLights, changed: NDArray[np.bool_]) -> None:
        """Light the samples of `changed` objects (n + 1,) anew."""
        if store.count == 0 or not changed.any():
            return
        if now.sky is not self._irradiance:
            self._device.write(self._sky, now.sky)
            self._irradiance = now.sky
        self._device.write(self._up, np.column_stack([now.up, changed]).astype(np.float32))
        self._device.write(self._lights, now.rows)
        names = ("position", "object_id", "radiance", "surface", "albedo")
        buffers = (*(store.arrays[name] for name in names), self._up, self._lights, self._sky)
        self._device.compute(
            "relight", store.count, buffers, lights_per_object=now.rows.shape[1], directional=now.directional,
            steps=self._steps,
        )  # fmt: skip
