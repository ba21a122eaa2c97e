"""ZeroMQ: DEALER links to a ROUTER hub. With curve.py and sockets.py the only file that imports zmq.

Messages have two parts: a tag (data, control, ask, grant, ...) and a body. ROUTER_MANDATORY makes a vanished peer an
error that is counted instead of a silent drop; ZMTP heartbeats close connections to frozen hosts. Between processes of
one machine a large packet goes through shared memory, and only its place there is sent, in order with all else.
"""

from __future__ import annotations

import os
import struct
import threading
import time
from collections import Counter, deque
from collections.abc import Sequence
from typing import TypeVar

import zmq

from wall.core.errors import RemoteProtocolError, RunError
from wall.transport.addresses import let_in, reachable
from wall.transport.base import MAX_CONTROL, MAX_CONTROL_BYTES, MAX_MESSAGE_BYTES, NOBODY, Hub, Inbox, Link, checked
from wall.transport.credit import HubCredit
from wall.transport.curve import Gatekeeper, Keys, holder
from wall.transport.shared_memory import OTHER_MACHINE, REFERENCE, RingReader, RingWriter
from wall.transport.sockets import bind_to, disconnect_monitor, disconnected, open_socket, receive, send

DATA, CONTROL, ASK, GRANT, BYE = b"D", b"C", b"A", b"G", b"B"
MEMORY, PLACED = b"M", b"P"  # memory to share, and what became of it; a packet that lies there
SMALLEST_PLACED = 4096  # bytes: smaller packets are sent as fast
ASK_AGAIN_S = 1.0  # a link without credit for so long asks again
MAX_PEERS = 4096
MAX_TAKEN = 4096  # messages taken in at once: a flood of tiny ones cannot hold the caller
MAX_SENT = 1 << 62  # bytes a link can claim to have sent
T = TypeVar("T")
_ASK = struct.Struct("<Q")  # bytes sent so far
_GRANT = struct.Struct("<QQ")  # limit, window
_PLACE = struct.Struct("<QQQ")  # token of the memory, position, size
_ANSWER = struct.Struct("<QB")  # token, whether it is open at the hub; then, unless it can be tried again, why not


class ZmqLink(Link):
    """Belongs to the thread that made it. Another one may `send_beside`: the socket is used under a lock.

    A socket may go from thread to thread where a memory barrier lies between, as a lock is, https://api.zeromq.org/4-3:zmq.
    """

    def __init__(self, endpoint: str, *, rank: int, keys: Keys | None = None, to: int = 0) -> None:
        """`keys`: what is sent is encrypted, and the hub has to be that of rank `to`. None: neither."""
        super().__init__(endpoint)
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._lock = threading.Lock()
        self._socket = open_socket(self._context, zmq.DEALER)
        self._socket.setsockopt(zmq.RCVHWM, 0)  # or heartbeats wait behind a full queue, and end the connection
        self._socket.setsockopt(zmq.ROUTING_ID, b"rank %d " % rank + os.urandom(8).hex().encode())
        if keys is not None:
            keys.unlock(self._socket, to)
        self._socket.connect(endpoint)
        self._messages: deque[bytes] = deque()
        self._outgoing: deque[bytes] = deque()
        self._asked = self._reference_sent = float("-inf")
        self._ring: RingWriter | None = None
        self._ring_open, self._refused = False, ""  # at the hub; why there will be none
        self._ask()

    def shares(self, size: int) -> bool:
        """Whether a packet of so many bytes goes through shared memory; tells the hub of some where that is not known.

        Never blocks. Memory that cannot be had, or that the hub cannot open, is not asked for again.
        """
        if self._refused or self.credit.window == 0:
            return False
        capacity = 2 * max(size, self.credit.window)
        if self._ring is None or self._ring.capacity < capacity:
            self._make_ring(capacity)
        if self._ring is not None and not self._ring_open and time.monotonic() - self._reference_sent > ASK_AGAIN_S:
            self._reference_sent = time.monotonic()
            self._put(MEMORY, self._ring.reference)
        return self._ring_open

    def _make_ring(self, capacity: int) -> None:
        self._drop_ring()
        try:
            self._ring = RingWriter(capacity)
        except OSError as error:
            self.note = self._refused = f"no shared memory of {capacity} bytes: {error.strerror}"

    def _drop_ring(self) -> None:
        self._ring_open, self._reference_sent = False, float("-inf")
        if self._ring is not None:
            self._ring.close()
            self._ring = None

    def _take_answer(self, body: bytes) -> None:
        """The hub has opened the ring, or has none, or says why it will have none."""
        token, state = _ANSWER.unpack_from(body)
        if self._ring is None or self._ring.token != token:
            return  # of an earlier one
        self._ring_open = state == 1
        if reason := body[_ANSWER.size :].decode(errors="replace"):
            self._drop_ring()
            self._refused = reason
            self.note = "" if reason == OTHER_MACHINE else reason

    def send(self, message: bytes) -> None:
        """Sends a control message to the hub; the oldest waiting one is dropped if too many wait."""
        self._outgoing.append(checked(message))
        if len(self._outgoing) > MAX_CONTROL:
            self._outgoing.popleft()
            self.counters["control_overflow"] += 1
        self._flush_control()

    def send_beside(self, message: bytes) -> None:
        """Sends a control message past those that wait, or drops it."""
        with self._lock:
            if not self._socket.closed:
                send(self._socket, (CONTROL, message))

    def receive(self) -> list[bytes]:
        """Takes all control messages that arrived."""
        self._pump()
        messages = list(self._messages)
        self._messages.clear()
        return messages

    def wait(self, seconds: float) -> None:
        """Waits up to `seconds` for a control message."""
        if not self._messages:
            with self._lock:
                self._socket.poll(max(0, round(seconds * 1000)), zmq.POLLIN)

    def close(self) -> None:
        """Says goodbye to the hub and closes the socket."""
        if not self._socket.closed:
            self._flush_control()
            self._put(BYE, b"")
            with self._lock:
                self._socket.close()
            self._context.term()
            self._drop_ring()

    def _pump(self) -> None:
        while (parts := self._receive()) is not None:
            if len(parts) == 2 and parts[0] == CONTROL:
                _keep(self._messages, parts[1], self.counters)
            elif len(parts) == 2 and parts[0] == GRANT and len(parts[1]) == _GRANT.size:
                self.credit.grant(*_GRANT.unpack(parts[1]))
            elif len(parts) == 2 and parts[0] == MEMORY and len(parts[1]) >= _ANSWER.size:
                self._take_answer(parts[1])
            else:
                self.counters["bad_frame"] += 1
        self.credit.flush(self._put_data)
        self._flush_control()
        if not self.credit.ready and time.monotonic() - self._asked > ASK_AGAIN_S:
            self._ask()

    def _receive(self) -> list[bytes] | None:
        with self._lock:
            return receive(self._socket)

    def _ask(self) -> None:
        self._asked = time.monotonic()
        self._put(ASK, _ASK.pack(self.credit.sent))

    def _flush_control(self) -> None:
        while self._outgoing and self._put(CONTROL, self._outgoing[0]):
            self._outgoing.popleft()

    def _put_data(self, packet: bytes) -> bool:
        ring, size = self._ring, len(packet)
        if ring is None or not self._ring_open or not SMALLEST_PLACED <= size <= ring.capacity // 2:
            return self._put(DATA, packet)
        ring.write(self.credit.sent, packet)
        return self._put(PLACED, _PLACE.pack(ring.token, self.credit.sent, size))

    def _put(self, tag: bytes, body: bytes) -> bool:
        with self._lock:
            return send(self._socket, (tag, body))


class ZmqHub(Hub):
    """Belongs to the thread that uses it first; it may be made by another."""

    def __init__(
        self, bind: str, *, credit_bytes: int, keys: Keys | None = None, ports: tuple[int, int] | None = None,
        allow: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """`keys`: links have to prove one of them, and what is sent is encrypted; None: anybody may connect.

        `ports`: first and last that it may listen on; None: any. `allow`: networks of those whose connections are not
        closed at once; none: all. Raises RunError where it cannot listen.
        """
        super().__init__(credit_bytes=credit_bytes)
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = open_socket(self._context, zmq.ROUTER)
        self._socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
        self._socket.setsockopt(zmq.ROUTER_HANDOVER, 1)
        for network in let_in(allow, bind) if allow else ():
            self._socket.setsockopt(zmq.TCP_ACCEPT_FILTER, network.encode())
        self._locked = keys is not None
        if keys is not None:
            self._gatekeeper = Gatekeeper(self._context, keys)
            keys.lock(self._socket)
        try:
            port = bind_to(self._socket, bind, ports)
        except RunError:
            self._socket.close()
            self._context.term()
            raise
        self.endpoint = f"tcp://{reachable(bind)}:{port}"
        self._holders: dict[bytes, int] = {}  # by peer: the rank, or GUEST, whose key it has
        self._rings: dict[bytes, RingReader] = {}  # by peer
        self._messages: dict[bytes, Inbox] = {}  # by peer: none can push out another's
        self._monitor: zmq.Socket[bytes] | None = None  # tells of connections, once somebody asks
        self._connections: dict[bytes, int] = {}  # by peer: the descriptor of that by which it spoke last

    def disconnected(self) -> set[bytes]:
        """Peers that spoke since this was asked first, and whose connections have closed without a goodbye."""
        if self._monitor is None:
            self._monitor = disconnect_monitor(self._context, self._socket)
        gone = disconnected(self._monitor, MAX_TAKEN)
        peers = {peer: descriptor for peer, descriptor in self._connections.items() if descriptor in gone}
        if peers:
            self._pump(MAX_MESSAGE_BYTES)  # goodbyes, and what came by another connection since
        peers = {peer: descriptor for peer, descriptor in peers.items() if self._connections.get(peer) == descriptor}
        for peer in peers:
            del self._connections[peer]
        return set(peers)

    def messages(self) -> list[tuple[bytes, bytes]]:
        """Takes all control messages that arrived, each with its peer."""
        self._pump(MAX_MESSAGE_BYTES)
        taken, self._messages = self._messages, {}
        return [(peer, message) for peer, inbox in taken.items() for message in inbox.messages]

    def send(self, peer: bytes, message: bytes) -> None:
        """Sends a control message to one peer."""
        self._put(peer, CONTROL, checked(message))

    def proven(self, peer: bytes) -> int | None:
        """The rank by whose key a peer speaks, GUEST or NOBODY; None where there are no keys."""
        return self._holders.get(peer, NOBODY) if self._locked else None

    def admit(self, rank: int, key: str) -> None:
        """From now on takes new connections of a rank by this key alone."""
        if self._locked:
            self._gatekeeper.admit(rank, key)

    def wait(self, seconds: float, link: Link | None = None) -> None:
        """Waits up to `seconds` for a packet or message, here or at `link`."""
        if self._data or self._messages:
            return
        own, limit_ms = (self._socket, zmq.POLLIN), max(0, round(seconds * 1000))
        if not isinstance(link, ZmqLink):
            zmq.zmq_poll([own], limit_ms)
        elif not link._messages:
            with link._lock:
                zmq.zmq_poll([own, (link._socket, zmq.POLLIN)], limit_ms)

    def close(self) -> None:
        """Closes the socket."""
        if not self._socket.closed:
            self._socket.close()
            if self._monitor is not None:
                self._monitor.close()
            self._context.term()
            self._rings.clear()

    def _pump(self, max_bytes: int) -> None:
        size = sum(len(packet) for _, packet in self._data)
        for _ in range(MAX_TAKEN):
            if size >= max_bytes or (parts := self._receive()) is None:
                return
            if not parts:
                continue
            if len(parts) != 3:
                self.counters["bad_frame"] += 1
                continue
            peer, tag, body = parts
            if tag == BYE:
                self._forget(peer)
                self._connections.pop(peer, None)
                continue
            if peer not in self._credits and not self._welcome(peer):
                continue
            if tag == DATA and body:
                size += self._take_packet(peer, body, len(body))
            elif tag == PLACED and len(body) == _PLACE.size:
                size += self._take_placed(peer, *_PLACE.unpack(body))
            elif tag == MEMORY and len(body) == REFERENCE.size:
                self._open_ring(peer, body)
            elif tag == CONTROL and len(body) <= MAX_CONTROL_BYTES:
                self._messages.setdefault(peer, Inbox()).keep(body, self.counters)
            elif tag == ASK and len(body) == _ASK.size and _ASK.unpack(body)[0] <= MAX_SENT:
                self._credits[peer].resume(*_ASK.unpack(body))
                self._grant(peer, self._credits[peer])
            else:
                self.counters["bad_frame"] += 1

    def _receive(self) -> list[bytes] | None:
        """The next message, None where there is none; empty for one by another key than its peer's first."""
        if not self._locked and self._monitor is None:
            return receive(self._socket)
        try:
            first = self._socket.recv(zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return None
        peer, rest = first.bytes, self._socket.recv_multipart()  # a message comes whole
        if self._monitor is not None:
            self._connections[peer] = first.get(zmq.SRCFD)
        if not self._locked:
            return [peer, *rest]
        who = holder(first)
        if len(self._holders) > 2 * MAX_PEERS:  # kept beyond a goodbye: what came before it may lie here
            self._holders = {known: rank for known, rank in self._holders.items() if known in self._credits}
        if self._holders.setdefault(peer, who) != who:
            self.counters["stranger"] += 1
            return []
        return [peer, *rest]

    def _welcome(self, peer: bytes) -> bool:
        if len(self._credits) >= MAX_PEERS:
            self.counters["too_many_peers"] += 1
            return False
        self._credits[peer] = HubCredit(self._window)
        return True

    def _forget(self, peer: bytes) -> None:
        self._credits.pop(peer, None)
        self._rings.pop(peer, None)

    def _take_packet(self, peer: bytes, packet: bytes | None, size: int) -> int:
        """Keep a packet, None for one that is lost. Returns the bytes that lie here now."""
        if not self._credits[peer].arrive(size):
            self.counters["over_credit"] += 1
        elif packet is None:
            self.counters["lost_in_memory"] += 1
            self.release(peer, size)
        else:
            self._data.append((peer, packet))
            return size
        return 0

    def _take_placed(self, peer: bytes, token: int, position: int, size: int) -> int:
        if not 0 < size <= MAX_MESSAGE_BYTES:
            self.counters["bad_frame"] += 1
            return 0
        ring = self._rings.get(peer)
        if ring is not None and ring.token == token:
            return self._take_packet(peer, ring.read(position, size), size)
        taken = self._take_packet(peer, None, size)
        self._answer(peer, token, opened=False)  # the peer was forgotten meanwhile
        return taken

    def _open_ring(self, peer: bytes, reference: bytes) -> None:
        """Open memory that a link wants to share, and tell it."""
        reason, token = "", REFERENCE.unpack(reference)[-1]
        try:
            self._rings[peer] = RingReader(reference)
        except RemoteProtocolError as error:
            reason = str(error)
        except OSError as error:
            reason = f"the receiver cannot open the sender's memory: {error.strerror or error}"
        self._rings = {known: ring for known, ring in self._rings.items() if known == peer or ring.alive}
        self._answer(peer, token, opened=not reason, reason=reason)

    def _answer(self, peer: bytes, token: int, *, opened: bool, reason: str = "") -> None:
        self._put(peer, MEMORY, _ANSWER.pack(token, opened) + reason.encode())

    def _send_grant(self, peer: bytes, limit: int) -> None:
        self._put(peer, GRANT, _GRANT.pack(limit, self._window))

    def _put(self, peer: bytes, tag: bytes, body: bytes) -> None:
        try:
            self._socket.send_multipart((peer, tag, body), zmq.NOBLOCK)
        except zmq.Again:
            self.counters["peer_full"] += 1
        except zmq.ZMQError as error:
            if error.errno != zmq.EHOSTUNREACH:
                raise
            self._forget(peer)  # it says hello again if it comes back
            self.counters["peer_gone"] += 1


def _keep(messages: deque[T], message: T, counters: Counter[str]) -> None:
    messages.append(message)
    if len(messages) > MAX_CONTROL:
        messages.popleft()
        counters["control_overflow"] += 1
