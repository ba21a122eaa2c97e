"""The newest states of edits by number: samples come with the number of the edits that they saw."""

from __future__ import annotations

from collections import deque

from wall.core.data import NO_EDITS, Batch, Edits

REMEMBERED = 256  # states: four seconds of a slider that moves at 60 Hz
EARLY_BATCHES = 1024  # that wait for their edits
EARLY_SAMPLES = 1 << 22  # of all of them: 200 MB


class EditHistory:
    """`know` the edits of every event; `of` gives those of a number; a batch whose edits are not known yet `waits`."""

    def __init__(self) -> None:
        self._known: dict[int, Edits] = {NO_EDITS.number: NO_EDITS}  # the oldest first
        self._newest = NO_EDITS.number
        self._early: deque[Batch] = deque()
        self._waiting = 0  # samples of these

    def know(self, edits: Edits) -> list[Batch]:
        """Remember a state. Returns batches that have waited for it, as they come from `of`."""
        if edits.number in self._known:
            return []
        self._known[edits.number] = edits
        self._newest = max(self._newest, edits.number)
        if len(self._known) > REMEMBERED:
            del self._known[next(iter(self._known))]
        early, self._early, self._waiting = self._early, deque(), 0
        return list(early)

    def of(self, number: int) -> Edits | None:
        """The edits of a number; None where they are not known."""
        return self._known.get(number)

    def waits(self, batch: Batch) -> bool:
        """Keep a batch of edits that are not known yet. Returns False where it is too old, or too many wait."""
        full = len(self._early) >= EARLY_BATCHES or self._waiting + len(batch.samples) > EARLY_SAMPLES
        if batch.edits.number < self._newest or full:
            return False
        self._waiting += len(batch.samples)
        self._early.append(batch)
        return True
