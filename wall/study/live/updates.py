"""`wall measure updates`: one scene, edited all the time, shown by many views at rates of their own, and in lock step.

After Ohlenburg and Broll, "Parallel Multi-View Rendering on Multi-Core Processor Systems": there an update of the scene
serves all views that wait for one, and each keeps its rate; with a common barrier all have the rate of the slowest. The
wall runs as a user starts it; processes beside it send edits as `wall set` does.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import RenderableType

from wall.client import connect
from wall.config.loading import Loaded
from wall.core.errors import RunError, WallError
from wall.roles.plan import make_layout, make_plan
from wall.scene.parameters import Parameter
from wall.study import json_lines
from wall.study.live.response import edited_parameter
from wall.study.live.rewriting import load_without_windows
from wall.study.live.runs import Run, run_anew
from wall.study.live.views import grid_of
from wall.study.quality.tables import Table
from wall.study.speed import record

FILE = "updates.jsonl"
RATES_HZ = (60.0, 30.0, 15.0, 5.0)  # that views ask for, by turns
LOOK_S = 0.02  # between looks whether the wall runs
PATIENCE_S = 1.0  # with a wall that does not answer: it has ended
NOTE = (
    "Views ask for 60, 30, 15 and 5 Hz by turns. An edit is shared that came into an update with others; an update, "
    "that several views have shown. Update to image: until the head shows it, p50 and p95."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One run: a line of the file, keys in this order."""

    config: str
    method: str
    barrier: bool
    views: int
    refresh_hz: list[float]  # that each view asks for
    refreshes_per_s: list[float]  # that each has
    sent_per_s: float  # edits that are asked for
    edits_per_s: float  # that were made, over the whole run
    updates_per_s: float  # of the scene
    edits_together: float  # share of edits that shared their update with others
    updates_shown: float  # share of updates that some view has shown
    updates_shared: float  # of these, the share that several views have shown
    latency_p50_ms: float  # from an update to the image of a view that shows it
    latency_p95_ms: float
    samples_per_s: int
    other_cores: float  # that everything else on the machine used during the run, senders too
    commit: str
    machine: str
    command: str


def measure(
    config: Path, method: str, *, counts: Sequence[int], rate: float, repeats: int, seconds: float, out: Path
) -> list[Row]:
    """Run so many copies of the first view at their own rates, without and with a barrier, by turns.

    rate : edits a second. Raises RunError, ConfigError, EditError.
    """
    loaded = load_without_windows(config, several=True)
    parameter = edited_parameter(make_plan(make_layout(loaded)), "")
    rows = []
    for count in counts:
        for barrier in (False, True) * repeats:
            variant = at_rates(grid_of(loaded, count), barrier=barrier)
            make_layout(variant)  # raises what is wrong with it before anything runs
            kind = "barrier" if barrier else "own"
            folder = out / f"{config.stem}-{method}-{kind}-{count}"
            run = _edited(variant, method, folder, parameter, rate=rate, seconds=seconds)
            rows.append(_row(config.stem, method, variant, run, rate))
            json_lines.append(out / FILE, rows[-1])
    return rows


def at_rates(loaded: Loaded, *, barrier: bool) -> Loaded:
    """The configuration whose views ask for RATES_HZ by turns."""
    views = tuple(
        view.model_copy(update={"refresh_hz": RATES_HZ[k % len(RATES_HZ)]})
        for k, view in enumerate(loaded.config.views)
    )
    return loaded.with_config(loaded.config.model_copy(update={"views": views, "barrier": barrier}))


def _edited(loaded: Loaded, method: str, folder: Path, parameter: Parameter, *, rate: float, seconds: float) -> Run:
    """A run, edited from its start to its end. Raises RunError where no edit came."""
    context = multiprocessing.get_context("spawn")
    ends, sent = context.Event(), context.Value("q", 0)
    name, value = parameter.name, list(parameter.default)
    sender = context.Process(target=_send, args=(folder, name, value, rate, ends, sent), daemon=True)
    sender.start()
    try:
        run = run_anew(loaded, method, folder, seconds=seconds)
    finally:
        ends.set()
        sender.join()
    if sent.value == 0:
        raise RunError(f"{loaded.path}: no edit was taken by the run in {folder}")
    return run


def _send(folder: Path, name: str, value: list[float], rate: float, ends: Any, sent: Any) -> None:
    """Send edits at a rate, half of the value and all of it by turns, until the run ends."""
    while not ends.wait(LOOK_S):
        try:
            with connect(folder, patience_s=PATIENCE_S) as wall:
                began = time.monotonic()
                while not ends.is_set():
                    share = 0.5 + 0.5 * (sent.value % 2)
                    wall.set({name: [share * x for x in value]})
                    sent.value += 1
                    time.sleep(max(0.0, began + sent.value / rate - time.monotonic()))
        except WallError:  # it does not run yet, or not any more
            continue


def _row(name: str, method: str, loaded: Loaded, run: Run, rate: float) -> Row:
    summary, found = run.summary, run.summary["scene"]
    seconds, edits, updates = summary["seconds"], max(found["edits"], 1), max(found["updates"], 1)
    return Row(
        config=name, method=method, barrier=loaded.config.barrier, views=len(loaded.config.views),
        refresh_hz=[view.refresh_hz for view in loaded.config.views],
        refreshes_per_s=[view["refreshes_per_s"] for view in summary["views"]],
        sent_per_s=rate, edits_per_s=round(found["edits"] / seconds, 1),
        updates_per_s=round(found["updates"] / seconds, 1), edits_together=round(found["edits_together"] / edits, 4),
        updates_shown=round(found["updates_shown"] / updates, 4),
        updates_shared=round(found["updates_shared"] / max(found["updates_shown"], 1), 4),
        latency_p50_ms=summary["latency_ms"]["p50"], latency_p95_ms=summary["latency_ms"]["p95"],
        samples_per_s=sum(view["samples_per_s"] for view in summary["views"]),
        other_cores=round(run.other_cores, 3), commit=record.commit(), machine=record.machine(),
        command=record.command(),
    )  # fmt: skip


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end: medians of equal runs."""
    runs: dict[tuple[str, str, int, bool], list[Row]] = {}
    for row in rows:
        runs.setdefault((row.config, row.method, row.views, row.barrier), []).append(row)
    heads = (
        "wall", "method", "views", "barrier", "refreshes/s", "edits/s", "updates/s", "edits shared", "updates shared",
        "update to image, ms",
    )  # fmt: skip
    lines = tuple(_line(own) for own in runs.values())
    yield Table(title="Updates of one scene", columns=heads, lines=lines, text=(0, 1, 3), note=NOTE).rich()
    yield f"rows in {out / FILE}"


def _line(rows: Sequence[Row]) -> tuple[str, ...]:
    first = rows[0]

    def middle(name: str) -> float:
        return median(float(getattr(row, name)) for row in rows)

    return (
        first.config, first.method, str(first.views), "yes" if first.barrier else "no", rates_of(rows),
        f"{middle('edits_per_s'):.0f}", f"{middle('updates_per_s'):.0f}", f"{middle('edits_together'):.0%}",
        f"{middle('updates_shared'):.0%}", f"{middle('latency_p50_ms'):.0f}, {middle('latency_p95_ms'):.0f}",
    )  # fmt: skip


def rates_of(rows: Sequence[Row]) -> str:
    """Medians of the views' rates in equal runs, of those that ask for one rate together: "58, 30"."""
    asked = rows[0].refresh_hz
    found: dict[float, list[float]] = {}
    for row in rows:
        for wanted, rate in zip(asked, row.refreshes_per_s, strict=True):
            found.setdefault(wanted, []).append(rate)
    return ", ".join(f"{median(rates):.{0 if median(rates) >= 10 else 1}f}" for rates in found.values())
