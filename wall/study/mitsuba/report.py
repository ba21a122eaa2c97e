"""Rows of `wall measure reference`: a file, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from wall.study import json_lines
from wall.study.mitsuba.compare import Row


def report(rows: Sequence[Row], out: Path) -> Table:
    """Writes reference.jsonl into `out` and returns the table."""
    text = "".join(json_lines.line_of(row) + "\n" for row in rows)
    (out / "reference.jsonl").write_text(text, encoding="utf-8")
    table = Table(title=f"against Mitsuba {rows[0].mitsuba}, pictures in {out}")
    for name in ("config", "samples a pixel", "mean, ours over theirs", "pixels that agree", "RMSE", "CPU s", "same"):
        table.add_column(name)
    for row in rows:
        name = row.config + (", its own materials" if row.materials == "mitsuba" else "")
        table.add_row(
            name, str(row.spp), ", ".join(f"{value:.4f}" for value in row.ratio), f"{100 * row.passed:.2f} %",
            f"{row.rmse:.4f}", f"{row.cpu_s:.1f}, {row.mitsuba_cpu_s:.1f}", "yes" if row.ok else "no",
        )  # fmt: skip
    return table
