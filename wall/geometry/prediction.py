"""Predict camera and scene at the moment a refresh becomes light, from the newest inputs and past predictions.

Pure: events and times in, an event out, never the clock. The scene's time runs on, exactly, unless it is paused. The
camera goes on by the twist between its newest two inputs (dead reckoning at constant speed in its own frame; compared
with other orders by LaValle et al., "Head Tracking for the Oculus Rift", 2014), times a trust in each of the six
components, learnt from how far it really went:

    trust = (sum of foreseen * came) / (sum of foreseen^2), within 0 and 1

the least-squares gain of the past foresights, newer ones weighing more (a one-tap Wiener predictor, adapted as by
Widrow and Hoff, 1960, but solved at every step). A smooth motion has trust 1; of a trembling hand, whose foresights are
as often wrong as right, little is left. Silence ends the motion, and what jumps is not foreseen to jump again.

Bound, for a camera path whose twist rate changes by at most a per second, heard every s seconds: h seconds beyond the
newest input a fully trusted foresight is off by at most a h (h + s) / 2, to first order in the turn of that time. A
less trusted one is in no component farther off than the worse of that and of no foresight at all.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from wall.core.data import STILL, Camera, Event, Float64
from wall.geometry.moving import MovingEvent
from wall.geometry.twist import between, moved

SPACING_S = 0.004  # inputs nearer together count as one: their difference would be mostly noise of their times
REMEMBERED = 16  # inputs
LONGEST_S = 0.1  # beyond the newest input nothing is foreseen: a viewer reacts in twice that time
MISSED, GONE = 1.5, 4.0  # usual intervals without an input: the motion begins to fade, has ended
GONE_S = 0.1  # or after so long in any case
JUMP = 16.0  # times as fast as just before is no motion but a cut
FORGETTING = 0.6  # weight of each foresight against the next
HOPE = 0.1  # weight of the present foresight, which nobody has seen come true yet: there must be a beginning
JUDGED_S = 0.012  # foresights nearer together would be one judgement that counts twice
OUTLIER = 2.0  # times what was foreseen: what came counts as no more, so that a cut does not spoil the trust for long


class Input(NamedTuple):
    """A camera that was heard, and when."""

    time: float  # seconds of the head's clock
    camera: Camera


class Foresight(NamedTuple):
    """A prediction that is checked once its moment has come."""

    moment: float  # that it is for
    camera: Camera  # it started from
    twist: Float64  # (6,) it expected, with full trust


class Predictor:
    """`take` every event in its order, `at` every refresh. Without prediction it gives the newest event."""

    def __init__(self, delay: float, *, on: bool = True, moving: bool = False, scale: float = 1.0) -> None:
        """`delay`: seconds from a refresh to its light; `moving`: tell how what is expected goes on: MovingEvent.

        `scale`: world units a metre of the wall. A tracked eye comes predicted already, so that it stays before the
        wall where it is, and only the wall's motion in the world goes on.
        """
        self._delay, self._on, self._moving, self._scale = delay, on, moving, scale
        self._event: Event | None = None
        self._scene_runs = False
        self._inputs: deque[Input] = deque(maxlen=REMEMBERED)
        self._foresights: deque[Foresight] = deque(maxlen=REMEMBERED)
        self._agreement, self._energy = np.zeros(6), np.zeros(6)
        self._predicted: Event | None = None
        self._count = 0

    def take(self, event: Event) -> None:
        """The newest event. One that is paused, or the first after a pause, starts anew: its clock stopped the path."""
        last = self._event
        if last == event:
            return  # said again
        self._event = event
        if last is None or last.paused != event.paused or event.input_time < last.input_time:
            self._scene_runs = False
            self._start(event)
            return
        self._scene_runs = not event.paused and event.scene_time != last.scene_time
        if self._wall(event) != self._wall(last):
            self._add(event)

    def at(self, now: float, later: float = 0.0, *, next_in: float | None = None) -> Event:
        """The event expected `later` seconds after a refresh at `now` (of the head's clock) could become light.

        It is the newest event itself, the same object, where nothing is expected to move; else it has a number of its
        own, below any real one's. Raises ValueError before the first event was taken.

        next_in : seconds; not None: the same for the refresh after so long, which rays of now are for. What is
            foreseen for rays is not judged, and reaches up to twice as far: wherever from, they are of the scene as
            it is
        """
        event = self._event
        if event is None:
            raise ValueError("nothing to predict from: no event was taken yet")
        wait = min(next_in or 0.0, LONGEST_S)
        moment, longest = now + wait + later + self._delay, LONGEST_S + wait
        if not self._on or not math.isfinite(moment):
            return event
        camera, twist = self._camera(now, moment, longest, judged=next_in is None)
        ahead = min(max(moment - event.input_time, 0.0), longest) if self._scene_runs else 0.0
        if camera == event.camera and ahead == 0.0:
            return event
        scene_time, last = event.scene_time + ahead, self._predicted
        if next_in is not None:
            rays = replace(event, camera=camera, scene_time=scene_time)
            return self._going_from(rays, twist, ahead) if self._moving else rays
        known = last is not None and (last.edits, last.tone) == (event.edits, event.tone)
        if last is None or not known or (last.camera, last.scene_time) != (camera, scene_time):
            self._count += 1
            number = -1 - self._count
            last = replace(event, camera_event=number, scene_event=number, camera=camera, scene_time=scene_time)
            self._predicted = last = self._going_from(last, twist, ahead) if self._moving else last
        return last

    def _going_from(self, event: Event, twist: Float64, ahead: float) -> Event:
        """The event with its motion: a twist (6,) a second; the scene's time runs where it has come `ahead`."""
        values = {field.name: getattr(event, field.name) for field in fields(event)}
        running = 1.0 if ahead > 0.0 else 0.0
        return MovingEvent(**values, twist=tuple(twist.tolist()), scene_rate=running)

    def _start(self, event: Event) -> None:
        """Forgets all inputs but this one."""
        self._inputs.clear()
        self._foresights.clear()
        self._agreement[:] = self._energy[:] = 0.0
        if _finite(event):
            self._inputs.append(Input(event.input_time, self._wall(event)))

    def _wall(self, event: Event) -> Camera:
        """The event's camera with the eye that is not tracked, which moves with the wall."""
        return event.camera.tracked(STILL.eye, self._scale)

    def _add(self, event: Event) -> None:
        """Takes an input whose camera moved; starts anew after a pause or a jump back in time."""
        inputs = self._inputs
        if not _finite(event) or not inputs or event.input_time - inputs[-1].time > GONE_S:
            self._start(event)
            return
        if len(inputs) > 1 and inputs[-1].time - inputs[-2].time < SPACING_S:
            inputs.pop()
        if event.input_time > inputs[-1].time:
            inputs.append(Input(event.input_time, self._wall(event)))
        else:
            inputs[-1] = Input(event.input_time, self._wall(event))

    def _camera(self, now: float, moment: float, longest: float, *, judged: bool) -> tuple[Camera, Float64]:
        """The camera at `moment`, the very one of the newest event where it rests, and its twist (6,) a second."""
        assert self._event is not None
        self._look_back(now)
        speed = self._speed(now)
        if not speed.any():
            return self._event.camera, speed
        newest = self._inputs[-1]
        ahead = min(max(moment - newest.time, 0.0), longest)
        twist = speed * ahead
        if judged and (not self._foresights or moment >= self._foresights[-1].moment + JUDGED_S):
            self._foresights.append(Foresight(moment, newest.camera, twist))
        trusted = twist * self._trust(twist)
        camera = moved(newest.camera, trusted).tracked(self._event.camera.eye, self._scale)
        return camera, self._of_eye(trusted / ahead if ahead > 0.0 else trusted)

    def _of_eye(self, twist: Float64) -> Float64:
        """(6,) a twist of the wall as one of the tracked eye, which is farther from the axis, or nearer to it."""
        assert self._event is not None
        away = self._scale * np.array(self._event.camera.eye)
        return np.concatenate([twist[:3], twist[3:] + np.cross(twist[:3], away)]) if away.any() else twist

    def _speed(self, now: float) -> Float64:
        """(6,) twist a second between the newest two inputs; nothing after a cut, less and less in silence."""
        inputs = list(self._inputs)
        if len(inputs) > 1 and inputs[-1].time - inputs[-2].time < SPACING_S:
            del inputs[-2]
        if len(inputs) < 3:
            return np.zeros(6)
        first, second, third = inputs[-3:]
        before = between(first.camera, second.camera) / (second.time - first.time)
        speed = between(second.camera, third.camera) / (third.time - second.time)
        for part in (slice(0, 3), slice(3, 6)):
            if math.hypot(*speed[part].tolist()) > JUMP * math.hypot(*before[part].tolist()):
                speed[part] = 0.0
        return np.asarray(speed * self._going_on(now))

    def _going_on(self, now: float) -> float:
        """1 while inputs come as usual, 0 once they have stopped."""
        recent = list(self._inputs)[-4:]
        usual = (recent[-1].time - recent[0].time) / (len(recent) - 1)
        begin, end = min(MISSED * usual, GONE_S / 2.0), min(GONE * usual, GONE_S)
        return min(max((end - (now - recent[-1].time)) / (end - begin), 0.0), 1.0)

    def _trust(self, twist: Float64) -> Float64:
        """(6,) in 0..1, by the foresights that could be checked, and a little by this one, as if it had come true."""
        own = HOPE * twist**2
        energy = self._energy + own
        share = np.divide(self._agreement + own, energy, out=np.zeros(6), where=energy > 0.0)
        return np.clip(share, 0.0, 1.0)

    def _look_back(self, now: float) -> None:
        """Hold foresights against what came: once an input is as late, or is not to be expected any more."""
        heard = max(self._inputs[-1].time, now - GONE_S) if self._inputs else now
        while self._foresights and self._foresights[0].moment <= heard:
            moment, camera, twist = self._foresights.popleft()
            came = between(camera, self._known(moment))
            most = OUTLIER * np.abs(twist)
            self._agreement = FORGETTING * self._agreement + twist * np.clip(came, -most, most)
            self._energy = FORGETTING * self._energy + twist**2

    def _known(self, moment: float) -> Camera:
        """Where the camera was, straight between inputs; the newest one after them."""
        later = self._inputs[-1]
        for input_ in reversed(self._inputs):
            if input_.time <= moment:
                share = (moment - input_.time) / (later.time - input_.time) if later.time > moment else 0.0
                return moved(input_.camera, share * between(input_.camera, later.camera)) if share else input_.camera
            later = input_
        return later.camera


def foreseen(event: Event, expected: Event) -> Event:
    """`event`, number and all, where and when `expected` is: what rays are traced under."""
    if expected is event:
        return event
    return replace(event, camera=expected.camera, scene_time=expected.scene_time)


def _finite(event: Event) -> bool:
    numbers = (event.input_time, *event.camera.position, *event.camera.world_from_wall)
    return all(map(math.isfinite, numbers))
