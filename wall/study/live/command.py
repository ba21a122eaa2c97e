"""What the words of `wall measure live` stand for, and its table."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path

from wall.config.loading import nearest
from wall.config.sampling import METHODS
from wall.core.errors import ConfigError, RunError
from wall.study.live.rows import Row
from wall.study.quality.command import cores_of
from wall.study.quality.tables import Table

NEEDED = {"flip_evaluator": "flip-evaluator", "skimage": "scikit-image", "av": "av"}
NOTE = (
    "RMSE: of display values, in 8-bit codes, against the ideal picture of each moment. Hz, p95 interval: of pictures "
    "that became light. Input to picture: to the refresh that first showed a sample of it, without the display's delay."
)


def check_installed() -> None:
    """Raises RunError, before anything is measured, where the extra `measure` is not installed."""
    missing = [name for module, name in NEEDED.items() if find_spec(module) is None]
    if missing:
        raise RunError(f"wall measure live needs {', '.join(missing)}: pip install '.[measure]' in the clone")


def methods_of(text: str) -> tuple[str, ...]:
    """Methods by name or pattern, such as adaptive,frame*. Raises ConfigError."""
    picked: dict[str, None] = {}
    for word in (part.strip() for part in text.split(",")):
        matching = [name for name in METHODS if fnmatchcase(name, word)]
        if not matching:
            raise ConfigError(f"--methods {word}: unknown{nearest(word, METHODS)}; accepted: {', '.join(METHODS)}")
        picked.update(dict.fromkeys(matching))
    return tuple(picked)


def cores_wanted(text: str) -> tuple[float, ...]:
    """Cores, such as 0.5,1,2; all that this process may use if left out. Raises ConfigError."""
    return cores_of(text) if text else (float(len(os.sched_getaffinity(0))),)


def configs_of(configs: Iterable[Path]) -> tuple[Path, ...]:
    """The configurations, all of them files. Raises ConfigError."""
    found = tuple(configs)
    for config in found:
        if not config.is_file():
            raise ConfigError(f"{config}: no such file; accepted: YAML configurations, such as configs/demo.yaml")
    return found


def table(rows: Sequence[Row]) -> Table:
    """A line for each row."""
    columns = (
        "configuration", "cores", "method", "RMSE", "FLIP", "SSIM", "Hz", "p95 interval, ms",
        "input to picture p50, p95, p99, ms", "samples/s", "bytes/s", "CPU s/s: head, others",
    )  # fmt: skip
    return Table(title="On the wall", columns=columns, lines=tuple(map(_line, rows)), text=(0, 2), note=NOTE)


def _line(row: Row) -> tuple[str, ...]:
    head = row.cpu_s.get("head", 0.0)
    others = sum(row.cpu_s.values()) - head
    latency = ", ".join(f"{ms:.0f}" for ms in (row.latency_p50_ms, row.latency_p95_ms, row.latency_p99_ms))
    return (
        row.config, f"{row.cores:g}", row.method, f"{255.0 * row.rmse_display:.2f}", f"{row.flip:.4f}",
        f"{row.ssim:.4f}", f"{row.refresh_hz:.1f}", f"{row.interval_p95_ms:.1f}", latency,
        f"{row.samples_per_s / 1e3:.0f} k", f"{row.bytes_per_s / 1e6:.2f} M",
        f"{head / row.run_s:.2f}, {others / row.run_s:.2f}",
    )  # fmt: skip
