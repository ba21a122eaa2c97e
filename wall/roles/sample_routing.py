"""Decide which image a batch of samples belongs to: what is shown is what the viewer asked for, whatever arrives.

Events and batches come by different ways. A batch of a sampler that is no longer asked for is late; one of an event
that was not heard of yet is early and waits for it.
"""

from __future__ import annotations

import enum
from collections import Counter

from wall.core.data import Batch, Event
from wall.roles.early_batches import EarlyBatches


class Destination(enum.Enum):
    """The images of a layer."""

    REPROJECTED = enum.auto()
    NEWEST = enum.auto()  # each pixel's newest sample, where it was traced
    COMPARED = enum.auto()  # the second sampler's, while two are compared


class SampleRouting:
    """Follows which sampler is asked for, or which two, and from which camera event on."""

    def __init__(self, method: str, counters: Counter[str], *, reprojects: bool) -> None:
        """`method`: shown where an event names none; `reprojects`: the layer reprojects samples of every sampler."""
        self._default, self._reprojects, self._counters = method, reprojects, counters
        self.method, self.compare = method, ""
        self._since = self._followed = 0  # camera events: the first that asked for these two, the newest
        self._early = EarlyBatches()

    @property
    def reprojected(self) -> bool:
        """Whether the layer's image is made by reprojection: the adaptive sampler's, or compared by depth."""
        return self.method == "adaptive" or bool(self.compare) or self._reprojects

    def follow(self, event: Event) -> None:
        """Route by the sampler that `event` names, or by the two. `event`: a published one, not a predicted one."""
        asked = event.sampler or self._default, event.compare
        if asked != (self.method, self.compare):
            self._since = event.camera_event
        (self.method, self.compare), self._followed = asked, event.camera_event

    def take_early(self) -> list[Batch]:
        """Take the batches that waited; an event that is followed tells where they belong."""
        return self._early.take()

    def destination(self, batch: Batch) -> Destination | None:
        """The image of a batch. None: it waits as too early, or is counted as `early` or `late`."""
        current = not batch.adaptive and batch.camera_event >= self._since
        if self.reprojected and (batch.adaptive or (current and self._reprojects)):
            return Destination.REPROJECTED
        if batch.camera_event > self._followed:
            if not self._early.keep(batch):
                self._counters["early"] += len(batch.samples)
        elif current and self.compare:
            return Destination.COMPARED
        elif current and not self.reprojected:
            return Destination.NEWEST
        else:
            self._counters["late"] += len(batch.samples)
        return None
