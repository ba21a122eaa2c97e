"""A compositor beside the head: does the nodes of its rank, and sends others what they need of them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict

from wall.core.data import Counters, Event
from wall.display.base import Sink
from wall.packets.control import MAX_COMMANDS, Hands, Heartbeat, serialise
from wall.roles.compositor import Compositor
from wall.roles.plan import HEAD, Plan, make_predictor
from wall.roles.statistics import Due
from wall.run.control import Control
from wall.run.sinks import distinct, show_all, window_sink
from wall.run.usage import peak_memory
from wall.transport.base import Hub, Link

POLL_S = 0.02  # how long an event of the head may wait, since samples come in by another way


class RemoteCompositor:
    def __init__(
        self,
        plan: Plan,
        rank: int,
        hub: Hub,
        control: Control,
        links: Mapping[int, Link],
        sinks: list[Sink | None],
    ) -> None:
        """`links`: to other compositors by rank, the head among them; `sinks`: windows on this machine."""
        self._plan, self._rank, self._control, self._links, self._sinks = plan, rank, control, links, sinks
        self._compositor = Compositor(plan, rank, hub, links)
        self._statistics_due = Due()
        self._ended = ("", False)  # what the head was told: where Escape was pressed, whether no window is left
        self._ahead = False  # what is shown is not the newest event yet, but what is expected after it

    def run(self) -> None:
        control, clock, compositor = self._control, self._control.clock, self._compositor
        due = -math.inf  # the head's time is not known yet
        predictor = make_predictor(self._plan)
        while not control.stopped:
            event = control.newest()
            if event is not None:
                compositor.follow(event)
            taken = compositor.take_in()
            now = clock.now()
            if event is not None and now >= due:
                due = max(due + 1.0 / self._plan.view.refresh_hz, now)
                while control.recent:
                    predictor.take(control.recent.popleft())
                expected = predictor.at(now)
                self._ahead = expected.number != event.number
                self._refresh(event, expected, now)
            compositor.send()
            beat = control.beat_due()
            self._tell_hands(again=beat)
            if beat:
                control.beat(self._heartbeat(event, last=False))
            if not taken:
                compositor.hub.wait(POLL_S if event is None else max(0.0, min(POLL_S, due - clock.now())))
        control.beat(self._heartbeat(control.event, last=True))

    def _refresh(self, event: Event, expected: Event, now: float) -> None:
        compositor = self._compositor
        if self._control.statistics is not None:
            compositor.say(asdict(self._control.statistics))
        compositor.refresh(expected, now)
        show_all(self._plan, self._sinks, compositor.shown(), event, now)
        if compositor.lockstep is not None and compositor.lockstep.news():
            self._control.beat(self._heartbeat(event, last=False))
        if event.statistics and self._links[HEAD].ready() and self._statistics_due.now(now):
            for statistics_image in compositor.statistics_images(now, comparing=True):
                compositor.offer(HEAD, serialise(statistics_image))

    def _tell_hands(self, *, again: bool) -> None:
        """Tell the head what hands did at the windows here; `again`: also if it was told how they ended the run."""
        window = window_sink(self._sinks)
        if window is None:
            return
        commands, ended = window.commands(), (window.escape, window.gone)
        if not commands and (not any(ended) or (ended == self._ended and not again)):
            return
        self._ended = ended
        for first in range(0, len(commands) or 1, MAX_COMMANDS):
            text = json.dumps(commands[first : first + MAX_COMMANDS])
            self._control.tell(Hands(rank=self._rank, commands=text, escape=ended[0], closed=ended[1]))

    def _dropped(self) -> Counters:
        dropped = self._compositor.drops()
        dropped.merge(self._control.counters.counts)
        for sink in distinct(self._sinks):
            dropped.merge(sink.dropped())
        return dropped

    def _heartbeat(self, event: Event | None, *, last: bool) -> Heartbeat:
        c = self._compositor
        packets, sent = c.sent
        number = event.number if event else (-1, -1)
        if c.lockstep is not None:
            number = c.lockstep.done
        return Heartbeat(
            rank=self._rank,
            time=self._control.clock.now(),
            samples_shown=c.samples_shown(),
            packets=packets,
            bytes=sent,
            peak_memory=peak_memory(),
            dropped=self._dropped().counts,
            complete=not self._ahead and c.idle,
            camera_event=number[0],
            scene_event=number[1],
            last=last,
        )
