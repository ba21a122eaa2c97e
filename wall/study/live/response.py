"""`wall measure response`: how soon a running wall shows an edit, and how soon its renderers turn to an input.

A wall is run as a user does, its images recorded. This process sends it edits as `wall set` does, at times that are in
step with nothing: a light is halved, and is as configured again.
"""

from __future__ import annotations

import math
import shutil
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType

from wall.client import Client, connect
from wall.config.loading import Loaded
from wall.config.sampling import ProgressiveSampling
from wall.core.errors import EditError, RunError, WallError
from wall.display.image_log import LoggedImages, LoggedPanel
from wall.roles.editing import editable
from wall.roles.plan import Plan, make_layout, make_plan
from wall.scene.parameters import Parameter, named
from wall.study import json_lines
from wall.study.live.cpu_limit import own_cores
from wall.study.live.rewriting import load_without_windows
from wall.study.live.runs import IMAGES, START_S, record_wall, written_anew
from wall.study.quality.tables import MET, MISSED, Table
from wall.study.speed import record

FILE, PROGRESSIVE = "response.jsonl", "progressive"
MOST_REFRESHES, MOST_ANSWER_MS = 2.0, 20.0  # what is wanted
WARM_UP_S = 3.0  # that a wall runs before the first edit
APART_S = (0.5, 1.0)  # from edit to edit, evenly spread
END_S = 3.0
SEED = 20050629
SIGMAS = 6.0  # by which pixels that follow an edit exceed the others; at least 37 pixels
NOTE = (
    f"Edit to pixel: from sending until the sinks have an image that shows it; wanted: {MOST_REFRESHES:g} refreshes. "
    f"Input to rays: until renderers break off what they trace, for it; wanted: {MOST_ANSWER_MS:g} ms. p50, p95."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was measured of one run: a line of the file, keys in this order."""

    config: str
    method: str
    parameter: str
    edits: int
    shown: int  # of them, before the next one came
    pixel_p50_ms: float  # from an edit to the first changed pixel
    pixel_p95_ms: float
    pixel_max_ms: float
    refresh_hz: float  # of the view: a refresh is 1 / refresh_hz
    answer_p50_ms: float  # from an input's coming to the head until a renderer traces for it
    answer_p95_ms: float
    answer_max_ms: float
    answers: int  # of all renderers
    pixels: int  # of all panels
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str


def measure(config: Path, method: str, *, edits: int, name: str, out: Path) -> Row:
    """Run a configuration with a method, and edit a parameter of it. Raises RunError, ConfigError, EditError."""
    loaded = load_without_windows(config)
    plan = make_plan(make_layout(loaded))
    parameter = edited_parameter(plan, name)
    folder = out / f"{config.stem}-{method}"
    path = written_anew(without_rests(loaded, method), method, folder)
    sender = Sender(folder, parameter, edits)
    seconds = WARM_UP_S + edits * APART_S[1] + END_S
    try:
        run = record_wall(path, folder, seconds=seconds, cores=own_cores(), options=("--still",))
        sender.end()
        found = [1e3 * wait for wait in waits(run.images, sender.sent) if wait is not None]
    finally:
        sender.end()
        shutil.rmtree(folder / IMAGES, ignore_errors=True)
    answers = [ms for rank in run.summary["ranks"] for ms in rank["answers_ms"]]
    row = Row(
        config=config.stem, method=method, parameter=parameter.name, edits=edits, shown=len(found),
        **_percentiles("pixel", found), refresh_hz=plan.view.refresh_hz, **_percentiles("answer", answers),
        answers=len(answers), pixels=sum(w * h for w, h in (panel.pixels for panel in plan.layout.wall.panels)),
        other_cores=round(run.other_cores, 3), commit=record.commit(), machine=record.machine(),
        command=record.command(),
    )  # fmt: skip
    json_lines.append(out / FILE, row)
    return row


def edited_parameter(plan: Plan, name: str) -> Parameter:
    """The parameter of a name, "": the first, that is light and not 0."""
    parameters = editable(plan)
    found = [named(parameters, name)] if name else list(parameters.values())
    usable = [p for p in found if (p.kind == "light" or p.name.endswith(".strength")) and max(p.default) > 0.0]
    if not usable:
        raise EditError(f"--parameter {name or '(any)'}: no light that could be halved; wanted one that is not 0")
    return usable[0]


def without_rests(loaded: Loaded, method: str) -> Loaded:
    """Where the progressive method is measured, there is always a tile to be broken off."""
    if method != PROGRESSIVE:
        return loaded
    sampling = loaded.config.sampling_of(0)
    threads = {"threads": sampling.threads, "seed": sampling.seed}
    own = sampling if isinstance(sampling, ProgressiveSampling) else ProgressiveSampling(**threads)
    views = tuple(view.model_copy(update={"sampling": None}) for view in loaded.config.views)
    own = own.model_copy(update={"rest_s": 0.0})
    return loaded.with_config(loaded.config.model_copy(update={"sampling": own, "views": views}))


class Sender(threading.Thread):
    """Sends a running wall edits of one parameter: half of what is configured, and back."""

    def __init__(self, folder: Path, parameter: Parameter, edits: int) -> None:
        super().__init__(name="edits", daemon=True)
        self.sent: list[float] = []  # when each was, seconds of this machine's monotonic clock
        self._folder, self._parameter, self._edits = folder, parameter, edits
        self._stopping, self._failure = threading.Event(), ""
        self.start()

    def end(self) -> None:
        """Wait for the last one. Raises RunError where the wall took none."""
        self._stopping.set()
        self.join()
        if self._failure:
            raise RunError(self._failure)

    def run(self) -> None:
        """Wait for the wall, then send edit after edit."""
        run = self._wall()
        if run is None or self._stopping.wait(WARM_UP_S):
            return
        pauses = np.random.default_rng(SEED).uniform(*APART_S, self._edits)
        try:
            with run:
                run.request()  # a first message that waits for the connection
                for number, pause in enumerate(pauses):
                    share = 0.5 if number % 2 == 0 else 1.0
                    self.sent.append(time.monotonic())
                    run.set({self._parameter.name: [share * x for x in self._parameter.default]})
                    if self._stopping.wait(pause):
                        return
        except WallError as error:
            self._failure = str(error)

    def _wall(self) -> Client | None:
        """A client of the wall, once it runs; None: the run has ended."""
        while not self._stopping.wait(0.02):
            try:
                return connect(self._folder, patience_s=START_S)
            except RunError:
                continue
        return None


def waits(log: LoggedImages, sent: Sequence[float]) -> list[float | None]:
    """Seconds from each edit to the first image that shows it; None: the next came first.

    The wall stands still, so that its k-th scene event is the k-th edit, from 1. Odd ones make it darker.
    """
    found: list[float | None] = [None] * len(sent)
    before: dict[str, LoggedPanel] = {}
    for panel in log.panels:
        last, before[panel.panel] = before.get(panel.panel), panel
        k = panel.scene_event - 1
        if not 0 <= k < len(sent) or found[k] is not None or last is None:
            continue
        if follows(log.rgb(panel), log.rgb(last), darker=k % 2 == 0):
            found[k] = panel.time - sent[k]
    return found


def follows(image: NDArray[np.uint8], before: NDArray[np.uint8], *, darker: bool) -> bool:
    """Whether so many pixels became darker, or brighter, that it is no noise: that goes as many ways as the other."""
    change = image.astype(np.int16).sum(axis=-1) - before.astype(np.int16).sum(axis=-1)
    down, up = int((change < 0).sum()), int((change > 0).sum())
    more = down - up if darker else up - down
    return more > SIGMAS * math.sqrt(down + up)


def _percentiles(name: str, values: Sequence[float]) -> dict[str, Any]:
    at = np.percentile(values, (50, 95, 100)).tolist() if len(values) else [math.nan] * 3
    return {f"{name}_{word}_ms": round(value, 3) for word, value in zip(("p50", "p95", "max"), at, strict=True)}


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    columns = (
        "wall", "method", "shown", "edit to pixel, ms", "refreshes", "met", "input to rays, ms", "met",
    )  # fmt: skip
    lines = tuple(map(_line, rows))
    yield Table(title="Response", columns=columns, lines=lines, text=(0, 1, 5, 7), note=NOTE).rich()
    yield f"rows in {out / FILE}"


def _line(row: Row) -> tuple[str, ...]:
    p50, p95 = (ms * row.refresh_hz / 1e3 for ms in (row.pixel_p50_ms, row.pixel_p95_ms))
    answers = row.answer_p50_ms, row.answer_p95_ms
    rays = (f"{answers[0]:.1f}, {answers[1]:.1f}", MET if answers[1] <= MOST_ANSWER_MS else MISSED)
    return (
        row.config, row.method, f"{row.shown} of {row.edits}",
        f"{row.pixel_p50_ms:.0f}, {row.pixel_p95_ms:.0f}", f"{p50:.2f}, {p95:.2f}",
        MET if p95 <= MOST_REFRESHES else MISSED, *(rays if row.method == PROGRESSIVE else ("", "")),
    )  # fmt: skip
