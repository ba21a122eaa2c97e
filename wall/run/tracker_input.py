"""Trackers' packets: a thread for each UDP port stamps what comes, the manager's loop takes it."""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from wall.config.tracking import TrackingConfig
from wall.core.clock import Clock
from wall.core.errors import RunError
from wall.packets.osc import MAX_BYTES
from wall.roles.instructions import TrackerPacket, TrackerStrangers
from wall.roles.plan import Plan

WAITING = 256  # packets at most that the loop has not taken yet; older ones give way
LOOK_S = 0.2  # how long a port that is to be closed may wait for a packet


@dataclass(frozen=True, slots=True)
class Wanted:
    """A port, and who may send there."""

    port: int
    sources: frozenset[str]  # IP addresses of one family

    @property
    def host(self) -> str:
        """The address to listen at: all of the machine's, unless only the machine itself may send."""
        addresses = [ipaddress.ip_address(source) for source in self.sources]
        if all(address.is_loopback for address in addresses):
            return min(self.sources)
        return "::" if addresses[0].version == 6 else "0.0.0.0"


class TrackerPort:
    """One open port."""

    def __init__(self, wanted: Wanted, clock: Clock) -> None:
        """Raises RunError where the port cannot be opened."""
        self.wanted, self._clock = wanted, clock
        self.strangers, self.told = 0, 0  # packets of others than the trackers' machines: so far, and told of
        family = socket.AF_INET6 if ":" in wanted.host else socket.AF_INET
        self._socket, self._open = socket.socket(family, socket.SOCK_DGRAM), True
        try:
            self._socket.bind((wanted.host, wanted.port))
        except OSError as error:
            self._socket.close()
            raise RunError(
                f"UDP port {wanted.port} of {wanted.host}, for a tracker: {error.strerror or error}"
            ) from error
        self._socket.settimeout(LOOK_S)
        self.waiting: deque[TrackerPacket] = deque(maxlen=WAITING)
        self._thread = threading.Thread(target=self._listen, name=f"tracker {wanted.port}", daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while self._open:
            try:
                data, sender = self._socket.recvfrom(MAX_BYTES + 1)  # one more, so that longer ones are seen to be
            except TimeoutError:
                continue
            except OSError:
                return
            if sender[0] not in self.wanted.sources:
                self.strangers += 1
                continue
            self.waiting.append(TrackerPacket(self.wanted.port, sender[0], data, self._clock.now()))

    def close(self) -> None:
        """Stop listening."""
        self._open = False
        self._thread.join()
        self._socket.close()


class TrackerInput:
    """All ports of the plan that runs."""

    def __init__(self, plan: Callable[[], Plan], clock: Clock, say: Callable[[str], None]) -> None:
        """Raises RunError where a port cannot be opened. `say`: told where that is so for a plan that comes later."""
        self._plan, self._clock, self._say = plan, clock, say
        self._ports: dict[int, TrackerPort] = {}
        self._configs = self._tracked()
        self._open_ports()

    def receive(self) -> Iterator[TrackerPacket | TrackerStrangers]:
        """What came since the last call."""
        configs = self._tracked()
        if configs != self._configs:
            self._configs = configs
            try:
                self._open_ports()
            except RunError as error:
                self._say(f"note: {error}")
        for port in self._ports.values():
            for _ in range(len(port.waiting)):
                yield port.waiting.popleft()
            if strangers := port.strangers - port.told:
                port.told += strangers
                yield TrackerStrangers(strangers)

    def close(self) -> None:
        """Close all ports."""
        for port in self._ports.values():
            port.close()
        self._ports = {}

    def _tracked(self) -> tuple[TrackingConfig, ...]:
        return tuple(view.tracking for view in self._plan().layout.config.views if view.tracking is not None)

    def _open_ports(self) -> None:
        """Open what is wanted and not open yet, close what is not wanted any more."""
        wanted = [
            Wanted(port, frozenset(config.source for config in self._configs if config.port == port))
            for port in sorted({config.port for config in self._configs})
        ]
        for number, port in [*self._ports.items()]:
            if port.wanted not in wanted:
                port.close()
                del self._ports[number]
        for each in wanted:
            if each.port not in self._ports:
                self._ports[each.port] = TrackerPort(each, self._clock)
