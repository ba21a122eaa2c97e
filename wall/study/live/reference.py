"""The reference images of a configuration: camera and objects exactly where they are at given times of its path.

A moment is that of a display's first row; where `row_time` says so, each further row is of its own, later moment: an
image that is light at one moment shows each row so much later, too.

They are traced as those of `wall measure quality`, for every panel, and kept under a hash of what they show.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from wall.core.data import Float32
from wall.roles.plan import Plan
from wall.study.quality.image_strips import Bytes
from wall.study.quality.metrics import display_values
from wall.study.quality.reference import Reference
from wall.tracing.tracer_scene import make_tracer_scene

FOLDER = "reference"


class WallReference:
    """Reference images at `times` (seconds of the path, growing); `make` traces those that are not there yet."""

    def __init__(self, plan: Plan, times: list[float], out: Path, *, spp: int) -> None:
        tracer_scene = make_tracer_scene(plan.scene)
        self.wall, self.path, self.times, self.spp = plan.layout.wall, plan.view.path, times, spp
        self.references = {
            panel.id: Reference(plan, tracer_scene, times, spp=spp, panel=panel.index, cache=out / FOLDER)
            for panel in self.wall.panels
        }
        keys = " ".join(reference.key for reference in self.references.values())
        self.key = hashlib.blake2b(keys.encode(), digest_size=12).hexdigest()

    def make(self, progress: Callable[[int, int], None]) -> None:
        """Trace what is missing, an image in each thread; `progress` hears how many are done, of how many."""
        todo = [(reference, k) for reference in self.references.values() for k in reference.missing()]
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            made = pool.map(lambda one: one[0].make([one[1]]), todo)
            try:
                for done, _ in enumerate(made, start=1):
                    progress(done, len(todo))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

    def display(self, panel: str, k: int) -> Float32:
        """(h, w, 3) float32 display values, 0 to 1, of a panel at time k."""
        return display_values(self.references[panel].image(k))

    def codes(self, panel: str, k: int) -> Bytes:
        """(h, w, 3) uint8 sRGB of a panel at time k."""
        found: Bytes = np.rint(255.0 * self.display(panel, k)).astype(np.uint8)
        return found
