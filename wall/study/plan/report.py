"""A plan as tables for the terminal, as JSON, and as one HTML page with its figures inside."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import Any

from rich.table import Table

from wall.study.plan import figures
from wall.study.plan.budget import DELAY_LIMIT_S, Budget, Machines, Way
from wall.study.plan.comparison import BAR, COMPARED, Comparison
from wall.study.plan.rates import Rates
from wall.study.plan.scenarios import HOPS, Simulated
from wall.study.speed.record import command

STYLE = """
:root { color-scheme: light dark; --ink: #1f2328; --paper: #fff; --soft: #59636e; --line: #d8dee4; --card: #f6f8fa }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf3; --paper: #0d1117; --soft: #9198a1; --line: #30363d; --card: #161b22 } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 }
main { max-width: 60rem; margin: 0 auto; padding: 1.5rem 1rem 4rem }
h1 { font-size: 1.7rem } h2 { margin-top: 2.2rem; font-size: 1.2rem; border-bottom: 1px solid var(--line) }
.scroll { overflow-x: auto } table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums }
th, td { padding: .3rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap }
th:first-child, td:first-child { text-align: left } th { color: var(--soft); font-weight: 600; vertical-align: bottom }
.note { color: var(--soft); font-size: .85rem } .no { color: #d1242f; font-weight: 600 }
figure { margin: 1rem 0; padding: .6rem; background: var(--card); border-radius: 8px; overflow-x: auto }
figure svg { max-width: 100%; height: auto; color: var(--ink) } code { font-size: .85em }
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All that one call of `wall plan` found."""

    rates: Rates
    machines: Machines
    budgets: tuple[Budget, ...]
    simulated: tuple[Simulated, ...] = ()
    comparisons: tuple[Comparison, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A table, for the terminal and for HTML: its first column is text."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def rich(self) -> Table:
        """For the terminal."""
        table = Table(title=self.title, title_justify="left", caption=self.note, caption_justify="left")
        for k, column in enumerate(self.columns):
            table.add_column(column, justify="right" if k else "left")
        for row in self.rows:
            table.add_row(*row)
        return table

    def html(self) -> str:
        """For a page."""
        head = "".join(f"<th>{escape(column)}</th>" for column in self.columns)
        rows = "".join("<tr>" + "".join(_cell(text) for text in row) + "</tr>" for row in self.rows)
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return f'<h2>{escape(self.title)}</h2><div class="scroll"><table><tr>{head}</tr>{rows}</table></div>{note}'


def _cell(text: str) -> str:
    return f'<td class="no">{escape(text)}</td>' if text == "MISSED" else f"<td>{escape(text)}</td>"


def grids(report: Report) -> Iterator[Grid]:
    """Every table of a report."""
    yield _acuity(report.budgets)
    for budget in report.budgets:
        yield _ways(budget, report.machines)
    yield _hops(report.budgets)
    if report.simulated:
        yield _simulated(report.simulated)
    if report.comparisons:
        yield _compared(report.comparisons)


def _acuity(budgets: Sequence[Budget]) -> Grid:
    rows = []
    for budget in budgets:
        t, a = budget.target, budget.acuity
        rows.append((
            t.name, f"{t.pixels / 1e6:,.0f}", f"{t.width_m:.2f} x {t.height_m:.2f}", f"{t.dpi:.0f}",
            f"{t.distance_m:.2f}",
            f"{a.pixels_per_degree:.0f}", f"{a.cycles_per_degree:.0f}", f"{a.minutes_a_pixel:.2f}",
            f"{a.acuity_pixels / 1e9:.2f}", f"{a.acuity_distance_m:.2f}", f"{a.hyperacuity_pixels / 1e9:.0f}",
            f"{a.hyperacuity_distance_m:.1f}",
        ))  # fmt: skip
    columns = (
        "wall", "Mpixel", "metres", "dpi", "eye at m", "pixels/degree", "cycles/degree", "minutes/pixel",
        "acuity Gpixel", "acuity from m", "hyperacuity Gpixel", "from m",
    )  # fmt: skip
    note = (
        "acuity: 60 cycles/degree, which takes 120 pixels/degree; hyperacuity: pixels of 4 seconds of arc; Gpixel of "
        "the same area, from that distance. The article's 190 dpi are one pixel a minute from 0.46 m: 30 cycles/degree."
    )
    return Grid(title="What the eye resolves", columns=columns, rows=tuple(rows), note=note)


def _ways(budget: Budget, machines: Machines) -> Grid:
    rows = tuple(map(_way, budget.ways))
    columns = ("way", "Gsamples/s", "bytes", "GB/s", "links", "tracing cores", "coding cores", "ranks")
    note = (
        f"bytes and coding are measured; adaptive takes {budget.fewer:g} times fewer samples, "
        f"{budget.compositors:,} compositors of {machines.cores_a_compositor:g} cores "
        f"({_cores(budget.compositor_cores)} cores in all), {budget.streams_a_compositor:.2g} renderers each; "
        f"links of {8e-9 * machines.link_bytes_per_s:g} Gbit/s"
    )
    return Grid(title=str(budget.target), columns=columns, rows=rows, note=note)


def _way(way: Way) -> tuple[str, ...]:
    sizes = _giga(way.samples_per_s), way.note, _giga(way.bytes_per_s), f"{way.links:,}"
    return way.name, *sizes, _cores(way.cores), _cores(way.coding_cores), f"{way.ranks:,}"


def _giga(value: float) -> str:
    """Of small walls two digits, not zeros."""
    return f"{value / 1e9:,.3f}" if value >= 1e8 or value == 0 else f"{value / 1e9:.2g}"


def _cores(value: float) -> str:
    return f"{value:,.0f}" if value >= 10 or value == 0 else f"{value:.2g}"


def _hops(budgets: Sequence[Budget]) -> Grid:
    first = budgets[0].hops
    rows = [
        (hop.name, *(f"{1e3 * budget.hops[k].seconds:.2f}" for budget in budgets), hop.why)
        for k, hop in enumerate(first)
    ]
    rows.append(("in all", *(f"{1e3 * budget.latency_s:.1f}" for budget in budgets), ""))
    names = tuple(budget.target.name for budget in budgets)
    note = (
        f"means, if nothing waits for anything else; {1e3 * DELAY_LIMIT_S:g} ms already slow interaction. "
        f"Reasons are those of {names[0]}."
    )
    return Grid(title="Latency at each hop, ms", columns=("hop", *names, "why"), rows=tuple(rows), note=note)


def _simulated(runs: Sequence[Simulated]) -> Grid:
    names = (
        "ranks", "images", "Msamples/s", "of its need", "packets/s", "MB/s", "events/s", "refreshes/s",
        "latency ms p50 / p95", "manager cores", "compositor cores", "took s",
    )  # fmt: skip
    note = (
        "images: how many times faster than one core they are made. Manager, renderers, compositors, loops, ports, "
        "credit, membership, heartbeats and the graph are the code of a run; tracing, pixels, sockets, lines and cores "
        "are costs. Need: the adaptive samples of the budget."
    )
    columns = list(map(_run, runs))
    rows = tuple(zip(names, *(column[1:] for column in columns), strict=True))
    return Grid(title="Simulated runs", columns=("", *(column[0] for column in columns)), rows=rows, note=note)


def _run(run: Simulated) -> tuple[str, ...]:
    out, (p50, p95, _) = run.outcome, run.outcome.latency_ms
    return (
        f"{run.name}, {run.scenario}",
        f"{out.ranks:,}",
        f"{run.images_faster:,.0f}x",
        f"{out.samples_per_s / 1e6:,.1f}",
        f"{run.share:.2%}",
        f"{out.packets_per_s:,.0f}",
        f"{out.bytes_per_s / 1e6:,.0f}",
        f"{out.events_per_s:.0f}",
        f"{out.refreshes_per_s:.1f}",
        "none shown" if math.isnan(p50) else f"{p50:,.0f} / {p95:,.0f}",
        f"{out.head_cores:.2f}",
        f"{out.compositor_cores:.2f}",
        f"{out.took_s:.0f}",
    )


def _compared(rows: Sequence[Comparison]) -> Grid:
    found = []
    for row in rows:
        for name in row.measured.__slots__:
            bar = "" if name not in COMPARED else "yes" if row.met(name) else "MISSED"
            run = f"{row.renderers} renderer{'s' * (row.renderers > 1)}, {name}"
            pair = _figure(getattr(row.predicted, name)), _figure(getattr(row.measured, name))
            found.append((run, *pair, f"{row.ratio(name):.2f}", bar, f"{row.others_cores:.2f}"))
    columns = ("run", "simulated", "measured", "ratio", f"within {BAR:.0%}", "cores of others")
    note = "cores of others: what else this machine did during the run, which is simulated too."
    return Grid(title="Simulated against measured runs of this machine", columns=columns, rows=tuple(found), note=note)


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.2f}"


def write(report: Report, out: Path) -> tuple[Path, Path]:
    """Write OUT/plan.json and OUT/plan.html."""
    out.mkdir(parents=True, exist_ok=True)
    data, page = out / "plan.json", out / "plan.html"
    data.write_text(json.dumps(_plain(values_of(report)), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    page.write_text(html(report), encoding="utf-8")
    return data, page


def values_of(report: Report) -> dict[str, Any]:
    """A report as JSON has it; trips of single events are left out."""
    values = asdict(report) | {"command": command()}
    for run, row in zip(report.simulated, values["simulated"], strict=True):
        del row["outcome"]["trips"]
        row |= {"hops_s": dict(zip(HOPS, run.hops_s, strict=True)), "share_of_need": run.share}
    for one, row in zip(report.comparisons, values["comparisons"], strict=True):
        row["ratios"] = {name: one.ratio(name) for name in one.measured.__slots__}
        row["met"] = {name: one.met(name) for name in COMPARED}
    for budget, row in zip(report.budgets, values["budgets"], strict=True):
        row["latency_s"] = budget.latency_s
    return values


def _plain(value: Any) -> Any:
    """What is not a number becomes null."""
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(name): _plain(part) for name, part in value.items()}
    return [_plain(part) for part in value] if isinstance(value, (list, tuple)) else value


def html(report: Report) -> str:
    """The whole page; it loads nothing else."""
    tables = list(grids(report))
    after = {0: figures.acuity(report.budgets), len(report.budgets): _bytes_figure(report)}
    parts = []
    for k, table in enumerate(tables):
        parts.append(table.html())
        if k in after:
            parts.append(_drawn(after[k]))
        if table.title.startswith("Latency"):
            parts.append(_drawn(figures.hops(report.budgets)))
        elif table.title == "Simulated runs":
            parts.append(_drawn(figures.simulated_hops(report.simulated)))
        elif table.title.startswith("Simulated against"):
            parts.append(_drawn(figures.compared(report.comparisons)))
    rates = "; ".join(f"{name} {_rate(value)}" for name, value in asdict(report.rates).items())
    sources = "; ".join(
        f"{budget.target.name}: {budget.target.source}" for budget in report.budgets if budget.target.source
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><title>Wall plan</title><style>{STYLE}</style></head>\n'
        f"<body><main><h1>Wall plan</h1>{''.join(parts)}<h2>Where this comes from</h2>"
        f'<p class="note">{escape(sources)}</p><p class="note">Measured rates: {escape(rates)}</p>'
        f"<p><code>{escape(command())}</code></p></main></body></html>\n"
    )


def _bytes_figure(report: Report) -> bytes:
    return figures.bytes_needed(report.budgets, report.machines.link_bytes_per_s)


def _drawn(svg: bytes) -> str:
    return f"<figure>{figures.inline(svg)}</figure>"


def _rate(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
