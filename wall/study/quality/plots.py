"""Plots of a quality run: error over time, against rays, against bytes, against CPU time. Each in light and dark."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, averaged, methods_at, middle, scenes, spending, spending_text, spendings

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

DPI, PANEL_INCHES = 144, (4.6, 3.1)

# Okabe and Ito's colours, told apart by most eyes; ours is the strong one
COLOURS = {
    OURS: "#d55e00",
    "framed": "#0072b2",
    "framed_x10": "#56b4e9",
    "frameless": "#009e73",
    "hilbert": "#8dbf3f",
    "best TAA": "#cc79a7",
    "best reduced": "#e69f00",
    "render cache": "#9467bd",
    "AFR 2005": "#8c6d5a",
    "Tapestry": "#17becf",
    "Shading Cache": "#d62728",
}
STREAMED = {
    "stream_raw": "#59636e",
    "stream_zstd_tiles": "#7d8590",
    "stream_jpeg90": "#b8860b",
    "stream_jpeg90_tiles": "#d4b106",
    "stream_h264": "#1a7f6b",
    "stream_h264_fine": "#6639ba",
}  # shown where bytes are: elsewhere they coincide with ours
FAMILIES = {
    "best TAA": "taa_",
    "best reduced": "reduced_",
    "render cache": "render_cache",
    "AFR 2005": "afr2005",
    "Tapestry": "tapestry",
    "Shading Cache": "shading_cache",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Theme:
    """Colours of a plot's text, background and grid."""

    ink: str
    paper: str
    grid: str


LIGHT = Theme(ink="#1f2328", paper="#ffffff", grid="#d8dee4")
DARK = Theme(ink="#e6edf3", paper="#161b22", grid="#30363d")


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """What one line of a plot stands for: a method, or the best of a family by hindsight, at each spending."""

    name: str
    methods: Mapping[tuple[str, float], str] = field(default_factory=dict)  # (scene, spending) -> method

    @property
    def colour(self) -> str:
        """Colour of the method's line."""
        return {**COLOURS, **STREAMED}.get(self.name, "#7f7f7f")

    @property
    def width(self) -> float:
        """Width of the line, in points; our method's is wider."""
        return 2.6 if self.name == OURS else 1.4


def lines(rows: Sequence[Row], names: Iterable[str] = COLOURS) -> list[Line]:
    """The lines that plots have: families stand for their best method on each scene, ablations for nothing."""
    errors, found = averaged(rows), []
    for name in names:
        prefix = FAMILIES.get(name)
        chosen: dict[tuple[str, float], str] = {}
        for spent in spendings(rows):
            methods = [a for a in methods_at(rows, spent) if (a == name if prefix is None else a.startswith(prefix))]
            for scene in scenes(rows):
                known = {method: errors[scene, method, spent] for method in methods if (scene, method, spent) in errors}
                if known:
                    chosen[scene, spent] = min(known, key=lambda method: known[method])
        if chosen:
            found.append(Line(name=name, methods=chosen))
    return found


def over_time(rows: Sequence[Row], spent: float, theme: Theme) -> bytes:
    """PNG: RMSE of each scored refresh, mean over seeds, a panel a scene."""
    curves = lines(rows)

    def draw(axes: Axes, scene: str) -> None:
        for line in curves:
            method = line.methods.get((scene, spent))
            runs = [row for row in rows if (row.scene, row.method, spending(row)) == (scene, method, spent)]
            runs = [row for row in runs if row.times == runs[0].times]
            if runs:
                mean = np.mean([row.error_over_time for row in runs], axis=0)
                axes.plot(runs[0].times, mean, color=line.colour, lw=line.width, label=line.name)
        axes.set_ylim(bottom=0.0)

    return _panels(scenes(rows), draw, theme, x="seconds", y="RMSE of display values")


def against(
    rows: Sequence[Row], x: Callable[[Row], float], label: str, theme: Theme, *, names: Iterable[str] = COLOURS
) -> bytes:
    """PNG: RMSE against a price, a panel a scene, both axes logarithmic; a point is a spending."""
    errors, curves = averaged(rows), lines(rows, names)
    prices: dict[tuple[str, str, float], list[float]] = {}
    for row in rows:
        prices.setdefault((row.scene, row.method, spending(row)), []).append(x(row))

    def draw(axes: Axes, scene: str) -> None:
        for line in curves:
            keys = [(scene, method, spent) for (s, spent), method in line.methods.items() if s == scene]
            points = [(float(np.mean(prices[key])), errors[key]) for key in keys if key in errors]
            points = [point for point in points if point[0] > 0.0]
            if points:
                style = "s:" if line.name in STREAMED else "o-"
                axes.plot(*zip(*points, strict=True), style, ms=4, color=line.colour, lw=line.width, label=line.name)
        _logarithmic(axes)

    return _panels(scenes(rows), draw, theme, x=label, y="RMSE of display values")


def all_plots(rows: Sequence[Row], theme: Theme) -> dict[str, tuple[str, bytes]]:
    """Every plot of a run by its file name: what it shows, and the PNG."""
    clock, spent = rows[0].clock, middle(rows)
    price = "rays a second, primary" if clock == "virtual" else "primary rays a second that the CPU time bought"
    return {
        "error_over_time": (f"Error over time, {spending_text(spent, clock)}", over_time(rows, spent, theme)),
        "error_against_rate": ("Error against rays", against(rows, lambda r: r.rays / r.seconds, price, theme)),
        "error_against_bytes": (
            "Error against bytes sent",
            against(rows, lambda r: r.bytes_per_s, "bytes a second", theme, names=(*COLOURS, *STREAMED)),
        ),
        "error_against_cpu": (
            "Error against CPU time",
            against(rows, lambda r: r.cpu_s / r.seconds, "CPU seconds a second, advance and show", theme),
        ),
    }


def _logarithmic(axes: Axes) -> None:
    """Both axes, marked at 1, 2 and 5: most plots span less than a decade."""
    from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter, StrMethodFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis, words in ((axes.xaxis, EngFormatter(sep="")), (axes.yaxis, StrMethodFormatter("{x:g}"))):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(words)
        axis.set_minor_formatter(NullFormatter())


def _panels(names: Sequence[str], draw: Callable[[Axes, str], None], theme: Theme, *, x: str, y: str) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(2, len(names))
    count = -(-len(names) // columns)
    figure = Figure(
        figsize=(PANEL_INCHES[0] * columns, PANEL_INCHES[1] * count + 0.5), facecolor=theme.paper, layout="constrained"
    )
    handles: dict[str, Artist] = {}
    for k, name in enumerate(names):
        axes = figure.add_subplot(count, columns, k + 1, facecolor=theme.paper)
        draw(axes, name)
        axes.set_title(name, color=theme.ink, fontsize=10, loc="left", fontweight="bold")
        axes.grid(True, which="both", color=theme.grid, lw=0.6)
        axes.tick_params(which="both", colors=theme.ink, labelsize=8)
        for side, spine in axes.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color(theme.grid)
        handles |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.supxlabel(x, color=theme.ink, fontsize=9)
    figure.supylabel(y, color=theme.ink, fontsize=9)
    figure.legend(
        list(handles.values()), list(handles), loc="outside upper center", ncols=5, frameon=False, fontsize=9,
        labelcolor=theme.ink,
    )  # fmt: skip
    out = io.BytesIO()
    FigureCanvasAgg(figure)  # no window system, whatever the user's settings say
    figure.savefig(out, format="png", dpi=DPI)
    return out.getvalue()
