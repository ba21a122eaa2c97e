"""What many rows say together: how much better, where worst, and at what price."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from rich.table import Table

Row = dict[str, Any]
OURS = "adaptive"


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """RMSE(arm) / RMSE(adaptive) over the scenes of one rate."""

    arm: str
    rate: float
    mean: float  # geometric
    worst: float
    worst_scene: str
    flip_ordered: bool  # FLIP of the arm is higher on every scene


def by_cell(rows: list[Row], measure: str) -> dict[tuple[str, str, float], float]:
    """Mean over seeds of a measure: (scene, arm, rate) -> value."""
    found = defaultdict(list)
    for row in rows:
        rate = row["rate"] if row["clock"] == "virtual" else row["cores"]
        found[row["scene"], row["arm"], rate].append(row[measure])
    return {key: sum(values) / len(values) for key, values in found.items()}


def compare(rows: list[Row], measure: str = "rmse_display") -> list[Compared]:
    """Every arm against the adaptive one, at every rate; scenes that lack either are left out."""
    errors, flips = by_cell(rows, measure), by_cell(rows, "flip")
    found = []
    for rate in sorted({key[2] for key in errors}):
        for arm in sorted({key[1] for key in errors if key[2] == rate and key[1] != OURS}):
            ratios = _ratios(errors, arm, rate)
            if ratios:
                worst = min(ratios, key=lambda scene: ratios[scene])
                ordered = all(flips[scene, arm, rate] > flips[scene, OURS, rate] for scene in ratios)
                found.append(
                    Compared(
                        arm=arm,
                        rate=rate,
                        mean=geometric(list(ratios.values())),
                        worst=ratios[worst],
                        worst_scene=worst,
                        flip_ordered=ordered,
                    )  # fmt: skip
                )
    return found


def _ratios(errors: dict[tuple[str, str, float], float], arm: str, rate: float) -> dict[str, float]:
    scenes = {scene for scene, a, r in errors if a == arm and r == rate and (scene, OURS, rate) in errors}
    return {scene: errors[scene, arm, rate] / errors[scene, OURS, rate] for scene in sorted(scenes)}


BESIDE = ("framed_x10", "progressive")  # not at the same rate, or not a way to show motion


def best_other(rows: list[Row]) -> list[Compared]:
    """The best of all other arms, chosen for each scene and rate by hindsight."""
    errors = {key: value for key, value in by_cell(rows, "rmse_display").items()}
    found = []
    for rate in sorted({key[2] for key in errors}):
        ratios = {}
        for scene in sorted({key[0] for key in errors if key[2] == rate}):
            others = {
                a: e for (s, a, r), e in errors.items()
                if s == scene and r == rate and a != OURS and a not in BESIDE and not a.startswith(OURS + ":")
            }  # fmt: skip
            if others and (scene, OURS, rate) in errors:
                best = min(others, key=lambda a: others[a])
                ratios[f"{scene}, {best}"] = others[best] / errors[scene, OURS, rate]
        if ratios:
            worst = min(ratios, key=lambda scene: ratios[scene])
            found.append(
                Compared(
                    arm="best other by hindsight",
                    rate=rate,
                    mean=geometric(list(ratios.values())),
                    worst=ratios[worst],
                    worst_scene=worst,
                    flip_ordered=True,
                )  # fmt: skip
            )
    return found


def equal_error_ratio(rows: list[Row], arm: str = "framed") -> dict[tuple[str, float], tuple[float, bool]]:
    """How much faster an arm must be to match: (scene, rate) -> (factor, whether it lies outside what was measured).

    The arm's error against its rate is taken as a power law between neighbouring measured rates, and beyond them.
    """
    errors = by_cell(rows, "rmse_display")
    tens = {"framed": "framed_x10"}.get(arm)
    found = {}
    for scene, ours, rate in sorted(errors):
        if ours != OURS:
            continue
        curve = {r: e for (s, a, r), e in errors.items() if s == scene and a == arm}
        if tens:
            curve |= {10 * r: e for (s, a, r), e in errors.items() if s == scene and a == tens}
        if len(curve) >= 2:
            found[scene, rate] = _rate_for(curve, errors[scene, OURS, rate], rate)
    return found


def _rate_for(curve: dict[float, float], error: float, rate: float) -> tuple[float, bool]:
    points = sorted(curve.items())
    outside = error < min(curve.values())
    low, high = points[-2], points[-1]
    for a, b in zip(points, points[1:], strict=False):
        if a[1] >= error >= b[1]:
            low, high = a, b
            break
    slope = math.log(high[1] / low[1]) / math.log(high[0] / low[0])
    if slope >= 0.0:
        return math.inf, True
    return math.exp(math.log(error / low[1]) / slope) * low[0] / rate, outside


def geometric(values: list[float]) -> float:
    return math.exp(sum(math.log(value) for value in values) / len(values))


def interval(values: list[float]) -> float:
    """Half of the 95 % interval of a mean over seeds (Student's t); 0 for a single one."""
    n = len(values)
    if n < 2:
        return 0.0
    mean = sum(values) / n
    variance = sum((v - mean) ** 2 for v in values) / (n - 1)
    t = {2: 12.71, 3: 4.303, 4: 3.182, 5: 2.776, 6: 2.571, 7: 2.447, 8: 2.365, 9: 2.306, 10: 2.262}.get(n, 2.0)
    return t * math.sqrt(variance / n)


def errors_table(rows: list[Row]) -> Table:
    """RMSE in display values: a line an arm and rate, a column a scene."""
    errors = by_cell(rows, "rmse_display")
    scenes = sorted({key[0] for key in errors})
    found = Table(title="RMSE of display values (0..1)", title_justify="left")
    for name in ("rate", "arm", *scenes, "mean"):
        found.add_column(name, justify="left" if name == "arm" else "right")
    for rate in sorted({key[2] for key in errors}):
        arms = sorted({key[1] for key in errors if key[2] == rate})
        lines = []
        for arm in arms:
            values = [errors.get((scene, arm, rate)) for scene in scenes]
            known = [value for value in values if value is not None]
            lines.append((geometric(known), arm, values))
        for mean, arm, values in sorted(lines, key=lambda line: line[0]):
            cells = ["" if value is None else f"{value:.4f}" for value in values]
            found.add_row(_rate(rate), arm, *cells, f"{mean:.4f}", style="bold" if arm == OURS else "")
    return found


def _rate(rate: float) -> str:
    return f"{rate / 1e3:g} k/s" if rate >= 1e3 else f"{rate:g} cores"


def ratios_table(rows: list[Row]) -> Table:
    found = Table(title="error of others / error of adaptive", title_justify="left")
    for name in ("rate", "arm", "geometric mean", "worst", "worst scene", "FLIP higher everywhere"):
        found.add_column(name, justify="right" if name in ("rate", "geometric mean", "worst") else "left")
    for row in [*compare(rows), *best_other(rows)]:
        ordered = "" if row.arm.startswith("best") else "yes" if row.flip_ordered else "NO"
        found.add_row(_rate(row.rate), row.arm, f"{row.mean:.2f}", f"{row.worst:.2f}", row.worst_scene, ordered)
    return found
