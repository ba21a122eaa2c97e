"""What a status line tells about a deep buffer: how many samples came, of which event, and how old each pixel's are."""

from __future__ import annotations

import numpy as np

from wall.core.data import Batch, Float64
from wall.deepbuffer.kernels.arrivals import note_newest

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
        shown = int(note_newest(batch.samples, batch.base_time, self.times))
        self.samples_shown += shown
        if shown:
            self.newest_event = max(self.newest_event, (batch.camera_event, batch.scene_event))
        return len(batch.samples) - shown

    def oldest_sample(self, now: float) -> float:
        """Age in seconds of the pixel whose newest sample is the oldest; inf while a pixel never had one."""
        return max(0.0, now - float(self.times.min()))
