"""How much a method may spend up to a refresh: rays at a rate (virtual), or what its CPU time buys (cpu).

With the CPU clock a method has an account: it earns `cores` CPU seconds a second of virtual time, and is charged what
its own advance() and show() took, all threads. Rays get what showing leaves, but at least RAYS_SHARE of what is
earned; a method that is overdrawn at a refresh misses it, and the display keeps its image. Nothing is saved up for
longer than a refresh.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from wall.core.data import Float32
from wall.study.quality.method import Method

STEPS_A_REFRESH = 4  # a CPU budget is handed out in so many parts, so that an estimate can be corrected
RAYS_SHARE = 0.25  # of what is earned is for rays, however dear showing is
SMOOTHING = 0.2  # weight of the newest cost of showing in its running estimate
GUESS_S = 1 / 60  # CPU seconds of every core that the first guess of a ray's cost weighs as much as
REPAID = 0.1  # of what rays turned out to cost more (or less) than planned, at every refresh

Timer = Callable[[], float]  # seconds of CPU time that this process has used, all its threads


class Clock(Protocol):
    """Decides how far a method gets between two refreshes."""

    spent: float  # CPU seconds of advance() and show()
    shown: int

    def refresh(self, method: Method, begin: float, end: float) -> Float32:
        """Take `method` from `begin` to the refresh at `end`: what the display shows then, (h, w, 3) linear RGB."""
        ...


class VirtualClock:
    """Every method has its rate of rays, and all the time that it needs for them."""

    def __init__(self) -> None:
        self.spent, self.shown = 0.0, 0

    def refresh(self, method: Method, begin: float, end: float) -> Float32:
        """Lets the method trace the rays of its set rate, then returns its image at `end`."""
        started = time.process_time()
        method.advance(end)
        image = method.show(end)
        self.spent += time.process_time() - started
        self.shown += 1
        return image


class CpuClock:
    """Every method has the same CPU time."""

    def __init__(
        self, cores: float, *, ray_s: float, show_s: float, image: Float32, timer: Timer = time.process_time
    ) -> None:
        """`ray_s`, `show_s`: first estimates of what a ray and a show() cost, seconds; `image` is shown at 0."""
        self.spent, self.shown = 0.0, 0
        self.allowed = 0  # rays so far
        self._cores, self._image, self._timer = cores, image, timer
        self._show_s, self._planned, self._mispriced = show_s, 0.0, 0.0
        weight = cores * GUESS_S / ray_s
        self._rays, self._rays_s = weight, weight * ray_s  # used so far and what they cost, the guess among them

    def refresh(self, method: Method, begin: float, end: float) -> Float32:
        """Lets the method trace what the cores' CPU time allows, then returns its image at `end`."""
        earned = self._cores * (end - begin)
        repaid = REPAID * self._mispriced
        self._mispriced -= repaid
        self._planned = min(self._planned, earned) + earned - repaid
        for step in range(STEPS_A_REFRESH):
            until = begin + (end - begin) * (step + 1) / STEPS_A_REFRESH
            least = RAYS_SHARE * earned / STEPS_A_REFRESH if self._planned > 0.0 else 0.0
            self._advance(method, until, max((self._planned - self._show_s) / (STEPS_A_REFRESH - step), least))
        if self._planned >= 0.0:
            self._show(method, end)
        return self._image

    def _advance(self, method: Method, until: float, budget: float) -> None:
        """Grant what `budget` seconds buy. It counts as used at once: a method may trace a whole frame at its end."""
        ray_s = self._rays_s / self._rays
        granted = max(0, int(budget / ray_s))
        self.allowed += granted
        self._planned -= granted * ray_s
        before, started = method.rays, self._timer()
        method.advance(until, self.allowed)
        cost, used = self._charge(started), method.rays - before
        self._rays, self._rays_s = self._rays + used, self._rays_s + cost
        self._mispriced += cost - used * ray_s

    def _show(self, method: Method, time_shown: float) -> None:
        started = self._timer()
        image = method.show(time_shown)
        cost = self._charge(started)
        self._planned -= cost
        self._show_s += SMOOTHING * (cost - self._show_s)
        self.shown += 1
        self._image = image.copy()  # the method's own may change before a later refresh that is missed

    def _charge(self, started: float) -> float:
        cost = self._timer() - started
        self.spent += cost
        return cost
