"""The newest states of edits by number: samples come with the number of the edits that they saw."""

from __future__ import annotations

from wall.core.data import NO_EDITS, Batch, Edits
from wall.roles.early_batches import EarlyBatches

REMEMBERED = 256  # states: four seconds of a slider that moves at 60 Hz


class EditHistory:
    """`know` the edits of every event; `of` gives those of a number; a batch whose edits are not known yet `waits`."""

    def __init__(self) -> None:
        self._known: dict[int, Edits] = {NO_EDITS.number: NO_EDITS}  # the oldest first
        self._newest = NO_EDITS.number
        self._early = EarlyBatches()

    def know(self, edits: Edits) -> list[Batch]:
        """Remember a state. Returns batches that have waited for it, as they come from `of`."""
        if edits.number in self._known:
            return []
        self._known[edits.number] = edits
        self._newest = max(self._newest, edits.number)
        if len(self._known) > REMEMBERED:
            del self._known[next(iter(self._known))]
        return self._early.take()

    def of(self, number: int) -> Edits | None:
        """The edits of a number; None where they are not known."""
        return self._known.get(number)

    def waits(self, batch: Batch) -> bool:
        """Keep a batch of edits that are not known yet. Returns False where it is too old, or too many wait."""
        return batch.edits.number >= self._newest and self._early.keep(batch)
