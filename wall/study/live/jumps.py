"""Error by the time since the camera's last jump: when it jumps, which moments follow that evenly, what they say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wall.config.views import KeyframesPathConfig, PathConfig

WITHIN_S = 0.005  # from one keyframe to the next, at another position or target: seconds in which nobody sees a motion
AFTER_S = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0)  # where the table's spans of time since a jump end


def jumps_of(path: PathConfig | None, first: float, seconds: float) -> list[float]:
    """When the camera of a path jumps within [first, first + seconds): keyframes elsewhere, next to each other."""
    if not isinstance(path, KeyframesPathConfig):
        return []
    frames, begin, length = path.keyframes, path.keyframes[0].time, path.keyframes[-1].time - path.keyframes[0].time
    found = [
        b.time for a, b in pairwise(frames)
        if b.time - a.time <= WITHIN_S and (a.position, a.target) != (b.position, b.target)
    ]  # fmt: skip
    if path.loop and length > 0.0:
        ends = frames[-1].position != frames[0].position or frames[-1].target != frames[0].target
        found = sorted({*(time if time < begin + length else begin for time in found), *([begin] if ends else [])})
        rounds = range(math.floor((first - begin) / length), math.ceil((first + seconds - begin) / length) + 1)
        found = [time + n * length for n in rounds for time in found]
    return [time for time in found if first <= time < first + seconds]


def moments_after(jumps: Sequence[float], count: int, *, end: float) -> list[float]:
    """`count` moments, each at another time since a jump: evenly from it to the soonest next one, by jumps in turn.

    jumps : seconds of the path, growing, at least one; the last counts only if as much time follows it, before `end`

    So every method is looked at equally often at each time since a jump, whatever their number.
    """
    stretches = [after - before for before, after in pairwise([*jumps, end])]
    shortest = min(stretches[:-1], default=stretches[-1])
    usable = [jump for jump, stretch in zip(jumps, stretches, strict=True) if stretch >= shortest * (1.0 - 1e-9)]
    return sorted(usable[k % len(usable)] + shortest * (k + 0.5) / count for k in range(count))


def since_jump(times: Sequence[float], jumps: Sequence[float]) -> list[float]:
    """Of each moment: seconds since the last jump."""
    at = np.searchsorted(jumps, times, side="right") - 1
    return [float(time - jumps[k]) for time, k in zip(times, at, strict=True)]


def spans(since: Sequence[float]) -> list[tuple[float, float, list[int]]]:
    """The spans of time since a jump that hold moments: from, to, and their indices."""
    edges = [0.0, *AFTER_S, math.inf]
    found = [(low, high, [k for k, time in enumerate(since) if low <= time < high]) for low, high in pairwise(edges)]
    return [span for span in found if span[2]]


def root_mean_square(values: Sequence[float], chosen: Sequence[int]) -> float:
    """Of the values with these indices."""
    return math.sqrt(float(np.mean([values[k] ** 2 for k in chosen])))
