"""Batches that came before what they refer to, until that comes too: bounded, whatever is sent."""

from __future__ import annotations

from wall.core.data import Batch

MOST_BATCHES = 1024  # what hundreds of ranks send until the next refresh
MOST_SAMPLES = 1 << 22  # of all of them: 200 MB


class EarlyBatches:
    """`keep` a batch, `take` them all."""

    def __init__(self) -> None:
        self._batches: list[Batch] = []
        self._samples = 0

    def keep(self, batch: Batch) -> bool:
        """Keep a batch. Returns False, and does not, where too many wait."""
        if len(self._batches) >= MOST_BATCHES or self._samples + len(batch.samples) > MOST_SAMPLES:
            return False
        self._batches.append(batch)
        self._samples += len(batch.samples)
        return True

    def take(self) -> list[Batch]:
        """Those kept since this was asked last, in the order in which they came."""
        batches, self._batches, self._samples = self._batches, [], 0
        return batches
