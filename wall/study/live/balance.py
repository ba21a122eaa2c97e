"""`wall measure balance`: how evenly the renderers of a wall are loaded, with borders that move and without.

Walls run as a user starts them. A renderer's cost is the CPU time of a sweep of its region at the end of the run, so
that evenness is known also with more renderers than cores; under the adaptive sampler, what its pixels ask for times
the CPU time of a sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from rich.console import RenderableType

from wall.config.graph import PresetGraph
from wall.config.loading import Loaded
from wall.core.errors import RunError
from wall.roles.plan import make_layout
from wall.study import json_lines, options
from wall.study.live.rewriting import load_without_windows
from wall.study.live.runs import run_anew
from wall.study.quality.tables import MET, MISSED, Table
from wall.study.speed import record

FILE = "balance.jsonl"
WANTED = 0.85  # of a perfect split
MOST_RANKS = 64  # a panel
NOTE = (
    "Evenness: mean cost of the renderers by the largest, which all wait for: 1 is a perfect split. The gain is that "
    f"of the wall's rate on as many cores as renderers. Wanted with balance: {WANTED:g} or more."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One run: a line of the file, keys in this order."""

    config: str
    method: str
    balance: bool
    renderers: int
    evenness: float
    largest_cost: float  # CPU seconds; of the adaptive sampler in another unit
    samples_per_s: float  # of the whole wall, on this machine's cores
    assignments: int  # how often borders moved
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str


def measure(config: Path, method: str, *, ranks: Sequence[int], repeats: int, seconds: float, out: Path) -> list[Row]:
    """Run a wall with and without balance by turns, with so many ranks a panel. Raises RunError, ConfigError."""
    loaded, rows = load_without_windows(config), []
    for count in ranks:
        for balance in (False, True) * repeats:
            variant = _with_balance(loaded, count, balance)
            make_layout(variant)  # raises what is wrong with it before anything runs
            rows.append(_run(config.stem, method, variant, seconds, out))
            json_lines.append(out / FILE, rows[-1])
    return rows


def _with_balance(loaded: Loaded, ranks: int, balance: bool) -> Loaded:
    graph = loaded.config.graph
    if not isinstance(graph, PresetGraph):
        raise loaded.error(("graph",), "only presets have `balance`", "preset: sort-first")
    changed = graph.model_copy(update={"ranks_per_panel": ranks, "balance": balance})
    return loaded.with_config(loaded.config.model_copy(update={"graph": changed}))


def _run(name: str, method: str, loaded: Loaded, seconds: float, out: Path) -> Row:
    graph = loaded.config.graph
    assert isinstance(graph, PresetGraph)
    folder = out / f"{name}-{method}-{graph.ranks_per_panel}-{'balanced' if graph.balance else 'fixed'}"
    run = run_anew(loaded, method, folder, seconds=seconds)
    costs = [rank["cost"] for rank in run.summary["ranks"] if rank["role"] == "renderer"]
    if not all(costs):
        raise RunError(f"{folder}: {costs.count(0)} of {len(costs)} renderers measured no cost; wanted more --seconds")
    return Row(
        config=name, method=method, balance=graph.balance, renderers=len(costs),
        evenness=round(sum(costs) / len(costs) / max(costs), 4), largest_cost=max(costs),
        samples_per_s=round(run.summary["samples_traced"] / run.summary["seconds"]),
        assignments=run.summary["assignments"], other_cores=round(run.other_cores, 3), commit=record.commit(),
        machine=record.machine(), command=record.command(),
    )  # fmt: skip


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end: medians of all runs."""
    columns = ("wall", "method", "ranks", "evenness", "balanced", "gain", "samples/s", "balanced", "met")
    lines = tuple(_line(*key, rows) for key in dict.fromkeys((r.config, r.method, r.renderers) for r in rows))
    yield Table(title="Load of renderers", columns=columns, lines=lines, text=(0, 1, 8), note=NOTE).rich()
    yield f"rows in {out / FILE}"


def _line(config: str, method: str, renderers: int, rows: Sequence[Row]) -> tuple[str, ...]:
    own = [row for row in rows if (row.config, row.method, row.renderers) == (config, method, renderers)]
    fixed, balanced = [row for row in own if not row.balance], [row for row in own if row.balance]
    even = median(row.evenness for row in balanced)
    gain = median(row.largest_cost for row in fixed) / median(row.largest_cost for row in balanced)
    return (
        config, method, str(renderers), f"{median(row.evenness for row in fixed):.2f}", f"{even:.2f}",
        "" if method == "adaptive" else f"{gain:.2f}x",
        f"{median(row.samples_per_s for row in fixed):,.0f}", f"{median(row.samples_per_s for row in balanced):,.0f}",
        MET if even >= WANTED else MISSED,
    )  # fmt: skip


def check_ranks(text: str) -> tuple[int, ...]:
    """Numbers of ranks a panel, such as 1,2,4. Raises ConfigError."""
    return options.numbers_of("--ranks", text, most=MOST_RANKS, wanted="numbers of ranks a panel")
