"""What samples cost on the wire against images: while something moves, at rest, and where they cost the same.

Samples cost rate x (bytes a sample); images cost pixels x refreshes x (bytes a pixel of each). Samples are therefore
cheaper below (bytes a pixel) / (bytes a sample) rays for each displayed pixel and refresh, whatever the panel's size:
as far as a pixel's and a sample's bytes depend on neither. Both are measured, at one rate, size and refresh rate.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, STREAMS, averaged, geometric, scenes, spending

REST_EDGES_S = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # after everything stopped
SILENCE_S = 0.5  # and longer is no mere pause
RAW_BYTES_A_PIXEL = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Traffic:
    """One method of one scene while something moves, mean over seeds."""

    scene: str
    method: str
    spending: float
    bytes_per_s: float
    raw: float  # of the bytes of raw 8-bit frames, one every refresh
    bytes_a_sample: float  # for images: for every ray that was spent on them
    error: float  # RMSE of display values, of the whole run
    cpu: float  # CPU seconds a second, of the whole run


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossover:
    """Where samples and one kind of images cost the same, from geometric means over scenes."""

    method: str
    spending: float
    bytes_a_pixel: float  # of each image sent
    bytes_a_sample: float
    density: float  # samples for each displayed pixel and refresh, below which samples are cheaper
    density_per_s: float  # the same for each second, at the rows' refresh rate
    refresh_hz: float  # above this samples are cheaper, at the rows' rate and size
    pixels: float  # above this, at the rows' rate and refresh rate
    error: float  # of what the images show over that of what the samples do


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Bytes a second of one method after everything stopped, in the windows between REST_EDGES_S; None: not seen."""

    scene: str
    method: str
    spending: float
    rested_s: float  # when the run ended
    windows: tuple[float | None, ...]
    silent_s: float | None  # seconds after the stop from which on nothing was sent; None: it never fell silent


def concerned(rows: Sequence[Row]) -> list[Row]:
    """Rows of samples and of streams of one clock and size, that say when their bytes were sent."""
    return [r for r in rows if (r.method == OURS or r.method.startswith(STREAMS)) and r.bytes_over_time]


def raw_bytes_per_s(row: Row) -> float:
    """Of 8-bit RGB at every refresh."""
    return RAW_BYTES_A_PIXEL * row.width * row.height * row.refresh_hz


def moving(row: Row) -> tuple[float, float, float]:
    """(bytes, rays, seconds) of the spans between compared refreshes at whose end something moved."""
    ends = zip([0.0, *row.times], [0.0, *row.bytes_over_time], [0.0, *row.rays_over_time], strict=True)
    total = [0.0, 0.0, 0.0]
    for still, (a, b) in zip(row.still_s, pairwise(ends), strict=True):
        if still < (b[0] - a[0]) / 2:
            for k, part in enumerate((b[1] - a[1], b[2] - a[2], b[0] - a[0])):
                total[k] += part
    return total[0], total[1], total[2]


def traffic(rows: Sequence[Row]) -> list[Traffic]:
    """Every scene, method and spending in which something moved, in the order of the file."""
    errors, cpu = averaged(rows), averaged(rows, "cpu_s")
    found: dict[tuple[str, str, float], list[Row]] = defaultdict(list)
    for row in concerned(rows):
        found[row.scene, row.method, spending(row)].append(row)
    result = []
    for (scene, method, spent), here in found.items():
        sent, rays, seconds = (sum(parts) for parts in zip(*map(moving, here), strict=True))
        if seconds > 0.0:
            result.append(
                Traffic(
                    scene=scene, method=method, spending=spent, bytes_per_s=sent / seconds,
                    raw=sent / seconds / raw_bytes_per_s(here[0]), bytes_a_sample=sent / max(rays, 1.0),
                    error=errors[scene, method, spent], cpu=cpu[scene, method, spent] / here[0].seconds,
                )
            )  # fmt: skip
    return result


def crossovers(rows: Sequence[Row]) -> list[Crossover]:
    """Every stream at every spending that samples have too, over the scenes that have both."""
    known = {(t.method, t.spending, t.scene): t for t in traffic(rows)}
    found = []
    for method, spent in dict.fromkeys((t.method, t.spending) for t in known.values() if t.method != OURS):
        pairs = [
            (known[OURS, spent, s], known[method, spent, s])
            for s in scenes(rows)
            if (OURS, spent, s) in known and (method, spent, s) in known
        ]
        if pairs and all(ours.bytes_per_s > 0.0 and theirs.bytes_per_s > 0.0 for ours, theirs in pairs):
            found.append(_crossover(method, spent, pairs, rows[0]))
    return found


def _crossover(method: str, spent: float, pairs: Sequence[tuple[Traffic, Traffic]], row: Row) -> Crossover:
    pixels, hz = row.width * row.height, row.refresh_hz
    sample = geometric(ours.bytes_a_sample for ours, _ in pairs)
    pixel = geometric(theirs.bytes_per_s / (pixels * hz) for _, theirs in pairs)
    rate = geometric(ours.bytes_per_s / ours.bytes_a_sample for ours, _ in pairs)  # that was spent while it moved
    density = pixel / sample
    return Crossover(
        method=method, spending=spent, bytes_a_pixel=pixel, bytes_a_sample=sample, density=density,
        density_per_s=density * hz, refresh_hz=rate / pixels / density, pixels=rate / hz / density,
        error=geometric(theirs.error / ours.error for ours, theirs in pairs),
    )  # fmt: skip


def at_rest(rows: Sequence[Row]) -> list[Rest]:
    """Rows of the first seed whose last compared refreshes saw nothing move for at least half a second."""
    found = []
    first = min((row.seed for row in rows), default=0)
    for row in concerned(rows):
        if row.seed == first and row.still_s[-1] >= REST_EDGES_S[1]:
            since = row.times[-1] - row.still_s[-1]
            windows = tuple(_window(row, since + a, since + b) for a, b in pairwise(REST_EDGES_S))
            found.append(
                Rest(
                    scene=row.scene, method=row.method, spending=spending(row), rested_s=row.still_s[-1],
                    windows=windows, silent_s=_silent(row, since),
                )
            )  # fmt: skip
    return found


def _window(row: Row, begin: float, end: float) -> float | None:
    """Bytes a second between the compared refreshes nearest two times; None where the run ended before."""
    if end > row.times[-1] + row.times[0] / 2:
        return None
    a, b = (min(range(len(row.times)), key=lambda k: abs(row.times[k] - t)) for t in (begin, end))
    return (row.bytes_over_time[b] - row.bytes_over_time[a]) / (row.times[b] - row.times[a]) if b > a else None


def _silent(row: Row, since: float) -> float | None:
    last = next((k for k in range(len(row.times) - 1, 0, -1) if row.bytes_over_time[k] > row.bytes_over_time[k - 1]), 0)
    return None if row.times[-1] - row.times[last] < SILENCE_S else max(row.times[last] - since, 0.0)


def size_of(pixels: float) -> str:
    """So many pixels as a panel of 16 : 9."""
    if not math.isfinite(pixels):
        return "any"
    return f"{math.sqrt(pixels * 16 / 9):.0f}x{math.sqrt(pixels * 9 / 16):.0f}"
