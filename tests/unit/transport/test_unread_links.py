"""A link whose process has no time to read: a held-up rank keeps its connection, and lives."""

from __future__ import annotations

import time

import pytest
import zmq

from wall.transport import sockets
from wall.transport.base import MAX_CONTROL
from wall.transport.zeromq import ZmqLink

DEADLINE_S = 10.0


def test_a_link_that_is_not_read_for_a_while_keeps_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full queue of libzmq's is not read, nor are heartbeats behind it: the connection ends, what is in it is lost,
    and the process may die, as an activation of the old connection meets the new one (libzmq issue 3937)."""
    monkeypatch.setattr(sockets, "HEARTBEAT_MS", 50)
    monkeypatch.setattr(sockets, "HEARTBEAT_TIMEOUT_MS", 200)
    count, words = 3 * MAX_CONTROL, list[bytes]()
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        router.setsockopt(zmq.SNDHWM, 0)
        router.setsockopt(zmq.LINGER, 0)
        port = router.bind_to_random_port("tcp://127.0.0.1")
        link = ZmqLink(f"tcp://127.0.0.1:{port}", rank=1)
        try:
            peer, _, _ = router.recv_multipart()
            for number in range(count):
                router.send_multipart([peer, b"C", str(number).encode()])
            time.sleep(1.0)  # five times what ends a connection
            limit = time.monotonic() + DEADLINE_S
            while words[-1:] != [str(count - 1).encode()]:
                assert time.monotonic() < limit, f"{len(words)} of {count} messages came"
                words += link.receive()
                time.sleep(0.001)
        finally:
            link.close()
    assert len(words) + link.counters["control_overflow"] == count
