"""A rank's side of the control link. The manager's is in roles/manager.py, messages in packets/control.py."""

from __future__ import annotations

import os
import socket
import time
from collections import deque

from wall.core.data import Counters, Event
from wall.core.errors import RemoteProtocolError, RunError
from wall.packets.control import Hands, Heartbeat, Hello, Ping, Pong, Statistics, Stop, parse_control, serialise
from wall.roles.plan import Plan
from wall.run.clock import HeadClock
from wall.transport.base import Link

RECENT_EVENTS = 32  # kept for who is late; older ones predict nothing
HEAD_LOST_BEATS = 3.0  # times lost_after_s without a word from the head, then a rank ends itself


class Control:
    """The newest event, signs of life, the head's clock."""

    def __init__(self, link: Link, plan: Plan, rank: int, *, same_clock: bool) -> None:
        """`same_clock`: this rank runs on the head's machine, whose monotonic clock all processes share."""
        self._link, self._rank, self._plan = link, rank, plan
        self._transport = plan.layout.config.transport
        self.clock, self.counters = HeadClock(), Counters()
        self.event: Event | None = None
        self.recent: deque[Event] = deque(maxlen=RECENT_EVENTS)  # all that came, for who wants them in their order
        self.statistics: Statistics | None = None  # the newest
        self.stopped = False
        self._beat_due, self._same_clock = 0.0, same_clock
        self._heard = time.monotonic()
        link.send(
            serialise(
                Hello(
                    rank=rank,
                    role=plan.layout.role(rank),
                    region=plan.layout.describe(rank),
                    pid=os.getpid(),
                    host=socket.gethostname(),
                )
            )
        )

    def newest(self) -> Event | None:
        """Take in what came; None before the head's first event and its time are known.

        Raises RunError when the head has been silent for too long.
        """
        for data in self._link.receive():
            self._heard = time.monotonic()
            try:
                message = parse_control(data)
            except RemoteProtocolError:
                self.counters.add("bad_message")
                continue
            if isinstance(message, Event):
                if self.event is None or message.number >= self.event.number:
                    self.event = message
                    self.recent.append(message)
            elif isinstance(message, Stop):
                self.stopped = True
            elif isinstance(message, Statistics):
                self.statistics = message
            elif isinstance(message, Pong):
                self.clock.learn(message.sent, message.head_time)
        silence = time.monotonic() - self._heard
        if silence > HEAD_LOST_BEATS * self._transport.lost_after_s:
            raise RunError(f"rank {self._rank}: nothing from the head for {silence:.1f} s; giving up")
        return self.event if self._same_clock or self.clock.known else None

    def beat_due(self) -> bool:
        return time.monotonic() >= self._beat_due

    def beat(self, heartbeat: Heartbeat) -> None:
        self._beat_due = time.monotonic() + self._transport.heartbeat_s
        self._link.send(serialise(heartbeat))
        if not self._same_clock:  # throughout: clocks of two machines drift apart
            self._link.send(serialise(Ping(sent=time.monotonic())))

    def tell(self, hands: Hands) -> None:
        """What was done at windows here."""
        self._link.send(serialise(hands))

    def wait(self, seconds: float) -> None:
        self._link.wait(seconds)
