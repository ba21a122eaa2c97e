"""One cell, run: the arm advances from refresh to refresh, what it shows is held against the ideal picture."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from wall.core.data import Float32
from wall.study.quality.cell import Cell, duration, scene_of, setup_of
from wall.study.quality.clocks import STEPS_A_REFRESH, Clock, CpuClock, VirtualClock
from wall.study.quality.method import Arm, Setup
from wall.study.quality.methods import make_arm
from wall.study.quality.metrics import Score, delay_of, display_values, mean_square
from wall.study.quality.reference import Gold, ideal_refreshes
from wall.study.quality.rows import Row
from wall.study.speed import record

JUDGED_PICTURES = 8  # of a run, by FLIP and SSIM, evenly spread: they are slow
SETTLE_S = 0.05  # after the start, whose picture is free for everybody, nothing is compared
LONGEST_DELAY_S = 1.0  # that an error is expressed as

Look = Callable[
    [int, float, Float32, Float32], None
]  # number of the ideal picture, its time, shown, ideal (both linear)

_warm: set[tuple[str, tuple[int, int]]] = set()  # arms that this process has run, their kernels loaded


def gold_of(cell: Cell) -> tuple[Gold, tuple[int, ...]]:
    """The ideal pictures that a cell is held against, and the refreshes they belong to."""
    return _gold(cell.config, cell.size, cell.seconds, cell.refresh_hz)


@lru_cache(maxsize=2)
def _gold(
    config: Path, size: tuple[int, int], seconds: float | None, refresh_hz: float
) -> tuple[Gold, tuple[int, ...]]:
    plan, resident = scene_of(config, size)
    refreshes = ideal_refreshes(size, seconds=duration(plan, seconds), refresh_hz=refresh_hz)
    return Gold(plan, resident, [k / refresh_hz for k in refreshes]), refreshes


def run(cell: Cell, look: Look = lambda *_: None) -> Row:
    """Measure a cell; ideal pictures that are not there yet are made first. Raises ConfigError."""
    gold, refreshes = gold_of(cell)
    gold.make(gold.missing())
    setup = setup_of(cell)
    arm, clock = _start(cell, setup)
    scored = {refresh: k for k, refresh in enumerate(refreshes) if refresh >= max(1, SETTLE_S * cell.refresh_hz)}
    score, times = Score(judged=_spread(JUDGED_PICTURES, len(scored))), [0.0]
    still: list[float] = []
    spent: list[tuple[int, int]] = []  # bytes and rays up to each scored refresh
    for refresh in range(1, max(refreshes) + 1):
        now = refresh / cell.refresh_hz
        shown = clock.refresh(arm, (refresh - 1) / cell.refresh_hz, now)
        if refresh in scored:
            ideal = gold.picture(scored[refresh])
            score.add(shown, ideal)
            look(scored[refresh], now, shown, ideal)
            times.append(now)
            still.append(now - gold.events[scored[refresh]].input_time)
            spent.append((arm.bytes, arm.rays))
    row = _row(cell, arm, clock, score=score, gold=gold, times=times[1:], still=still)
    sent, rays = ([float(count) for count in counts] for counts in zip(*spent, strict=True))
    return replace(row, bytes_over_time=sent, rays_over_time=rays)


def _start(cell: Cell, setup: Setup) -> tuple[Arm, Clock]:
    """A fresh arm and its clock; another one has been there before it, so that nothing is compiled while it runs."""
    refresh_s = 1.0 / cell.refresh_hz
    if cell.clock == "virtual":
        if (cell.arm, cell.size) not in _warm:
            VirtualClock().refresh(make_arm(cell.arm, setup), 0.0, refresh_s)
            _warm.add((cell.arm, cell.size))
        return make_arm(cell.arm, setup), VirtualClock()
    VirtualClock().refresh(make_arm(cell.arm, setup), 0.0, refresh_s)
    began = time.process_time()
    arm = make_arm(cell.arm, setup)
    traced = time.process_time()
    arm.show(0.0)
    show_s, ray_s = time.process_time() - traced, (traced - began) / setup.rect.area
    arm = make_arm(cell.arm, replace(setup, rate=cell.cores / ray_s, input_step_s=refresh_s / STEPS_A_REFRESH))
    return arm, CpuClock(cell.cores, ray_s=ray_s, show_s=show_s, picture=arm.show(0.0).copy())


def _spread(wanted: int, count: int) -> frozenset[int]:
    """As many numbers below `count` as are wanted, evenly spread."""
    return frozenset(min(count - 1, int((k + 0.5) * count / wanted)) for k in range(wanted))


def _row(
    cell: Cell, arm: Arm, clock: Clock, *, score: Score, gold: Gold, times: list[float], still: list[float]
) -> Row:
    seconds = times[-1]
    step = times[1] - times[0] if len(times) > 1 else seconds
    return Row(
        scene=cell.scene,
        arm=cell.arm,
        rate=cell.rate if cell.clock == "virtual" else arm.rays / seconds,
        width=cell.size[0],
        height=cell.size[1],
        seed=cell.seed,
        clock=cell.clock,
        rmse=score.rmse,
        rmse_display=score.rmse_display,
        flip=score.flip,
        ssim=score.ssim,
        flicker=score.flicker,
        latency_equivalent_ms=delay_of(score.rmse_display, delay_errors(gold, step), step * 1e3),
        bytes_per_s=arm.bytes / seconds,
        rays=arm.rays,
        cpu_s=clock.spent,
        secondary=arm.secondary,
        cores=cell.cores,
        refresh_hz=cell.refresh_hz,
        seconds=seconds,
        shown=clock.shown,
        error_over_time=score.over_time,
        times=times,
        still_s=still,
        gold=gold.key,
        config=str(cell.config),
        ablation=cell.arm.partition(":")[2],
        commit=record.commit(),
        machine=record.machine(),
        command=record.command(),
    )


def delay_errors(gold: Gold, step: float) -> list[float]:
    """RMSE of the display values of the ideal picture shown 0, 1, 2 ... scored refreshes late; kept beside it.

    Before time 0 it shows what it shows at time 0, as every arm does.
    """
    path = gold.folder / "delays.json"
    if path.exists():
        found: list[float] = json.loads(path.read_text(encoding="utf-8"))
        return found
    pictures = [display_values(gold.picture(k)) for k in range(len(gold))]
    errors = []
    for late in range(min(len(gold), round(LONGEST_DELAY_S / step) + 1)):
        squares = [mean_square(pictures[max(k - late, 0)], pictures[k]) for k in range(1, len(gold))]
        errors.append(math.sqrt(sum(squares) / max(len(squares), 1)))
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fresh.write_text(json.dumps(errors), encoding="utf-8")
    fresh.replace(path)
    return errors
