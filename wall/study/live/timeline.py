"""When images were on the wall: which one was held at a moment, how regularly they changed.

Pure: a log in, figures out. All times are of the camera's path: seconds since the animation began. An image becomes
light when the sinks have it, and not before the display's delay after its refresh has passed: the display delay of the
configuration, one refresh unless it says otherwise, which is also how far ahead the adaptive method predicts.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.display.image_log import LoggedImages, LoggedPanel

SEED = 20050629


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """How often panels changed within a span of time."""

    refresh_hz: float  # images a second of a panel, on average over panels
    p95_ms: float  # of the time from one image of a panel to its next


def moments(count: int, *, first: float, seconds: float) -> list[float]:
    """`count` path times in equal parts of [first, first + seconds), somewhere in each: no method can be in step."""
    jitter = np.random.default_rng(SEED).random(count)
    return [first + seconds * (k + float(jitter[k])) / count for k in range(count)]


class Timeline:
    """The images of a log by the time at which they became light."""

    def __init__(self, log: LoggedImages, display_delay_s: float | None = None) -> None:
        """`display_delay_s`: from a refresh to its light; the one of the log if None."""
        delay_s = log.display_delay_s if display_delay_s is None else display_delay_s
        self._shown: dict[str, list[tuple[float, LoggedPanel]]] = defaultdict(list)
        for panel in log.panels:
            light = max(panel.time, panel.refresh + delay_s) - log.began
            self._shown[panel.panel].append((light, panel))
        self._log = log

    def held(self, panel: str, time: float) -> LoggedPanel | None:
        """The newest image of a panel that was light at `time`; None before its first."""
        shown = self._shown.get(panel, [])
        k = bisect_right(shown, time, key=lambda one: one[0])
        return shown[k - 1][1] if k else None

    def intervals(self, first: float, seconds: float) -> Intervals:
        """Of the images that became light within `seconds` from `first` on, each panel for itself.

        Where panels overlap, what a neighbour's new image changes there is no image of the panel's own.
        """
        return intervals([self._own(shown) for shown in self._shown.values()], first, seconds)

    def _own(self, shown: list[tuple[float, LoggedPanel]]) -> list[float]:
        """When a panel's images became light that changed something beside its overlaps with other panels."""
        alone = np.ones(shown[0][1].size[::-1], np.bool_)
        (left, top), here = shown[0][1].screen, shown[0][1].panel
        for (_, other), *_ in (images for panel, images in self._shown.items() if panel != here):
            (x, y), (width, height) = other.screen, other.size
            alone[max(y - top, 0) : max(y + height - top, 0), max(x - left, 0) : max(x + width - left, 0)] = False
        if alone.all() or not alone.any():
            return [light for light, _ in shown]
        own, before = list[float](), None
        for light, panel in shown:
            pixels = self._log.rgb(panel)[alone]
            if before is None or (pixels != before).any():
                own.append(light)
                before = pixels
        return own


def intervals(panels: Sequence[Sequence[float]], first: float, seconds: float) -> Intervals:
    """How often panels changed, on average, and the intervals of all of them.

    panels : of each, the growing times of its images

    Each interval ends at an image within the span. For a panel that never changed, the whole span is one interval.
    """
    count, steps = 0, []
    for times in panels:
        begin, end = bisect_right(times, first), bisect_right(times, first + seconds)
        count += end - begin
        own = list(np.diff(times[max(begin - 1, 0) : end]))
        steps += own or [seconds]
    p95 = float(np.percentile(steps, 95)) if steps else seconds
    return Intervals(refresh_hz=count / seconds / max(len(panels), 1), p95_ms=1000.0 * p95)
