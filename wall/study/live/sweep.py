"""All runs of `wall measure live`, one after the other on the same cores, and what is made of their images."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wall.config.loading import Loaded
from wall.config.sampling import METHODS
from wall.config.views import KeyframesPathConfig, PathConfig
from wall.core.errors import ConfigError, RunError
from wall.geometry.panels import Wall
from wall.roles.plan import Plan
from wall.study import json_lines
from wall.study.live import cpu_limit
from wall.study.live.film import film_hz
from wall.study.live.jumps import jumps_of, moments_after, since_jump
from wall.study.live.reference import WallReference
from wall.study.live.results import compose, keep
from wall.study.live.rewriting import REDUCED, Rows, left_out, load_without_windows, moving, text_for, with_rows
from wall.study.live.rows import FILE, Row
from wall.study.live.runs import IMAGES, RecordedRun, record_wall
from wall.study.live.scores import Shown, score
from wall.study.live.timeline import moments
from wall.study.options import check_names
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
    spp: int = SAMPLES_A_PIXEL  # of the reference images
    keep: bool = False  # the recorded images too
    display_delay_s: float | None = None  # from a refresh to its light; None: the configuration's
    rows: Rows = "known"  # what renderers make of `row_time`; images are scored by it in any case

    def check(self) -> None:
        """Raises ConfigError, RunError where this cannot be measured here."""
        check_names(self.configs)
        try:
            self.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"--out {self.out}: {error.strerror}; wanted a folder that can be written") from error
        for cores in self.cores:
            cpu_limit.check(cores)

    def times_on(self, path: PathConfig | None) -> list[float]:
        """The moments that are compared, seconds of a camera's path: where it jumps, evenly after its jumps."""
        if jumps := self.jumps_on(path):
            return moments_after(jumps, self.moments, end=self.warm_up_s + self.seconds)
        return moments(self.moments, first=self.warm_up_s, seconds=self.seconds)

    def jumps_on(self, path: PathConfig | None) -> list[float]:
        """When the camera jumps while it is measured, seconds of its path."""
        return jumps_of(path, self.warm_up_s, self.seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One run: a configuration, a method, how many cores."""

    config: str  # its name
    method: str
    cores: float
    text: str  # YAML that is run
    setup: str  # a hash of what is run: the text, for how long, on what display
    folder: Path  # for all that the run leaves
    refresh_hz: float
    display_delay_s: float  # from a refresh to its light, or that of its first row

    @classmethod
    def of(cls, loaded: Loaded, method: str, cores: float, wanted: Wanted) -> Trial:
        """The trial of a configuration under a method."""
        name, text = loaded.path.stem, text_for(with_rows(loaded, wanted.rows), method)
        name += "" if wanted.rows == "known" else f"-rows-{wanted.rows}"
        what = f"{wanted.seconds} {wanted.warm_up_s} {wanted.display_delay_s} {text}"
        return cls(
            config=name, method=method, cores=cores, text=text, display_delay_s=_light_after(loaded, wanted),
            setup=hashlib.blake2b(what.encode(), digest_size=12).hexdigest(),
            folder=wanted.out / f"{name}-{cores:g}cores" / method, refresh_hz=loaded.config.views[0].refresh_hz,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of it."""

    rows: list[Row]  # of what was asked for, those that were there too
    failures: list[str]  # runs that failed, and why
    notes: list[str]


def _light_after(loaded: Loaded, wanted: Wanted) -> float:
    """Seconds from a refresh to the light of its first row."""
    return loaded.config.views[0].light_after_s if wanted.display_delay_s is None else wanted.display_delay_s


def sweep(wanted: Wanted, watch: Watch) -> Outcome:
    """Measure what is not in `wanted.out` yet. A run that fails keeps no other from being measured.

    Raises ConfigError, RunError for what can be refused before the first run.
    """
    wanted.check()
    outcome = Outcome(rows=[], failures=[], notes=[])
    loaded = [load_without_windows(config) for config in wanted.configs]
    outcome.notes.extend(filter(None, map(left_out, wanted.configs)))
    for one in loaded:
        watch(f"{one.path.stem}: loading the scene", 0, len(loaded))
        plan = moving(one)
        check_room(plan, wanted)
        outcome.notes.extend(notes_of(plan, wanted))
        reference = WallReference(plan, wanted.times_on(plan.view.path), wanted.out, spp=wanted.spp)
        for cores in wanted.cores:
            _compare(wanted, plan.layout.loaded, reference, cores, watch, outcome)
    return outcome


def check_room(plan: Plan, wanted: Wanted) -> None:
    """Raises RunError where the disk has no room: a mapped file on a full one ends the process without a word."""
    values = 3 * pixels_of(plan.layout.wall)
    recordings = len(wanted.methods) * len(wanted.cores) if wanted.keep else 1
    recorded = values * plan.view.refresh_hz * (wanted.warm_up_s + wanted.seconds + BEYOND_S) * recordings
    needed, free = recorded + values * 2 * wanted.moments, shutil.disk_usage(wanted.out).free  # reference: float16
    if needed > free:
        raise RunError(
            f"{plan.layout.loaded.path.stem}: recordings and reference images may need {needed / 1e6:.3g} MB in "
            f"{wanted.out}, and {free / 1e6:.2f} MB are free; wanted: another --out, fewer --seconds or --moments"
        )


def pixels_of(wall: Wall) -> int:
    """Of all panels."""
    return sum(width * height for width, height in (panel.pixels for panel in wall.panels))


def notes_of(plan: Plan, wanted: Wanted) -> list[str]:
    """What a reader of the rows should know of a configuration."""
    name, path, end = plan.layout.loaded.path.stem, plan.view.path, wanted.warm_up_s + wanted.seconds
    if isinstance(path, KeyframesPathConfig) and not path.loop and path.keyframes[-1].time < end:
        return [f"{name}: the camera rests from {path.keyframes[-1].time:g} s on; moments are compared until {end:g} s"]
    return []


def _compare(
    wanted: Wanted, loaded: Loaded, reference: WallReference, cores: float, watch: Watch, outcome: Outcome
) -> None:
    """Every method on so many cores, and their strip and film."""
    path, rows, measured = wanted.out / FILE, [], False
    have = {row.identity: row for row in json_lines.newest(json_lines.read(path, Row))}
    trials = [Trial.of(loaded, method, cores, wanted) for method in wanted.methods]
    for done, trial in enumerate(trials):
        row = have.get((trial.config, trial.method, cores, trial.setup, reference.key))
        if row is None:
            reference.make(lambda k, n: watch(f"{loaded.path.stem}: reference images", k, n))
            watch(f"{trial.config}, {cores:g} cores: {trial.method}", done, len(trials))
            try:
                row = measure(wanted, trial, reference)
            except RunError as error:
                outcome.failures.append(f"{trial.config}, {cores:g} cores, {trial.method}: {error}")
                continue
            json_lines.append(path, row)
            measured = True
        rows.append(row)
    outcome.rows.extend(rows)
    folder = trials[0].folder.parent
    if rows and (measured or not (folder / "film.mp4").exists()):
        watch(f"{trials[0].config}: strip and film", len(rows), len(rows))
        compose(folder, rows)


def measure(wanted: Wanted, trial: Trial, reference: WallReference) -> Row:
    """Run a wall, and hold what it showed against the reference images."""
    trial.folder.mkdir(parents=True, exist_ok=True)
    config = trial.folder / f"{trial.config}.yaml"
    config.write_text(trial.text, encoding="utf-8")
    seconds = wanted.warm_up_s + wanted.seconds + BEYOND_S
    try:
        run = record_wall(config, trial.folder, seconds=seconds, cores=trial.cores)
        shown = Shown(run.images, trial.display_delay_s, enlarges=trial.method in REDUCED)
        row = _row(wanted, trial, run, shown, reference)
        hz = film_hz(trial.refresh_hz)
        keep(trial.folder, shown, reference, first=wanted.warm_up_s, seconds=wanted.seconds, hz=hz)
    finally:
        if not wanted.keep:
            shutil.rmtree(trial.folder / IMAGES, ignore_errors=True)
    return row


def _row(wanted: Wanted, trial: Trial, run: RecordedRun, shown: Shown, reference: WallReference) -> Row:
    summary, latency = run.summary, run.summary["latency_ms"]
    error, pace = score(shown, reference), shown.timeline.intervals(wanted.warm_up_s, wanted.seconds)
    jumps = wanted.jumps_on(reference.path)
    return Row(
        config=trial.config,
        method=trial.method,
        cores=trial.cores,
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
        panels=len(reference.wall.panels),
        pixels=pixels_of(reference.wall),
        display_delay_s=trial.display_delay_s,
        error_over_time=error.over_time,
        times=reference.times,
        log_cpu_s=run.images.cpu_s,
        dropped=summary["dropped"],
        setup=trial.setup,
        reference=reference.key,
        spp=reference.spp,
        other_cores=round(run.other_cores, 3),
        commit=record.commit(),
        machine=record.machine(),
        command=record.command(),
        flip_over_time=error.flip_over_time,
        since_jump=since_jump(reference.times, jumps) if jumps else [],
    )


def cpu_by_role(ranks: Sequence[dict[str, Any]]) -> dict[str, float]:
    """CPU seconds of all ranks of each role, from the ranks of summary.json."""
    found: dict[str, float] = {}
    for rank in ranks:
        found[rank["role"]] = round(found.get(rank["role"], 0.0) + rank["cpu_s"], 3)
    return found
