"""What an image tells of its samples: where and how old they are, and which is each pixel's nearest."""

from __future__ import annotations

from typing import NamedTuple

from wall.core.data import Float32


class StoredSamples(NamedTuple):
    """Where and how old the samples of an image are; see SampleStore."""

    times: Float32  # (in_use,) or more, seconds after `epoch`
    confidence: Float32
    screen_position: Float32  # (3, in_use) or more
    in_use: int  # samples
    epoch: float  # seconds


class NearestSamples(NamedTuple):
    """Each pixel's nearest sample, (h, w) float32."""

    depth: Float32  # along the panel's axis; inf: none
    object_id: Float32  # 0: the background; -1: none; exact to 2^24
