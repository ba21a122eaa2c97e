"""One configuration after another in a running rank: made in a thread beside what runs, adopted between two batches."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from wall.config.loading import loads, read_text
from wall.core.errors import ConfigError, RunError, WallError
from wall.core.system import available_bytes
from wall.packets.control import Adopt, Prepare, Prepared
from wall.roles.instructions import Changed, PlanMade, Role
from wall.roles.joining import grown
from wall.roles.plan import Plan, check_files, make_layout, make_plan, reconstructed_at_renderers
from wall.roles.reloading import as_run, check_fits
from wall.run.host_memory import check_next
from wall.run.tracers import Tracers
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

LOOK_S = 0.25  # between looks at a file that is watched
Makes = Callable[[Plan, TracerScene, Role], tuple[Role, Tracers | None]]  # what a rank is under a plan, after a role


class Preparer:
    """Makes plans, in a thread, of configurations that a run may adopt: the newest one is kept.

    At the head, manager and compositor share one.
    """

    def __init__(self, plan: Plan, machines: Sequence[str]) -> None:
        """`plan`: what runs; `machines`: of every rank."""
        self._plan, self.machines = plan, machines
        self._lock = threading.Lock()
        self._begun = plan.number
        self._newest: tuple[PlanMade, TracerScene | None] | None = None
        self._news: deque[PlanMade] = deque()

    def begin(self, wanted: Prepare) -> None:
        """Begin to make a plan, unless that was done."""
        with self._lock:
            if wanted.number <= self._begun:
                return
            self._begun = wanted.number
        threading.Thread(target=self._make, args=(wanted,), name="preparer", daemon=True).start()

    def make(self, number: int, text: str, path: str) -> tuple[Plan, TracerScene]:
        """Make a plan at once, for a rank that begins with it. Raises RunError."""
        self._begun = number
        self._make(Prepare(number=number, text=text, path=path))
        if (taken := self.take(number)) is None:
            raise RunError(self._newest[0].refused if self._newest is not None else path)
        return taken

    def _make(self, wanted: Prepare) -> None:
        plan: Plan | None = None
        scene: TracerScene | None = None
        refused, left = "", available_bytes()  # all ranks are asked at once
        try:
            loaded = loads(wanted.text, name=wanted.path, path=Path(wanted.path))
            layout = make_layout(as_run(self._plan.layout, loaded))
            check_fits(self._plan.layout, layout)
            check_files(layout)
            layout = grown(reconstructed_at_renderers(layout, self.machines), self._plan.layout.extra)
            plan = replace(make_plan(layout), number=wanted.number, cores=self._plan.cores)
            check_next(plan, self.machines, left)
            scene = make_tracer_scene(plan.scene)
            warm_up(plan, scene, lambda line: None, beside=True)
        except WallError as error:
            plan, refused = None, str(error)
        except Exception as error:  # the run that is shown must not end by it
            plan, refused = None, f"{wanted.path}: {type(error).__name__}: {error}"
        with self._lock:
            if wanted.number == self._begun:
                made = PlanMade(wanted.number, plan, refused)
                self._newest = made, scene
                self._news.append(made)

    def news(self) -> Iterator[PlanMade]:
        """What was made since this was asked last, for the manager."""
        while self._news:
            yield self._news.popleft()

    def made(self, number: int) -> PlanMade | None:
        """The plan of a configuration; None while it is being made."""
        newest = self._newest
        return newest[0] if newest is not None and newest[0].number == number else None

    def take(self, number: int) -> tuple[Plan, TracerScene] | None:
        """The plan and its scene, to be run from now on; None where it was not made."""
        newest = self._newest
        if newest is None or newest[0].number != number or newest[0].plan is None or newest[1] is None:
            return None
        self._plan = newest[0].plan
        return newest[0].plan, newest[1]


class Succession:
    """A rank's side of a reload: it prepares when asked, and says when there is something to adopt."""

    def __init__(self, rank: int, preparer: Preparer, makes: Makes) -> None:
        self._rank, self._preparer, self._makes = rank, preparer, makes
        self._asked = self._adopted = 0  # numbers of configurations

    def prepare(self, message: Prepare) -> None:
        """Prepare, and answer once more if that is asked for once more."""
        self._asked = message.number
        self._preparer.begin(message)

    def answers(self) -> Iterator[Prepared]:
        """What the manager waits for."""
        if self._asked and (made := self._preparer.made(self._asked)) is not None:
            self._asked = 0
            yield Prepared(rank=self._rank, number=made.number, refused=made.refused)

    def adopt(self, message: Adopt, before: Role) -> tuple[Role, Tracers | None] | None:
        """What this rank is from now on; None where nothing changes."""
        taken = self._preparer.take(message.number) if message.number > self._adopted else None
        if taken is None:
            return None
        self._adopted = message.number
        plan, scene = taken
        return self._makes(replace(plan, since=message.since), scene, before)


class FileWatch:
    """Notices that a file has another text; looks so often that a person who saves it does not wait."""

    def __init__(self, path: Path) -> None:
        self._path, self._looked = path, time.monotonic()
        self._stamp, self._text = self._now(), _text_of(path)

    def _now(self) -> tuple[int, int]:
        try:
            found = self._path.stat()
        except OSError:
            return 0, 0  # an editor may be replacing it
        return found.st_mtime_ns, found.st_size

    def changes(self) -> Iterator[Changed]:
        """The new text, once it has not changed between two looks."""
        if time.monotonic() < self._looked + LOOK_S:
            return
        self._looked, before = time.monotonic(), self._stamp
        self._stamp = self._now()
        text = _text_of(self._path) if self._stamp == before else self._text
        if text and text != self._text:
            self._text = text
            yield Changed(text, str(self._path))


def _text_of(path: Path) -> str:
    """The text of a file; "" while it cannot be read."""
    try:
        return read_text(path)
    except ConfigError:
        return ""
