"""Show the newest sample of each pixel, where it was traced: framed and frameless samplers without reprojection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Framelet, StatisticsImage
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.geometry.panels import Panel
from wall.reconstruction.channels import blank_framelet, show_newest
from wall.roles.statistics import statistics_image_of


class PixelLayer:
    """A pixel buffer, and the framelet that it is shown in."""

    def __init__(self, panel: Panel, framelet: Framelet, *, transparent: bool = False, compared: bool = False) -> None:
        """`transparent`: pixels whose samples hit nothing have alpha 0; `compared`: the second of two samplers."""
        self.framelet, self._panel, self._transparent, self._compared = framelet, panel, transparent, compared
        width, height = panel.pixels
        self.buffer = PixelBuffer(width, height)
        self._tone: Tone | None = None  # of what the framelet shows

    def refresh(self, now: float, tone: Tone = AS_IT_IS) -> NDArray[np.bool_]:
        """Write what changed to the framelet, exposed and mapped: all of it where `tone` differs from before.

        Returns the 16-pixel tiles that changed, (rows, columns) bool.
        """
        dirty = self.buffer.take_dirty() | (self._tone not in (None, tone))
        self._tone = tone
        if dirty.any():
            self.framelet.stamp(now)
            for surfaces in (self.framelet.albedo, self.framelet.normal):
                if surfaces is not None:
                    surfaces[:] = 0.0  # of reprojected samples, which no longer show
            show_newest(self.buffer, dirty, self._transparent, self.framelet, tone=tone)
        return dirty

    def statistics_image(self, now: float) -> StatisticsImage:
        """Age and density of its samples, for tiles of a fixed grid."""
        return statistics_image_of(self.buffer, [], self._panel.index, compared=self._compared, now=now)


def compared_layer(panel: Panel, framelet: Framelet | None = None) -> PixelLayer:
    """Make the layer of the second sampler of a comparison: opaque, black until it is given an image.

    `framelet`: of the comparison before, which the graph's nodes go on to read.
    """
    framelet = framelet or blank_framelet(panel, frozenset({"colour"}), encoded=True, order=0)
    return PixelLayer(panel, framelet, compared=True)
