"""Show the newest sample of each pixel, where it was traced: framed and frameless samplers without reprojection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import StatisticsImage
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.geometry.panels import Panel
from wall.reconstruction.channels import blank_framelet, show_newest
from wall.roles.layer_image import LayerImage
from wall.roles.statistics import statistics_image_of


class PixelLayer:
    """A pixel buffer, and the image that it is shown in."""

    def __init__(self, image: LayerImage, *, transparent: bool = False, compared: bool = False) -> None:
        """`transparent`: pixels whose samples hit nothing have alpha 0; `compared`: the second of two samplers."""
        self.image, self._transparent, self._compared = image, transparent, compared
        width, height = image.panel.pixels
        self.buffer = PixelBuffer(width, height)

    def refresh(self, now: float) -> NDArray[np.bool_]:
        """Write what changed to the framelet. Returns the 16-pixel tiles that changed, (rows, columns) bool."""
        dirty = self.buffer.take_dirty()
        if dirty.any():
            self.image.framelet.stamp(now)
            show_newest(self.buffer, dirty, self._transparent, self.image.framelet)
            self.image.version += 1
        return dirty

    def statistics_image(self, now: float) -> StatisticsImage:
        """Age and density of its samples, for tiles of a fixed grid."""
        return statistics_image_of(self.buffer, [], self.image.panel.index, compared=self._compared, now=now)


def compared_layer(panel: Panel, *, version: int) -> PixelLayer:
    """Make the layer of the second sampler of a comparison: opaque, black until samples come.

    `version`: of its first picture; greater than any of an earlier comparison.
    """
    framelet = blank_framelet(panel, frozenset({"colour"}), encoded=True, order=0)
    return PixelLayer(LayerImage(panel, framelet, version=version), compared=True)
