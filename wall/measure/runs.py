"""What whole runs cost: `wall run` is started as a user starts it, and its summary read."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from wall.errors import RunError
from wall.measure.record import Row, bounded

START_S = 60.0
LIVE = """\
version: 1
scene: {{source: {source}}}
wall: {{grid: {{columns: {columns}, rows: {rows}, pixels: [480, 270], size: [0.48, 0.27], bezel: 0.008}}}}
views: [{{camera: {camera}, path: {{type: orbit, period_s: 40}}, refresh_hz: 30}}]
sampling: {{method: frameless}}
graph: {{preset: sort-first, sinks: [png]}}
"""
COURTYARD = "{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}"


def run(seconds: float, *options: str, columns: int = 1, rows: int = 1, source: str = "courtyard") -> dict[str, Any]:
    """The summary of a headless run."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "wall.yaml"
        camera = COURTYARD if source == "courtyard" else "auto"
        config.write_text(LIVE.format(source=source, columns=columns, rows=rows, camera=camera), encoding="utf-8")
        command = [sys.executable, "-m", "wall", "run", str(config), "--headless", "--seconds", str(seconds)]
        done = subprocess.run(
            [*command, "--out", folder, *options], capture_output=True, text=True, timeout=seconds + START_S
        )
        if done.returncode:
            raise RunError(f"a measured run failed: {done.stderr.strip()[-500:]}")
        found: dict[str, Any] = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
        return found


def compositor_cpu(seconds: float) -> list[Row]:
    """CPU of the head of a one-panel wall: taking packets in, refreshing at 30 Hz, manager and sinks included."""
    found = run(seconds)
    rate = found["samples_shown"] / found["seconds"] / 1e6
    note = f"480x270 at 30 Hz, {rate:.1f} M samples/s coming in, the head's whole process"
    return [
        bounded(
            "compositor_cpu", found["head_cores"], 0.5, unit="cores", below=True, note=note,
            refreshes_per_s=found["refreshes"] / found["seconds"], samples_per_s=rate * 1e6,
        )
    ]  # fmt: skip


def input_latency(seconds: float) -> list[Row]:
    """From an input to the refresh that first shows it, in refresh intervals; four panels on this machine."""
    found = run(seconds, columns=2, rows=2)
    interval_ms = 1000.0 / 30.0
    latency = found["latency_ms"]
    note = "2x2 panels of 480x270, 30 Hz, an input every half refresh"
    return [
        bounded(
            "input_latency", latency["p50"] / interval_ms, 2.0, unit="refresh intervals", below=True, note=note,
            p50_ms=latency["p50"], p95_ms=latency["p95"], p99_ms=latency["p99"],
        )
    ]  # fmt: skip


def static_bytes(seconds: float) -> list[Row]:
    """Bytes of samples that a still, complete view sends: a long run's bytes less those of a short one."""
    short, long = run(seconds, "--still"), run(2 * seconds, "--still")
    extra = long["bytes"] - short["bytes"]
    note = f"paused: {short['bytes']} bytes of samples in {short['seconds']:.1f} s and {long['seconds']:.1f} s"
    more = {"until_complete": short["bytes"]}
    return [bounded("static_bytes", float(extra), 0.0, unit="bytes", below=True, note=note, **more)]


def memory_per_rank(seconds: float) -> list[Row]:
    """Largest resident set of a renderer of the 2.1 million triangle forest."""
    found = run(seconds, source="forest")
    peak = max(rank["peak_memory"] for rank in found["ranks"] if rank["role"] == "renderer") / 2**20
    small = run(seconds)
    other = max(rank["peak_memory"] for rank in small["ranks"] if rank["role"] == "renderer") / 2**20
    note = "forest, 2.12 M triangles by instancing; memory shared with the head counted in full"
    return [bounded("memory_per_rank", peak, 600.0, unit="MB", below=True, note=note, courtyard_mb=other)]
