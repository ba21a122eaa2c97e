"""Simulated machines and the network between them, and the real transport's ends upon it.

Hubs and links are those of wall/transport/base.py with the real credit (wall/transport/credit.py); ports are those of
wall/run/ports.py. Only the sockets are replaced: a message takes the time that its bytes take on the sender's and the
receiver's line, in turn with all others there, and the latency between them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TypeVar

from wall.core.errors import RemoteProtocolError
from wall.packets.control import Message, parse_control
from wall.run.clock import HeadClock
from wall.run.ports import Ports
from wall.study.plan.engine import Cores, Engine
from wall.transport.base import Hub, Link, checked
from wall.transport.credit import HubCredit

HEADER_BYTES = 78  # of a message beside its bytes: Ethernet, IP, TCP, ZMTP
GRANT_BYTES = 16
LOCAL_S = 60e-6  # between two processes of a machine, over a socket
LOCAL_BYTES_PER_S = 2e9
PARSED = 4096  # messages whose parsed form is remembered: a broadcast is parsed once for all
T = TypeVar("T")


class Machine:
    """Its cores, and when its line is free."""

    def __init__(self, engine: Engine, name: str, cores: int) -> None:
        self.name, self.cores = name, Cores(engine, cores)
        self.sends_from = self.receives_from = 0.0
        self.sent = self.received = 0  # bytes, to and from other machines


class Network:
    """Machines' lines of `bytes_per_s` each way, `latency_s` apart."""

    def __init__(self, engine: Engine, *, bytes_per_s: float, latency_s: float) -> None:
        self._engine, self._bytes_per_s, self._latency_s = engine, bytes_per_s, latency_s
        self._newest: dict[tuple[int, int], float] = {}  # by pair of processes: when their last message comes
        self.hubs: dict[str, SimulatedHub] = {}
        self.parsed: dict[bytes, Message] = {}

    def send(self, source: Process, target: Process, size: int, deliver: Callable[..., None], *args: object) -> None:
        """Deliver so many bytes when they have come; messages between two processes keep their order."""
        at, size = source.now(), size + HEADER_BYTES
        if source.machine is target.machine:
            came = at + LOCAL_S + size / LOCAL_BYTES_PER_S
        else:
            took = size / self._bytes_per_s
            begins = max(at, source.machine.sends_from)
            source.machine.sends_from = begins + took
            came = max(begins + self._latency_s, target.machine.receives_from) + took
            target.machine.receives_from = came
            source.machine.sent += size
            target.machine.received += size
        pair = id(source), id(target)
        self._newest[pair] = came = max(came, self._newest.get(pair, 0.0))
        self._engine.at(came, deliver, *args)


class Costs:
    """CPU seconds of sockets and messages, at each end."""

    def __init__(self, *, message_s: float, event_send_s: float, event_s: float, packet_s: float) -> None:
        self.message_s, self.event_send_s, self.event_s, self.packet_s = message_s, event_send_s, event_s, packet_s


class Process:
    """Where a role lives, as far as the network sees it. `charge` adds CPU time to its present turn."""

    def __init__(self, engine: Engine, machine: Machine, costs: Costs) -> None:
        self.engine, self.machine, self.costs = engine, machine, costs
        self.charged = 0.0  # CPU seconds of this turn so far: its own clock runs on meanwhile
        self.arrived: Callable[[object], None] = lambda way: None  # told of the way by which something came

    def now(self) -> float:
        """The simulated time of what this process does now."""
        return self.engine.now + self.charged

    def charge(self, seconds: float) -> None:
        """Spend CPU time."""
        self.charged += seconds


class SimulatedHub(Hub):
    """A hub whose messages come over a simulated network."""

    def __init__(self, network: Network, process: Process, *, credit_bytes: int) -> None:
        super().__init__(credit_bytes=credit_bytes)
        self.endpoint = f"simulated:{len(network.hubs)}"
        self.process, self._network = process, network
        self._links: dict[bytes, SimulatedLink] = {}
        self._arrived: deque[tuple[bytes, bytes]] = deque()
        self._control: deque[tuple[bytes, bytes]] = deque()
        network.hubs[self.endpoint] = self

    @property
    def waits(self) -> bool:
        """Whether something lies here."""
        return bool(self._data or self._arrived or self._control)

    def welcome(self, link: SimulatedLink) -> None:
        """A link asks for its first credit."""
        self._links[link.peer] = link
        credit = self._credits[link.peer] = HubCredit(self._window)
        self._grant(link.peer, credit)

    def take_data(self, peer: bytes, packet: bytes) -> None:
        """A packet has come."""
        self._arrived.append((peer, packet))
        self.process.arrived(self)

    def take_message(self, peer: bytes, message: bytes) -> None:
        """A control message has come."""
        self._control.append((peer, message))
        self.process.arrived(self)

    def messages(self) -> list[tuple[bytes, bytes]]:
        """Takes all control messages that came."""
        self.process.charge(len(self._control) * self.process.costs.message_s)
        return _taken(self._control)

    def send(self, peer: bytes, message: bytes) -> None:
        """Sends a control message to a peer."""
        self.process.charge(self.process.costs.event_send_s)
        link = self._links[peer]
        self._network.send(self.process, link.process, len(message), link.take_message, checked(message))

    def wait(self, seconds: float, link: Link | None = None) -> None:
        """Nothing waits here: the simulation calls a process when something comes."""

    def close(self) -> None:
        """Nothing to let go of."""

    def _pump(self, max_bytes: int) -> None:
        while self._arrived:
            peer, packet = self._arrived.popleft()
            self._credits[peer].arrive(len(packet))
            self.process.charge(self.process.costs.packet_s)
            self._data.append((peer, packet))

    def _send_grant(self, peer: bytes, limit: int) -> None:
        link = self._links[peer]
        self._network.send(self.process, link.process, GRANT_BYTES, link.take_grant, limit, self._window)


class SimulatedLink(Link):
    """A link over a simulated network."""

    def __init__(self, network: Network, process: Process, endpoint: str) -> None:
        super().__init__(endpoint)
        self.process, self._network, self._hub = process, network, network.hubs[endpoint]
        self.peer = f"{id(process)} {endpoint}".encode()
        self._inbox: deque[bytes] = deque()
        network.send(process, self._hub.process, GRANT_BYTES, self._hub.welcome, self)

    @property
    def waits(self) -> bool:
        """Whether a control message lies here."""
        return bool(self._inbox)

    def take_message(self, message: bytes) -> None:
        """A control message has come."""
        self._inbox.append(message)
        self.process.arrived(self)

    def take_grant(self, limit: int, window: int) -> None:
        """A grant has come."""
        self.credit.grant(limit, window)
        self.process.arrived(self)

    def shares(self, size: int) -> bool:
        """Never: machines share no memory."""
        return False

    def send(self, message: bytes) -> None:
        """Sends a control message to the hub."""
        self.process.charge(self.process.costs.message_s)
        hub = self._hub
        self._network.send(self.process, hub.process, len(message), hub.take_message, self.peer, checked(message))

    def receive(self) -> list[bytes]:
        """Takes all control messages that came."""
        self._pump()
        self.process.charge(len(self._inbox) * self.process.costs.event_s)
        return _taken(self._inbox)

    def wait(self, seconds: float) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Nothing to let go of."""

    def _pump(self) -> None:
        self.credit.flush(self._put_data)

    def _put_data(self, packet: bytes) -> bool:
        self.process.charge(self.process.costs.packet_s)
        hub = self._hub
        self._network.send(self.process, hub.process, len(packet), hub.take_data, self.peer, packet)
        return True


class SimulatedPorts(Ports):
    """The ports of a run over simulated links."""

    def __init__(
        self, network: Network, process: Process, rank: int, *, hub: SimulatedHub | None, manager: str | None
    ) -> None:
        """`manager`: the endpoint of its hub; None for the manager itself."""
        self.way = None if manager is None else SimulatedLink(network, process, manager)
        super().__init__(rank, HeadClock(process.now), hub=hub, manager=self.way)
        self._network, self._process, self.hub = network, process, hub

    def connect(self, rank: int, endpoint: str) -> None:
        """Open a link to a rank's hub, in place of an earlier one."""
        self._links[rank] = SimulatedLink(self._network, self._process, endpoint)

    @property
    def watched(self) -> SimulatedHub | SimulatedLink:
        """The one way that a process sleeps at: see Ports.wait."""
        if self.hub is not None:
            return self.hub
        way = next((link for link in self._links.values() if not link.ready()), self.way)
        assert isinstance(way, SimulatedLink)
        return way

    def _parsed(self, data: bytes) -> Message | None:
        """A broadcast is the same bytes everywhere: it is parsed once."""
        known = self._network.parsed
        if data not in known:
            if len(known) >= PARSED:
                known.clear()
            try:
                known[data] = parse_control(data)
            except RemoteProtocolError:
                return super()._parsed(data)
        return known[data]


def _taken(queue: deque[T]) -> list[T]:
    items = list(queue)
    queue.clear()
    return items
