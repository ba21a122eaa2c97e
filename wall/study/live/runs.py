"""One run of a wall as a user starts it, on some cores, its images kept: `wall run CONFIG --headless --images`."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wall.config.loading import Loaded
from wall.core.errors import RunError
from wall.display.image_log import LoggedImages, read_log
from wall.study.live.cpu_limit import limited, own_cores
from wall.study.live.rewriting import text_for

START_S = 120.0  # of one core, until a wall runs: a large scene, kernels that are not compiled yet
END_S = 30.0  # from the end of its time to that of its processes
STOP_S = 8.0  # for a run that is interrupted to end in order
IMAGES, OUTPUT, SUMMARY = "recorded", "run.log", "summary.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a run left."""

    summary: dict[str, Any]
    other_cores: float  # that everything else on this machine used meanwhile


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedRun(Run):
    """What a run left, and what it showed."""

    images: LoggedImages


class Bystanders:
    """How much CPU time others take on this machine, beside processes that this one starts and waits for."""

    def __init__(self) -> None:
        self._began, self._others = time.monotonic(), self._cpu_s()

    def cores(self) -> float:
        """Cores that others used since this was made, on average."""
        return max(0.0, self._cpu_s() - self._others) / max(time.monotonic() - self._began, 1e-3)

    def _cpu_s(self) -> float:
        words = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()
        own = resource.getrusage(resource.RUSAGE_CHILDREN)
        return busy_ticks(words) / os.sysconf("SC_CLK_TCK") - own.ru_utime - own.ru_stime


def busy_ticks(words: Sequence[str]) -> int:
    """Of the first line of /proc/stat: all but idle and waiting for disks; guests are in `user` already."""
    user, nice, system, _idle, _iowait, irq, softirq, steal = map(int, words[1:9])
    return user + nice + system + irq + softirq + steal


def record_wall(
    config: Path, folder: Path, *, seconds: float, cores: float, options: Sequence[str] = ()
) -> RecordedRun:
    """Run a configuration for a while, and return what it showed. Raises RunError, ConfigError; see run_wall."""
    recorded = folder / IMAGES
    run = run_wall(config, folder, seconds=seconds, cores=cores, options=("--images", str(recorded), *options))
    return RecordedRun(images=read_log(recorded), summary=run.summary, other_cores=run.other_cores)


def run_anew(loaded: Loaded, method: str, folder: Path, *, seconds: float) -> Run:
    """Run a configuration under a method, on all cores, in a folder made anew. Raises RunError; see run_wall."""
    return run_wall(written_anew(loaded, method, folder), folder, seconds=seconds, cores=own_cores())


def written_anew(loaded: Loaded, method: str, folder: Path) -> Path:
    """Write a configuration under a method to a folder made anew: control.json of a run that was killed is gone."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path = folder / f"{loaded.path.stem}.yaml"
    path.write_text(text_for(loaded, method), encoding="utf-8")
    return path


def run_wall(config: Path, folder: Path, *, seconds: float, cores: float, options: Sequence[str] = ()) -> Run:
    """Run a configuration for a while. Raises RunError, ConfigError.

    Everything is kept in `folder`, what the run printed too. No process is left, however this ends.
    """
    command = [sys.executable, "-m", "wall", "run", str(config), "--headless", "--seconds", f"{seconds:g}"]
    command += ["--out", str(folder), *options]
    limit_s = START_S / min(cores, 1.0) + seconds + END_S
    bystanders = Bystanders()
    with limited(cores) as launcher, (folder / OUTPUT).open("w", encoding="utf-8") as output:
        process = subprocess.Popen(
            [*launcher, *command], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
        try:
            code = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise RunError(f"{config}: the run did not end within {limit_s:.0f} s; see {folder / OUTPUT}") from None
        finally:
            stop(process)
    others = bystanders.cores()
    if code:
        said = (folder / OUTPUT).read_text(encoding="utf-8", errors="replace").strip()
        raise RunError(f"{config}: the run failed with exit code {code}: {said[-500:]}")
    summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    return Run(summary=summary, other_cores=others)


def stop(process: subprocess.Popen[bytes]) -> None:
    """End a run and every process of its session: in order at first."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(STOP_S)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
