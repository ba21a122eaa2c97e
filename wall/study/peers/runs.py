"""One renderer on some cores, and what it showed: a wall of this project, or another renderer in its own process."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from wall.config.loading import Loaded
from wall.core.errors import RunError
from wall.roles.plan import Plan
from wall.study.live.cpu_limit import limited
from wall.study.live.rewriting import text_for
from wall.study.live.runs import IMAGES, Bystanders, RecordedRun, record_wall, stop
from wall.study.live.scores import Shown, Shows
from wall.study.live.timeline import intervals
from wall.study.peers.cpu_meter import CpuMeter
from wall.study.peers.drawing import Codes, Triangles, at_rest, fov_of
from wall.study.peers.held import Pictures
from wall.study.peers.process import DONE, JOB, POSE_S, POSES, SHOWN, STILL, TRIANGLES
from wall.study.peers.renderers import SOFTWARE, write_triangles

BEYOND_S = 0.2  # a run goes on for so long after what is measured
REST_S = 4.0  # until a wall whose camera rests is as good as it gets, about
START_S, END_S = 240.0, 60.0  # of one core: a renderer's start, what it does after its time
AHEAD_S = 30.0  # of the path beyond the end: a slow renderer may draw from there


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """When pictures are compared."""

    first: float  # seconds of the camera's path
    seconds: float
    moments: tuple[float, ...]

    @property
    def end(self) -> float:
        """When a run is over."""
        return self.first + self.seconds + BEYOND_S

    @property
    def middle(self) -> float:
        """The moment whose camera rests in still pictures."""
        return self.moments[len(self.moments) // 2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a renderer showed, and what it took."""

    shows: Shows
    still: Codes  # of the middle moment's camera at rest
    refresh_hz: float
    interval_p95_ms: float
    cpu_cores: float
    other_cores: float
    version: str
    device: str


def run_ours(loaded: Loaded, method: str, folder: Path, *, span: Span, cores: float) -> Found:
    """A wall under one method, in motion, then at rest. Raises RunError."""
    moving, still = folder / "moving", folder / "rest"
    with CpuMeter() as meter:
        run = _recorded(loaded, method, moving, seconds=span.end, cores=cores)
    shown = Shown(run.images)
    pace = shown.timeline.intervals(span.first, span.seconds)
    rest = _recorded(at_rest(loaded, span.middle), method, still, seconds=REST_S, cores=cores).images
    began = run.images.began
    return Found(
        shows=shown, still=rest.rgb(rest.panels[-1]), refresh_hz=pace.refresh_hz, interval_p95_ms=pace.p95_ms,
        cpu_cores=meter.cores(began + span.first, began + span.first + span.seconds), other_cores=run.other_cores,
        version=version("wall"), device="Embree",
    )  # fmt: skip


def _recorded(loaded: Loaded, method: str, folder: Path, *, seconds: float, cores: float) -> RecordedRun:
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / f"{loaded.path.stem}.yaml"
    config.write_text(text_for(loaded, method), encoding="utf-8")
    run = record_wall(config, folder, seconds=seconds, cores=cores)
    if not run.images.panels:
        raise RunError(f"{config}: no picture was shown within {seconds:g} s")
    return run


def run_peer(
    name: str, plan: Plan, triangles: Triangles, folder: Path, *, span: Span, cores: float
) -> Found:  # fmt: skip
    """Another renderer in a process of its own. Raises RunError with what it said where it fails."""
    folder.mkdir(parents=True, exist_ok=True)
    write_triangles(folder / TRIANGLES, triangles)
    np.save(folder / POSES, _poses(plan, span.end + AHEAD_S))
    job = {
        "size": plan.layout.wall.panels[0].pixels, "fov": fov_of(plan.view), "refresh_hz": plan.view.refresh_hz,
        "seconds": span.end, "moments": span.moments, "still": span.middle,
    }  # fmt: skip
    (folder / JOB).write_text(json.dumps(job), encoding="utf-8")
    bystanders = Bystanders()
    with CpuMeter() as meter:
        _process(name, folder, seconds=span.end, cores=cores)
    others = bystanders.cores()
    done = json.loads((folder / DONE).read_text(encoding="utf-8"))
    pace = intervals([done["completed"]], span.first, span.seconds)
    began = done["began"] + span.first
    found = Found(
        shows=Pictures(span.moments, np.load(folder / SHOWN)), still=np.load(folder / STILL),
        refresh_hz=pace.refresh_hz, interval_p95_ms=pace.p95_ms, cpu_cores=meter.cores(began, began + span.seconds),
        other_cores=others, version=done["version"], device=done["device"],
    )  # fmt: skip
    for file in (TRIANGLES, POSES, SHOWN, STILL):
        (folder / file).unlink()
    return found


def _process(name: str, folder: Path, *, seconds: float, cores: float) -> None:
    """Start it, and wait for its end."""
    threads = str(math.ceil(cores))
    environment = os.environ | SOFTWARE | {"LP_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
    command = [sys.executable, "-m", "wall.study.peers.process", name, str(folder)]
    log, limit_s = folder / "run.log", START_S / min(cores, 1.0) + seconds + END_S
    with limited(cores) as launcher, log.open("w", encoding="utf-8") as output:
        process = subprocess.Popen(
            [*launcher, *command], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, env=environment,
            start_new_session=True,
        )  # fmt: skip
        try:
            code = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise RunError(f"{name}: did not end within {limit_s:.0f} s; see {log}") from None
        finally:
            stop(process)
    if code:
        said = log.read_text(encoding="utf-8", errors="replace").strip()
        raise RunError(f"{name}: ended with exit code {code}: {said[-500:]}")


def _poses(plan: Plan, seconds: float) -> np.typing.NDArray[np.float64]:
    """(n, 3, 4): rotation and origin of the camera every millisecond."""
    cameras = [plan.view.camera_at(k * POSE_S) for k in range(round(seconds / POSE_S))]
    return np.array([np.column_stack([camera.rotation(), camera.origin()]) for camera in cameras])


def blocks_rmse(a: Codes, b: Codes, size: int) -> float:
    """RMSE of display values, 0 to 1, of the means over blocks of `size` pixels; what is left at the edges counts not.

    a, b : (h, w, 3) uint8
    """
    height, width = (side // size * size for side in a.shape[:2])
    off = (a[:height, :width].astype(np.float64) - b[:height, :width]) / 255.0
    means = off.reshape(height // size, size, width // size, size, 3).mean(axis=(1, 3))
    return float(np.sqrt(np.mean(np.square(means))))


def clean(folder: Path, names: Sequence[str] = ("moving", "rest")) -> None:
    """Remove the recorded images of a wall's runs."""
    import shutil

    for name in names:
        shutil.rmtree(folder / name / IMAGES, ignore_errors=True)
