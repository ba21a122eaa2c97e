"""Frames of an animation or of a recorded run: rendered one after the other, written as files, encoded as a film.

Each is the image of `wall render` at its moment, made from the scene, whatever a wall could show of it in time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.commands.offline import event_at
from wall.commands.one_view import plans_of_views
from wall.commands.whole_image import ViewPart, assembled, display_of, parts_of
from wall.core.data import Event, Float32
from wall.core.errors import ConfigError
from wall.core.mpi import under_mpi
from wall.display.film import check_film, write_film
from wall.display.image_file import Display, Over, check_suffix, write_image
from wall.roles.plan import Plan
from wall.sampling.pixel_layers import blank_columns
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

Done = Callable[[int], None]  # is told how many frames are done
Moment: TypeAlias = Sequence[Event]  # of each view
Frame: TypeAlias = tuple[Float32, Display]  # (h, w, 3) float32 linear RGB, and how it is displayed
MOST_FRAMES = 1_000_000
MOST_HZ = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """How frames are rendered."""

    spp: int  # samples a pixel
    seed: int
    size: tuple[int, int] | None = None  # width and height, pixels; None: the wall's own


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """Where frames go: files by a pattern, a film, or both."""

    pattern: Path | None = None  # whose name has #### in place of the frame's number
    film: Path | None = None
    over: Over | None = None  # draws over each

    def check(self) -> None:
        """Refuse what cannot be written. Raises ConfigError."""
        if under_mpi():
            raise ConfigError("frames are rendered by the cores of one machine: start it without mpirun")
        if self.pattern is not None:
            check_suffix(self.pattern)
            if len(re.findall("#+", self.pattern.name)) != 1:
                raise ConfigError(f"-o {self.pattern}: wanted one #### in the name, for the number of the frame")
        if self.film is not None:
            check_film(self.film, "--film")

    def file(self, number: int) -> Path:
        """The file of a frame."""
        assert self.pattern is not None
        name = re.sub("#+", lambda found: f"{number:0{len(found[0])}d}", self.pattern.name)
        return self.pattern.with_name(name)


def parse_frames(text: str) -> range:
    """The frames of FIRST:LAST or FIRST:LAST:STEP, the last one included. Raises ConfigError."""
    found = re.fullmatch(r"(\d{1,9}):(\d{1,9})(?::(\d{1,9}))?", text)
    first, last, step = (int(part or 1) for part in found.groups()) if found else (1, 0, 1)
    if last < first or step < 1 or (last - first) // step >= MOST_FRAMES:
        wanted = f"FIRST:LAST or FIRST:LAST:STEP, such as 0:119, at most {MOST_FRAMES:,} frames"
        raise ConfigError(f"--frames {text}: wanted {wanted}")
    return range(first, last + 1, step)


def checked_rate(rate: float, option: str = "--rate") -> float:
    """Frames a second. Raises ConfigError."""
    if not 0.0 < rate <= MOST_HZ:
        raise ConfigError(f"{option} {rate:g}: wanted frames a second, above 0, at most {MOST_HZ:g}")
    return rate


def render_frames(plan: Plan, quality: Quality, numbers: range, targets: Targets, *, rate: float, done: Done) -> None:
    """Render frames of a plan's views, of the moments number / rate, seconds, and write them.

    Raises RunError naming a file that cannot be written.
    """
    plans = plans_of_views(plan)
    moments = ([event_at(own, number / rate) for own in plans] for number in numbers)
    frames = rendered_frames(plan, make_tracer_scene(plan.scene), moments, quality)
    write_frames(frames, numbers, targets, hz=rate_of(rate, numbers.step), done=done)


def rendered_frames(
    plan: Plan, tracer_scene: TracerScene, moments: Iterable[Moment], quality: Quality
) -> Iterator[Frame]:
    """The image of all views in each moment. A view that shows the same as before is not rendered again."""
    parts = [_RenderedPart(part, tracer_scene, quality.spp) for part in parts_of(plan, quality.size, seed=quality.seed)]
    bands = [band for part in parts for band in part.bands]
    image = np.zeros((0, 0, 3), np.float32)
    for moment in moments:
        changed = [part.render(event) for part, event in zip(parts, moment, strict=True)]
        if any(changed):
            image = assembled(bands, [band for part in parts for band in part.rendered], blank_columns(()))
        yield image, display_of([part.part for part in parts], [event.tone for event in moment])


class _RenderedPart:
    """A view's part of the image, as it was rendered last."""

    def __init__(self, part: ViewPart, tracer_scene: TracerScene, spp: int) -> None:
        self.part, self.bands, self.rendered = part, part.bands, list[Float32]()
        self._renderer = part.renderer(tracer_scene, spp=spp)
        self._seen: object = None

    def render(self, event: Event) -> bool:
        """Render the part under an event, unless it shows the same as before. Returns whether it was rendered."""
        seen = event.camera, event.scene_time, event.edits.of_scene
        if seen == self._seen:
            return False
        self._renderer.event, self._seen = event, seen
        self.rendered = list(self._renderer.bands(self.bands, lambda band: band))
        return True


def write_frames(frames: Iterable[Frame], numbers: range, targets: Targets, *, hz: Fraction, done: Done) -> None:
    """Write each image to its file and to the film, which shows `hz` a second.

    Raises RunError naming a file that cannot be written.
    """
    written = _written(frames, numbers, targets, done)
    if targets.film is not None:
        write_film(targets.film, written, hz=hz)
    else:
        for _ in written:
            pass


def _written(frames: Iterable[Frame], numbers: range, targets: Targets, done: Done) -> Iterator[NDArray[np.uint8]]:
    for count, ((image, display), number) in enumerate(zip(frames, numbers, strict=True), 1):
        if targets.pattern is not None:
            write_image(targets.file(number), image, display=display, over=targets.over)
        codes = display(image)
        if targets.over is not None:
            targets.over(codes)
        yield codes
        done(count)


def rate_of(rate: float, step: int = 1) -> Fraction:
    """Images a second of a film of every `step`th frame."""
    return Fraction(rate).limit_denominator(1001) / step
