"""How much an arm may spend up to a refresh: rays at a rate (virtual), or what its CPU time buys (cpu).

With the CPU clock an arm has an account: it earns `cores` CPU seconds a second of virtual time, and is charged what
its own advance() and show() took, all threads. Rays get what showing leaves, but at least RAYS_SHARE of what is
earned; an arm that is overdrawn at a refresh misses it, and the display keeps its picture. Nothing is saved up for
longer than a refresh.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from wall.data import Float32
from wall.measure.quality.arm import Arm

STEPS_A_REFRESH = 4  # a CPU budget is handed out in so many parts, so that an estimate can be corrected
RAYS_SHARE = 0.5  # of what is earned is for rays, however dear showing is
SMOOTHING = 0.2  # weight of the newest cost in the running estimates

Timer = Callable[[], float]  # seconds of CPU time that this process has used, all its threads


class Clock(Protocol):
    spent: float  # CPU seconds of advance() and show()
    shown: int

    def refresh(self, arm: Arm, begin: float, end: float) -> Float32:
        """Take `arm` from `begin` to the refresh at `end`: what the display shows then, (h, w, 3) linear RGB."""
        ...


class VirtualClock:
    """Every arm has its rate of rays, and all the time that it needs for them."""

    def __init__(self) -> None:
        self.spent, self.shown = 0.0, 0

    def refresh(self, arm: Arm, begin: float, end: float) -> Float32:
        started = time.process_time()
        arm.advance(end)
        picture = arm.show(end)
        self.spent += time.process_time() - started
        self.shown += 1
        return picture


class CpuClock:
    """Every arm has the same CPU time."""

    def __init__(
        self, cores: float, *, ray_s: float, show_s: float, picture: Float32, timer: Timer = time.process_time
    ) -> None:
        """`ray_s`, `show_s`: first estimates of what a ray and a show() cost, seconds; `picture` is shown at 0."""
        self.spent, self.shown = 0.0, 0
        self.ray_s, self.show_s = ray_s, show_s
        self._cores, self._balance, self._picture = cores, 0.0, picture
        self.allowed, self._timer = 0, timer  # rays so far

    def refresh(self, arm: Arm, begin: float, end: float) -> Float32:
        earned = self._cores * (end - begin)
        self._balance = min(self._balance, earned) + earned
        for step in range(STEPS_A_REFRESH):
            self._advance(arm, begin + (end - begin) * (step + 1) / STEPS_A_REFRESH, earned, STEPS_A_REFRESH - step)
        if self._balance >= 0.0:
            self._show(arm, end)
        return self._picture

    def _advance(self, arm: Arm, until: float, earned: float, steps_left: int) -> None:
        least = RAYS_SHARE * earned / STEPS_A_REFRESH if self._balance > 0.0 else 0.0
        budget = max((self._balance - self.show_s) / steps_left, least)
        self.allowed += max(0, int(budget / self.ray_s))
        before, started = arm.rays, self._timer()
        arm.advance(until, self.allowed)
        cost, rays = self._charge(started), arm.rays - before
        if rays:
            self.ray_s += SMOOTHING * (cost / rays - self.ray_s)

    def _show(self, arm: Arm, time_shown: float) -> None:
        started = self._timer()
        picture = arm.show(time_shown)
        self.show_s += SMOOTHING * (self._charge(started) - self.show_s)
        self.shown += 1
        self._picture = picture.copy()  # the arm's own may change before a later refresh that is missed

    def _charge(self, started: float) -> float:
        cost = self._timer() - started
        self._balance -= cost
        self.spent += cost
        return cost
