"""What a layer of a panel shows: a framelet, and the same as display bytes for sinks."""

from __future__ import annotations

import numpy as np

from wall.core.data import Framelet
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.display.base import PanelPicture
from wall.geometry.panels import Panel
from wall.reconstruction.display_values import update_display


class LayerImage:
    """A framelet that its owner writes; `picture` copies it as display bytes, once a version."""

    def __init__(self, panel: Panel, framelet: Framelet, *, version: int = 0) -> None:
        """`version`: of the first picture; the owner increases it whenever it has written the framelet."""
        self.panel, self.framelet, self.version = panel, framelet, version
        self._picture: PanelPicture | None = None

    def picture(self) -> PanelPicture:
        """The framelet as display bytes. A picture is never written again: sinks keep it."""
        if self._picture is None or self._picture.version != self.version:
            rgb = self.framelet.colour.copy()
            if not self.framelet.encoded:
                rows, columns = (-(-size // TILE) for size in rgb.shape[:2])
                rgb = np.empty(rgb.shape, np.uint8)
                update_display(self.framelet.colour, np.ones((rows, columns), np.bool_), TILE, rgb)
            self._picture = PanelPicture(id=self.panel.id, rgb=rgb, screen=self.panel.screen, version=self.version)
        return self._picture
