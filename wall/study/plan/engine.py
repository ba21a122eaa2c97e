"""Simulated time, and cores that share it out: calls in the order of their times, nothing of a real clock.

Cores share as Linux's fair scheduler does: each task has a virtual runtime that grows with its CPU time over its
weight; the smallest runs next, for a slice; who slept comes back a little before the others.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from itertools import count
from typing import Any

SLICE_S = 0.003  # that a task runs before another may have its core
WAKE_LEAD_S = 0.003  # virtual runtime that a task which slept is given back at most
WEIGHTS = {0: 1024.0, 5: 335.0}  # of Linux, by niceness
LEAST_S = 1e-9  # of CPU time that counts


class Engine:
    """Calls at their times. `now` is the time of the one that runs, seconds."""

    def __init__(self) -> None:
        self.now = 0.0
        self._calls: list[tuple[float, int, Callable[..., None], tuple[Any, ...]]] = []
        self._numbers = count()

    def at(self, time: float, call: Callable[..., None], *args: Any) -> None:
        """Call at a time, not before now; calls of one time go in the order in which they were asked for."""
        heapq.heappush(self._calls, (max(time, self.now), next(self._numbers), call, args))

    def run(self, until: float) -> None:
        """Go on until a time, or until nothing is left to call."""
        calls = self._calls
        while calls and calls[0][0] <= until:
            self.now, _, call, args = heapq.heappop(calls)
            call(*args)


class Task:
    """A thread: what it has used of some cores."""

    __slots__ = ("began", "done", "remaining", "turn", "used", "vruntime", "weight")

    def __init__(self, nice: int = 0) -> None:
        self.weight = WEIGHTS[nice]
        self.vruntime = self.remaining = self.began = self.used = 0.0
        self.turn = 0  # which of its slices is valid
        self.done: Callable[[], None] = lambda: None


class Cores:
    """The cores of one machine."""

    def __init__(self, engine: Engine, count: int) -> None:
        self._engine, self._count = engine, count
        self._running: list[Task] = []
        self._ready: list[Task] = []

    def submit(self, task: Task, seconds: float, done: Callable[[], None]) -> None:
        """Let a task work so many CPU seconds, then call `done`. It has no other work."""
        task.remaining, task.done = max(seconds, LEAST_S), done
        others = [*self._running, *self._ready]
        if others:
            task.vruntime = max(task.vruntime, min(map(self._vruntime, others)) - WAKE_LEAD_S)
        if len(self._running) < self._count:
            self._start(task)
            return
        last = max(self._running, key=self._vruntime)
        if self._vruntime(last) > task.vruntime:
            self._stop(last)
            self._ready.append(last)
            self._start(task)
        else:
            self._ready.append(task)

    def _vruntime(self, task: Task) -> float:
        ran = self._engine.now - task.began if task in self._running else 0.0
        return task.vruntime + ran * WEIGHTS[0] / task.weight

    def _start(self, task: Task) -> None:
        self._running.append(task)
        task.began, task.turn = self._engine.now, task.turn + 1
        slice_s = min(task.remaining, SLICE_S) if self._ready or len(self._running) == self._count else task.remaining
        self._engine.at(self._engine.now + slice_s, self._slice_over, task, task.turn)

    def _stop(self, task: Task) -> None:
        """Take a task off its core, and count what it ran."""
        ran = self._engine.now - task.began
        task.vruntime += ran * WEIGHTS[0] / task.weight
        task.remaining -= ran
        task.used += ran
        task.turn += 1
        self._running.remove(task)

    def _slice_over(self, task: Task, turn: int) -> None:
        if task.turn != turn:
            return
        self._stop(task)
        finished = task.remaining <= LEAST_S
        if not finished:
            self._ready.append(task)
        if self._ready and len(self._running) < self._count:
            following = min(self._ready, key=lambda other: other.vruntime)
            self._ready.remove(following)
            self._start(following)
        if finished:
            task.done()
