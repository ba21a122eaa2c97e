"""The second picture of a panel while another sampler is compared with the adaptive one; gone when that ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.display.base import PanelPicture
from wall.geometry.panels import Panel
from wall.reconstruction.channels import blank_framelet
from wall.reconstruction.display_values import update_display


class Compared:
    """Every pixel shows its newest sample of `method`; black until there is one."""

    def __init__(self, panel: Panel, method: str, *, version: int) -> None:
        """`version`: of its first picture; greater than any of an earlier comparison."""
        width, height = panel.pixels
        self.method, self._panel = method, panel
        self.buffer = PixelBuffer(width, height)
        self.framelet = blank_framelet(panel, frozenset({"colour"}), encoded=True, order=0)
        self._picture = self._hand_over(version)

    def refresh(self) -> NDArray[np.bool_]:
        """Bring display values up to date. Returns the 16-pixel tiles that changed, (rows, columns) bool."""
        dirty = self.buffer.take_dirty()
        if dirty.any():
            update_display(self.buffer.radiance, dirty, TILE, self.framelet.colour)
            self._picture = self._hand_over(self._picture.version + 1)
        return dirty

    def picture(self) -> PanelPicture:
        """What it shows after the last refresh."""
        return self._picture

    def _hand_over(self, version: int) -> PanelPicture:
        rgb = self.framelet.colour.copy()  # sinks keep what they get: never written again
        return PanelPicture(id=self._panel.id, rgb=rgb, screen=self._panel.screen, version=version)
