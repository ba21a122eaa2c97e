"""One trial, run: the method advances from refresh to refresh, what it shows is held against the reference image."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from wall.core.data import Float32
from wall.display.files import replaced
from wall.study.quality.clocks import STEPS_A_REFRESH, Clock, CpuClock, VirtualClock
from wall.study.quality.method import Method, Setup
from wall.study.quality.methods import make_method
from wall.study.quality.metrics import Score, delay_of, display_values, mean_product
from wall.study.quality.reference import Reference, reference_refreshes
from wall.study.quality.rows import Row
from wall.study.quality.trial import Trial, duration, scene_of, setup_of
from wall.study.speed import record

JUDGED_IMAGES = 8  # of a run, by FLIP and SSIM, evenly spread: they are slow
SETTLE_S = 0.05  # after the start, whose image is free for everybody, nothing is compared
LONGEST_DELAY_S = 1.0  # that an error is expressed as

Look = Callable[
    [int, float, Float32, Float32], None
]  # number of the reference image, its time, shown, reference (both linear)

_warm: set[tuple[str, tuple[int, int]]] = set()  # methods that this process has run, their kernels loaded


def reference_of(trial: Trial) -> tuple[Reference, tuple[int, ...]]:
    """The reference images that a trial is held against, and the refreshes they belong to."""
    return _reference(trial.config, trial.size, trial.seconds, trial.refresh_hz)


@lru_cache(maxsize=2)
def _reference(
    config: Path, size: tuple[int, int], seconds: float | None, refresh_hz: float
) -> tuple[Reference, tuple[int, ...]]:
    plan, tracer_scene = scene_of(config, size)
    refreshes = reference_refreshes(size, seconds=duration(plan, seconds), refresh_hz=refresh_hz)
    return Reference(plan, tracer_scene, [k / refresh_hz for k in refreshes]), refreshes


def run(trial: Trial, look: Look = lambda *_: None) -> Row:
    """Measure a trial; reference images that are not there yet are made first. Raises ConfigError."""
    reference, refreshes = reference_of(trial)
    reference.make(reference.missing())
    setup = setup_of(trial)
    method, clock = _start(trial, setup)
    scored = {refresh: k for k, refresh in enumerate(refreshes) if refresh >= max(1, SETTLE_S * trial.refresh_hz)}
    score, times = Score(judged=_spread(JUDGED_IMAGES, len(scored))), [0.0]
    still: list[float] = []
    spent: list[tuple[int, int]] = []  # bytes and rays up to each scored refresh
    for refresh in range(1, max(refreshes) + 1):
        now = refresh / trial.refresh_hz
        shown = clock.refresh(method, (refresh - 1) / trial.refresh_hz, now)
        if refresh in scored:
            score.add(shown, *reference.halves(scored[refresh]))
            look(scored[refresh], now, shown, reference.image(scored[refresh]))
            times.append(now)
            still.append(now - reference.events[scored[refresh]].input_time)
            spent.append((method.bytes, method.rays))
    row = _row(trial, method, clock, score=score, reference=reference, times=times[1:], still=still)
    sent, rays = ([float(count) for count in counts] for counts in zip(*spent, strict=True))
    return replace(row, bytes_over_time=sent, rays_over_time=rays)


def _start(trial: Trial, setup: Setup) -> tuple[Method, Clock]:
    """A fresh method and its clock; another one has been there before it, so that nothing is compiled while it runs."""
    refresh_s = 1.0 / trial.refresh_hz
    if trial.clock == "virtual":
        if (trial.method, trial.size) not in _warm:
            VirtualClock().refresh(make_method(trial.method, setup), 0.0, refresh_s)
            _warm.add((trial.method, trial.size))
        return make_method(trial.method, setup), VirtualClock()
    VirtualClock().refresh(make_method(trial.method, setup), 0.0, refresh_s)
    began = time.process_time()
    method = make_method(trial.method, setup)
    traced = time.process_time()
    method.show(0.0)
    show_s, ray_s = time.process_time() - traced, (traced - began) / setup.rect.area
    setup = replace(setup, rate=trial.cores / ray_s, input_step_s=refresh_s / STEPS_A_REFRESH)
    method = make_method(trial.method, setup)
    return method, CpuClock(trial.cores, ray_s=ray_s, show_s=show_s, image=method.show(0.0).copy())


def _spread(wanted: int, count: int) -> frozenset[int]:
    """As many numbers below `count` as are wanted, evenly spread."""
    return frozenset(min(count - 1, int((k + 0.5) * count / wanted)) for k in range(wanted))


def _row(
    trial: Trial,
    method: Method,
    clock: Clock,
    *,
    score: Score,
    reference: Reference,
    times: list[float],
    still: list[float],
) -> Row:
    seconds = times[-1]
    step = times[1] - times[0] if len(times) > 1 else seconds
    return Row(
        scene=trial.scene,
        method=trial.method,
        rate=trial.rate if trial.clock == "virtual" else method.rays / seconds,
        width=trial.size[0],
        height=trial.size[1],
        seed=trial.seed,
        clock=trial.clock,
        rmse=score.rmse,
        rmse_display=score.rmse_display,
        flip=score.flip,
        ssim=score.ssim,
        flicker=score.flicker,
        latency_equivalent_ms=delay_of(score.rmse_display, delay_errors(reference, step), step * 1e3),
        bytes_per_s=method.bytes / seconds,
        rays=method.rays,
        cpu_s=clock.spent,
        secondary=method.secondary,
        cores=trial.cores,
        refresh_hz=trial.refresh_hz,
        seconds=seconds,
        shown=clock.shown,
        error_over_time=score.over_time,
        times=times,
        still_s=still,
        reference=reference.key,
        config=str(trial.config),
        ablation=trial.method.partition(":")[2],
        commit=record.commit(),
        machine=record.machine(),
        command=record.command(),
    )


def delay_errors(reference: Reference, step: float) -> list[float]:
    """RMSE of the display values of the reference image shown 0, 1, 2 ... scored refreshes late; kept beside it.

    Before time 0 it shows what it shows at time 0, as every method does.
    """
    path = reference.folder / "delays.json"
    if path.exists():
        found: list[float] = json.loads(path.read_text(encoding="utf-8"))
        return found
    images = [np.array([display_values(half) for half in reference.halves(k)]) for k in range(len(reference))]
    errors = []
    for late in range(min(len(reference), round(LONGEST_DELAY_S / step) + 1)):
        differences = (images[max(k - late, 0)] - images[k] for k in range(1, len(reference)))
        squares = [mean_product(first, second) for first, second in differences]
        errors.append(math.sqrt(max(sum(squares), 0.0) / max(len(squares), 1)))
    with replaced(path) as fresh:
        fresh.write_text(json.dumps(errors), encoding="utf-8")
    return errors
