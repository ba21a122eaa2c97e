"""Figures of a plan as SVG, drawn so that they read on light and dark pages: text and lines take the page's ink."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from wall.study.plan.budget import ACUITY_CYCLES, HYPERACUITY_ARCSEC, Budget
from wall.study.plan.comparison import BAR, COMPARED, Comparison
from wall.study.plan.scenarios import HOPS, Simulated

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#010203"  # replaced by the page's own colour
COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "#8c6d5a", "#59636e", "#9467bd")
NAMES = {"samples_per_s": "samples/s", "packets_per_s": "packets/s", "latency_p50_ms": "median latency"}


def _figure(width: float, height: float, draw: Callable[[Figure], None], *, png: bool = False) -> bytes:
    """Draw with matplotlib. Returns SVG text, or PNG for tests and reviews."""
    import matplotlib

    settings: Any = {
        "font.family": "DejaVu Sans", "font.size": 8.5, "svg.fonttype": "none", "svg.hashsalt": "wall plan",
        "text.color": INK, "axes.edgecolor": INK, "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK,
        "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9, "axes.titleweight": "bold",
        "axes.linewidth": 0.7, "legend.frameon": False, "axes.axisbelow": True,
    }  # fmt: skip
    with matplotlib.rc_context(settings):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure)
        out = io.BytesIO()
        if png:
            figure.savefig(out, format="png", dpi=130, facecolor="white")
        else:
            figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    return out.getvalue()


def inline(svg: bytes) -> str:
    """SVG for an HTML page: no prologue, and the page's ink."""
    text = svg.decode("utf-8")
    text = text[text.index("<svg") :]
    return re.sub(INK, "currentColor", text)


def bytes_needed(budgets: Sequence[Budget], link_bytes_per_s: float, *, png: bool = False) -> bytes:
    """Bytes a second of every wall, by how they are sent."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        names = [way.name for way in budgets[0].ways]
        height = 0.8 / len(names)
        for k, name in enumerate(names):
            rows = [len(budgets) - 1 - b + 0.4 - (k + 0.5) * height for b in range(len(budgets))]
            values = [budget.ways[k].bytes_per_s for budget in budgets]
            axes.barh(rows, values, 0.9 * height, color=COLOURS[k], label=name)
            for row, value in zip(rows, values, strict=True):
                axes.text(value * 1.08, row, _si(value, "B/s"), va="center", fontsize=7)
        axes.set_yticks(range(len(budgets)), [_two_lines(budget) for budget in reversed(budgets)])
        axes.set_xscale("log")
        axes.set_xlim(right=axes.get_xlim()[1] * 6)
        axes.axvline(link_bytes_per_s, color=INK, lw=0.8, ls="--")
        axes.text(
            link_bytes_per_s, len(budgets) - 0.5, f" one link, {8e-9 * link_bytes_per_s:g} Gbit/s", fontsize=7, va="top"
        )
        axes.set_xlabel("bytes a second to the displays")
        _engineering(axes, "B/s")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=len(names), fontsize=7.5)

    return _figure(7.6, 1.0 + 1.1 * len(budgets), draw, png=png)


def acuity(budgets: Sequence[Budget], *, png: bool = False) -> bytes:
    """Cycles a degree that each wall shows, against the eye's distance."""
    import numpy as np

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        distance = np.geomspace(0.2, 10.0, 60)
        for k, budget in enumerate(budgets):
            target, shown = budget.target, budget.acuity
            cycles = shown.cycles_per_degree * distance / target.distance_m
            colour = COLOURS[(0, 2, 4)[k % 3]]
            axes.plot(distance, cycles, color=colour, label=f"{target.name}, {target.dpi:.0f} dpi")
            axes.plot(target.distance_m, shown.cycles_per_degree, "o", color=colour, ms=5)
        hyper = 0.5 * 3600.0 / HYPERACUITY_ARCSEC
        for value, words, x, side in (
            (ACUITY_CYCLES, f"visual acuity: {ACUITY_CYCLES:g} cycles/degree", 10.0, "right"),
            (hyper, f"hyperacuity: pixels of {HYPERACUITY_ARCSEC:g} seconds of arc", 0.2, "left"),
        ):
            axes.axhline(value, color=INK, lw=0.8, ls="--")
            axes.text(x, value * 1.06, words, ha=side, fontsize=7.5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xticks([0.2, 0.5, 1, 2, 5, 10], ["0.2", "0.5", "1", "2", "5", "10"])
        axes.set_yticks([10, 30, 100, 300, 1000], ["10", "30", "100", "300", "1000"])
        axes.minorticks_off()
        axes.set_xlabel("distance of the eye, metres (dots: as planned)")
        axes.set_ylabel("cycles/degree that pixels show")
        axes.grid(color=INK, alpha=0.12)
        axes.legend(loc="lower right", fontsize=7.5)

    return _figure(5.2, 3.3, draw, png=png)


def hops(budgets: Sequence[Budget], *, png: bool = False) -> bytes:
    """Mean time at every hop, if machines keep up and nothing waits for anything else."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        rows = range(len(budgets) - 1, -1, -1)
        for row, budget in zip(rows, budgets, strict=True):
            begins = 0.0
            for k, hop in enumerate(hop for hop in budget.hops if hop.seconds > 0.0):
                axes.barh(
                    row, 1e3 * hop.seconds, 0.5, left=begins, color=COLOURS[k % len(COLOURS)],
                    label=hop.name if budget is budgets[0] else None,
                )  # fmt: skip
                begins += 1e3 * hop.seconds
            axes.text(begins, row, f"  {begins:.0f} ms", va="center", fontsize=8)
        axes.set_yticks(rows, [_two_lines(budget) for budget in budgets])
        axes.set_xlabel("milliseconds from an input to its light")
        axes.set_xlim(right=axes.get_xlim()[1] * 1.1)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7.5)

    return _figure(7.6, 1.5 + 0.6 * len(budgets), draw, png=png)


def simulated_hops(runs: Sequence[Simulated], *, png: bool = False) -> bytes:
    """Mean time at every hop of simulated runs, a panel a scenario: these differ by orders of magnitude."""
    scenarios = list(dict.fromkeys(run.scenario for run in runs))

    def draw(figure: Figure) -> None:
        panels = figure.subplots(len(scenarios), 1, squeeze=False)[:, 0]
        for axes, scenario in zip(panels, scenarios, strict=True):
            _draw_hops(axes, [run for run in runs if run.scenario == scenario])
            axes.set_title(scenario, loc="left")
        panels[-1].set_xlabel("milliseconds from an input to the image that shows it")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7.5)

    return _figure(7.6, 1.0 + 0.5 * len(scenarios) + 0.45 * len(runs), draw, png=png)


def _draw_hops(axes: Axes, runs: Sequence[Simulated]) -> None:
    rows = range(len(runs) - 1, -1, -1)
    for row, run in zip(rows, runs, strict=True):
        begins = 0.0
        for k, seconds in enumerate(run.hops_s):
            label = HOPS[k] if run is runs[0] else None
            axes.barh(row, 1e3 * seconds, 0.55, left=begins, color=COLOURS[k], label=label)
            begins += 1e3 * seconds
        axes.text(begins, row, f"  {begins:,.0f} ms" if begins else "  nothing was shown", va="center", fontsize=8)
    axes.set_yticks(rows, [run.name for run in runs])
    axes.set_xlim(right=axes.get_xlim()[1] * 1.12)


def compared(rows: Sequence[Comparison], *, png: bool = False) -> bytes:
    """Predicted and measured against the number of renderers, a panel a figure that the bar is set for."""

    def draw(figure: Figure) -> None:
        for k, (name, axes) in enumerate(zip(COMPARED, figure.subplots(1, len(COMPARED)), strict=True)):
            x = [row.renderers for row in rows]
            measured = [getattr(row.measured, name) for row in rows]
            low, high = ([value * (1.0 + sign * BAR) for value in measured] for sign in (-1, 1))
            axes.fill_between(x, low, high, color=COLOURS[7], alpha=0.25, lw=0, label=f"measured ± {BAR:.0%}")
            axes.plot(x, measured, "o-", color=COLOURS[7], ms=4, label="measured")
            predicted = [getattr(row.predicted, name) for row in rows]
            axes.plot(x, predicted, "s--", color=COLOURS[4], ms=4, label="simulated")
            axes.set_xscale("log", base=2)
            axes.set_xticks(x, [str(count) for count in x])
            axes.set_title(NAMES[name] + (", ms" if name.endswith("ms") else ""))
            axes.set_xlabel("renderers")
            axes.set_ylim(bottom=0.0)
            if not name.endswith("ms"):
                _engineering(axes, "", y=True)
            axes.grid(color=INK, alpha=0.12)
            if k == 0:
                handles = axes.get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=3, fontsize=7.5)

    return _figure(7.6, 2.6, draw, png=png)


def _two_lines(budget: Budget) -> str:
    target = budget.target
    return f"{target.name}\n{_si(target.pixels, 'pixel')} at {target.refresh_hz:g} Hz"


def _engineering(axes: Axes, unit: str, *, y: bool = False) -> None:
    from matplotlib.ticker import EngFormatter

    (axes.yaxis if y else axes.xaxis).set_major_formatter(EngFormatter(unit=unit, sep=" " if unit else ""))


def _si(value: float, unit: str) -> str:
    for factor, prefix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:.3g} {unit}"
