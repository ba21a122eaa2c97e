"""What whole runs cost: `wall run` is started as a user starts it, and its summary read."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from wall.core.errors import RunError
from wall.study.speed.record import Row, bounded
from wall.study.speed.tracing import CAMERAS

START_S = 60.0
REFRESH_HZ = 30.0
PANEL_PIXELS = 480 * 270
LARGEST_MB, SMALL_MB = 200.0, 150.0  # of a renderer: of the forest, and of one small panel
MPI_ENVIRONMENT = {  # as root in containers, and with more ranks than cores
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}
LIVE = """\
version: 1
scene: {{source: {source}}}
wall: {{grid: {{columns: {columns}, rows: {rows}, pixels: [480, 270], size: [0.48, 0.27], bezel: 0.008}}}}
views: [{{camera: {camera}, path: {{type: orbit, period_s: 40}}, refresh_hz: 30}}]
sampling: {{method: frameless, threads: {threads}}}
graph: {{preset: sort-first, sinks: [png]}}
"""


def run(
    seconds: float,
    *options: str,
    columns: int = 1,
    rows: int = 1,
    source: str = "courtyard",
    threads: int = 1,
    launcher: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The summary of a headless run, its processes started by `launcher` or by itself."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "wall.yaml"
        text = LIVE.format(source=source, columns=columns, rows=rows, camera=CAMERAS[source], threads=threads)
        config.write_text(text, encoding="utf-8")
        command = [*launcher, sys.executable, "-m", "wall", "run", str(config), "--headless", "--seconds", str(seconds)]
        done = subprocess.run(
            [*command, "--out", folder, *options],
            capture_output=True,
            text=True,
            timeout=seconds + START_S,
            env=os.environ | MPI_ENVIRONMENT,
        )
        if done.returncode:
            raise RunError(f"a measured run failed: {done.stderr.strip()[-500:]}")
        found: dict[str, Any] = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
        return found


def compositor_cpu(seconds: float) -> list[Row]:
    """CPU of the head of a one-panel wall: taking packets in, refreshing at 30 Hz, manager and sinks included."""
    return [compositor_row(run(seconds))]


def compositor_row(found: dict[str, Any]) -> Row:
    """compositor_cpu of a run's summary; a head that saves its time by missing refreshes misses the bar."""
    rate = found["samples_shown"] / found["seconds"] / 1e6
    refreshes, slowest = found["refreshes"] / found["seconds"], 0.9 * REFRESH_HZ
    note = f"480x270 at {refreshes:.1f} Hz, {rate:.1f} M samples/s coming in, the head's whole process"
    row = bounded(
        "compositor_cpu", found["head_cores"], 0.5, unit="cores", below=True, note=note,
        refreshes_per_s=refreshes, samples_per_s=rate * 1e6,
    )  # fmt: skip
    return replace(row, bar=f"{row.bar} at >= {slowest:g} Hz", met=bool(row.met) and refreshes >= slowest)


def input_latency(seconds: float) -> list[Row]:
    """From an input to the refresh that first shows it, in refresh intervals; four panels on this machine."""
    return [latency_row(run(seconds, columns=2, rows=2))]


def latency_row(found: dict[str, Any]) -> Row:
    """input_latency of a run's summary. Raises RunError if no input was shown."""
    interval_ms = 1000.0 / REFRESH_HZ
    latency = found["latency_ms"]
    if latency["p50"] <= 0.0:
        raise RunError(f"no input of the {found['seconds']:.1f} s run was shown: latencies {latency}")
    note = "2x2 panels of 480x270, 30 Hz, an input every half refresh"
    return bounded(
        "input_latency", latency["p50"] / interval_ms, 2.0, unit="refresh intervals", below=True, note=note,
        p50_ms=latency["p50"], p95_ms=latency["p95"], p99_ms=latency["p99"],
    )  # fmt: skip


def static_bytes(seconds: float) -> list[Row]:
    """Bytes of samples that a still, complete view sends: a long run's bytes less those of a short one.

    With two threads samples travel; what an image takes until it is complete depends on when it is refreshed.
    """
    return [static_row(run(seconds, "--still", threads=2), run(2 * seconds, "--still", threads=2))]


def static_row(short: dict[str, Any], long: dict[str, Any]) -> Row:
    """static_bytes of the summaries of two paused runs. Raises RunError if the short one was not complete."""
    if short["samples_traced"] < PANEL_PIXELS:
        raise RunError(
            f"the view was not complete: {short['samples_traced']} samples of {PANEL_PIXELS} pixels in "
            f"{short['seconds']:.1f} s; nothing can be said about what comes after"
        )
    extra = long["bytes"] - short["bytes"]
    note = f"paused: {short['bytes']} bytes of samples in {short['seconds']:.1f} s and {long['seconds']:.1f} s"
    more = {"until_complete": short["bytes"]}
    return bounded("static_bytes", float(extra), 0.0, unit="bytes", below=True, note=note, **more)


def memory_per_rank(seconds: float) -> list[Row]:
    """Largest resident sets of renderers: of the 2.1 million triangle forest by mpirun, and of one small panel."""
    small, local = renderer_peak(run(seconds)), renderer_peak(run(seconds, source="forest"))
    if (program := mpirun()) is None:
        return memory_rows(small, local_mb=local)
    launcher = (program, "-n", "2")  # the head and one renderer
    return memory_rows(small, local_mb=local, mpi_mb=renderer_peak(run(seconds, source="forest", launcher=launcher)))


def memory_rows(small: float, *, local_mb: float, mpi_mb: float | None = None) -> list[Row]:
    """memory_per_rank and memory_small of renderers' peaks, MB; `mpi_mb`: None where mpirun is absent."""
    note = "forest, 2.12 M triangles by instancing; local ranks share the scene with the head, mpirun's load their own"
    more = {"local_mb": local_mb}
    if mpi_mb is None:
        note += "; mpirun is absent, so only local ranks were measured"
    else:
        more["mpi_mb"] = mpi_mb
    peak = max(local_mb, mpi_mb or 0.0)
    return [
        bounded("memory_per_rank", peak, LARGEST_MB, unit="MB", below=True, note=note, **more),
        bounded("memory_small", small, SMALL_MB, unit="MB", below=True, note="courtyard, a local panel of 480x270"),
    ]


def renderer_peak(found: dict[str, Any]) -> float:
    """MB (2^20) of the largest renderer of a run's summary. Raises RunError if none told its memory."""
    peak: float = max((rank["peak_memory"] for rank in found["ranks"] if rank["role"] == "renderer"), default=0) / 2**20
    if not peak:
        raise RunError(f"no renderer of the run said how much memory it took: {found['ranks']}")
    return peak


def mpirun() -> str | None:
    """The launcher of this environment, or of the system."""
    own = Path(sys.executable).with_name("mpirun")
    return str(own) if own.exists() else shutil.which("mpirun")
