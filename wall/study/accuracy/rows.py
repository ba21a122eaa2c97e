"""Rows of accuracy.jsonl: the hard cases measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from wall.study.accuracy.case import Case, Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One case as it was measured."""

    case: str
    figure: float
    bound: float
    unit: str
    ok: bool  # whether the figure is at most the bound
    note: str
    seconds: float  # that it took, compiling included


def measure(
    cases: Sequence[Case], *, long: bool, say: Callable[[str], None]
) -> Iterator[tuple[Row, tuple[Picture, ...]]]:
    """A row for each case, and its pictures. With `long` cases that have a larger size run at it."""
    for case in cases:
        say(case.name)
        began = time.monotonic()
        found = case.measure(case.long if long and case.long is not None else case.size)
        row = Row(
            case=case.name, figure=found.figure, bound=case.bound, unit=case.unit, ok=case.ok(found.figure),
            note=found.note, seconds=round(time.monotonic() - began, 2),
        )  # fmt: skip
        yield row, found.pictures
