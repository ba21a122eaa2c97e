"""Requirements on the adaptive method, of error and of bytes sent, and whether the rows of a run meet them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from wall.study.quality.rows import Row
from wall.study.quality.summary import (
    OURS,
    SMALLEST,
    Comparison,
    best_other,
    compare,
    equal_error,
    geometric,
    methods_at,
    scenes,
    spending,
    spending_text,
)
from wall.study.quality.traffic import Rest, Traffic, at_rest, traffic

EQUAL_ERROR = 40.0  # times faster that framed must be
AT_REST_S = 2.0  # after everything stopped, an image is held against the progressive renderer's
SCENES = ("orbit", "shadows", "light", "mirrors")  # of the project: what is required is required of these
NOISY = ("bounce", "metal", "lamps")  # path-traced ones, of which other things are required
BESIDE_SCENES = ("walk", "telephoto", "jerky", "cuts", *NOISY)  # measured only if asked for
RIVALS = (
    "taa_",
    "reduced_",
    "render_cache",
    "afr2005",
    "tapestry",
    "shading_cache",
)  # of "best other": all must have run on all scenes
BYTES_A_SAMPLE = 7.0  # at most, while something moves
OF_RAW = 0.25  # of the bytes of raw frames, at most
OF_RAW_AT = (256, 256, 60.0, 400_000.0)  # width, height, refreshes and rays a second that OF_RAW is about
LOSSLESS = "stream_zstd_tiles"
COMPLETE = 256  # samples a pixel that a rest must have had time for, before an image is expected to be complete


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One requirement at one spending: what was wanted, what was measured, whether that meets it."""

    what: str
    wanted: str
    came: str
    met: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """error(method) / error(adaptive) over scenes: a geometric mean and a worst scene."""

    method: str
    mean: float
    worst: float
    clock: str = "virtual"


REQUIREMENTS = (
    Requirement(method="framed", mean=6.0, worst=2.5),
    Requirement(method="frameless", mean=4.0, worst=0.0),
    Requirement(method="framed_x10", mean=2.5, worst=1.2),
    Requirement(method="best other", mean=1.8, worst=1.3),
    Requirement(method="framed", mean=2.0, worst=0.0, clock="cpu"),
    Requirement(method="best TAA", mean=1.3, worst=0.0, clock="cpu"),
)
NOISY_REQUIREMENTS = (
    Requirement(method="framed", mean=5.0, worst=4.0),
    Requirement(method="accumulating", mean=5.0, worst=4.0),
    Requirement(method="best SVGF", mean=2.0, worst=1.5),
    Requirement(method="adaptive:no_filtering", mean=2.2, worst=0.0),
    Requirement(method="framed", mean=3.0, worst=0.0, clock="cpu"),
    Requirement(method="best SVGF", mean=1.2, worst=0.0, clock="cpu"),
)


def verdicts(rows: Sequence[Row]) -> list[Verdict]:
    """Every requirement that the rows can say something about. All rows must have the same clock."""
    if not rows:
        return []
    clock, plain = rows[0].clock, [row for row in rows if row.scene not in NOISY]
    found, others = compare(plain), [c for c in best_other(plain) if _has_rivals(plain, c.spending)]
    verdicts = _ratios(REQUIREMENTS, [*found, *_best(plain, "taa_", "best TAA"), *others], clock)
    verdicts += _noise([row for row in rows if row.scene in NOISY], clock)
    if clock == "virtual":
        verdicts += [*_equal_error(plain), *_flip(found), *_at_rest(rows), *_wire(rows)]
    return verdicts


def _noise(rows: Sequence[Row], clock: str) -> list[Verdict]:
    """Of noisy light, where a method ran on every scene of NOISY: with fewer the mean is another one."""
    found = [c for c in [*compare(rows), *_best(rows, "svgf", "best SVGF")] if c.scenes == len(NOISY)]
    return _ratios(NOISY_REQUIREMENTS, found, clock, "noisy light, ")


def _best(rows: Sequence[Row], prefix: str, name: str) -> list[Comparison]:
    """The best of one family of methods, chosen for each scene by hindsight."""
    family = [row for row in rows if row.method == OURS or row.method.startswith(prefix)]
    return [replace(found, method=name) for found in best_other(family)]


def _ratios(
    wanted: Iterable[Requirement], found: Iterable[Comparison], clock: str, about: str = ""
) -> list[Verdict]:
    """Each requirement at every spending that has its method; about : what it is about, in words."""
    known = sorted(found, key=lambda c: (c.method, c.spending))
    return [
        _ratio(requirement, c, clock, about)
        for requirement in wanted
        if requirement.clock == clock
        for c in known
        if c.method == requirement.method
    ]


def _has_rivals(rows: Sequence[Row], spent: float) -> bool:
    """On every scene: where one lacks them, the best of what is there flatters."""
    for scene in scenes(rows):
        methods = methods_at([row for row in rows if row.scene == scene], spent)
        if not all(any(method.startswith(rival) for method in methods) for rival in RIVALS):
            return False
    return True


def _ratio(requirement: Requirement, found: Comparison, clock: str, about: str) -> Verdict:
    wanted = f"≥ {requirement.mean:g}" + (f", worst scene ≥ {requirement.worst:g}" if requirement.worst else "")
    return Verdict(
        what=f"error of {requirement.method} over adaptive, {about}{spending_text(found.spending, clock)}",
        wanted=wanted,
        came=f"{found.mean:.2f}, worst {found.worst:.2f} ({found.worst_scene})",
        met=found.mean >= requirement.mean and found.worst >= requirement.worst,
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
        what = f"times faster framed must be for equal error, {spending_text(rate, 'virtual')}"
        found.append(Verdict(what=what, wanted=f"≥ {EQUAL_ERROR:g}", came=came, met=mean >= EQUAL_ERROR))
    return found


def _flip(found: Iterable[Comparison]) -> list[Verdict]:
    others = [c for c in found if c.method in ("framed", "frameless", "framed_x10")]
    if not others:
        return []
    lower = [f"{c.method} at {spending_text(c.spending, 'virtual')}" for c in others if not c.flip_higher]
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
            what=f"error {AT_REST_S:g} s after a stop over a progressive renderer's, {spending_text(spent, 'virtual')}",
            wanted="≤ 1", came=f"at worst {max(ratios)[0]:.2f} ({max(ratios)[1]})", met=max(ratios)[0] <= 1.0,
        )
        for spent, ratios in sorted(found.items())
    ]  # fmt: skip


def _wire(rows: Sequence[Row]) -> list[Verdict]:
    """Of bytes sent, as far as the rows say when that was."""
    found = traffic(rows)
    ours = [t for t in found if t.method == OURS]
    verdicts = []
    for spent in sorted({t.spending for t in ours}):
        here = [t for t in ours if t.spending == spent]
        verdicts.append(_bytes_a_sample(here))
        if (rows[0].width, rows[0].height, rows[0].refresh_hz, spent) == OF_RAW_AT:
            verdicts.append(_of_raw(here))
        verdicts += _of_lossless(here, [t for t in found if t.method == LOSSLESS and t.spending == spent])
    return [*verdicts, *_silence(at_rest(rows), rows[0].width * rows[0].height)]


def _bytes_a_sample(ours: Sequence[Traffic]) -> Verdict:
    """The average over scenes, and the worst one."""
    mean, worst = sum(t.bytes_a_sample for t in ours) / len(ours), max(ours, key=lambda t: t.bytes_a_sample)
    return Verdict(
        what=f"bytes a sample while something moves, {spending_text(ours[0].spending, 'virtual')}",
        wanted=f"≤ {BYTES_A_SAMPLE:g}", came=f"{mean:.2f}, at most {worst.bytes_a_sample:.2f} ({worst.scene})",
        met=mean <= BYTES_A_SAMPLE,
    )  # fmt: skip


def _of_raw(ours: Sequence[Traffic]) -> Verdict:
    worst = max(ours, key=lambda t: t.raw)
    return Verdict(
        what=f"bytes of samples over those of raw frames, {spending_text(worst.spending, 'virtual')}",
        wanted=f"≤ {OF_RAW:g}", came=f"at most {worst.raw:.3f} ({worst.scene})", met=worst.raw <= OF_RAW,
    )  # fmt: skip


def _of_lossless(ours: Sequence[Traffic], theirs: Sequence[Traffic]) -> list[Verdict]:
    other = {t.scene: t.bytes_per_s for t in theirs}
    ratios = [(t.bytes_per_s / other[t.scene], t.scene) for t in ours if other.get(t.scene)]
    if not ratios:
        return []
    what = f"bytes of samples over those of lossless dirty tiles, {spending_text(ours[0].spending, 'virtual')}"
    ratio, scene = max(ratios)
    return [Verdict(what=what, wanted="< 1", came=f"at most {ratio:.2f} ({scene})", met=ratio < 1.0)]


def _silence(found: Sequence[Rest], pixels: int) -> list[Verdict]:
    """Only of runs that rest for long enough."""
    verdicts = []
    for rest in found:
        if rest.method == OURS and rest.rested_s * rest.spending >= COMPLETE * pixels:
            what = f"nothing is sent of an image at rest, {spending_text(rest.spending, 'virtual')}, {rest.scene}"
            silent = rest.silent_s is not None
            came = f"after {rest.silent_s:.1f} s" if silent else f"not within {rest.rested_s:.1f} s"
            verdicts.append(Verdict(what=what, wanted=f"within {COMPLETE} samples a pixel", came=came, met=silent))
    return verdicts
