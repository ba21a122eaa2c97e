"""Rows of `wall measure noise`: files, and tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from wall.study import json_lines
from wall.study.noise.denoising import DenoisedRow
from wall.study.noise.points import PointsRow


def report_points(rows: Sequence[PointsRow], out: Path) -> Table:
    """Writes points.jsonl into `out` and returns the table."""
    _write(rows, out / "points.jsonl")
    table = Table(title="error of N samples a pixel, linear RGB")
    for name in ("scene", "N", "ours", "independent", "ratio", "as many as", "blurred", "independent", "ratio"):
        table.add_column(name, justify="left" if name == "scene" else "right")
    for row in rows:
        table.add_row(
            row.scene, str(row.spp), f"{row.ours:.5f}", f"{row.independent:.5f}", f"{row.independent / row.ours:.2f}",
            f"{row.equals:.0f}", f"{row.blurred:.5f}", f"{row.blurred_independent:.5f}",
            f"{row.blurred_independent / row.blurred:.2f}",
        )  # fmt: skip
    return table


def report_denoised(rows: Sequence[DenoisedRow], out: Path) -> Table:
    """Writes denoised.jsonl into `out` and returns the table."""
    _write(rows, out / "denoised.jsonl")
    table = Table(title="error of display values at rest: RMSE, FLIP")
    images = list(dict.fromkeys(row.image for row in rows))
    for name in ("scene", "samples", *images):
        table.add_column(name)
    for scene, spp in dict.fromkeys((row.scene, row.spp) for row in rows):
        found = {row.image: row for row in rows if (row.scene, row.spp) == (scene, spp)}
        table.add_row(scene, str(spp), *(f"{found[name].rmse:.4f}, {found[name].flip:.3f}" for name in images))
    return table


def _write(rows: Sequence[object], path: Path) -> None:
    path.write_text("".join(json_lines.line_of(row) + "\n" for row in rows), encoding="utf-8")
