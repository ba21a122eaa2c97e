"""A view as a rank follows it: its newest event, what is expected of it, and when it is refreshed.

Refreshes are a period apart. What follows an edit need not wait for its turn: the next refresh is brought forward, the
others then follow it. Only one every EARLY_APART_S is, so that a slider that is dragged makes no more images.
"""

from __future__ import annotations

import math

from wall.core.data import Event
from wall.roles.plan import Plan, make_predictor

NEWEST_SHARE = 0.2  # of the newest time in a moving mean
LONGEST_INTERVAL_S = 0.25  # longer ones are pauses
EARLY_APART_S = 0.25  # between refreshes that are brought forward
ON_ITS_WAY_S = 0.0085  # an image that was made elsewhere, until the head shows it: 4 to 8 ms, then 3 to 4 for its turn


class FollowedView:
    """One of a plan's views, at a rank that shows it."""

    def __init__(self, plan: Plan, index: int) -> None:
        self.index, self.period = index, 1.0 / plan.views[index].refresh_hz
        self.event: Event | None = None  # the newest
        self.due = math.inf  # when it is refreshed next, seconds of the head's clock; never before the first event
        self.ahead = False  # the last refresh did not show the newest event, but what is expected after it
        self.quiet = False  # the last refresh was of the newest event, and changed nothing
        self.refreshes = 0
        self.soonest = -math.inf  # before, it is not refreshed, whatever was edited
        self.may_wait = False  # nothing has moved for a while: the next refresh may come later than its turn
        self._began = -math.inf  # the last refresh
        self._hastened = False  # the next refresh was brought forward
        self._hastens = plan.layout.graph.sync == "none" and not plan.layout.config.barrier
        self._interval = self.period  # between refreshes, a moving mean: more than the period where they take longer
        self._making = 0.0  # from a refresh here to the one of the head that shows it, a moving mean
        self._predictor = make_predictor(plan, index)

    def take(self, event: Event) -> bool:
        """Follow an event of this view, unless a newer one came before. Returns whether it is followed."""
        if event.view != self.index or (self.event is not None and event.number < self.event.number):
            return False
        if self.event is None:
            self.due = -math.inf
        self.event = event
        self._predictor.take(event)
        return True

    def hasten(self) -> None:
        """An edit can be shown now: refresh as soon as may be. In lock step all wait for each other, so not there."""
        if self._hastens and self.soonest < self.due:
            self.due, self._hastened = self.soonest, True

    def begin_refresh(self, now: float) -> Event:
        """Begin a refresh at `now`, and plan the next. Returns the event that is expected when it is seen.

        It is seen until the next one is: the middle of that time is where its error is least.
        """
        self.refreshes += 1
        if now - self._began < LONGEST_INTERVAL_S and not self.may_wait:
            self._interval += NEWEST_SHARE * (now - self._began - self._interval)
        self.due = max((now if self._hastened else self.due) + self.period, now)
        self.soonest = now + EARLY_APART_S if self._hastened else max(self.soonest, now)
        self._began, self._hastened = now, False
        return self._expected(now)

    def at_next_refresh(self, now: float) -> Event:
        """The event that is expected when the next refresh is seen: what is traced by `now` is shown first then."""
        return self._expected(now, next_in=max(self.due - now, 0.0))

    def _expected(self, now: float, next_in: float | None = None) -> Event:
        return self._predictor.at(now, self._making + 0.5 * max(self._interval, self.period), next_in=next_in)

    @property
    def lateness(self) -> float:
        """By what share of the period refreshes were further apart lately, on average."""
        return self._interval / self.period - 1.0

    def made(self, seconds: float) -> None:
        """An image that others show was ready so long after its refresh had begun; the display's delay starts then."""
        self._making += NEWEST_SHARE * (seconds + ON_ITS_WAY_S - self._making)
