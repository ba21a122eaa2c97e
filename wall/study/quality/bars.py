"""What the adaptive method is meant to reach, and whether it did: a missed bar is a result like any other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from wall.study.quality.bars_wire import wire_verdicts
from wall.study.quality.rows import Row
from wall.study.quality.summary import (
    OURS,
    SMALLEST,
    Compared,
    best_other,
    compare,
    equal_error,
    geometric,
    methods_at,
    said,
    scenes,
    spending,
)
from wall.study.quality.verdict import Verdict

EQUAL_ERROR = 40.0  # times faster that framed must be
AT_REST_S = 2.0  # after everything stopped, a picture is held against the progressive renderer's
RIVALS = ("taa_", "reduced_", "render_cache", "afr2005")  # of "best other": all must have run on all scenes


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """error(method) / error(adaptive) over scenes: a geometric mean and a worst scene."""

    method: str
    mean: float
    worst: float
    clock: str = "virtual"


BARS = (
    Bar(method="framed", mean=6.0, worst=2.5),
    Bar(method="frameless", mean=4.0, worst=0.0),
    Bar(method="framed_x10", mean=2.5, worst=1.2),
    Bar(method="best other", mean=1.8, worst=1.3),
    Bar(method="framed", mean=2.0, worst=0.0, clock="cpu"),
    Bar(method="best TAA", mean=1.3, worst=0.0, clock="cpu"),
)


def verdicts(rows: Sequence[Row]) -> list[Verdict]:
    """Every bar that the rows can say something about. All rows must have the same clock."""
    if not rows:
        return []
    clock = rows[0].clock
    taa = best_other([row for row in rows if row.method == OURS or row.method.startswith("taa_")])
    found = compare(rows)
    known = {("best TAA", c.spending): c for c in taa} | {(c.method, c.spending): c for c in found}
    known |= {(c.method, c.spending): c for c in best_other(rows) if _has_rivals(rows, c.spending)}
    verdicts = []
    for bar in BARS:
        if bar.clock == clock:
            verdicts += [_ratio(bar, c, clock) for (method, _), c in sorted(known.items()) if method == bar.method]
    if clock == "virtual":
        verdicts += [*_equal_error(rows), *_flip(found), *_at_rest(rows), *wire_verdicts(rows)]
    return verdicts


def _has_rivals(rows: Sequence[Row], spent: float) -> bool:
    """On every scene: where one lacks them, the best of what is there flatters."""
    for scene in scenes(rows):
        methods = methods_at([row for row in rows if row.scene == scene], spent)
        if not all(any(method.startswith(rival) for method in methods) for rival in RIVALS):
            return False
    return True


def _ratio(bar: Bar, found: Compared, clock: str) -> Verdict:
    wanted = f"≥ {bar.mean:g}" + (f", worst scene ≥ {bar.worst:g}" if bar.worst else "")
    return Verdict(
        what=f"error of {bar.method} over adaptive, {said(found.spending, clock)}",
        wanted=wanted,
        came=f"{found.mean:.2f}, worst {found.worst:.2f} ({found.worst_scene})",
        met=found.mean >= bar.mean and found.worst >= bar.worst,
    )


def _equal_error(rows: Sequence[Row]) -> list[Verdict]:
    matched, found = equal_error(rows), []
    for rate in sorted({m.spending for m in matched}):
        here = [m for m in matched if m.spending == rate]
        factors = [m.factor for m in here]
        mean = geometric(factors) if all(map(math.isfinite, factors)) else math.inf
        beyond = sum(m.beyond for m in here)
        note = f" ({beyond} of {len(here)} scenes extrapolated)" if beyond else ""
        came = f"{mean:.0f}{note}" if math.isfinite(mean) else f"no rate is enough{note}"
        what = f"times faster framed must be for equal error, {said(rate, 'virtual')}"
        found.append(Verdict(what=what, wanted=f"≥ {EQUAL_ERROR:g}", came=came, met=mean >= EQUAL_ERROR))
    return found


def _flip(found: Iterable[Compared]) -> list[Verdict]:
    others = [c for c in found if c.method in ("framed", "frameless", "framed_x10")]
    if not others:
        return []
    lower = [f"{c.method} at {said(c.spending, 'virtual')}" for c in others if not c.flip_higher]
    came = f"not {', '.join(lower)}" if lower else "yes"
    what = "FLIP of framed, frameless and framed_x10 above adaptive's on every scene"
    return [Verdict(what=what, wanted="yes", came=came, met=not lower)]


def _at_rest(rows: Sequence[Row]) -> list[Verdict]:
    """Where a scene rests for long enough: the first compared refresh AT_REST_S after the stop, every seed."""
    others = {(r.scene, r.seed, spending(r)): r for r in rows if r.method == "progressive"}
    found: dict[float, list[tuple[float, str]]] = {}
    for ours in rows:
        other = others.get((ours.scene, ours.seed, spending(ours)))
        at = next((k for k, still in enumerate(ours.still_s) if still >= AT_REST_S), None)
        if ours.method == OURS and other is not None and at is not None and other.times == ours.times:
            a, b = ours.error_over_time[at], other.error_over_time[at]
            found.setdefault(spending(ours), []).append((a / max(b, SMALLEST), f"{a:.4f} to {b:.4f} in {ours.scene}"))
    return [
        Verdict(
            what=f"error {AT_REST_S:g} s after a stop over a progressive renderer's, {said(spent, 'virtual')}",
            wanted="≤ 1", came=f"at worst {max(ratios)[0]:.2f} ({max(ratios)[1]})", met=max(ratios)[0] <= 1.0,
        )
        for spent, ratios in sorted(found.items())
    ]  # fmt: skip
