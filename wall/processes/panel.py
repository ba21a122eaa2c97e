"""One panel at its compositor: packets in, display values out, only what changed is redone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.data import Batch
from wall.deepbuffer.buffer import DeepBuffer
from wall.deepbuffer.kernels import TILE
from wall.display.base import PanelPicture
from wall.geometry.panels import Panel
from wall.reconstruction.display_values import update_display


class PanelCompositor:
    """`insert` batches as they come, `refresh` at every display refresh."""

    def __init__(self, panel: Panel) -> None:
        self.panel = panel
        width, height = panel.pixels
        self.buffer = DeepBuffer(width, height)
        self._rgb = np.zeros((height, width, 3), np.uint8)
        self._picture = self._hand_over(version=0)

    def insert(self, batch: Batch) -> None:
        self.buffer.insert(batch)

    def refresh(self) -> NDArray[np.bool_]:
        """Bring display values up to date. Returns the 16-pixel tiles that changed, (rows, columns) bool."""
        dirty = self.buffer.take_dirty()
        if dirty.any():
            update_display(self.buffer.radiance, dirty, TILE, self._rgb)
            self._picture = self._hand_over(version=self._picture.version + 1)
        return dirty

    def oldest_sample(self, now: float) -> float | None:
        """Age in seconds of the oldest sample shown; None while a pixel never had one."""
        age = self.buffer.oldest_sample(now)
        return age if math.isfinite(age) else None

    def picture(self) -> PanelPicture:
        """What the panel shows after the last refresh."""
        return self._picture

    def _hand_over(self, *, version: int) -> PanelPicture:
        rgb = self._rgb.copy()  # sinks keep what they get: never written again
        return PanelPicture(id=self.panel.id, rgb=rgb, screen=self.panel.screen, version=version)
