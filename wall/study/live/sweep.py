"""All runs of `wall measure live`, one after the other on the same cores, and what is made of their pictures."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wall.config.loading import Loaded
from wall.config.sampling import METHODS
from wall.config.views import KeyframesPathConfig
from wall.core.errors import RunError
from wall.display.files import replaced
from wall.roles.plan import Plan
from wall.study import json_lines
from wall.study.live import cpu_limit
from wall.study.live.film import OWN_WIDTH, QUALITY, film_hz, scaled, side_by_side, write_film
from wall.study.live.ideal import Ideal
from wall.study.live.images import strip, wall_image
from wall.study.live.rewriting import load_without_windows, moving, text_for
from wall.study.live.rows import FILE, Row, newest
from wall.study.live.runs import PICTURES, Run, run_wall
from wall.study.live.scores import Shown, score
from wall.study.live.timeline import moments
from wall.study.options import check_names
from wall.study.quality.image_strips import Bytes
from wall.study.quality.reference import SAMPLES_A_PIXEL
from wall.study.speed import record

SECONDS, WARM_UP_S, MOMENTS = 6.0, 2.0, 24
BEYOND_S = 0.2  # a run goes on for so long after what is measured: at its end the view is held

Watch = Callable[[str, int, int], None]  # what is being done, how much is done, of how much


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is to be measured: the product of configurations, cores and methods."""

    configs: tuple[Path, ...]
    out: Path
    methods: tuple[str, ...] = METHODS
    cores: tuple[float, ...] = (1.0,)
    seconds: float = SECONDS  # measured, after the warm-up
    warm_up_s: float = WARM_UP_S
    moments: int = MOMENTS
    spp: int = SAMPLES_A_PIXEL  # of the ideal pictures
    keep: bool = False  # the recorded pictures too

    def check(self) -> None:
        """Raises ConfigError, RunError where this cannot be measured here."""
        check_names(self.configs)
        for cores in self.cores:
            cpu_limit.check(cores)

    @property
    def times(self) -> list[float]:
        """The moments that are compared, seconds of the camera's path."""
        return moments(self.moments, first=self.warm_up_s, seconds=self.seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of it."""

    rows: list[Row]  # of what was asked for, those that were there too
    failures: list[str]  # runs that failed, and why
    notes: list[str]


def sweep(wanted: Wanted, watch: Watch) -> Outcome:
    """Measure what is not in `wanted.out` yet. A run that fails keeps no other from being measured.

    Raises ConfigError, RunError for what can be refused before the first run.
    """
    wanted.check()
    outcome = Outcome(rows=[], failures=[], notes=[])
    loaded = [load_without_windows(config) for config in wanted.configs]
    for one in loaded:
        watch(f"{one.path.stem}: loading the scene", 0, len(loaded))
        plan = moving(one)
        outcome.notes.extend(notes_of(plan, wanted))
        ideal = Ideal(plan, wanted.times, wanted.out, spp=wanted.spp)
        for cores in wanted.cores:
            _compare(wanted, plan.layout.loaded, ideal, cores, watch, outcome)
    return outcome


def notes_of(plan: Plan, wanted: Wanted) -> list[str]:
    """What a reader of the rows should know of a configuration."""
    name, path, end = plan.layout.loaded.path.stem, plan.view.path, wanted.warm_up_s + wanted.seconds
    if isinstance(path, KeyframesPathConfig) and not path.loop and path.keyframes[-1].time < end:
        return [f"{name}: the camera rests from {path.keyframes[-1].time:g} s on; moments are compared until {end:g} s"]
    return []


def _compare(wanted: Wanted, loaded: Loaded, ideal: Ideal, cores: float, watch: Watch, outcome: Outcome) -> None:
    """Every method on so many cores, and their strip and film."""
    name, path, rows, measured = loaded.path.stem, wanted.out / FILE, [], False
    have = {row.identity: row for row in newest(json_lines.read(path, Row))}
    folder = wanted.out / f"{name}-{cores:g}cores"
    for done, method in enumerate(wanted.methods):
        text = text_for(loaded, method)
        row = have.get((name, method, cores, setup_of(text, wanted), ideal.key))
        if row is None:
            ideal.make(lambda k, n: watch(f"{name}: ideal pictures", k, n))
            watch(f"{name}, {cores:g} cores: {method}", done, len(wanted.methods))
            try:
                row = measure(wanted, loaded, text, ideal, method=method, cores=cores)
            except RunError as error:
                outcome.failures.append(f"{name}, {cores:g} cores, {method}: {error}")
                continue
            json_lines.append(path, row)
            measured = True
        rows.append(row)
    outcome.rows.extend(rows)
    if rows and (measured or not (folder / "film.mp4").exists()):
        watch(f"{name}: strip and film", len(rows), len(rows))
        _compose(folder, rows)


def setup_of(text: str, wanted: Wanted) -> str:
    """A hash of what is run: the configuration under a method, for how long."""
    return hashlib.blake2b(f"{wanted.seconds} {wanted.warm_up_s} {text}".encode(), digest_size=12).hexdigest()


def measure(wanted: Wanted, loaded: Loaded, text: str, ideal: Ideal, *, method: str, cores: float) -> Row:
    """Run a configuration under a method, and hold what it showed against the ideal pictures."""
    folder = wanted.out / f"{loaded.path.stem}-{cores:g}cores" / method
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / f"{loaded.path.stem}.yaml"
    config.write_text(text, encoding="utf-8")
    load = os.getloadavg()[0]
    run = run_wall(config, folder, seconds=wanted.warm_up_s + wanted.seconds + BEYOND_S, cores=cores)
    shown = Shown(run.pictures)
    row = _row(wanted, run, shown, ideal, method=method, cores=cores, config=loaded.path.stem, load=load,
               setup=setup_of(text, wanted))  # fmt: skip
    _keep(folder, shown, ideal, wanted, film_hz(loaded.config.views[0].refresh_hz))
    if not wanted.keep:
        shutil.rmtree(folder / PICTURES)
    return row


def _row(
    wanted: Wanted, run: Run, shown: Shown, ideal: Ideal, *, method: str, cores: float, config: str, load: float,
    setup: str,
) -> Row:  # fmt: skip
    summary, latency = run.summary, run.summary["latency_ms"]
    error, pace = score(shown, ideal), shown.timeline.intervals(wanted.warm_up_s, wanted.seconds)
    return Row(
        config=config,
        method=method,
        cores=cores,
        rmse_display=error.rmse_display,
        flip=error.flip,
        ssim=error.ssim,
        refresh_hz=pace.refresh_hz,
        interval_p95_ms=pace.p95_ms,
        latency_p50_ms=latency["p50"],
        latency_p95_ms=latency["p95"],
        latency_p99_ms=latency["p99"],
        samples_per_s=float(sum(rank["samples_per_s"] for rank in summary["ranks"])),
        bytes_per_s=float(sum(rank["bytes_per_s"] for rank in summary["ranks"])),
        cpu_s=cpu_by_role(summary["ranks"]),
        run_s=summary["seconds"],
        seconds=wanted.seconds,
        warm_up_s=wanted.warm_up_s,
        panels=len(ideal.wall.panels),
        pixels=sum(width * height for width, height in (panel.pixels for panel in ideal.wall.panels)),
        display_delay_s=run.pictures.display_delay_s,
        error_over_time=error.over_time,
        times=ideal.times,
        log_cpu_s=run.pictures.cpu_s,
        dropped=summary["dropped"],
        setup=setup,
        reference=ideal.key,
        spp=ideal.spp,
        load=round(load, 2),
        commit=record.commit(),
        machine=record.machine(),
        command=record.command(),
    )


def cpu_by_role(ranks: Sequence[dict[str, Any]]) -> dict[str, float]:
    """CPU seconds of all ranks of each role, from the ranks of summary.json."""
    found: dict[str, float] = {}
    for rank in ranks:
        found[rank["role"]] = round(found.get(rank["role"], 0.0) + rank["cpu_s"], 3)
    return found


def _keep(folder: Path, shown: Shown, ideal: Ideal, wanted: Wanted, hz: float) -> None:
    """Write what strip and film are made of: the pictures of one moment, and the film of this run."""
    k = len(ideal.times) // 2
    _write(folder.parent / "ideal.png", wall_image(ideal.wall, lambda panel: ideal.codes(panel.id, k)))
    _write(folder / "shown.png", wall_image(ideal.wall, lambda panel: shown.codes(panel, ideal.times[k])))

    def image(time: float) -> Bytes:
        return scaled(wall_image(ideal.wall, lambda panel: shown.codes(panel, time)), OWN_WIDTH)

    count = round(wanted.seconds * hz)
    write_film(folder / "film.mp4", (image(wanted.warm_up_s + n / hz) for n in range(count)), hz=hz)


def _compose(folder: Path, rows: Sequence[Row]) -> None:
    """strip.png and film.mp4 of methods that were measured on the same configuration and cores."""
    shown = {row.method: (_read(folder / row.method / "shown.png"), _middle(row.error_over_time)) for row in rows}
    _write(folder / "strip.png", strip(_read(folder / "ideal.png"), shown))
    films = {
        f"{row.method}: RMSE {255.0 * row.rmse_display:.2f} codes, {row.refresh_hz:.1f} Hz": folder / row.method
        for row in rows
    }
    hz = _hz_of(folder / rows[0].method / "film.mp4")
    paths = {text: path / "film.mp4" for text, path in films.items()}
    write_film(folder / "film.mp4", side_by_side(paths), hz=hz, quality=QUALITY)


def _middle(values: Sequence[float]) -> float:
    return values[len(values) // 2]


def _hz_of(film: Path) -> float:
    import av

    with av.open(str(film)) as opened:
        return float(opened.streams.video[0].average_rate or 0)


def _read(path: Path) -> Bytes:
    return np.asarray(Image.open(path).convert("RGB"))


def _write(path: Path, image: Bytes) -> None:
    with replaced(path) as part:
        Image.fromarray(image).save(part, format="PNG")
