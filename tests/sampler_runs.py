"""Batches of a sampler, and samples at given positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wall.core.data import SAMPLE, Event, Float32, Samples
from wall.sampling.base import Sampler, Targets

MOST_BATCHES = 4000  # more than any test needs


def until_idle(sampler: Sampler, event: Event) -> list[Targets]:
    """All batches until the sampler has none."""
    found = []
    while (targets := sampler.choose(event)) is not None:
        found.append(targets)
        assert len(found) <= MOST_BATCHES, "never idle"
    return found


def positions(batches: list[Targets]) -> Float32:
    """(n, 2) float32 positions of batches."""
    return np.concatenate([np.zeros((0, 2), np.float32), *(targets.xy for targets in batches)])


def samples_at(xy: ArrayLike, radiance: ArrayLike = 0.0) -> Samples:
    """Samples at (n, 2) positions."""
    samples = np.zeros(len(np.asarray(xy)), SAMPLE)
    samples["xy"], samples["radiance"] = xy, radiance
    return samples
