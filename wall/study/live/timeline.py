"""When images were on the wall: which one was held at a moment, how regularly they changed.

Pure: a log in, figures out. All times are of the camera's path: seconds since the animation began. An image becomes
light when the sinks have it, and not before the display's delay after its refresh has passed: the display delay of the
configuration, one refresh unless it says otherwise, which is also how far ahead the adaptive method predicts.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.display.image_log import LoggedImages, LoggedPanel

SEED = 20050629


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """How often the wall changed within a span of time."""

    refresh_hz: float
    p95_ms: float  # of the time from one image to the next


def moments(count: int, *, first: float, seconds: float) -> list[float]:
    """`count` path times in equal parts of [first, first + seconds), somewhere in each: no method can be in step."""
    jitter = np.random.default_rng(SEED).random(count)
    return [first + seconds * (k + float(jitter[k])) / count for k in range(count)]


class Timeline:
    """The images of a log by the time at which they became light."""

    def __init__(self, log: LoggedImages) -> None:
        self._shown: dict[str, list[tuple[float, LoggedPanel]]] = defaultdict(list)
        for panel in log.panels:
            light = max(panel.time, panel.refresh + log.display_delay_s) - log.began
            self._shown[panel.panel].append((light, panel))
        self.times = sorted({light for shown in self._shown.values() for light, _ in shown})

    def held(self, panel: str, time: float) -> LoggedPanel | None:
        """The newest image of a panel that was light at `time`; None before its first."""
        shown = self._shown.get(panel, [])
        k = bisect_right(shown, time, key=lambda one: one[0])
        return shown[k - 1][1] if k else None

    def intervals(self, first: float, seconds: float) -> Intervals:
        """Of the images that became light within `seconds` from `first` on; each interval ends at one of them.

        Where the image never changed, the whole span counts as one interval.
        """
        return intervals(self.times, first, seconds)


def intervals(times: Sequence[float], first: float, seconds: float) -> Intervals:
    """Timeline.intervals of growing times."""
    begin, end = bisect_right(times, first), bisect_right(times, first + seconds)
    inside = list(times[begin:end])
    before = [times[begin - 1]] if begin else []
    steps = np.diff([*before, *inside])
    p95 = float(np.percentile(steps, 95)) if len(steps) else math.nan
    return Intervals(refresh_hz=len(inside) / seconds, p95_ms=1000.0 * (seconds if math.isnan(p95) else p95))
