"""`wall measure soak`: a wall that runs for long, with inputs, viewers that come and go, and a fault a minute."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import random
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import RenderableType

from wall.config.loading import load
from wall.core.errors import RunError
from wall.display.viewer import visit
from wall.study import json_lines
from wall.study.faults.faults import FROZEN, FROZEN_S, KILLED, SLOWED, Say
from wall.study.faults.walls import FaultyWall, Slowed, processes_of
from wall.study.live.rewriting import text_in_motion
from wall.study.quality.tables import MET, MISSED, Table

FILE, PLOT = "soak.jsonl", "soak.png"
DEAF_S = 60.0  # without a word of the page, which viewers that were cut off find again
LOOK_S = 5.0  # between two rows
FAULT_S = 60.0  # between two faults
VISIT_S, PAUSE_S = 4.0, 3.0  # that a viewer stays, and until the next one comes
SETTLE_S = 600.0  # before memory is judged; a third of a shorter run
MOST_GROWTH = 1.0  # percent of memory
INHERITED = 5  # descriptors more once a rank was forked again: 3 of its own, 2 of the process that does it
MOST_AGING = 2.0  # times as old as before, of the oldest sample shown; it is older while a viewer has paused
YOUNGEST_S = 0.1  # of ages that are compared
MOST_DRIFT_MS = 50.0  # of the head's clock against this process's
SLOW_S = 5.0
KINDS = (KILLED, FROZEN, SLOWED)
COMMANDS: tuple[dict[str, object], ...] = (
    {"kind": "pause"},
    {"kind": "orbit", "x": 0.1, "y": 0.02},
    {"kind": "zoom", "x": 0.1},
    {"kind": "reset"},
    {"kind": "pause"},
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """How the wall was at one moment: a line of the file, keys in this order."""

    seconds: float  # since the first row
    memory_mb: float  # of all its processes, shared pages counted once
    descriptors: int  # open files of all its processes
    processes: int
    threads: int
    age_s: float  # of the oldest sample shown, of any rank
    clock_ms: float  # the head's clock less this process's, as the soonest status since the row before told it; from 0
    dropped: dict[str, int]  # so far, by name
    fault: str  # that was made since the row before; "" for none


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is judged of a run; `why`: what is not as wanted, in words."""

    growth_percent: float  # of memory, from the first third of what is judged to the last
    descriptors: int  # more at the end than at the beginning of what is judged, medians
    drift_ms: float  # of the head's clock, medians likewise
    aging: float  # of the oldest sample shown: its age at the end over that at the beginning, medians
    forgotten: tuple[str, ...]  # names of drops whose count fell
    why: str


def judge(rows: Sequence[Row]) -> Verdict:
    """See whether anything grew, drifted or was forgotten. Raises RunError where there are too few rows."""
    end = rows[-1].seconds if rows else 0.0
    settled = [row for row in rows if row.seconds >= min(SETTLE_S, end / 3.0)]
    third = len(settled) // 3
    if not third:
        raise RunError(f"{len(rows)} rows are too few to judge; wanted: a longer run")
    first, last = settled[:third], settled[-third:]
    before, after = (float(np.median([row.memory_mb for row in part])) for part in (first, last))
    growth = 100.0 * (after / before - 1.0)
    more = round(float(np.median([r.descriptors for r in last]) - np.median([r.descriptors for r in first])))
    expected = INHERITED * min(sum(row.fault == KILLED for row in settled), rows[-1].processes)
    drift = abs(float(np.median([row.clock_ms for row in last]) - np.median([row.clock_ms for row in first])))
    young, old = (float(np.median([row.age_s for row in part])) for part in (first, last))
    aging = old / max(young, YOUNGEST_S)
    fell = {
        name
        for one, other in itertools.pairwise(rows)
        for name, count in one.dropped.items()
        if other.dropped.get(name, 0) < count
    }
    found = [
        f"memory grew by {growth:.1f} %" if growth > MOST_GROWTH else "",
        f"{more} descriptors more" if more > expected else "",
        f"the head's clock drifted by {drift:.0f} ms" if drift > MOST_DRIFT_MS else "",
        f"the oldest samples became {aging:.1f} times as old" if aging > MOST_AGING else "",
        f"forgotten drops: {', '.join(sorted(fell))}" if fell else "",
    ]
    return Verdict(
        growth_percent=round(growth, 2), descriptors=more, drift_ms=round(drift, 1), aging=round(aging, 2),
        forgotten=tuple(sorted(fell)), why="; ".join(filter(None, found)),
    )  # fmt: skip


def measure(config: Path, *, minutes: float, seed: int, out: Path, say: Say) -> list[Row]:
    """Run a wall for so many minutes. Raises RunError where it ends before, ConfigError."""
    out.mkdir(parents=True, exist_ok=True)
    path, results = out / config.name, out / "results"
    shutil.rmtree(results, ignore_errors=True)
    results.mkdir()
    path.write_text(text_in_motion(load(config)), encoding="utf-8")
    (out / FILE).unlink(missing_ok=True)
    wall = FaultyWall(path, out, results, most_s=60.0 * minutes + 600.0, keeps_images=False)
    ending = threading.Event()
    viewers = threading.Thread(target=_visit, args=(wall.address, ending), name="visitors", daemon=True)
    viewers.start()
    rows: list[Row] = []
    try:
        for row in _rows(wall, results, minutes=minutes, chance=random.Random(seed)):
            rows.append(row)
            json_lines.append(out / FILE, row)
            say(f"{row.seconds / 60.0:.1f} of {minutes:g} minutes, {row.memory_mb:.0f} MB {row.fault}")
        wall.end(signal.SIGINT)
    finally:
        ending.set()
        wall.close()
    plot(rows, out / PLOT)
    return rows


def _rows(wall: FaultyWall, results: Path, *, minutes: float, chance: random.Random) -> Iterator[Row]:
    steady = {wall.process.pid}
    while not (results / "summary.json").exists() or not wall.seen:  # results are written every few seconds
        _living(wall)
        time.sleep(0.2)
    steady.add(processes_of(wall.process.pid)[-1])  # the nursery, forked last
    began, faults, offset = time.monotonic(), 0, None
    while (now := time.monotonic()) < began + 60.0 * minutes:
        _living(wall)
        fault = ""
        if now >= began + FAULT_S * (faults + 1):
            fault, faults = _fault(KINDS[faults % len(KINDS)], wall, steady, chance), faults + 1
        seen = wall.take_seen()  # with the newest of before
        if time.monotonic() - seen[-1].time > DEAF_S:
            raise RunError(f"{wall.address}: the page has told nothing for {DEAF_S:g} s")
        ahead = max(each.status["seconds"] - each.time for each in seen)
        offset = ahead if offset is None else offset
        processes = processes_of(wall.process.pid)
        yield Row(
            seconds=round(now - began, 2), memory_mb=round(sum(map(memory_mb, processes)), 1),
            descriptors=sum(_count(pid, "fd") for pid in processes), processes=len(processes),
            threads=sum(_count(pid, "task") for pid in processes),
            age_s=round(max(rank["oldest_sample_s"] or 0.0 for rank in seen[-1].status["ranks"]), 3),
            clock_ms=round(1e3 * (ahead - offset), 1), dropped=_dropped(results), fault=fault,
        )  # fmt: skip
        time.sleep(max(0.0, now + LOOK_S - time.monotonic()))


def _living(wall: FaultyWall) -> None:
    if wall.process.poll() is not None:
        raise RunError(f"the wall ended: {wall.said.strip()[-500:]}")


def _fault(kind: str, wall: FaultyWall, steady: set[int], chance: random.Random) -> str:
    """Do something to one of the ranks but the head. Returns what."""
    victims = [pid for pid in processes_of(wall.process.pid) if pid not in steady]
    if not victims:
        return ""
    victim = chance.choice(victims)
    with contextlib.suppress(ProcessLookupError):
        if kind == KILLED:
            os.kill(victim, signal.SIGKILL)
        elif kind == FROZEN:
            os.kill(victim, signal.SIGSTOP)
            time.sleep(FROZEN_S)
            os.kill(victim, signal.SIGCONT)
        else:
            with Slowed(victim):
                time.sleep(SLOW_S)
    return kind


def _visit(address: str, ending: threading.Event) -> None:
    """Viewers that come, steer a little, draw what they get, and go."""
    samples = False
    while not ending.wait(PAUSE_S):
        with contextlib.suppress(RunError):  # a page that is slow to answer has no viewer this time
            visit(address, COMMANDS, display="samples" if samples else "images", seconds=VISIT_S)
        samples = not samples


def memory_mb(pid: int) -> float:
    """Memory of a process, each shared page shared out among those that have it; 0 for one that has ended."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) / 1024.0
    return 0.0


def _count(pid: int, what: str) -> int:
    with contextlib.suppress(OSError):
        return sum(1 for _ in Path(f"/proc/{pid}/{what}").iterdir())
    return 0


def _dropped(results: Path) -> dict[str, int]:
    """What the summary says so far."""
    found = json.loads((results / "summary.json").read_text(encoding="utf-8"))["dropped"]
    return {str(name): int(count) for name, count in found.items()}


def plot(rows: Sequence[Row], path: Path) -> None:
    """PNG: memory, descriptors, age and drops over time; dotted: faults."""
    from matplotlib.figure import Figure

    shown: tuple[tuple[str, Callable[[Row], float]], ...] = (
        ("memory, MB", lambda row: row.memory_mb),
        ("descriptors", lambda row: row.descriptors),
        ("oldest sample, s", lambda row: row.age_s),
        ("dropped", lambda row: sum(row.dropped.values())),
    )
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    for axes, (label, value) in zip(figure.subplots(len(shown), 1, sharex=True), shown, strict=True):
        axes.plot([row.seconds / 60.0 for row in rows], [value(row) for row in rows])
        for row in rows:
            if row.fault:
                axes.axvline(row.seconds / 60.0, ls=":", lw=0.8, color="0.5")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel("minutes")
    figure.savefig(path)


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    verdict = judge(rows)
    lines = (
        ("memory", f"{verdict.growth_percent:+.2f} %", f"at most {MOST_GROWTH:g} %"),
        ("descriptors", f"{verdict.descriptors:+d}", "none more, but of ranks forked again"),
        ("the head's clock", f"{verdict.drift_ms:.1f} ms", f"at most {MOST_DRIFT_MS:g} ms"),
        ("age of the oldest sample", f"{verdict.aging:.2f} times", f"at most {MOST_AGING:g} times"),
        ("dropped", f"{sum(rows[-1].dropped.values())}", "no count falls"),
        ("faults", f"{sum(bool(row.fault) for row in rows)}", ""),
        ("verdict", verdict.why or "nothing", MISSED if verdict.why else MET),
    )
    yield Table(title="Soak", columns=("what", "found", "wanted"), lines=lines, text=(0, 1, 2)).rich()
    yield f"rows and plot in {out / FILE}, {out / PLOT}"
