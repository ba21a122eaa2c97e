"""One measurement as a row: what, how much, against what, on which machine, by which command."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

SEED = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """`ratio` is value / limit; `bar` is what ratio or value must reach, `met` whether it does."""

    metric: str
    value: float | None
    unit: str
    limit: float | None
    ratio: float | None
    bar: str
    met: bool | None  # None: not measured, or no bar is set
    note: str = ""
    spread: float | None = None  # half the range of the ratio over the rounds
    failed: bool = False  # it was to be measured, and could not be
    load: float = field(default_factory=lambda: round(os.getloadavg()[0], 2))  # of the machine in the last minute
    more: dict[str, Any] = field(default_factory=dict)

    def json_line(self) -> str:
        """Returns the row as one line of JSON, with command, machine, seed and commit."""
        row = asdict(self)
        more = row.pop("more")
        about = {"command": command(), "machine": machine(), "seed": SEED, "commit": commit()}
        return json.dumps({**row, **more, **about}, allow_nan=False)


def compared(
    metric: str, values: list[float], limits: list[float], *, unit: str, at_least: float, note: str = "", **more: Any
) -> Row:
    """A row of rounds measured in turn, value against limit; the ratio is the median of the rounds' own ratios."""
    ratios = sorted(value / limit for value, limit in zip(values, limits, strict=True))
    ratio = median(ratios)
    return Row(
        metric=metric, value=median(values), unit=unit, limit=median(limits), ratio=ratio, bar=f"ratio >= {at_least:g}",
        met=ratio >= at_least, note=note, spread=(ratios[-1] - ratios[0]) / 2, more=more,
    )  # fmt: skip


def bounded(metric: str, value: float, limit: float, *, unit: str, below: bool, note: str = "", **more: Any) -> Row:
    """A row of one figure that must stay below (or reach) a limit."""
    met = value <= limit if below else value >= limit
    return Row(
        metric=metric, value=value, unit=unit, limit=limit, ratio=value / limit if limit else None,
        bar=f"value {'<=' if below else '>='} {limit:g}", met=met, note=note, more=more,
    )  # fmt: skip


def reported(metric: str, value: float, *, unit: str, note: str = "", **more: Any) -> Row:
    """A row of one figure that no bar is set for."""
    return Row(
        metric=metric, value=value, unit=unit, limit=None, ratio=None, bar="", met=None, note=note, more=more,
    )  # fmt: skip


def skipped(metric: str, unit: str, bar: str, why: str) -> Row:
    """Returns the row of a metric that was not measured, and why."""
    return Row(metric=metric, value=None, unit=unit, limit=None, ratio=None, bar=bar, met=None, note=f"skipped: {why}")


def failed(metric: str, why: str) -> Row:
    """A row of what was to be measured and could not be."""
    return Row(
        metric=metric, value=None, unit="", limit=None, ratio=None, bar="", met=None, failed=True, note=f"failed: {why}"
    )  # fmt: skip


def median(values: list[float]) -> float:
    """Returns the median."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2


@cache
def machine() -> str:
    """CPU, usable cores and the versions that speed depends on."""
    model = "unknown CPU"
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    versions = ", ".join(f"{name} {version(name)}" for name in ("numba", "embreex", "numpy", "pyzmq"))
    return f"{model}, {len(os.sched_getaffinity(0))} cores, Python {platform.python_version()}, {versions}"


@cache
def commit() -> str:
    """The clone's commit, "-dirty" if files differ from it; "unknown" outside a clone."""
    folder = Path(__file__).parent
    try:
        head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=folder, capture_output=True, text=True, timeout=10)
        changed = subprocess.run(["git", "status", "--porcelain", "-uno"], cwd=folder, capture_output=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    if head.returncode:
        return "unknown"
    return head.stdout.strip() + ("-dirty" if changed.stdout else "")


def command() -> str:
    """Returns the command line that measures."""
    return " ".join(["wall", *sys.argv[1:]])
