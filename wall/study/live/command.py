"""What the words of `wall measure live` stand for, and its tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich.console import RenderableType

from wall.config.sampling import METHODS
from wall.core.errors import ConfigError
from wall.study import options
from wall.study.live.cpu_limit import own_cores
from wall.study.live.jumps import root_mean_square, spans
from wall.study.live.rewriting import REDUCED, ROWS, Rows
from wall.study.live.rows import FILE, Row
from wall.study.live.sweep import Outcome
from wall.study.quality.tables import Table

NEEDED = {"flip_evaluator": "flip-evaluator", "skimage": "scikit-image", "av": "av"}
QUIET_CORES = 0.1  # that others may use without being told
NOTE = (
    "RMSE of display values in 8-bit codes, against the reference image of each moment. Hz, interval: of images of "
    "a panel that became light. Input: to the refresh that first showed a sample of it, without the display's delay."
)


def check_installed() -> None:
    """Raises RunError, before anything is measured, where the extra `measure` is not installed."""
    options.check_installed("wall measure live", NEEDED)


def methods_of(text: str) -> tuple[str, ...]:
    """Methods by name or pattern, such as adaptive,frame*. Raises ConfigError."""
    return options.picked("--methods", text, (*METHODS, *REDUCED))


def cores_of(text: str) -> tuple[float, ...]:
    """Cores, such as 0.5,1,2; all that this process may use if left out. Raises ConfigError."""
    return options.cores_of(text) if text else (own_cores(),)


def rows_of(text: str) -> Rows:
    """What renderers make of rows' moments. Raises ConfigError."""
    found = next((each for each in ROWS if each == text), None)
    if found is None:
        raise ConfigError(f"--rows {text}; wanted {', '.join(ROWS)}")
    return found


def configs_of(configs: Iterable[Path]) -> tuple[Path, ...]:
    """The configurations, all of them files. Raises ConfigError."""
    found = tuple(configs)
    options.check_files(found)
    return found


def runs_of(configs: Iterable[Path], methods: str) -> list[tuple[Path, str]]:
    """Each configuration with each method, in turn. Raises ConfigError."""
    return [(config, method) for config in configs_of(configs) for method in methods_of(methods)]


def report(outcome: Outcome, out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    yield from (table.rich() for table in [*tables(outcome.rows), *tables_after_jumps(outcome.rows)])
    yield from (f"note: {note}" for note in outcome.notes)
    others = max((row.other_cores for row in outcome.rows), default=0.0)
    if others > QUIET_CORES:
        yield f"note: other processes used up to {others:.2f} cores during the runs; figures of a quiet machine differ"
    yield f"rows in {out}/{FILE}; strip.png and film.mp4 in {out}/CONFIG-CORES/"


def tables(rows: Sequence[Row]) -> list[Table]:
    """A table for each configuration and number of cores, a line for each method."""
    columns = (
        "method", "RMSE", "FLIP", "SSIM", "Hz", "interval p95 ms", "input p50, p95 ms", "samples/s", "bytes/s",
        "cores: head, others",
    )  # fmt: skip
    groups = _groups(rows)
    return [
        Table(
            title=f"{config}, {_cores(cores)}", columns=columns,
            lines=tuple(map(_line, group)), text=(0,), note=NOTE if group[-1] is rows[-1] else "",
        )
        for (config, cores), group in groups.items()
    ]  # fmt: skip


def tables_after_jumps(rows: Sequence[Row]) -> list[Table]:
    """RMSE in 8-bit codes and FLIP by the time since a jump, where the camera jumps."""
    found = []
    for (config, cores), group in _groups([row for row in rows if row.since_jump]).items():
        known = spans(group[0].since_jump)
        heads = tuple(f"to {high:g} s" if high < math.inf else f"from {low:g} s" for low, high, _ in known)
        lines = tuple((row.method, *(_error(row, chosen) for _, _, chosen in known)) for row in group)
        title = f"{config}, {_cores(cores)}: RMSE (FLIP) by time since a jump"
        found.append(Table(title=title, columns=("method", *heads), lines=lines, text=(0,), note=""))
    return found


def _error(row: Row, chosen: Sequence[int]) -> str:
    flip = sum(row.flip_over_time[k] for k in chosen) / len(chosen)
    return f"{255.0 * root_mean_square(row.error_over_time, chosen):.1f} ({flip:.3f})"


def _groups(rows: Sequence[Row]) -> dict[tuple[str, float], list[Row]]:
    groups: dict[tuple[str, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.config, row.cores), []).append(row)
    return groups


def _cores(cores: float) -> str:
    return f"{cores:g} core{'' if cores == 1.0 else 's'}"


def _line(row: Row) -> tuple[str, ...]:
    head = row.cpu_s.get("head", 0.0)
    others = sum(row.cpu_s.values()) - head
    return (
        row.method, f"{255.0 * row.rmse_display:.2f}", f"{row.flip:.4f}", f"{row.ssim:.4f}", f"{row.refresh_hz:.1f}",
        f"{row.interval_p95_ms:.1f}", f"{row.latency_p50_ms:.0f}, {row.latency_p95_ms:.0f}",
        f"{row.samples_per_s / 1e3:.0f} k", f"{row.bytes_per_s / 1e6:.2f} M",
        f"{head / row.run_s:.2f}, {others / row.run_s:.2f}",
    )  # fmt: skip
