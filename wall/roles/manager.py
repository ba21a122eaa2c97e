"""The manager: turns inputs into numbered events, tells everyone, and hears how they are.

Director is the pure part: commands and the time in, the newest event out. Manager runs it in a thread of the head.
All commands that arrive while an event is made share the next one (Ohlenburg and Broll, "Parallel Multi-View
Rendering on Multi-Core Processor Systems").
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from wall.config.schema import METHODS
from wall.core.data import Camera, Counters, Event
from wall.core.errors import RemoteProtocolError
from wall.geometry.steering import Command, Steering, parse
from wall.packets.control import (
    Hands,
    Heartbeat,
    Hello,
    Ping,
    Pong,
    Statistics,
    Stop,
    commands_of,
    parse_control,
    serialise,
)
from wall.roles.plan import Plan, first_event
from wall.run.clock import Clock
from wall.run.control import RECENT_EVENTS
from wall.run.sinks import window_ranks
from wall.transport.base import MAX_MESSAGE_BYTES, Hub

COMPARED_WITH = "adaptive"  # one of two samplers that are compared: the only one whose samples make their own picture
EVENTS_A_REFRESH = 2  # frameless samples gain from inputs between refreshes; more only costs updates
COMMAND_POLL_S = 0.004  # a quarter of a 60 Hz refresh: how long a viewer's command may wait
BYE_WAIT_S = 0.8  # for the ranks' last words


def samplers_of(plan: Plan) -> tuple[str, ...]:
    """What viewers may choose among: in lock step only the configured one, since others make no frames."""
    return METHODS if plan.layout.graph.sync == "none" else (plan.layout.sampling.method,)


class Director:
    """What the viewer sees: the camera path or the steered camera, the animation's time, the sampler."""

    def __init__(self, plan: Plan, now: float) -> None:
        self._plan, self._view = plan, plan.view
        self._steering: Steering | None = None
        self._scene_time, self._path_time, self._last = 0.0, 0.0, now
        self.paused = False
        self.sampler: str = plan.layout.sampling.method
        self.compare = ""  # with the adaptive sampler, whichever `sampler` is
        self.statistics = False
        self.event = first_event(plan, now)

    def update(self, commands: list[Command], now: float) -> bool:
        """Apply what came in until `now`. Returns whether there is a new event."""
        if not self.paused:
            self._scene_time += now - self._last
            self._path_time += now - self._last
        self._last = now
        for command in commands:
            self._apply(command)
        camera = self._camera()
        scene_time = self._scene_time if self._plan.scene.animated else 0.0
        old = self.event
        sampler = COMPARED_WITH if self.compare else self.sampler
        turned = camera != old.camera or (sampler, self.compare) != (old.sampler or sampler, old.compare)
        moved = scene_time != old.scene_time
        if not turned and not moved and (self.paused, self.statistics) == (old.paused, old.statistics):
            return False
        self.event = Event(
            view=0,
            camera_event=old.camera_event + turned,
            scene_event=old.scene_event + moved,
            scene_time=scene_time,
            input_time=now,
            camera=camera,
            sampler=sampler,
            paused=self.paused,
            compare=self.compare,
            statistics=self.statistics,
        )
        return True

    def hold(self) -> bool:
        """Stop everything where it is. Returns whether that is news: then the event says that it is paused."""
        was, self.paused = self.event.paused, True
        self.event = replace(self.event, paused=True)
        return not was

    def _camera(self) -> Camera:
        return self._steering.camera() if self._steering else self._view.camera_at(self._path_time)

    def _apply(self, command: Command) -> None:
        if command.kind == "pause":
            self.paused = not self.paused
        elif command.kind == "reset":
            self._steering = None
        elif command.kind == "sampler":
            self.sampler = command.value if command.value in samplers_of(self._plan) else self.sampler
            self.compare = ""
        elif command.kind == "compare":
            graph = self._plan.layout.graph  # others have no second picture, or no frames of it
            self.compare = command.value if graph.plain and graph.sync == "none" else ""
        elif command.kind == "statistics":
            self.statistics = command.value == "on"
        else:
            steering = self._steering or Steering.from_view(self._view, self._path_time)
            self._steering = steering.apply(command)


class Latency:
    """From an event's input to the refresh that first showed a sample of it, on the head's clock."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[tuple[int, int], float]] = deque(maxlen=4096)
        self.seconds: deque[float] = deque(maxlen=65536)

    def published(self, event: Event) -> None:
        self._waiting.append((event.number, event.input_time))

    def shown(self, number: tuple[int, int], now: float) -> None:
        while self._waiting and self._waiting[0][0] <= number:
            self.seconds.append(now - self._waiting.popleft()[1])


class Manager(threading.Thread):
    """Owns the control hub. Other threads read what has no underscore, and call `stop`."""

    def __init__(
        self, plan: Plan, hub: Hub, clock: Clock, commands: Callable[[], list[dict[str, Any]]], *, still: bool
    ) -> None:
        super().__init__(name="manager", daemon=True)
        self._hub, self._clock, self._commands, self._still = hub, clock, commands, still
        self._director = Director(plan, clock.now())
        self._stopping = threading.Event()
        self._heartbeat_s = plan.layout.config.transport.heartbeat_s
        self._tick_s = 1.0 / (plan.view.refresh_hz * EVENTS_A_REFRESH)
        self.event = self._director.event
        self.recent = deque([self.event], maxlen=RECENT_EVENTS)  # for the head's thread to take
        self.latency, self.counters = Latency(), Counters()
        self.heartbeats: dict[int, tuple[float, Heartbeat]] = {}  # by rank: when it came, what it said
        self.hellos: dict[int, Hello] = {}
        self.window_ranks, self._asked = window_ranks(plan.layout), list[Command]()  # what hands asked for there
        self.escape = ""  # at which of them a hand ended the run
        self.closed: frozenset[int] = frozenset()  # those that have no window left
        self._statistics: Statistics | None = None  # not told yet
        self.failure: BaseException | None = None
        self._held = threading.Event()
        self._lockstep, self._released = plan.layout.graph.sync != "none", (-1, -1)
        self._others, self._began = range(1, plan.layout.size), clock.now()
        if still:
            self._director.paused = True

    def release(self, event: Event) -> None:
        """In lock step: everybody is done with the frame of `event`, the next may begin."""
        self._released = event.number

    def _waits(self) -> bool:
        """Whether a frame is still under way."""
        return self._lockstep and self._released < self.event.number

    def tell(self, statistics: Statistics) -> None:
        """Broadcast these soon, unless newer ones come first."""
        self._statistics = statistics

    def hold(self) -> None:
        """No new events from now on."""
        self._held.set()

    def stop(self) -> None:
        """Tell everyone, collect their last words, end the thread. Bounded."""
        self._stopping.set()
        self.join(BYE_WAIT_S + 1.0)

    def run(self) -> None:
        try:
            self._run()
        except BaseException as failure:
            self.failure = failure

    def _run(self) -> None:
        due = beat = self._clock.now()
        commands: list[Command] = []  # not applied yet
        while not self._stopping.is_set():
            now = self._clock.now()
            commands += self._parse(self._commands()) + self._asked
            self._asked = []
            if self._held.is_set() and self._director.hold():
                self._publish(now)
                beat = now
            wanted = (now >= due or commands) and not self._held.is_set() and not self._waits()
            news = wanted and self._director.update(commands, now)
            if wanted:
                commands = []
            if news:
                self._publish(now)
                beat = now
            elif now - beat >= self._heartbeat_s:  # the newest event again: a sign of life, and it may have been lost
                self._hub.broadcast(serialise(self.event))
                beat = now
            statistics, self._statistics = self._statistics, None
            if statistics is not None:
                self._hub.broadcast(serialise(statistics))
            if now >= due:
                due = max(due + self._tick_s, now)
            self._hub.wait(min(COMMAND_POLL_S, max(0.0, due - now)))
            self._listen()
        self._say_goodbye()

    def _publish(self, now: float) -> None:
        self.event = self._director.event
        self.recent.append(self.event)
        if len(self.hellos) == len(self._others):  # before, nobody is there who could show it
            self.latency.published(self.event)
        self._hub.broadcast(serialise(self.event))

    def _parse(self, raw: list[Any]) -> list[Command]:
        commands = []
        for command in raw:
            try:
                commands.append(parse(command))
            except RemoteProtocolError:
                self.counters.add("bad_command")
        return commands

    def _listen(self) -> None:
        for peer, packet in self._hub.drain(MAX_MESSAGE_BYTES):  # nobody sends them here; left there, none waits
            self._hub.release(peer, len(packet))
            self.counters.add("stray_packet")
        for peer, data in self._hub.messages():
            try:
                message = parse_control(data)
                if isinstance(message, Hands):
                    self._take_hands(message)
            except RemoteProtocolError:
                self.counters.add("bad_message")
                continue
            if isinstance(message, Hello):
                self.hellos[message.rank] = message
                self._hub.send(peer, serialise(self.event))  # whoever joins late gets the state
            elif isinstance(message, Heartbeat):
                self.heartbeats[message.rank] = (self._clock.now(), message)
            elif isinstance(message, Ping):
                self._hub.send(peer, serialise(Pong(sent=message.sent, head_time=self._clock.now())))

    def _take_hands(self, hands: Hands) -> None:
        """What was done at another compositor's windows. Raises RemoteProtocolError for that of a rank without any."""
        if hands.rank not in self.window_ranks:
            raise RemoteProtocolError(f"rank {hands.rank} has no windows; wanted: {sorted(self.window_ranks)}")
        self._asked += self._parse(commands_of(hands))
        self.escape = self.escape or hands.escape
        self.closed |= {hands.rank} if hands.closed else set()

    def _say_goodbye(self) -> None:
        self._hub.broadcast(serialise(Stop(reason="end of run")))
        limit = self._clock.now() + BYE_WAIT_S
        while self._clock.now() < limit and not all(beat.last for _, beat in self.heartbeats.values()):
            self._hub.wait(0.02)
            self._listen()

    def silent(self, now: float, seconds: float) -> Mapping[int, float]:
        """Ranks not heard for more than `seconds`, and for how long."""
        heard = dict.fromkeys(self._others, self._began) | {r: when for r, (when, _) in self.heartbeats.items()}
        return {rank: now - when for rank, when in heard.items() if now - when > seconds}
