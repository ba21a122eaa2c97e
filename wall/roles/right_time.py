"""How soon after an input an image is right nearly everywhere, not only in its first sample.

A pixel is right under an event if what it shows was traced under that event or a newer one. Samples of the adaptive
sampler follow instead: a pixel is right where one of them shows in its block of 4x4 pixels, since that sampler leaves
pixels out where an image is flat; after an edit, where one was traced there since, needed or not. After edits the time
is thus too long rather than too short.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64
from wall.deepbuffer.pixel_buffer import count_of

RIGHT_SHARE = 0.9  # of an image's pixels
BLOCK = 4  # pixels; one pixel, or one block, of each 4x4 is looked at
MOST_SEEN = 16_384  # of them; in large images they lie farther apart
LEAST_WEIGHT = 0.1  # of the samples that show in a block: with less it is filled in from around
WAITING = 512  # events
RECENT = 32  # of their times


class RightTimes:
    """`follow` events, `see_...` images; `seconds` from the input to an image that is right."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, float]] = deque(maxlen=WAITING)  # sum of an event's numbers, its input's time
        self._recent: deque[float] = deque(maxlen=RECENT)
        self._newest: tuple[int, int] | None = None
        self._edit = (0, -math.inf)  # number of the newest edits, and the time of their input

    def follow(self, event: Event) -> None:
        """A published event is to be shown; the first, which the start delays, is not timed."""
        if self._newest is None:
            self._newest, self._edit = event.number, (event.edits.number, -math.inf)
        elif event.number > self._newest:
            self._newest = event.number
            self._waiting.append((sum(event.number), event.input_time))
            if event.edits.number != self._edit[0]:
                self._edit = event.edits.number, event.input_time

    def see_traced(self, keys: NDArray[np.uint64], now: float) -> None:
        """See an image of samples that stay where they were traced; `keys` (h, w): of their events, see PIXEL."""
        if self._waiting:
            step = BLOCK * _stride(keys.shape)
            seen = keys[::step, ::step].ravel()
            rank = int((1.0 - RIGHT_SHARE) * len(seen))
            self._shown(count_of(int(np.partition(seen, rank)[rank])), now)

    def see_reprojected(self, event: Event, weights: Float32 | None, times: Float64, now: float) -> None:
        """See an image of samples that follow `event`, or what was expected after the newest: a number below 0.

        weights : (h / 4, w / 4), rounded up, of the samples that show in each block; None if they are not known: then
            only what was traced since is right
        times : (h, w) seconds, when each pixel was traced last
        """
        if not self._waiting or self._newest is None:
            return
        oldest, input_time = self._waiting[0]
        since = self._edit[1] if weights is not None else max(self._edit[1], input_time)
        right = np.ones(1, np.bool_)
        if math.isfinite(since):
            right = newest_in_blocks(times, _stride(times.shape)) >= since
        if weights is not None:
            stride = _stride(times.shape)
            right = right & (weights[::stride, ::stride] >= LEAST_WEIGHT)
        if right.mean() >= RIGHT_SHARE:
            shown = sum(event.number if event.camera_event >= 0 else self._newest)
            self._shown(shown if weights is not None else oldest, now)

    def _shown(self, count: int, now: float) -> None:
        while self._waiting and self._waiting[0][0] <= count:
            self._recent.append(max(0.0, now - self._waiting.popleft()[1]))

    def seconds(self, now: float) -> float:
        """Of recent events the median, or how long the oldest waits already, if that is longer; 0: not known."""
        waits = now - self._waiting[0][1] if self._waiting else 0.0
        return max(waits, median(self._recent) if self._recent else 0.0)


def _stride(shape: tuple[int, ...]) -> int:
    """One block of so many each way is looked at."""
    return max(1, math.isqrt(math.prod(shape) // (BLOCK * BLOCK * MOST_SEEN)))


def newest_in_blocks(times: Float64, stride: int) -> Float64:
    """The newest time in every `stride`-th block each way; blocks at the right and lower edge may be cut off."""
    height, width = times.shape
    rows, columns = np.arange(0, height, BLOCK * stride), np.arange(0, width, BLOCK * stride)
    newest = times[np.ix_(rows, columns)]
    for y in range(BLOCK):
        for x in range(BLOCK):
            own = np.ix_(np.minimum(rows + y, height - 1), np.minimum(columns + x, width - 1))
            np.maximum(newest, times[own], out=newest)
    return newest
