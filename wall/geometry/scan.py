"""When the rows of a scanning display become light: the top one first, the bottom one up to a refresh later.

After Mine and Bishop, "Just-In-Time Pixels", 1993: each row shows the scene of the moment at which it is scanned out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from wall.config.screens import PanelConfig
from wall.core.data import Float32, Float64, Rect

MOST_BANDS = 16  # parts of a batch or of a scan that are traced for a moment each
LEAST_ROWS = 16  # of such a part: those of a tile

Seconds = TypeVar("Seconds", float, Float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """When a display lights the pixels of a panel: seconds after its first row, linear in panel pixels."""

    first: float  # of the top left corner
    per_x: float  # a pixel to the right
    per_y: float  # a pixel down

    def at(self, x: Seconds, y: Seconds) -> Seconds:
        """Seconds after the first row at (x, y), panel pixels."""
        return self.first + x * self.per_x + y * self.per_y

    @property
    def row_time(self) -> float:
        """Seconds from one row to the next."""
        return abs(self.per_x) + abs(self.per_y)

    def bands(self, xy: Float32) -> list[tuple[float, Float32]]:
        """Positions (n, 2), panel pixels, in parts of rows that are light at about the same time, the first row first.

        Returns
        -------
        parts : (seconds of its middle row, (m, 2) float32 positions in the order in which they came); a part spans
            LEAST_ROWS rows, or a sixteenth of those of all positions if that is more
        """
        if len(xy) == 0:
            return []
        seconds = self.at(xy[:, 0].astype(np.float64), xy[:, 1].astype(np.float64))
        first, last = float(seconds.min()), float(seconds.max())
        length = max(LEAST_ROWS * self.row_time, (last - first) / MOST_BANDS)
        band = np.minimum((seconds - first) / length, MOST_BANDS - 1).astype(np.int64)
        parts = []
        for k in np.unique(band):
            inside = band == k
            parts.append((0.5 * float(seconds[inside].min() + seconds[inside].max()), xy[inside]))
        return parts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageScan:
    """The scan of one image, a rectangle of a panel."""

    first: float  # seconds after the display's first row at which the image's first one is seen
    last: float  # and the end of its last one
    share: Float32  # (3,) a, b, c: image pixel (x, y) is seen at a + b x + c y, 0 at `first` and 1 at `last`

    @classmethod
    def of(cls, scan: Scan, rect: Rect) -> ImageScan:
        """Of a rectangle of panel pixels."""
        corners = [scan.at(float(x), float(y)) for x in (rect.x, rect.right) for y in (rect.y, rect.bottom)]
        first, last = min(corners), max(corners)
        values = np.array([scan.at(float(rect.x), float(rect.y)) - first, scan.per_x, scan.per_y]) / (last - first)
        return cls(first=first, last=last, share=values.astype(np.float32))


def scan_of(panel: PanelConfig, at: tuple[int, int] = (0, 0)) -> Scan | None:
    """When a panel's display lights it; None where that is all at once.

    at : its top left pixel in the display's image, where that holds both eyes

    The rows are the display's own: of one that is mounted turned they run across the image, or from its bottom up.
    """
    time, (width, height) = panel.row_time, panel.pixels
    if time == 0.0:
        return None
    if panel.rotation == 90:
        return Scan(first=width * time, per_x=-time, per_y=0.0)
    if panel.rotation == 270:
        return Scan(first=0.0, per_x=time, per_y=0.0)
    if panel.rotation == 180:
        return Scan(first=height * time, per_x=0.0, per_y=-time)
    return Scan(first=at[1] * time, per_x=0.0, per_y=time)
