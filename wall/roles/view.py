"""A view as a rank follows it: its newest event, what is expected of it, and when it is refreshed."""

from __future__ import annotations

import math

from wall.core.data import Event
from wall.roles.plan import Plan, make_predictor


class FollowedView:
    """One of a plan's views, at a rank that shows it."""

    def __init__(self, plan: Plan, index: int) -> None:
        self.index, self.period = index, 1.0 / plan.views[index].refresh_hz
        self.event: Event | None = None  # the newest
        self.due = -math.inf  # when it is refreshed next, seconds of the head's clock
        self._predictor = make_predictor(plan, index)

    def take(self, event: Event) -> bool:
        """Follow an event of this view, unless a newer one came before. Returns whether it is followed."""
        if event.view != self.index or (self.event is not None and event.number < self.event.number):
            return False
        self.event = event
        self._predictor.take(event)
        return True

    def begin_refresh(self, now: float) -> Event:
        """Begin a refresh at `now`, and plan the next. Returns the event that is expected when it is seen."""
        self.due = max(self.due + self.period, now)
        return self._predictor.at(now)
