"""Summaries for a terminal and for machines: tables, and summary.json."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from wall.study.quality.bars import verdicts
from wall.study.quality.rows import Row
from wall.study.quality.summary import (
    OURS,
    averaged,
    best_other,
    compare,
    equal_error,
    geometric,
    methods_at,
    said,
    scenes,
    spendings,
)
from wall.study.quality.tables_wire import Lines, wire_tables
from wall.study.quality.traffic import at_rest, crossovers, traffic


def tables(rows: Sequence[Row]) -> list[Table]:
    """Errors, ratios and bars of rows that share clock and size."""
    if not rows:
        return []
    return [errors_table(rows), ratios_table(rows), *map(_wire, wire_tables(rows)), bars_table(rows)]


def errors_table(rows: Sequence[Row]) -> Table:
    """RMSE: a line a method and spending, the best first, a column a scene."""
    errors, flips, clock = averaged(rows), averaged(rows, "flip"), rows[0].clock
    names = scenes(rows)
    found = _table("RMSE of display values (0 to 1)", "", "method", *names, "mean", "FLIP")
    for spent in spendings(rows):
        lines = []
        for method in methods_at(rows, spent):
            keys = [(scene, method, spent) for scene in names if (scene, method, spent) in errors]
            flip = [flips[key] for key in keys if key in flips]
            lines.append((geometric(errors[key] for key in keys), sum(flip) / max(len(flip), 1), method))
        for mean, flip_mean, method in sorted(lines):
            trials = [f"{errors[s, method, spent]:.4f}" if (s, method, spent) in errors else "" for s in names]
            style = "bold" if method == OURS else ""
            found.add_row(said(spent, clock), method, *trials, f"{mean:.4f}", f"{flip_mean:.3f}", style=style)
        found.add_section()
    return found


def ratios_table(rows: Sequence[Row]) -> Table:
    found = _table(
        "error of others over error of adaptive", "", "method", "mean", "95 %", "worst", "worst scene", "FLIP higher"
    )
    for row in sorted(
        [*compare(rows), *best_other(rows)], key=lambda c: (c.spending, c.method == "best other", c.mean)
    ):
        interval = f"{row.low:.2f} to {row.high:.2f}" if row.low is not None and row.high is not None else ""
        higher = "" if row.flip_higher is None else "everywhere" if row.flip_higher else "NOT everywhere"
        found.add_row(
            said(row.spending, rows[0].clock), row.method, f"{row.mean:.2f}", interval, f"{row.worst:.2f}",
            row.worst_scene, higher,
        )  # fmt: skip
    return found


def bars_table(rows: Sequence[Row]) -> Table:
    found = _table("bars", "what", "wanted", "came", "met")
    for verdict in verdicts(rows):
        met = "yes" if verdict.met else "MISSED"
        found.add_row(verdict.what, verdict.wanted, verdict.came, met, style="" if verdict.met else "red")
    return found


def _wire(wanted: Lines) -> Table:
    found = Table(title=wanted.title, title_justify="left", caption=wanted.note, caption_justify="left")
    for k, column in enumerate(wanted.columns):
        found.add_column(column, justify="left" if k in wanted.text else "right", overflow="fold")
    for line in wanted.lines:
        found.add_row(*line, style="bold" if OURS in line else "")
    return found


def write_summary(path: Path, rows: Sequence[Row]) -> None:
    """Everything the tables say, as JSON; numbers that do not exist are null."""
    errors = [
        {"scene": scene, "method": method, "spending": spent, "rmse_display": error}
        for (scene, method, spent), error in averaged(rows).items()
    ]
    summary = {
        "clock": rows[0].clock if rows else None,
        "size": [rows[0].width, rows[0].height] if rows else None,
        "commits": sorted({row.commit for row in rows}),
        "seeds": sorted({row.seed for row in rows}),
        "errors": errors,
        "ratios": [asdict(c) for c in [*compare(rows), *best_other(rows)]],
        "equal_error": [asdict(m) for m in equal_error(rows)],
        "traffic": [asdict(t) for t in traffic(rows)],
        "crossovers": [asdict(c) for c in crossovers(rows)],
        "at_rest": [asdict(r) for r in at_rest(rows)],
        "bars": [asdict(v) for v in verdicts(rows)],
    }
    path.write_text(json.dumps(_finite(summary), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(title: str, *columns: str) -> Table:
    found = Table(title=title, title_justify="left")
    for column in columns:
        left = column in ("", "method", "what", "wanted", "came", "met", "worst scene", "FLIP higher")
        found.add_column(column, justify="left" if left else "right")
    return found
