"""Tables and the plot of `wall measure peers`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import RenderableType

from wall.display.files import replaced
from wall.study.live.command import QUIET_CORES
from wall.study.peers.drawing import Codes
from wall.study.peers.rows import FILE, Row
from wall.study.quality.plots import DPI, LIGHT
from wall.study.quality.tables import Table

PLOT = "error_against_cpu.png"
SAME_CODES = 2.0  # RMSE of means over blocks up to which two renderers are said to draw the same
MARKS = "os^vDPX*<>hp"
NOTE = (
    "RMSE of display values in 8-bit codes, against the picture of each moment that is right; a picture counts until "
    "the next one. p95: of the time to it. cores: CPU seconds a second. At rest: from a camera that stands still, of "
    "pixels, and of means over 8x8 of them."
)


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    yield from (table.rich() for table in tables(rows))
    for row in rows:
        if 255.0 * row.rest_blocks > SAME_CODES:
            off = f"{255.0 * row.rest_blocks:.1f} codes, more than {SAME_CODES:g}"
            yield f"note: {row.config}: {row.renderer} draws something else at rest: {off}"
    others = max((row.other_cores for row in rows), default=0.0)
    if others > QUIET_CORES:
        yield f"note: other processes used up to {others:.2f} cores during the runs; figures of a quiet machine differ"
    yield f"rows in {out}/{FILE}, plot in {out}/{PLOT}, strips in {out}/CONFIG-SIZE/"


def tables(rows: Sequence[Row]) -> list[Table]:
    """A table for each configuration and number of cores, the smallest error first."""
    columns = ("renderer", "RMSE", "FLIP", "SSIM", "Hz", "p95 ms", "cores", "at rest", "means")
    groups: dict[tuple[str, float, int, int], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.config, row.cores, row.triangles, row.pixels), []).append(row)
    return [
        Table(
            title=f"{config}: {triangles:,} triangles, {pixels:,} pixels, {cores:g} core{'' if cores == 1.0 else 's'}",
            columns=columns, lines=tuple(map(_line, sorted(group, key=lambda row: row.rmse_display))), text=(0,),
            note=NOTE if group[-1] is rows[-1] else "",
        )
        for (config, cores, triangles, pixels), group in groups.items()
    ]  # fmt: skip


def _line(row: Row) -> tuple[str, ...]:
    return (
        row.renderer, f"{255.0 * row.rmse_display:.2f}", f"{row.flip:.4f}", f"{row.ssim:.4f}", f"{row.refresh_hz:.1f}",
        f"{row.interval_p95_ms:.0f}", f"{row.cpu_cores:.2f}", f"{255.0 * row.rest_rmse:.2f}",
        f"{255.0 * row.rest_blocks:.2f}",
    )  # fmt: skip


def plot(out: Path, rows: Sequence[Row]) -> None:
    """error_against_cpu.png: error in motion against CPU time, a panel for each configuration."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    scenes = list(dict.fromkeys((row.config, row.pixels) for row in rows))
    names = list(dict.fromkeys(row.renderer for row in rows))
    figure, axes = pyplot.subplots(1, len(scenes), figsize=(4.6 * len(scenes), 4.2), dpi=DPI, squeeze=False)
    for axis, (config, pixels) in zip(axes[0], scenes, strict=True):
        for k, name in enumerate(names):
            own = [row for row in rows if (row.config, row.pixels, row.renderer) == (config, pixels, name)]
            found = sorted((row.cpu_cores, 255.0 * row.rmse_display) for row in own)
            if found:
                axis.plot(*np.array(found).T, marker=MARKS[k % len(MARKS)], color=f"C{k % 10}", label=name)
        axis.set(title=f"{config}, {pixels:,} pixels", xlabel="CPU seconds a second", ylabel="RMSE, 8-bit codes")
        axis.set_xlim(left=0.0)
        axis.set_ylim(bottom=0.0)
        axis.grid(color=LIGHT.grid)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=min(len(names), 6), frameon=False)
    figure.tight_layout(rect=(0.0, 0.08, 1.0, 1.0))
    with replaced(out / PLOT) as part:
        figure.savefig(part)
    pyplot.close(figure)


def write_image(path: Path, image: Codes) -> None:
    """An (h, w, 3) image as a PNG."""
    with replaced(path) as part:
        Image.fromarray(image).save(part, format="PNG")
