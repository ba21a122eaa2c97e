"""What viewers see of one view: commands and the time in, numbered events out.

All commands that arrive while an event is made share the next one (Ohlenburg and Broll, "Parallel Multi-View
Rendering on Multi-Core Processor Systems").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from wall.core.data import NO_EDITS, Camera, Edits, Event
from wall.geometry.steering import Command, Steering
from wall.roles.plan import Plan, first_event
from wall.roles.status import samplers_of
from wall.roles.tone import NO_PICTURE, tone_at
from wall.roles.tracking import Tracker
from wall.scene.parameters import Numbers

COMPARED_WITH = "adaptive"  # one of two samplers that are compared: the only one whose samples make their own image


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What users have made of a view."""

    steering: Steering | None
    bookmarks: dict[str, Steering]
    time: float  # its own, of the scene, seconds
    paused: bool  # that
    sampler: str
    compare: str
    statistics: bool


class Director:
    """What the viewer sees: the camera path or the steered camera, the animation's time, the sampler."""

    def __init__(
        self, plan: Plan, now: float, view: int = 0, others: Sequence[Director] = (), before: Director | None = None
    ) -> None:
        """`others`: of all views before this one, updated first: it may have the camera or the time of one of them.

        `before`: this view of the configuration before, or, where that had none, its first.
        """
        self._plan, self._view, self.view = plan, plan.views[view], view
        links = self._view.leader, self._view.clock
        self._leader, self._clock = (None if each is None else others[plan.views.index(each)] for each in links)
        self._steering: Steering | None = None
        self._bookmarks: dict[str, Steering] = {}
        self._own_time, self._last = self._view.time_after(0.0), now  # the first of those that have no other's
        self._paused = not self._view.runs
        self.sampler: str = plan.layout.sampling_of(view).method
        self.compare = ""  # with the adaptive sampler, whichever `sampler` is
        self.statistics = False
        self.tracker = Tracker(plan, view)
        self.event = first_event(plan, now, view)
        if before is not None:
            self._go_on_from(before)

    def _go_on_from(self, before: Director) -> None:
        """Time goes on; the camera stays steered, and the sampler chosen, where their configurations are the same.

        Cameras that were kept are of the view of that name alone.
        """
        self._last, self.statistics = before._last, before.statistics
        self._bookmarks = dict(before._bookmarks) if before.name == self.name else {}
        old, new = before._view, self._view
        alike = (old.clock is None, old.offset_s, old.runs) == (new.clock is None, new.offset_s, new.runs)
        if alike or self.view == 0:
            self._own_time, self._paused = before.time, before.paused
        if (old.still, old.path) == (new.still, new.path):
            self._steering = before._steering
        if before.tracker.key == self.tracker.key:
            self.tracker = before.tracker
        configured = before._plan.layout.sampling_of(before.view).method
        if configured == self.sampler and before.sampler in samplers_of(self._plan):
            self.sampler = before.sampler
        self.event = replace(self.event, camera=self.wall_camera(), scene_time=self.time, paused=self.paused)

    @property
    def kept(self) -> Kept:
        """What users have made of it so far."""
        return Kept(
            steering=self._steering, bookmarks=dict(self._bookmarks), time=self._own_time, paused=self._paused,
            sampler=self.sampler, compare=self.compare, statistics=self.statistics,
        )  # fmt: skip

    def keep(self, kept: Kept) -> None:
        """Go on from what users had made of this view under another director."""
        self._steering, self._bookmarks = kept.steering, dict(kept.bookmarks)
        self._own_time, self._paused = kept.time, kept.paused
        self.sampler, self.compare, self.statistics = kept.sampler, kept.compare, kept.statistics
        self.event = replace(
            self.event, camera=self.wall_camera(), scene_time=self.time, paused=self.paused,
            sampler=self.shown_sampler, compare=self.compare, statistics=self.statistics,
        )  # fmt: skip

    def update(
        self, commands: list[Command], now: float, edits: Edits = NO_EDITS, picture: Mapping[str, Numbers] = NO_PICTURE
    ) -> bool:
        """Apply what came in until `now`, with the edits of the scene. Returns whether there is a new event.

        `picture`: edits of exposure and tone mapping. They make a new event of the same number, and so do others that
        are not of the scene.
        """
        if not self._paused:
            self._own_time += now - self._last
        self._last = now
        for command in commands:
            self._apply(command)
        camera = self.wall_camera().tracked(self.tracker.eye(now), self._view.scale)
        scene_time = self.time if self._plan.scene.animated else 0.0
        old = self.event
        sampler = self.shown_sampler
        turned = camera != old.camera or (sampler, self.compare) != (old.sampler or sampler, old.compare)
        tone = tone_at(self._plan, scene_time, picture, view=self.view)
        moved = scene_time != old.scene_time or edits.of_scene != old.edits.of_scene
        if self._plan.layout.graph.sync != "none":
            moved |= tone != old.tone  # every change is a frame
        flags = self.paused, self.statistics, tone, edits.number
        if not turned and not moved and flags == (old.paused, old.statistics, old.tone, old.edits.number):
            return False
        self.event = Event(
            view=self.view,
            camera_event=old.camera_event + turned,
            scene_event=old.scene_event + moved,
            scene_time=scene_time,
            input_time=now,
            camera=camera,
            sampler=sampler,
            paused=self.paused,
            compare=self.compare,
            statistics=self.statistics,
            edits=edits,
            exposure=tone.stops,
            tone_mapping=tone.mapping,
        )
        return True

    def pause(self) -> None:
        """Begin paused."""
        self._paused = True

    def hold(self) -> bool:
        """Stop everything where it is. Returns whether that is news: then the event says that it is paused."""
        was, self._paused = self.event.paused, True
        self.event = replace(self.event, paused=True)
        return not was

    @property
    def shown_sampler(self) -> str:
        """The one whose image is the wall's, or its own half of a comparison."""
        return COMPARED_WITH if self.compare else self.sampler

    @property
    def name(self) -> str:
        """Of the view."""
        return self._view.id

    @property
    def steered(self) -> int:
        """The view that steering of this one steers: its own, or the one that it follows."""
        return self.view if self._leader is None else self._leader.steered

    @property
    def timed(self) -> int:
        """The view whose time that of this one is: its own, or the one that it follows."""
        return self.view if self._clock is None else self._clock.timed

    @property
    def time(self) -> float:
        """Of the scene, seconds."""
        return self._own_time if self._clock is None else max(0.0, self._clock.time + self._view.offset_s)

    @property
    def paused(self) -> bool:
        """Whether its time stands still."""
        return self._paused if self._clock is None else self._clock.paused

    @property
    def compares(self) -> bool:
        """Whether two samplers can be compared: other graphs have no second image, or no frames of it."""
        graph = self._plan.layout.graph
        return graph.plain and graph.sync == "none" and len(self._plan.views) == 1

    def wall_camera(self) -> Camera:
        """The camera of an eye that is not tracked."""
        if self._leader is not None:
            return self._leader.wall_camera()
        return self._steering.camera() if self._steering else self._view.camera_at(self.time)

    def _apply(self, command: Command) -> None:
        if command.kind == "pause":
            self._paused = command.value == "on" if command.value else not self._paused
        elif command.kind == "seek":  # not before the beginning
            self._own_time = max(0.0, self._own_time + command.x)
        elif command.kind == "reset":
            self._steering = None
        elif command.kind == "bookmark":
            self._bookmarks[command.value] = self._steering or Steering.from_view(self._view, self.time)
        elif command.kind == "recall":
            self._steering = self._bookmarks.get(command.value, self._steering)
        elif command.kind == "sampler":
            self.sampler = command.value if command.value in samplers_of(self._plan) else self.sampler
            self.compare = ""
        elif command.kind == "compare":
            self.compare = command.value if self.compares else ""
        elif command.kind == "statistics":
            self.statistics = command.value == "on"
        else:
            steering = self._steering or Steering.from_view(self._view, self.time)
            self._steering = steering.apply(command)
