"""The tables of a quality run, for a terminal and for the report, and summary.json."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import rich.table

from wall.study.quality.requirements import BESIDE_SCENES, SCENES, verdicts
from wall.study.quality.rows import Row
from wall.study.quality.summary import (
    OURS,
    Comparison,
    averaged,
    best_other,
    compare,
    equal_error,
    geometric,
    methods_at,
    scenes,
    spending_text,
    spendings,
)
from wall.study.quality.traffic import (
    REST_EDGES_S,
    at_rest,
    concerned,
    crossovers,
    raw_bytes_per_s,
    size_of,
    traffic,
)

MOST_TIMES = 100.0  # faster or slower than that nothing was measured: an extrapolation would say anything
REQUIRED = "Requirements"
MET, MISSED = "yes", "MISSED"  # cells that are coloured


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Lines of text under a title. The line of the adaptive method stands out."""

    title: str
    columns: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    text: tuple[int, ...]  # columns of words, which are left-aligned
    note: str = ""

    def rich(self) -> rich.table.Table:
        """For a terminal."""
        found = rich.table.Table(
            title=self.title, title_justify="left", caption=self.note or None, caption_justify="left"
        )
        for k, column in enumerate(self.columns):
            found.add_column(column, justify="left" if k in self.text else "right", overflow="fold")
        for line in self.lines:
            found.add_row(*line, style="bold" if OURS in line else "red" if MISSED in line else "")
        return found

    def html(self) -> str:
        """For a page: heading, note and table."""
        kinds = ["text" if k in self.text else "number" for k in range(len(self.columns))]

        def cells(tag: str, texts: Iterable[str]) -> str:
            return "".join(f'<{tag} class="{kind}">{text}</{tag}>' for kind, text in zip(kinds, texts, strict=True))

        body = []
        for line in self.lines:
            ours = ' class="ours"' if OURS in line else ""
            body.append(f"<tr{ours}>{cells('td', map(_cell, line))}</tr>")
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        rows = f"<thead><tr>{cells('th', map(escape, self.columns))}</tr></thead><tbody>{''.join(body)}</tbody>"
        return f'<h2>{escape(self.title)}</h2>{note}<div class="wide"><table>{rows}</table></div>'


def _cell(text: str) -> str:
    kind = {MET: "met", MISSED: "missed"}.get(text)
    return f'<span class="{kind}">{text}</span>' if kind else escape(text)


def tables(rows: Sequence[Row]) -> list[Table]:
    """Every table that rows of one clock and size have anything for; requirements are the last."""
    if not rows:
        return []
    found = [errors_table(rows), *ratio_tables(rows), equal_table(rows), *wire_tables(rows)]
    if set(scenes(rows)) <= {*SCENES, *BESIDE_SCENES}:  # what is required holds for these
        found.append(requirements_table(rows))
    return [table for table in found if table.lines]


def errors_table(rows: Sequence[Row]) -> Table:
    """RMSE: a line for each method and spending, the best first, a column for each scene."""
    errors, flips, names, lines = averaged(rows), averaged(rows, "flip"), scenes(rows), []
    for spent in spendings(rows):
        here = []
        for method in methods_at(rows, spent):
            keys = [(scene, method, spent) for scene in names]
            flip = [flips[key] for key in keys if key in flips]
            mean = geometric(errors[key] for key in keys if key in errors)
            cells = [f"{errors[key]:.4f}" if key in errors else "" for key in keys]
            here.append((mean, (method, *cells, f"{mean:.4f}", f"{sum(flip) / len(flip):.3f}" if flip else "")))
        lines += [(spending_text(spent, rows[0].clock), *line) for _, line in sorted(here)]
    columns = ("", "method", *names, "mean", "FLIP")
    return Table(title="RMSE of display values (0 to 1)", columns=columns, lines=tuple(lines), text=(0, 1))


def ratio_tables(rows: Sequence[Row]) -> list[Table]:
    """Other methods against the adaptive one; and the adaptive one without each of its ingredients."""
    found = [*compare(rows), *best_other(rows)]
    ablations = [c for c in found if c.method.startswith(OURS + ":")]
    others = [c for c in found if c not in ablations]
    return [
        _compared("Error of others over error of adaptive", others, rows[0].clock),
        _compared("Gain of each ingredient: error without it over error of adaptive", ablations, rows[0].clock),
    ]


def _compared(title: str, found: Iterable[Comparison], clock: str) -> Table:
    lines = tuple(
        (
            spending_text(c.spending, clock), c.method, f"{c.mean:.2f}",
            f"{c.low:.2f} to {c.high:.2f}" if c.low is not None and c.high is not None else "", f"{c.worst:.2f}",
            c.worst_scene, "" if c.flip_higher is None else "everywhere" if c.flip_higher else "NOT everywhere",
        )
        for c in sorted(found, key=lambda c: (c.spending, c.method == "best other", c.mean))
    )  # fmt: skip
    columns = ("", "method", "mean", "95 % over seeds", "worst", "worst scene", "FLIP higher")
    return Table(title=title, columns=columns, lines=lines, text=(0, 1, 5, 6))


def _times(factor: float) -> str:
    """A factor; of one that is nowhere near what was measured, no more than that."""
    if factor > MOST_TIMES:
        return f"> {MOST_TIMES:g}"
    return f"{factor:.1f}" if factor > 1.0 / MOST_TIMES else f"< {1.0 / MOST_TIMES:g}"


def equal_table(rows: Sequence[Row]) -> Table:
    """How much faster framed must be; only where every method has a rate."""
    found = equal_error(rows) if rows[0].clock == "virtual" else []
    lines = tuple(
        (spending_text(m.spending, "virtual"), m.scene, _times(m.factor), "extrapolated" if m.beyond else "")
        for m in found
    )
    title = "How many times faster framed must be for equal error"
    return Table(title=title, columns=("adaptive at", "scene", "times", ""), lines=lines, text=(0, 1, 3))


def requirements_table(rows: Sequence[Row]) -> Table:
    """What is required of the adaptive method."""
    lines = tuple((v.what, v.wanted, v.came, MET if v.met else MISSED) for v in verdicts(rows))
    return Table(title=REQUIRED, columns=("what", "wanted", "came", "met"), lines=lines, text=(0, 1, 2, 3))


def wire_tables(rows: Sequence[Row]) -> list[Table]:
    """Those that the rows have anything for. Samples alone are no comparison, so streams must be among them."""
    if not any(row.method != OURS for row in concerned(rows)):
        return []
    return [found for found in (_moving(rows), _crossing(rows), _resting(rows)) if found.lines]


def _moving(rows: Sequence[Row]) -> Table:
    clock = rows[0].clock
    lines = [
        (
            t.scene, spending_text(t.spending, clock), t.method, _bytes(t.bytes_per_s), f"{t.raw:.3f}",
            f"{t.bytes_a_sample:.2f}" if t.method == OURS else "", f"{t.error:.4f}", f"{t.cpu:.2f}",
        )
        for t in sorted(traffic(rows), key=lambda t: (t.scene, t.spending, -t.bytes_per_s))
    ]  # fmt: skip
    return Table(
        title="Bytes while something moves",
        note=f"Samples against images of the same renderer. Raw 8-bit frames: {_bytes(raw_bytes_per_s(rows[0]))}/s.",
        columns=("scene", "", "method", "bytes/s", "of raw", "bytes a sample", "RMSE", "CPU s a second"),
        lines=tuple(lines),
        text=(0, 1, 2),
    )


def _crossing(rows: Sequence[Row]) -> Table:
    first = rows[0]
    lines = [
        (
            spending_text(c.spending, first.clock), c.method, f"{c.bytes_a_pixel:.4f}", f"{c.bytes_a_sample:.2f}",
            f"{c.density:.4f}", f"{c.density_per_s:.2f}", f"{c.refresh_hz:.0f} Hz", size_of(c.pixels), f"{c.error:.2f}",
        )
        for c in sorted(crossovers(rows), key=lambda c: (c.spending, -c.density))
    ]  # fmt: skip
    return Table(
        title="Where samples begin to cost less than images",
        note=(
            "Samples cost rate times bytes a sample, images cost pixels times refreshes times bytes a pixel. So "
            "samples cost less below so many a displayed pixel and refresh, or second. At the rate measured that "
            f"is from so many refreshes on at {first.width}x{first.height}, or from such a panel on at "
            f"{first.refresh_hz:g} Hz, if bytes a pixel and bytes a sample stay what they were."
        ),
        columns=(
            "", "method", "bytes a pixel", "bytes a sample", "samples a pixel and refresh",
            "samples a pixel and second", "refreshes from", "panels from", "error over adaptive's",
        ),
        lines=tuple(lines),
        text=(0, 1),
    )  # fmt: skip


def _resting(rows: Sequence[Row]) -> Table:
    clock = rows[0].clock
    lines = [
        (
            rest.scene, spending_text(rest.spending, clock), rest.method,
            *("" if w is None else _bytes(w) for w in rest.windows),
            "not yet" if rest.silent_s is None else f"{rest.silent_s:.1f} s",
        )
        for rest in at_rest(rows)
    ]  # fmt: skip
    windows = tuple(f"{a:g}-{b:g} s" for a, b in pairwise(REST_EDGES_S))
    seen = [k for k in range(len(windows)) if any(line[3 + k] for line in lines)]
    kept = [0, 1, 2, *(3 + k for k in seen), 3 + len(windows)]
    columns = ("scene", "", "method", *windows, "silent after")
    return Table(
        title="Bytes a second after everything stopped",
        note="Of the first seed. An image that does not change is not sent, nor is a sample that would gain nothing.",
        columns=tuple(columns[k] for k in kept),
        lines=tuple(tuple(line[k] for k in kept) for line in lines),
        text=(0, 1, 2),
    )


def _bytes(count: float) -> str:
    """12.3 kB: decimal units, three digits."""
    if count < 1.0:
        return "0"
    power = min(int(math.log10(count)) // 3, 3)
    return f"{count / 1000**power:.3g} {('B', 'kB', 'MB', 'GB')[power]}"


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
        "requirements": [asdict(v) for v in verdicts(rows)],
    }
    path.write_text(json.dumps(_finite(summary), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
