"""The stranger of `wall measure faults`: it costs a wall what somebody without a key can make it do."""

from __future__ import annotations

import os
import socket
import time

import pytest
import zmq
from zmq.utils.monitor import recv_monitor_message

from wall.core.errors import RunError
from wall.study.faults import stranger
from wall.study.faults.intrusion import cpu_seconds
from wall.transport.curve import Keys

PER_S, SECONDS = 200.0, 0.5
CRYPTOGRAPHIC = 0x11000001  # libzmq: a box that cannot be opened with the keys


def test_each_connection_gets_as_far_as_a_box_that_has_to_be_decrypted() -> None:
    context = zmq.Context()
    server = context.socket(zmq.ROUTER)
    keys, _ = Keys.of_all(2)
    keys.lock(server)
    monitor = server.get_monitor_socket(zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL | zmq.EVENT_HANDSHAKE_SUCCEEDED)
    try:
        port = server.bind_to_random_port("tcp://127.0.0.1")
        made = stranger.attack([("127.0.0.1", port)], PER_S, SECONDS)
        found = []
        while len(found) < made and monitor.poll(2000):
            event = recv_monitor_message(monitor)
            found.append((event["event"], event["value"]))
        assert 0.2 * PER_S * SECONDS < made <= PER_S * SECONDS + 1
        assert found == made * [(zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL, CRYPTOGRAPHIC)]
    finally:
        server.disable_monitor()
        context.destroy(linger=0)


def test_ports_are_found_where_somebody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        assert stranger.open_ports(["127.0.0.1"], port, port) == [("127.0.0.1", port)]
    assert stranger.open_ports(["127.0.0.1"], port, port) == []


def test_at_rest_it_takes_the_time_that_connections_take_and_a_process_s_time_is_known() -> None:
    own = [os.getpid()]
    before, began = cpu_seconds(own), time.process_time()
    stranger.spin(round(PER_S * SECONDS), 1e-3, SECONDS)
    taken = time.process_time() - began
    assert 1.0 <= taken / (PER_S * SECONDS * 1e-3) < 2.0
    assert cpu_seconds(own) - before == pytest.approx(taken, abs=0.05)
    with pytest.raises(RunError, match="has ended"):
        cpu_seconds([2**22 + 1])
