"""Series of steps in time as objects of a scene: each step is an instance, and one of them is there at a moment.

The meshes of steps are loaded when they are shown, the next one ahead of that, and those behind are dropped. Whoever
asks for one that is not loaded waits for it, so that an image depends on the scene's time alone.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING

from wall.core.data import Float64

if TYPE_CHECKING:
    from wall.scene.model import Instance, Mesh

KEPT = 2  # meshes of a series, beside its first, for each time: the one asked for last and the one ahead


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Steps whose instances stand one after another, all with the mesh of the first step."""

    first: int  # instance of step 0
    times: tuple[float, ...]  # seconds of scene time at which each step begins, ascending
    period: float | None  # seconds after which the first one begins again; None: the last one stays
    meshes: StepMeshes

    @property
    def rows(self) -> slice:
        """The instances of its steps."""
        return slice(self.first, self.first + len(self.times))

    def step_at(self, time: float) -> int:
        """The step that is shown at a scene time in seconds."""
        since = time - self.times[0]
        if self.period is not None:
            since %= self.period
        return max(0, bisect_right(self.times, self.times[0] + since) - 1)


class StepMeshes:
    """Loads the meshes of a series' steps, from 1 on: those of step 0 are the scene's own. For any thread."""

    def __init__(self, load: Callable[[int], Mesh], count: int, *, loops: bool) -> None:
        """`load` gives the mesh of a step, in the frame of the first step's, and may raise SceneError."""
        self._load, self._count, self._loops = load, count, loops
        self._lock = Lock()
        self.times = 1  # that views have, who ask by turns
        self._kept: dict[int, Future[Mesh]] = {}  # the newest last
        self._pool: ThreadPoolExecutor | None = None  # made in the process that loads, which may be forked

    def mesh(self, step: int) -> Mesh:
        """The mesh of a step; waits where it is not loaded yet, and lets the next one be loaded."""
        with self._lock:
            found = self._begun(step)
            ahead = (step + 1) % self._count if self._loops else min(step + 1, self._count - 1)
            if ahead not in (0, step):
                self._begun(ahead)
            for behind in list(self._kept)[: -KEPT * self.times]:
                del self._kept[behind]
        return found.result()

    @property
    def kept(self) -> tuple[int, ...]:
        """The steps that are loaded, or being loaded."""
        return tuple(self._kept)

    def _begun(self, step: int) -> Future[Mesh]:
        """The newest now."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, thread_name_prefix="steps")
        found = self._kept.pop(step, None) or self._pool.submit(self._load, step)
        self._kept[step] = found
        return found


def hide_others(poses: Float64, series: Sequence[Series], steps: Sequence[int]) -> None:
    """Give all steps but those shown no extent, as hidden objects have none.

    poses : (at least as many as instances, 4, 4), world from object, changed; steps : the one shown of each series
    """
    for each, step in zip(series, steps, strict=True):
        shown = poses[each.first + step, :3, :3].copy()
        poses[each.rows, :3, :3] = 0.0
        poses[each.first + step, :3, :3] = shown


def at_once(instances: Sequence[Instance], series: Sequence[Series]) -> list[Instance]:
    """The instances that can be there at one moment: of each series, its first step."""
    further = {row for each in series for row in range(each.rows.start + 1, each.rows.stop)}
    return [instance for row, instance in enumerate(instances) if row not in further]
