"""What a status line tells about a deep buffer: how many samples came, of which event, and how old each pixel's are."""

from __future__ import annotations

import numpy as np

from wall.core.data import Batch, Float64

NEVER = (-1, -1)  # the number of no event


class Arrivals:
    """Counts the samples that came for one panel.

    A sample counts for the pixel that it was traced for: reprojection does not move it here.
    """

    def __init__(self, width: int, height: int) -> None:
        """`width`, `height`: panel pixels; 8 bytes each."""
        self.samples_shown = 0
        self.newest_event = NEVER
        self.times: Float64 = np.full((height, width), -np.inf)  # seconds, of each pixel's newest sample

    def note(self, batch: Batch) -> int:
        """Count a batch. Returns how many of its samples lie outside the panel."""
        height, width = self.times.shape
        x, y = np.floor(batch.samples["xy"]).T
        inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        pixels = y[inside].astype(np.int64), x[inside].astype(np.int64)
        np.maximum.at(self.times, pixels, batch.base_time + batch.samples["time"][inside].astype(np.float64))
        shown = int(inside.sum())
        self.samples_shown += shown
        if shown:
            self.newest_event = max(self.newest_event, (batch.camera_event, batch.scene_event))
        return len(batch.samples) - shown

    def oldest_sample(self, now: float) -> float:
        """Age in seconds of the pixel whose newest sample is the oldest; inf while a pixel never had one."""
        return max(0.0, now - float(self.times.min()))
