"""ZeroMQ sockets with our limits: opened, bound, used without waiting. Imports zmq, as zeromq.py does."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence

import zmq

from wall.core.errors import RunError
from wall.transport.base import MAX_MESSAGE_BYTES

LINGER_MS = 200  # for the last words of a socket that is closed
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 500, 3000  # of ZMTP; machines with more ranks than cores are late by seconds
_EVENT = struct.Struct("=Hi")  # of libzmq: which, and here the descriptor
HANDSHAKE_MS = 4_000  # for a connection to say who it is: one that does not is closed; ours tries again


def open_socket(context: zmq.Context[zmq.Socket[bytes]], kind: int) -> zmq.Socket[bytes]:
    """A socket with our limits. Raises RunError where this process has none left."""
    try:
        socket = context.socket(kind)
    except zmq.ZMQError as error:
        context.term()
        raise RunError(f"no socket can be had: {error}; wanted: more open files (ulimit -n)") from error
    socket.setsockopt(zmq.LINGER, LINGER_MS)
    socket.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE_BYTES)
    socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
    socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    socket.setsockopt(zmq.RECONNECT_IVL, 50)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
    return socket


def bind_to(socket: zmq.Socket[bytes], bind: str, ports: tuple[int, int] | None) -> int:
    """Listen on an address, at the first port of a range that is free. Returns the port. Raises RunError."""
    first, last = ports or (0, 0)
    for port in range(first, last + 1):
        try:
            socket.bind(f"tcp://{bind}:{port or '*'}")
        except zmq.ZMQError as error:
            if error.errno == zmq.EADDRINUSE:
                continue
            raise RunError(f"transport.bind: cannot listen on {bind}: {error}; wanted a local address") from error
        return int(socket.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2])
    raise RunError(
        f"transport.ports: none of {first}-{last} is free at {bind}; wanted: two for the head, and one for each other "
        "compositor of a machine"
    )


def disconnect_monitor(context: zmq.Context[zmq.Socket[bytes]], socket: zmq.Socket[bytes]) -> zmq.Socket[bytes]:
    """A socket that tells of another one's connections that close, see disconnected. To be closed after the other one.

    Raises RunError where this process has none left.
    """
    address = f"inproc://disconnects-{id(socket)}"
    try:
        monitor: zmq.Socket[bytes] = context.socket(zmq.PAIR)
        monitor.setsockopt(zmq.LINGER, 0)
        monitor.setsockopt(zmq.RCVHWM, 0)  # or libzmq's own thread would wait for who reads this
        monitor.connect(address)
        socket.monitor(address, zmq.EVENT_DISCONNECTED)
    except zmq.ZMQError as error:
        raise RunError(f"no socket can be had: {error}; wanted: more open files (ulimit -n)") from error
    return monitor


def disconnected(monitor: zmq.Socket[bytes], most: int) -> set[int]:
    """Descriptors of connections that have closed since this was asked last, of so many at most."""
    found = set()
    for _ in range(most):
        if (parts := receive(monitor)) is None:
            break
        found.add(_EVENT.unpack(parts[0])[1])
    return found


def send(socket: zmq.Socket[bytes], parts: Sequence[bytes]) -> bool:
    """Send a message unless there is no room. Returns whether there was."""
    try:
        socket.send_multipart(parts, zmq.NOBLOCK)
    except zmq.Again:
        return False
    return True


def receive(socket: zmq.Socket[bytes]) -> list[bytes] | None:
    """The parts of the next message, None where there is none."""
    with contextlib.suppress(zmq.Again):
        return socket.recv_multipart(zmq.NOBLOCK)
    return None
