"""`wall measure views`: what a view gets beside others, and alone; and the rates of 1 to 16 views on one wall.

Walls run as a user starts them. Rates, and each view's share of the renderers' time, are what the run's summary says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from rich.console import RenderableType

from wall.config.loading import Loaded
from wall.config.views import MOST_VIEWS, ViewConfig, ViewportConfig
from wall.roles.plan import make_layout
from wall.study import json_lines, options
from wall.study.live.rewriting import load_without_windows
from wall.study.live.runs import run_anew
from wall.study.quality.tables import MET, MISSED, Table
from wall.study.speed import record

FILE = "views.jsonl"
WANTED = 0.95  # of what a view gets alone, less the others' weight
NOTE = (
    f"Wanted: the first view keeps {WANTED:g} of the samples and refreshes a second that it gets alone, less the share "
    "of time that the others are given by their weights; refreshes are wanted up to its own rate."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One view in one run: a line of the file, keys in this order."""

    config: str
    method: str
    kind: str  # "alone", "together", or "grid": the first view's copies
    views: int  # of the run
    view: str
    weight: float
    refresh_hz: float  # that is asked for
    refreshes_per_s: float
    samples_per_s: float
    share: float  # of the time that renderers spent on all views
    latency_p50_ms: float  # of all views of the run: from an input to an image that shows it
    latency_p95_ms: float
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str


def measure(config: Path, method: str, *, counts: Sequence[int], repeats: int, seconds: float, out: Path) -> list[Row]:
    """Run a wall with its first view alone and with all, by turns, and with so many copies of the first view.

    Raises RunError, ConfigError.
    """
    loaded = load_without_windows(config, several=True)
    variants = [("grid", grid_of(loaded, count)) for count in counts]
    if len(loaded.config.views) > 1:
        variants = [("alone", first_alone(loaded)), ("together", loaded)] * repeats + variants
    rows: list[Row] = []
    for kind, variant in variants:
        make_layout(variant)  # raises what is wrong with it before anything runs
        rows += _run(config.stem, method, kind, variant, seconds, out)
    return rows


def first_alone(loaded: Loaded) -> Loaded:
    """The configuration without all views but the first."""
    return _with_views(loaded, loaded.config.views[:1])


def grid_of(loaded: Loaded, count: int) -> Loaded:
    """So many copies of the first view, side by side and above each other; together they fill the wall."""
    first, views = loaded.config.views[0], list[ViewConfig]()
    rows = round(math.sqrt(count))
    for row in range(rows):
        across = count * (row + 1) // rows - count * row // rows
        for column in range(across):
            place = ViewportConfig(left=column / across, top=row / rows, width=1 / across, height=1 / rows)
            own = {"id": f"view{len(views)}", "panels": None, "viewport": place}
            views.append(first.model_copy(update=own))
    return _with_views(loaded, tuple(views))


def _with_views(loaded: Loaded, views: tuple[ViewConfig, ...]) -> Loaded:
    return loaded.with_config(loaded.config.model_copy(update={"views": views}))


def _run(name: str, method: str, kind: str, loaded: Loaded, seconds: float, out: Path) -> list[Row]:
    views = loaded.config.views
    run = run_anew(loaded, method, out / f"{name}-{method}-{kind}-{len(views)}", seconds=seconds)
    rows = [
        Row(
            config=name, method=method, kind=kind, views=len(views), view=view.id, weight=view.weight,
            refresh_hz=view.refresh_hz, refreshes_per_s=found["refreshes_per_s"],
            samples_per_s=found["samples_per_s"], share=found["share"],
            latency_p50_ms=run.summary["latency_ms"]["p50"], latency_p95_ms=run.summary["latency_ms"]["p95"],
            other_cores=round(run.other_cores, 3), commit=record.commit(), machine=record.machine(),
            command=record.command(),
        )
        for view, found in zip(views, run.summary["views"], strict=True)
    ]  # fmt: skip
    for row in rows:
        json_lines.append(out / FILE, row)
    return rows


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    beside = {(row.config, row.method, row.view): row for row in rows if row.kind == "together"}
    if beside:
        columns = ("wall", "method", "view", "asked, Hz", "refreshes/s", "samples/s", "of the time", "kept", "met")
        lines = tuple(_beside(*key, rows) for key in beside)
        yield Table(title="Views beside each other", columns=columns, lines=lines, text=(0, 1, 2, 8), note=NOTE).rich()
    if grids := tuple(_grids(rows)):
        heads = ("wall", "method", "views", "refreshes/s of each", "samples/s of all", "input to image, ms")
        yield Table(title="Equal views that fill the wall", columns=heads, lines=grids, text=(0, 1)).rich()
    yield f"rows in {out / FILE}"


def _beside(config: str, method: str, view: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Medians of all runs."""
    known = [row for row in rows if (row.config, row.method) == (config, method)]
    alone = [row for row in known if row.kind == "alone"]
    together = [row for row in known if row.kind == "together"]
    own = [row for row in together if row.view == view]
    refreshes, samples = median(row.refreshes_per_s for row in own), median(row.samples_per_s for row in own)
    cells = (
        config, method, view, f"{own[0].refresh_hz:g}", f"{refreshes:.1f}", f"{samples:,.0f}",
        f"{median(row.share for row in own):.1%}",
    )  # fmt: skip
    if view != alone[0].view:
        return (*cells, "", "")
    share = own[0].weight / sum({row.view: row.weight for row in together}.values())
    kept = [
        samples / max(median(row.samples_per_s for row in alone), 1.0),
        refreshes / max(median(row.refreshes_per_s for row in alone), 1e-9),
    ]
    return (*cells, f"{kept[0]:.2f}, {kept[1]:.2f}", MET if min(kept) >= WANTED * share else MISSED)


def _grids(rows: Sequence[Row]) -> Iterator[tuple[str, ...]]:
    found: dict[tuple[str, str, int], list[Row]] = {}
    for row in rows:
        if row.kind == "grid":
            found.setdefault((row.config, row.method, row.views), []).append(row)
    for (config, method, count), views in found.items():
        rates = sorted(view.refreshes_per_s for view in views)
        latency = f"{views[0].latency_p50_ms:.0f}, {views[0].latency_p95_ms:.0f}"
        samples = sum(view.samples_per_s for view in views)
        yield config, method, str(count), f"{rates[0]:.1f} to {rates[-1]:.1f}", f"{samples:,.0f}", latency


def check_counts(text: str) -> tuple[int, ...]:
    """Numbers of views, such as 1,2,4; "" none. Raises ConfigError."""
    if not text.strip():
        return ()
    return options.numbers_of("--counts", text, most=MOST_VIEWS, wanted="numbers of views", otherwise=", or nothing")
