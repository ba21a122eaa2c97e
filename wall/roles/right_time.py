"""How soon after an input an image is right nearly everywhere, not only in its first sample.

A pixel is right under an event if what it shows was traced under that event or a newer one, or was traced before and
follows to it: samples of the adaptive sampler are reprojected. After an edit such a pixel is right once it was traced
again, whether the edit concerns it or not. The time is thus too long rather than too short.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64
from wall.deepbuffer.pixel_buffer import event_of

RIGHT_SHARE = 0.9  # of an image's pixels
STEP = 4  # one pixel of so many each way is looked at: 0.3 % of standard error in a share of 0.9 of 8,100 pixels
MOST_SEEN = 16_384  # pixels, for which steps are longer in large images
LEAST_WEIGHT = 0.1  # of the samples that show in a pixel: with less, most of it is filled in from around
WAITING = 512  # events
RECENT = 32  # of their times


def _some(image: NDArray[Any]) -> NDArray[Any]:
    """Pixels of an image (h, w), evenly spread."""
    step = max(STEP, math.isqrt(image.size // MOST_SEEN))
    return image[::step, ::step]


class RightTimes:
    """`follow` events, `see_...` images; `seconds` from the input to an image that is right."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[tuple[int, int], float]] = deque(maxlen=WAITING)  # event, its input's time
        self._recent: deque[float] = deque(maxlen=RECENT)
        self._newest: tuple[int, int] | None = None
        self._edit = (0, -math.inf)  # number of the newest edits, and the time of their input

    def follow(self, event: Event) -> None:
        """A published event is to be shown; the first, which the start delays, is not timed."""
        if self._newest is None:
            self._newest, self._edit = event.number, (event.edits.number, -math.inf)
        elif event.number > self._newest:
            self._newest = event.number
            self._waiting.append((event.number, event.input_time))
            if event.edits.number != self._edit[0]:
                self._edit = event.edits.number, event.input_time

    def see_traced(self, keys: NDArray[np.uint64], now: float) -> None:
        """See an image of samples that stay where they were traced; `keys` (h, w): of their events, see PIXEL."""
        if self._waiting:
            seen = _some(keys).ravel()
            rank = int((1.0 - RIGHT_SHARE) * len(seen))
            self._shown(event_of(int(np.partition(seen, rank)[rank])), now)

    def see_reprojected(self, event: Event, weights: Float32 | None, times: Float64, now: float) -> None:
        """See an image of samples that follow `event`.

        weights : (h, w) of the samples that show in each pixel, None if they are not known: then none follow
        times : (h, w) seconds, when each pixel was traced last
        """
        if not self._waiting:
            return
        since = self._edit[1] if weights is not None else max(self._edit[1], self._waiting[0][1])
        right = _some(times) >= since
        if weights is not None:
            right &= _some(weights) >= LEAST_WEIGHT
        if right.mean() >= RIGHT_SHARE:
            number = event.number if weights is not None else self._waiting[0][0]
            self._shown(number, now)

    def _shown(self, number: tuple[int, int], now: float) -> None:
        while self._waiting and self._waiting[0][0] <= number:
            self._recent.append(max(0.0, now - self._waiting.popleft()[1]))

    def seconds(self, now: float) -> float:
        """Of recent events the median, or how long the oldest waits already, if that is longer; 0: not known."""
        waits = now - self._waiting[0][1] if self._waiting else 0.0
        return max(waits, median(self._recent) if self._recent else 0.0)
