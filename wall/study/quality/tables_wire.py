"""What the wire's tables hold, for a terminal and for the report: title, columns, lines of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, said
from wall.study.quality.traffic import REST_EDGES_S, at_rest, concerned, crossovers, raw_bytes_per_s, size_of, traffic


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    title: str
    note: str
    columns: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    text: tuple[int, ...]  # columns of words


def wire_tables(rows: Sequence[Row]) -> list[Lines]:
    """Those that the rows have anything for. Samples alone are no comparison, so streams must be among them."""
    if not any(row.method != OURS for row in concerned(rows)):
        return []
    return [found for found in (_moving(rows), _crossing(rows), _resting(rows)) if found.lines]


def _moving(rows: Sequence[Row]) -> Lines:
    clock = rows[0].clock
    lines = [
        (
            t.scene, said(t.spending, clock), t.method, _bytes(t.bytes_per_s), f"{t.raw:.3f}",
            f"{t.bytes_a_sample:.2f}" if t.method == OURS else "", f"{t.error:.4f}", f"{t.cpu:.2f}",
        )
        for t in sorted(traffic(rows), key=lambda t: (t.scene, t.spending, -t.bytes_per_s))
    ]  # fmt: skip
    return Lines(
        title="Bytes while something moves",
        note=(
            f"Samples against pictures of the same renderer. Raw 8-bit frames: {_bytes(raw_bytes_per_s(rows[0]))}/s."
        ),
        columns=("scene", "", "method", "bytes/s", "of raw", "bytes a sample", "RMSE", "CPU s a second"),
        lines=tuple(lines),
        text=(0, 1, 2),
    )


def _crossing(rows: Sequence[Row]) -> Lines:
    first = rows[0]
    lines = [
        (
            said(c.spending, first.clock), c.method, f"{c.bytes_a_pixel:.4f}", f"{c.bytes_a_sample:.2f}",
            f"{c.density:.4f}", f"{c.density_per_s:.2f}", f"{c.refresh_hz:.0f} Hz", size_of(c.pixels), f"{c.error:.2f}",
        )
        for c in sorted(crossovers(rows), key=lambda c: (c.spending, -c.density))
    ]  # fmt: skip
    return Lines(
        title="Where samples begin to cost less than pictures",
        note=(
            "Samples cost rate times bytes a sample, pictures cost pixels times refreshes times bytes a pixel. So "
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


def _resting(rows: Sequence[Row]) -> Lines:
    clock = rows[0].clock
    lines = [
        (
            rest.scene, said(rest.spending, clock), rest.method,
            *("" if w is None else _bytes(w) for w in rest.windows),
            "not yet" if rest.silent_s is None else f"{rest.silent_s:.1f} s",
        )
        for rest in at_rest(rows)
    ]  # fmt: skip
    windows = tuple(f"{a:g}-{b:g} s" for a, b in pairwise(REST_EDGES_S))
    seen = [k for k in range(len(windows)) if any(line[3 + k] for line in lines)]
    kept = [0, 1, 2, *(3 + k for k in seen), 3 + len(windows)]
    columns = ("scene", "", "method", *windows, "silent after")
    return Lines(
        title="Bytes a second after everything stopped",
        note="Of the first seed. A picture that does not change is not sent, nor is a sample that would gain nothing.",
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
