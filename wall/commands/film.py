"""`wall replay --film`, `wall run --film`: what a run was to show, rendered anew at any rate, size, samples a pixel."""

from __future__ import annotations

import math
import shutil
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wall.commands.frames import (
    Done,
    Moment,
    Quality,
    Targets,
    checked_rate,
    rate_of,
    rendered_frames,
    write_frames,
)
from wall.commands.legends import legends_of
from wall.commands.one_view import plan_of_view
from wall.commands.progress import progress_bar
from wall.commands.terminal import console, errors
from wall.config.loading import nearest
from wall.core.data import Event
from wall.core.errors import ConfigError, RunError
from wall.core.mpi import under_mpi
from wall.geometry.cameras import View
from wall.roles.plan import Plan
from wall.run.replay import Recorded, open_recording, recorded_events
from wall.tracing.tracer_scene import make_tracer_scene

ROUNDED = 1e-9  # of a frame


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmOfRun:
    """The film of a run that has still to be made, from its events."""

    film: Path
    events: Path  # folder
    kept: bool  # the events stay
    rate: float
    spp: int
    view: str | None = None  # None: all, in their places

    def drop(self) -> None:
        """Remove the events, unless they were asked for."""
        if not self.kept:
            shutil.rmtree(self.events, ignore_errors=True)

    def make(self) -> None:
        """Make it; who ends that with Ctrl-C is told how to go on. Raises RunError."""
        try:
            make_film(self.events, self.film, Quality(spp=self.spp, seed=1), rate=self.rate, view=self.view)
        except BaseException:
            command = f"wall replay {self.events} --film {self.film} --rate {self.rate:g} --spp {self.spp}"
            command += f" --view {self.view}" if self.view else ""
            errors.print(f"note: {self.film} is not finished; {command} makes it", soft_wrap=True)
            raise
        self.drop()


def film_of_run(
    film: Path, record: Path | None, views: Sequence[str], *, rate: float, spp: int, view: str | None = None
) -> FilmOfRun:
    """The film that `wall run` is to make, checked before the run begins. Raises ConfigError.

    `record`: where the run's events are to stay; None: they are beside the film, until it is made. `views`: names of
    the configuration's; `view`: the one that is shown, None: all of them.
    """
    if under_mpi():
        raise ConfigError("--film under mpirun: wanted --record FOLDER, of all machines, then wall replay --film")
    if view is not None and view not in views:
        raise ConfigError(f"--film-view {view}: no such view; accepted: {', '.join(views)}{nearest(view, views)}")
    Targets(film=film).check()
    events = record or film.with_suffix(".events")
    if record is None and events.exists():
        raise ConfigError(
            f"--film {film}: {events} is there already, of a run whose film was not finished (wall replay {events} "
            f"--film {film} makes it); wanted: another name, or that folder removed"
        )
    rate = checked_rate(rate, "--film-rate")
    return FilmOfRun(film=film, events=events, kept=record is not None, rate=rate, spp=spp, view=view)


def make_film(folder: Path, film: Path, quality: Quality, *, rate: float, view: str | None) -> None:
    """Render a film as replay_film does, with a bar, and say what came of it."""
    with progress_bar("rendering frames") as update:
        count = replay_film(
            folder, film, quality,
            rate=rate,
            view=view,
            total=lambda total: update(total=total),
            done=lambda done: update(completed=done),
        )  # fmt: skip
    console.print(f"wrote {film}: {count} frames at {rate:g} Hz, {quality.spp} samples a pixel")


def replay_film(
    folder: Path, film: Path, quality: Quality, *, rate: float, view: str | None, total: Done, done: Done
) -> int:
    """Render the film of one view of a recorded run; of all, and its legends, if `view` is None. Returns how many
    frames it has.

    `total` is told how many there will be. Raises ConfigError, and RunError.
    """
    targets = Targets(film=film)
    targets.check()
    rate = checked_rate(rate)
    recorded = open_recording(folder)
    plan, moments = frames_of(recorded, view=view, rate=rate)
    if view is None:  # legends stand on the wall, wherever views are
        legends, small = legends_of(plan.layout, quality.size)
        targets = replace(targets, over=legends.draw)
        for why in small:
            errors.print(f"note: {why}, and is left out")
    total(len(moments))
    frames = rendered_frames(plan, make_tracer_scene(plan.scene), moments, quality)
    write_frames(frames, range(len(moments)), targets, hz=rate_of(rate), done=done)
    return len(moments)


def frames_of(recorded: Recorded, *, view: str | None, rate: float) -> tuple[Plan, list[Moment]]:
    """The plan of a view, or of all, and what it shows in each frame, from the run's first event to its end."""
    names = [each.id for each in recorded.plan.layout.config.views]
    if view is not None and view not in names:
        raise ConfigError(f"--view {view}: {recorded.folder} has no such view; accepted: {', '.join(names)}")
    plan = recorded.plan if view is None else plan_of_view(recorded.plan, view)
    numbers = range(len(names)) if view is None else [names.index(view)]
    shown, ends = zip(*(recorded_events(recorded, number) for number in numbers), strict=True)
    for number, events in zip(numbers, shown, strict=True):
        if not events:
            wanted = "a run that had begun, or --view of another one"
            raise RunError(f"{recorded.folder}: holds no event of view {names[number]}; wanted {wanted}")
    began = min(events[0].input_time for events in shown)
    count = 1 + math.floor(max(0.0, max(ends) - began) * rate + ROUNDED)
    times = (began + k / rate for k in range(count))
    return plan, [[shown_at(own, events, t) for own, events in zip(plan.views, shown, strict=True)] for t in times]


def shown_at(view: View, events: Sequence[Event], time: float) -> Event:
    """What is shown at a time, seconds of the head's clock: the newest event by then.

    Until the next event the animation goes on, and with it a camera that follows its path; a steered one stays.
    """
    number = bisect_right(events, time, key=lambda event: event.input_time) - 1
    event = events[max(number, 0)]
    following = events[number + 1] if 0 <= number < len(events) - 1 else event
    if event.paused or following.scene_time <= event.scene_time:
        return event
    scene_time = min(event.scene_time + (time - event.input_time), following.scene_time)
    camera = view.camera_at(scene_time) if event.camera == view.camera_at(event.scene_time) else event.camera
    return replace(event, scene_time=scene_time, camera=camera)
