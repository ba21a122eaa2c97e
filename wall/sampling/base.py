"""The interface of all samplers: choose positions, observe the samples, forget what was lost.

A sampler owns the pixels of one thread. It is told the newest event at every choice and decides itself under which
event its next batch is traced (framed keeps one event a frame). Pure: no clock, no sockets, randomness from the seed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Samples

Pixels = NDArray[np.int32]  # (n, 2) panel pixels, x then y


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """The next batch: positions, 16 in a row a packet, and the event to trace them under."""

    xy: Float32  # (n, 2) panel pixels
    event: Event
    frame: int = 0  # see wall.core.data.Batch
    frame_samples: int = 0
    blend: float = 1.0
    number: int | None = None  # of the samples among those of their pixels, see Tracer.trace
    depth: int | None = None  # most surfaces of paths; None: the scene's
    footprint: float = 1.0  # pixels, edge of the square that a sample stands for: textures are filtered over it


class Sampler(Protocol):
    """A way to choose what to trace next."""

    coherent: bool  # whether its packets are small screen tiles (Embree's coherent traversal pays)

    def choose(self, newest: Event) -> Targets | None:
        """The next batch; None once the view is complete under `newest`, and nothing needs tracing."""
        ...

    def observe(self, samples: Samples, base_time: float) -> None:
        """Learn from samples just traced; their times count from `base_time`, seconds."""
        ...

    def forget(self, samples: Samples, base_time: float) -> None:
        """Count these as not sampled: their packet was dropped. They are as they were observed, rounded by packing."""
        ...

    def restart(self) -> None:
        """Start over: a compositor came back and has no samples."""
        ...
