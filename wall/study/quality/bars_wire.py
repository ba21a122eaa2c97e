"""Bars of the wire: bytes a sample, against raw and lossless pictures, and silence once a picture is complete."""

from __future__ import annotations

from collections.abc import Sequence

from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, said
from wall.study.quality.traffic import Rest, Traffic, at_rest, traffic
from wall.study.quality.verdict import Verdict

BYTES_A_SAMPLE = 7.0
OF_RAW = 0.25
OF_RAW_AT = (256, 256, 60.0, 400_000.0)  # width, height, refreshes and rays a second: what that bar is about
LOSSLESS = "stream_zstd_tiles"
COMPLETE = 256  # samples a pixel that a rest must have had time for, before a picture is expected to be complete


def wire_verdicts(rows: Sequence[Row]) -> list[Verdict]:
    """As far as the rows say when their bytes were sent."""
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
        what=f"bytes a sample while something moves, {said(ours[0].spending, 'virtual')}",
        wanted=f"≤ {BYTES_A_SAMPLE:g}", came=f"{mean:.2f}, at most {worst.bytes_a_sample:.2f} ({worst.scene})",
        met=mean <= BYTES_A_SAMPLE,
    )  # fmt: skip


def _of_raw(ours: Sequence[Traffic]) -> Verdict:
    worst = max(ours, key=lambda t: t.raw)
    return Verdict(
        what=f"bytes of samples over those of raw frames, {said(worst.spending, 'virtual')}",
        wanted=f"≤ {OF_RAW:g}", came=f"at most {worst.raw:.3f} ({worst.scene})", met=worst.raw <= OF_RAW,
    )  # fmt: skip


def _of_lossless(ours: Sequence[Traffic], theirs: Sequence[Traffic]) -> list[Verdict]:
    other = {t.scene: t.bytes_per_s for t in theirs}
    ratios = [(t.bytes_per_s / other[t.scene], t.scene) for t in ours if other.get(t.scene)]
    if not ratios:
        return []
    what = f"bytes of samples over those of lossless dirty tiles, {said(ours[0].spending, 'virtual')}"
    ratio, scene = max(ratios)
    return [Verdict(what=what, wanted="< 1", came=f"at most {ratio:.2f} ({scene})", met=ratio < 1.0)]


def _silence(found: Sequence[Rest], pixels: int) -> list[Verdict]:
    """Only of runs that rest for long enough."""
    verdicts = []
    for rest in found:
        if rest.method == OURS and rest.rested_s * rest.spending >= COMPLETE * pixels:
            what = f"nothing is sent of a picture at rest, {said(rest.spending, 'virtual')}, {rest.scene}"
            silent = rest.silent_s is not None
            came = f"after {rest.silent_s:.1f} s" if silent else f"not within {rest.rested_s:.1f} s"
            verdicts.append(Verdict(what=what, wanted=f"within {COMPLETE} samples a pixel", came=came, met=silent))
    return verdicts
