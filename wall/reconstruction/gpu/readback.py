"""Bring what shaders wrote to the CPU, by way of textures.

A driver may keep a buffer that is read in the CPU's memory, where shaders write at a hundredth of their speed. And on
an NVIDIA H200 (driver 580.159) copies of such buffers to others were not always complete when those were read. A
texture stays where it is, and to read it is to wait for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.reconstruction.gpu.device import WORD_BYTES, Device

COLUMNS = 2048  # words in a row of a texture


class Readback:
    """Reads buffers of 4-byte words; keeps a texture for each size that was read."""

    def __init__(self, device: Device) -> None:
        self._device, self._textures = device, dict[int, Any]()

    def read(self, source: Any, out: NDArray[Any], *, first: int = 0) -> None:
        """Fill `out`, of any type and shape, from the word `first` of a buffer on."""
        words = -(-out.nbytes // WORD_BYTES)
        texture = self._texture(words)
        texture.bind_to_image(0, read=False, write=True)
        self._device.compute("unload", words, (source,), first=first)
        columns, rows = texture.size
        if columns * rows * WORD_BYTES == out.nbytes and out.flags.c_contiguous:
            self._device.read(texture, out)
            return
        values = np.empty(columns * rows, np.uint32)
        self._device.read(texture, values)
        out[...] = values.view(np.uint8)[: out.nbytes].view(out.dtype).reshape(out.shape)

    def _texture(self, words: int) -> Any:
        if words not in self._textures:
            columns = next(c for c in range(min(words, COLUMNS), 0, -1) if words % c == 0)
            if columns * self._device.largest_texture < words:  # no such divisor
                columns = COLUMNS
            self._textures[words] = self._device.context.texture((columns, -(-words // columns)), 1, dtype="u4")
        return self._textures[words]
