"""`wall measure rows`: what it gains to make each row of a scanning display for the moment when it is seen.

The roles of a run, in one process, on a clock that is turned by hand: every sampler traces the same samples a second,
events come twice a refresh, and figures do not depend on the machine. What is light at a moment is held against the
reference image, each of whose rows is of its own moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import RenderableType

from wall.core.data import Event
from wall.display.base import WallImage
from wall.display.image_log import ImageLog, read_log
from wall.roles.manager import EVENTS_A_REFRESH
from wall.roles.plan import Plan, aimed, first_event, make_layout
from wall.run.single_process import SingleProcess
from wall.study import json_lines, options
from wall.study.live.reference import WallReference
from wall.study.live.rewriting import (
    ROWS,
    Rows,
    load_without_windows,
    moving,
    sampling_for,
    with_rows,
)
from wall.study.live.scores import Shown, score
from wall.study.live.timeline import moments
from wall.study.quality.tables import Table
from wall.study.speed import record
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

FILE, IMAGES = "rows.jsonl", "recorded"
NEEDED = {"flip_evaluator": "flip-evaluator", "skimage": "scikit-image"}
BATCH = 256  # samples: a refresh waits for the batch that is under way
IDLE_S = 1e-3  # where nothing was missing
BEYOND_S = 0.1  # a run goes on for so long after the last moment
NOTE = (
    "RMSE of display values in 8-bit codes, against the reference image of each moment, whose rows are each of their "
    "own. Rows known: each is made for its moment; middle: all for that of the middle row; ignored: row_time 0, where "
    "only the adaptive sampler predicts. Gain: of known against middle."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """How it is measured."""

    out: Path
    rate: float = 400_000.0  # samples a second of a renderer
    seconds: float = 2.0  # measured
    warm_up_s: float = 0.5
    moments: int = 24
    spp: int = 16  # of the reference images


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One run: a line of the file, keys in this order."""

    config: str
    method: str
    rows: str  # known, middle or ignored
    scan_s: float  # from the first row of the first panel to its last
    rmse_display: float  # over pixels, channels and moments; display values, 0 to 1
    flip: float
    ssim: float
    refresh_hz: float  # images that became light a second, of a panel
    rate: float  # samples a second of a renderer
    seconds: float
    moments: int
    spp: int
    commit: str
    command: str


def check_installed() -> None:
    """Raises RunError, before anything is measured, where the extra `measure` is not installed."""
    options.check_installed("wall measure rows", NEEDED)


def measure(config: Path, method: str, wanted: Wanted) -> list[Row]:
    """Run a wall with rows known, for one moment, and ignored. Raises RunError, ConfigError."""
    loaded = load_without_windows(config)
    plan = moving(loaded)
    if plan.layout.wall.scanned(0) is None:
        raise loaded.error(("wall",), "all rows of its displays are shown at once", "row_time above 0")
    times = moments(wanted.moments, first=wanted.warm_up_s, seconds=wanted.seconds)
    wanted.out.mkdir(parents=True, exist_ok=True)
    reference = WallReference(plan, times, wanted.out, spp=wanted.spp)
    reference.make(lambda done, of: None)
    scene, found = make_tracer_scene(plan.scene), []
    for rows in ROWS:
        shown = _run(_variant(plan, method, rows), scene, wanted, delay_s=plan.view.display_delay_s)
        error, pace = score(shown, reference), shown.timeline.intervals(wanted.warm_up_s, wanted.seconds)
        row = Row(
            config=config.stem, method=method, rows=rows, scan_s=plan.layout.wall.panels[0].scan_s,
            rmse_display=error.rmse_display, flip=error.flip, ssim=error.ssim, refresh_hz=pace.refresh_hz,
            rate=wanted.rate, seconds=wanted.seconds, moments=wanted.moments, spp=wanted.spp, commit=record.commit(),
            command=record.command(),
        )  # fmt: skip
        json_lines.append(wanted.out / FILE, row)
        found.append(row)
    return found


def _variant(plan: Plan, method: str, rows: Rows) -> Plan:
    """The plan under a method, with small batches, for a renderer that knows so much of rows."""
    loaded = with_rows(plan.layout.loaded, rows)
    sampling = sampling_for(loaded.config.sampling_of(0), method).model_copy(update={"samples_per_batch": BATCH})
    views = tuple(view.model_copy(update={"sampling": None}) for view in loaded.config.views)
    changed = loaded.config.model_copy(update={"sampling": sampling, "views": views})
    return aimed(make_layout(loaded.with_config(changed)), plan.scene)


def _run(plan: Plan, scene: TracerScene, wanted: Wanted, *, delay_s: float) -> Shown:
    """What is on the wall while its camera takes its path. `delay_s`: from a refresh to the light of its first row."""
    log = ImageLog(wanted.out / IMAGES)
    log.begin(began=0.0, display_delay_s=delay_s)
    process, wall = SingleProcess(plan, scene, at_renderers=False), plan.layout.wall
    tick_s, end = 1.0 / (plan.view.refresh_hz * EVENTS_A_REFRESH), wanted.warm_up_s + wanted.seconds + BEYOND_S
    while (now := process.clock.now()) < end:
        process.event = event_at(plan, int(now / tick_s), tick_s)
        traced = process.step()
        process.clock.time = now + (traced / wanted.rate if traced else IDLE_S)
        panels = tuple(process.composition.shown()[0].images())
        number = process.event.number
        image = WallImage(
            width=wall.width, height=wall.height, panels=panels, time=now, camera_event=number[0],
            scene_event=number[1],
        )  # fmt: skip
        log.take([image], now)
    log.close()
    return Shown(read_log(wanted.out / IMAGES))


def event_at(plan: Plan, tick: int, tick_s: float) -> Event:
    """What a manager publishes at a tick, as it was at its time."""
    time, first = tick * tick_s, first_event(plan, now=0.0)
    event = replace(first, camera_event=tick, input_time=time, camera=plan.view.camera_at(time))
    return replace(event, scene_event=tick, scene_time=time) if plan.scene.animated else event


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    columns = ("wall", "method", "Hz", "rows known", "middle", "ignored", "gain")
    lines = []
    for config, method in dict.fromkeys((row.config, row.method) for row in rows):
        own = {row.rows: row for row in rows if (row.config, row.method) == (config, method)}
        known, middle, ignored = (255.0 * own[name].rmse_display for name in ROWS)
        lines.append((
            config, method, f"{own['known'].refresh_hz:.0f}", f"{known:.2f}", f"{middle:.2f}", f"{ignored:.2f}",
            f"{1.0 - known / middle:.0%}",
        ))  # fmt: skip
    yield Table(title="Rows of scanning displays", columns=columns, lines=tuple(lines), text=(0, 1), note=NOTE).rich()
    yield f"rows in {out / FILE}"
