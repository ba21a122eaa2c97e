"""The image that a renderer makes of its own samples, where it is shown on the same machine: no sample travels."""

from __future__ import annotations

from collections.abc import Iterator

from wall.core.clock import Clock
from wall.core.data import Batch, Event
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.composition import Composition
from wall.roles.instructions import Offer, Ready, Shares, shares_nothing
from wall.roles.plan import Plan
from wall.roles.view import FollowedView

SHARE_OF_TIME = 0.9  # at most spent on refreshes; rarer images lag by more than rays would mend, see docs/lab/live.md


class RendererImage:
    """`follow` events, `insert` batches; `on_tick` refreshes the image when that is due, and offers what changed."""

    def __init__(self, plan: Plan, rank: int, ready: Ready, clock: Clock, shares: Shares = shares_nothing) -> None:
        """`clock`: tells how long refreshes take."""
        self._clock = clock
        self.composition = Composition(plan, rank, ready, shares=shares)
        (self._layer,) = self.composition.layers.values()
        self._view = FollowedView(plan, plan.layout.view_index(plan.layout.panel(rank)))
        self.expected: Event | None = None  # what the last refresh shows
        self._rests = False  # the last refresh was of the newest event, and changed nothing

    @property
    def reconstruction(self) -> Reconstruction:
        """The reconstruction that the adaptive sampler shares; made when it is first asked for."""
        return self._layer.reprojected.shared()

    def follow(self, event: Event) -> None:
        """Show a new event from the next refresh on; the manager repeats the newest, which changes nothing."""
        before = self._view.event
        if self._view.take(event):
            self.composition.follow(event)
            self._rests = self._rests and event == before

    def insert(self, batch: Batch) -> None:
        """Show a batch from the next refresh on."""
        self.composition.insert_batch(batch)
        self._rests = False

    def on_tick(self, now: float) -> Iterator[Offer]:
        """Refresh if that is due, and offer what others need as far as there is credit."""
        view = self._view
        if view.event is not None and now >= view.due:
            began = self._clock.now()
            self.expected = expected = view.begin_refresh(now)
            changed = self.composition.refresh(expected, now)
            self._rests = not changed and expected.number == view.event.number
            took = self._clock.now() - began
            view.made(took)
            view.due = max(view.due, now + took / SHARE_OF_TIME)
            if view.event.statistics:
                yield from self.composition.offer_statistics(now)
        yield from self.composition.send()

    @property
    def due(self) -> float:
        """When the next refresh is due, seconds of the head's clock."""
        return self._view.due

    @property
    def complete(self) -> bool:
        """Whether all that came is shown, and has been sent."""
        return self._rests and self.composition.idle

    def oldest_sample_at(self, now: float) -> float:
        """When the oldest sample shown was traced, seconds of the head's clock; -1 while a pixel never had one."""
        age = self._layer.oldest_sample(now)
        return -1.0 if age is None else now - age


def image_at(
    plan: Plan, rank: int, ready: Ready, clock: Clock, shares: Shares = shares_nothing
) -> RendererImage | None:
    """The image that a renderer makes. None where its samples travel to a compositor."""
    return RendererImage(plan, rank, ready, clock, shares) if plan.layout.layer(rank).at_renderer else None
