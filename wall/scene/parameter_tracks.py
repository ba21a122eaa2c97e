"""Parameters over time: straight lines between keyframes, a pure function of the scene time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wall.config.scene import AnimationConfig, ParameterConfig
from wall.core.data import Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParameterTrack:
    """The keyframes of one parameter."""

    name: str  # name path
    times: Float64  # (k,) seconds, growing
    values: Float64  # (k, n)
    loop: bool  # begins again after the last keyframe

    def at(self, time: float) -> tuple[float, ...]:
        """Its numbers at a scene time in seconds."""
        first, last = float(self.times[0]), float(self.times[-1])
        if self.loop:
            time = first + (time - first) % (last - first)
        return tuple(float(np.interp(time, self.times, column)) for column in self.values.T)

    def with_values(self, rows: Sequence[Sequence[float]]) -> ParameterTrack:
        """The same keyframes with other numbers, (k, n)."""
        return replace(self, values=np.array(rows, np.float64))


def tracks_of(animation: Sequence[AnimationConfig]) -> tuple[ParameterTrack, ...]:
    """The parameters among an animation's entries."""
    return tuple(
        ParameterTrack(
            name=config.name,
            times=np.array([k.time for k in config.keyframes], np.float64),
            values=_rows(config.numbers),
            loop=config.loop and len(config.keyframes) > 1,
        )
        for config in animation
        if isinstance(config, ParameterConfig)
    )


def _rows(numbers: Sequence[Sequence[float]]) -> Float64:
    """(k, n); one number counts for all n."""
    width = max(map(len, numbers))
    return np.array([np.broadcast_to(row, width) for row in numbers], np.float64)
