"""`python -m wall.study.faults.stranger FIRST-LAST CONNECTIONS SECONDS HOST...`: somebody on the network without a key.

It looks for open ports on the hosts, as anybody can. For each line `connect` that it reads it connects to them for so
many seconds, so many times a second: each connection begins as a peer of ZeroMQ does that has a key (ZMTP 3.1 with
CURVE, rfc.zeromq.org 37 and 26), so that the other end has to decrypt what it sends, and is refused. For each line
`rest` it takes the CPU time that the connections before took it, and leaves the hosts alone. It answers each line in
JSON: how many ports it found, how many connections it made, and which CPU time it took.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import socket
import sys
import time
from collections.abc import Sequence

from wall.core.system import end_with_parent

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01" + b"CURVE".ljust(20, b"\0") + bytes(32)  # of a client
HELLO_BYTES = 200  # "\5HELLO", version, padding, a client's key, a nonce, a sealed box
BOX_BYTES = 32 + 8 + 80  # of which nobody can tell that they are none before they are decrypted
FINDS_S = 0.2  # for a port to answer
LASTS_S = 0.5  # that a connection stays, if the other end keeps it
MOST_OPEN = 512
LOOKS_S = 0.05  # at the latest for connections that have lasted long enough

Address = tuple[str, int]


def hello() -> bytes:
    """A greeting and a HELLO command with a box that is none."""
    command = b"\x05HELLO\x01\x00"
    body = command + bytes(HELLO_BYTES - len(command) - BOX_BYTES) + os.urandom(BOX_BYTES)
    return GREETING + b"\x04" + bytes([len(body)]) + body


def open_ports(hosts: Sequence[str], first: int, last: int) -> list[Address]:
    """Where somebody listens."""
    found = []
    for host in hosts:
        for port in range(first, last + 1):
            try:
                socket.create_connection((host, port), FINDS_S).close()
            except OSError:
                continue
            found.append((host, port))
    return found


def attack(addresses: Sequence[Address], per_s: float, seconds: float) -> int:
    """Connect so many times a second, by turns, and let the last ones end. Returns how many connections were made."""
    opened, made, began = dict[socket.socket, float](), 0, time.monotonic()
    with selectors.DefaultSelector() as selector:
        while (now := time.monotonic()) < began + seconds or opened:
            due = began + made / per_s
            if due <= now < began + seconds and len(opened) < MOST_OPEN:
                connection = socket.socket()
                connection.setblocking(False)
                connection.connect_ex(addresses[made % len(addresses)])
                selector.register(connection, selectors.EVENT_WRITE)
                opened[connection], made = now, made + 1
                continue
            old = [connection for connection, since in opened.items() if now > since + LASTS_S]
            for key, events in selector.select(min(LOOKS_S, due - now) if due > now else LOOKS_S):
                assert isinstance(key.fileobj, socket.socket)
                if not _goes_on(key.fileobj, events, selector):
                    old.append(key.fileobj)
            for connection in dict.fromkeys(old):
                selector.unregister(connection)
                connection.close()
                del opened[connection]
    return made


def spin(count: int, each_s: float, seconds: float) -> None:
    """Take so much CPU time so many times within some seconds, for nothing."""
    began = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, began + number * seconds / count - time.monotonic()))
        enough = time.process_time() + each_s
        while time.process_time() < enough:
            pass


def _goes_on(connection: socket.socket, events: int, selector: selectors.BaseSelector) -> bool:
    """Say hello once connected, then read what comes. Returns whether the other end keeps the connection."""
    try:
        if events & selectors.EVENT_WRITE:
            connection.send(hello())
            selector.modify(connection, selectors.EVENT_READ)
            return True
        return bool(connection.recv(4096))
    except OSError:
        return False


if __name__ == "__main__":
    end_with_parent(signal.SIGKILL)
    first, last = map(int, sys.argv[1].split("-"))
    per_s, seconds, hosts = float(sys.argv[2]), float(sys.argv[3]), sys.argv[4:]
    found = open_ports(hosts, first, last)
    count, each_s = 0, 0.0  # connections of the last turn, and the CPU time of each
    for line in sys.stdin:
        before, made = time.process_time(), 0
        if line.strip() == "connect" and found:
            count = made = attack(found, per_s, seconds)
            each_s = (time.process_time() - before) / max(made, 1)
        else:
            spin(count, each_s, seconds)
        told = {"ports": len(found), "connections": made, "cpu_s": time.process_time() - before}
        print(json.dumps(told), flush=True)
