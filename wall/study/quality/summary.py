"""What many rows say together: how much better, how surely, where worst, and how much faster others would have to be.

A method is compared at each *spending*: a rate of rays, or CPU cores with the CPU clock. Errors are RMSE of display
values, averaged over seeds; ratios are error(other) / error(adaptive), averaged over scenes geometrically.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from wall.study.quality.rows import Row

OURS = "adaptive"
STREAMS = "stream_"  # methods that send images of OURS
BESIDE = ("framed_x10", "progressive")  # not the same spending, or not a way to show motion: in no "best of the others"
TENFOLD = {"framed": "framed_x10"}  # more points of a method's error against its rate
STUDENT_95 = (math.nan, 12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262)  # by degrees of freedom
NORMAL_95 = 1.96

SMALLEST = 1e-9  # error that ratios are taken of: far below what any image has, and more than none

Key = tuple[str, str, float]  # scene, method, spending
Errors = Mapping[Key, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A method against the adaptive one at one spending, over the scenes that have both."""

    method: str
    spending: float
    mean: float  # geometric, of the ratios
    low: float | None  # 95 % interval of the mean over seeds; None with a single seed
    high: float | None
    worst: float
    worst_scene: str
    scenes: int
    flip_higher: bool | None  # its FLIP is higher on every scene; None where that does not apply


@dataclass(frozen=True, slots=True, kw_only=True)
class EqualError:
    """How many times faster a method must be to reach the adaptive one's error, on one scene."""

    method: str
    scene: str
    spending: float
    factor: float  # inf: not at any rate, as far as the measured ones tell
    beyond: bool  # outside the measured rates: extrapolated


def spending(row: Row) -> float:
    """Returns what a row spends: samples a second on the virtual clock, else cores."""
    return row.rate if row.clock == "virtual" else row.cores


def averaged(rows: Iterable[Row], measure: str = "rmse_display") -> dict[Key, float]:
    """Mean over seeds of a measure, at least SMALLEST, where every row has it."""
    found: dict[Key, list[float | None]] = defaultdict(list)
    for row in rows:
        found[row.scene, row.method, spending(row)].append(getattr(row, measure))
    known = {key: [v for v in values if v is not None] for key, values in found.items()}
    whole = {key: values for key, values in known.items() if len(values) == len(found[key])}
    return {key: max(sum(values) / len(values), SMALLEST) for key, values in whole.items()}


def compare(rows: Sequence[Row], *, ours: str = OURS) -> list[Comparison]:
    """Every method against `ours` at every spending. A scene that lacks either is left out."""
    flips, found = averaged(rows, "flip"), []
    for spent in spendings(rows):
        for method in methods_at(rows, spent):
            if method == ours:
                continue
            ratios = _ratios(averaged(rows), method, spent, ours)
            if not ratios:
                continue
            higher = [flips.get((s, method, spent), math.nan) > flips.get((s, ours, spent), math.nan) for s in ratios]
            by_seed = [_ratios(averaged(part), method, spent, ours) for part in _seeds(rows)]
            found.append(_compared(method, spent, ratios, by_seed, flip_higher=all(higher)))
    return found


def best_other(rows: Sequence[Row]) -> list[Comparison]:
    """At every spending the best of all other methods, chosen for each scene by hindsight."""
    errors, found = averaged(rows), []
    for spent in spendings(rows):
        others = [method for method in methods_at(rows, spent) if is_other(method)]
        best: dict[str, str] = {}
        for scene in scenes(rows):
            known = {method: errors[scene, method, spent] for method in others if (scene, method, spent) in errors}
            if known and (scene, OURS, spent) in errors:
                best[scene] = min(known, key=lambda method: known[method])
        ratios = {f"{s} ({a})": errors[s, a, spent] / errors[s, OURS, spent] for s, a in best.items()}
        if ratios:
            by_seed = [_best_ratios(averaged(part), best, spent) for part in _seeds(rows)]
            found.append(_compared("best other", spent, ratios, by_seed, flip_higher=None))
    return found


def is_other(method: str) -> bool:
    """Whether a method is another way to spend the same: not ours, sent as samples or as images, nor one beside."""
    return method.partition(":")[0] != OURS and method not in BESIDE and not method.startswith(STREAMS)


def equal_error(rows: Sequence[Row], method: str = "framed") -> list[EqualError]:
    """How much faster `method` must be, for each scene and rate of the adaptive one."""
    errors, found = averaged(rows), []
    for scene, name, rate in sorted(errors):
        if name != OURS:
            continue
        curve = {r: e for (s, a, r), e in errors.items() if s == scene and a == method}
        curve |= {10.0 * r: e for (s, a, r), e in errors.items() if s == scene and a == TENFOLD.get(method)}
        if len(curve) >= 2:
            needed, beyond = rate_for(curve, errors[scene, OURS, rate])
            found.append(EqualError(method=method, scene=scene, spending=rate, factor=needed / rate, beyond=beyond))
    return found


def rate_for(curve: Mapping[float, float], error: float) -> tuple[float, bool]:
    """The rate at which a measured curve rate -> error reaches `error`, and whether that is an extrapolation.

    A power law between neighbouring rates, and beyond the outermost ones that of the nearest two. inf where the error
    does not fall with the rate there.
    """
    points = sorted(curve.items())
    pairs = list(pairwise(points))
    inside = [(a, b) for a, b in pairs if a[1] >= error >= b[1]]
    (low, e_low), (high, e_high) = inside[0] if inside else pairs[0] if error > points[0][1] else pairs[-1]
    slope = math.log(e_high / e_low) / math.log(high / low)
    if slope >= 0.0:
        return math.inf, True
    return low * math.exp(math.log(error / e_low) / slope), not inside


def geometric(values: Iterable[float]) -> float:
    """Returns the geometric mean of positive values."""
    logs = [math.log(value) for value in values]
    return math.exp(sum(logs) / len(logs))


def interval(values: Sequence[float]) -> tuple[float, float] | None:
    """95 % interval of a geometric mean, by Student's t of the logarithms; None for fewer than two values."""
    n = len(values)
    if n < 2:
        return None
    logs = [math.log(value) for value in values]
    mean = sum(logs) / n
    spread = math.sqrt(sum((v - mean) ** 2 for v in logs) / (n - 1) / n)
    half = (STUDENT_95[n - 1] if n <= len(STUDENT_95) else NORMAL_95) * spread
    return math.exp(mean - half), math.exp(mean + half)


def scenes(rows: Iterable[Row]) -> list[str]:
    """In the order of the file."""
    return list(dict.fromkeys(row.scene for row in rows))


def spendings(rows: Iterable[Row]) -> list[float]:
    """Returns the distinct spendings of the rows, ascending."""
    return sorted({spending(row) for row in rows})


def middle(rows: Iterable[Row]) -> float:
    """The spending that is shown where only one can be."""
    found = spendings(rows)
    return found[len(found) // 2]


def methods_at(rows: Iterable[Row], spent: float) -> list[str]:
    """In the order of the file."""
    return list(dict.fromkeys(row.method for row in rows if spending(row) == spent))


def spending_text(spent: float, clock: str) -> str:
    """A spending in words: 400 k rays/s, 2 cores."""
    if clock == "cpu":
        return f"{spent:g} core{'' if spent == 1.0 else 's'}"
    return f"{spent / 1e6:g} M rays/s" if spent >= 1e6 else f"{spent / 1e3:g} k rays/s"


def _ratios(errors: Errors, method: str, spent: float, ours: str) -> dict[str, float]:
    found = {}
    for scene, name, rate in errors:
        if name == method and rate == spent and (scene, ours, spent) in errors:
            found[scene] = errors[scene, method, spent] / errors[scene, ours, spent]
    return found


def _best_ratios(errors: Errors, best: Mapping[str, str], spent: float) -> dict[str, float]:
    pairs = {scene: ((scene, method, spent), (scene, OURS, spent)) for scene, method in best.items()}
    return {scene: errors[a] / errors[b] for scene, (a, b) in pairs.items() if a in errors and b in errors}


def _seeds(rows: Iterable[Row]) -> list[list[Row]]:
    found: dict[int, list[Row]] = defaultdict(list)
    for row in rows:
        found[row.seed].append(row)
    return list(found.values())


def _compared(
    method: str, spent: float, ratios: Mapping[str, float], by_seed: Iterable[Mapping[str, float]], *,
    flip_higher: bool | None,
) -> Comparison:  # fmt: skip
    worst = min(ratios, key=lambda scene: ratios[scene])
    whole = [geometric(part.values()) for part in by_seed if len(part) == len(ratios)]
    low, high = interval(whole) or (None, None)
    return Comparison(
        method=method, spending=spent, mean=geometric(ratios.values()), low=low, high=high, worst=ratios[worst],
        worst_scene=worst, scenes=len(ratios), flip_higher=flip_higher,
    )  # fmt: skip
