"""The same paths by Mitsuba 3: the scenes of paths.py, 1 and 16 samples a pixel, each renderer on one core.

Runs in its own process (python -m wall.study.speed.path_peer), as mitsuba_peer.py does, and for its reasons. CPU time
of the process is what is measured, all threads; compilation is done before.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import numpy as np

from wall.roles.plan import Plan
from wall.study.mitsuba.description import describe
from wall.study.speed.mitsuba_peer import in_own_process
from wall.study.speed.paths import DEPTH, PIXELS, SCENES, PathBench, path_plan
from wall.study.speed.record import Row, compared, skipped

COUNTS = (1, 16)  # samples a pixel
METRICS = tuple(f"path_mitsuba{ending}_{spp}" for ending in SCENES for spp in COUNTS)


def measure(rounds: int) -> list[Row]:
    """path_mitsuba_1 and its like: paths a second, ours against theirs."""
    found = in_own_process("wall.study.speed.path_peer", rounds)
    if isinstance(found, str):
        return [skipped(metric, "M paths/s", "ratio >= 1", found) for metric in METRICS]
    rows = []
    for ending, words in SCENES.items():
        for spp in COUNTS:
            one = found[f"path_mitsuba{ending}_{spp}"]
            note = f"{words} ({one['triangles']} triangles), depth {DEPTH}, {PIXELS}x{PIXELS} pixels at {spp}, one core"
            rows.append(
                compared(
                    f"path_mitsuba{ending}_{spp}", one["ours"], one["theirs"], unit="M paths/s", at_least=1.0,
                    note=note, means=one["means"], mitsuba=found["version"],
                )
            )  # fmt: skip
    return rows


class Theirs:
    """Mitsuba 3 on the LLVM backend, with one thread."""

    def __init__(self, plan: Plan) -> None:
        import drjit
        import mitsuba

        mitsuba.set_variant("llvm_ad_rgb")
        drjit.set_thread_count(1)
        self._mi, self._dr, self.version = mitsuba, drjit, mitsuba.__version__
        self._scene = mitsuba.load_dict(describe(mitsuba, plan, spp=1))
        self._seed = 0

    def rate(self, spp: int) -> float:
        """Renders so many samples a pixel and returns paths a second."""
        self._seed += 1
        began = time.process_time()
        self._dr.eval(self._mi.render(self._scene, spp=spp, seed=self._mi.UInt32(self._seed)))
        self._dr.sync_thread()
        return PIXELS * PIXELS * spp / (time.process_time() - began)

    def mean(self, spp: int) -> float:
        """Of an image, linear."""
        return float(np.array(self._mi.render(self._scene, spp=spp, seed=self._mi.UInt32(9)))[..., :3].mean())


def _main(folder: str, rounds: int) -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    found: dict[str, object] = {}
    for ending in SCENES:
        plan = path_plan(ending)
        ours, theirs = PathBench(plan), Theirs(plan)
        for spp in COUNTS:
            ours.rate(spp), theirs.rate(spp)
            turns = [(ours.rate(spp) / 1e6, theirs.rate(spp) / 1e6) for _ in range(rounds)]
            found[f"path_mitsuba{ending}_{spp}"] = {
                "ours": [turn[0] for turn in turns], "theirs": [turn[1] for turn in turns],
                "means": [ours.mean(spp), theirs.mean(spp)], "triangles": plan.scene.triangles,
            }  # fmt: skip
        found["version"] = theirs.version
    Path(folder, "rates.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    _main(sys.argv[1], int(sys.argv[2]))
