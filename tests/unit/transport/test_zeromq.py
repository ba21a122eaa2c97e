"""What only sockets do: peers that speak another protocol, grants that get lost, hubs that go and come back."""

from __future__ import annotations

import math
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
import zmq

from wall.core.errors import RemoteProtocolError, RunError
from wall.transport import zeromq
from wall.transport.addresses import WILDCARDS, reachable
from wall.transport.base import MAX_CONTROL, MAX_CONTROL_BYTES, MAX_MESSAGE_BYTES, Hub
from wall.transport.shared_memory import OTHER_MACHINE
from wall.transport.zeromq import ZmqHub, ZmqLink

DEADLINE_S = 10.0
WINDOW = 10_000
Raw = Callable[[int, str], "zmq.Socket[bytes]"]


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def raw(closing: ExitStack) -> Raw:
    """Makes a plain socket of some kind, connected to an endpoint ("" = not connected)."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    closing.callback(context.destroy, linger=0)

    def make(kind: int, endpoint: str) -> zmq.Socket[bytes]:
        socket = context.socket(kind)
        if endpoint:
            socket.connect(endpoint)
        return socket

    return make


def hub_of(closing: ExitStack, *, ports: tuple[int, int] | None = None, allow: tuple[str, ...] = ()) -> ZmqHub:
    hub = ZmqHub("127.0.0.1", credit_bytes=WINDOW, ports=ports, allow=allow)
    closing.callback(hub.close)
    return hub


def link_to(closing: ExitStack, endpoint: str) -> ZmqLink:
    link = ZmqLink(endpoint, rank=1)
    closing.callback(link.close)
    return link


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end


def goes_through(link: ZmqLink, hub: Hub) -> bool:
    """Whether a packet offered now and then reaches the hub; what came is consumed."""
    if link.ready():
        link.offer(b"through")
    link.wait(0.005)
    came = hub.drain(1 << 20)
    for peer, packet in came:
        hub.release(peer, len(packet))
    return any(packet == b"through" for _, packet in came)


def test_strangers_are_counted_and_harm_no_good_link(closing: ExitStack, raw: Raw) -> None:
    hub = hub_of(closing)
    stranger, link = raw(zmq.DEALER, hub.endpoint), link_to(closing, hub.endpoint)
    frames = [
        [b"alone"], [b"D"], [b"D", b"a", b"b"], [b"", b""], [b"X", b"tag"], [b"D", b""], [b"A", b"short"],
        [b"A", struct.pack("<Q", 2**64 - 1)], [b"G", struct.pack("<QQ", 1, 1)],
    ]  # fmt: skip
    for parts in frames:
        stranger.send_multipart(parts)
    until(lambda: goes_through(link, hub) and hub.counters.get("bad_frame") == len(frames))
    assert set(hub.counters) == {"bad_frame"}


def test_a_peer_that_ignores_its_credit_is_cut_to_it(closing: ExitStack, raw: Raw) -> None:
    hub = hub_of(closing)
    greedy = raw(zmq.DEALER, hub.endpoint)
    for _ in range(100):
        greedy.send_multipart([b"D", bytes(1000)])
    greedy.send_multipart([b"C", b"end"])
    until(lambda: bool(hub.messages()))
    assert len(hub.drain(1 << 20)) == 10
    assert hub.counters == {"over_credit": 90}


def test_an_oversize_message_costs_its_sender_the_connection_and_nobody_else(closing: ExitStack, raw: Raw) -> None:
    hub = hub_of(closing)
    link, giant = link_to(closing, hub.endpoint), raw(zmq.DEALER, hub.endpoint)
    giant.send_multipart([b"C", bytes(MAX_MESSAGE_BYTES + 1)])
    giant.send_multipart([b"C", b"after"])  # arrives on the next connection
    words: list[bytes] = []
    until(lambda: goes_through(link, hub) and bool(words.extend(w for _, w in hub.messages()) or words))
    assert words == [b"after"]


def test_a_link_ignores_and_counts_frames_that_no_hub_sends(closing: ExitStack, raw: Raw) -> None:
    router = raw(zmq.ROUTER, "")
    port = router.bind_to_random_port("tcp://127.0.0.1")
    link = link_to(closing, f"tcp://127.0.0.1:{port}")
    peer, tag, body = router.recv_multipart()
    assert (tag, body) == (b"A", struct.pack("<Q", 0))
    for parts in ([b"G", b"short"], [b"?", b""], [b"C"], [b"C", b"good"]):
        router.send_multipart([peer, *parts])
    words: list[bytes] = []
    until(lambda: bool(words.extend(link.receive()) or words))
    assert words == [b"good"]
    assert link.counters == {"bad_frame": 3}
    assert not link.ready()


def test_a_link_whose_grant_was_lost_asks_again_and_goes_on(
    closing: ExitStack, raw: Raw, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 0.02)
    router = raw(zmq.ROUTER, "")
    port = router.bind_to_random_port("tcp://127.0.0.1")
    link = link_to(closing, f"tcp://127.0.0.1:{port}")
    assert router.recv_multipart()[1] == b"A"  # not answered
    until(lambda: link.ready() or bool(router.poll(1)))
    peer, tag, _ = router.recv_multipart()
    assert tag == b"A"
    router.send_multipart([peer, b"G", struct.pack("<QQ", WINDOW, WINDOW)])
    until(link.ready)


def test_asking_over_and_over_does_not_widen_the_window(closing: ExitStack, monkeypatch: pytest.MonkeyPatch) -> None:
    hub = hub_of(closing)
    link = link_to(closing, hub.endpoint)
    until(lambda: bool(hub.drain(1 << 20)) or link.ready())
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 0.0)
    for _ in range(50):
        link.offer(bytes(1000))
    link.send(b"end")
    taken: list[tuple[bytes, bytes]] = []
    words: list[tuple[bytes, bytes]] = []
    until(lambda: bool(words.extend(hub.messages()) or words))
    for _ in range(20):
        link.ready()
        taken += hub.drain(1 << 20)
    assert len(taken) == WINDOW // 1000


def test_links_recover_when_their_hub_goes_and_comes_back(closing: ExitStack, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 0.02)
    first = hub_of(closing)
    link = link_to(closing, first.endpoint)
    until(lambda: goes_through(link, first))
    while link.ready():
        link.offer(bytes(1000))  # never consumed: gone with the hub
    first.close()
    port = int(first.endpoint.rsplit(":", 1)[1])
    second = hub_of(closing, ports=(port, port))
    assert second.endpoint == first.endpoint
    until(lambda: goes_through(link, second))
    link.send(b"hello again")
    until(lambda: goes_through(link, second) and bool(second.messages()))
    second.broadcast(b"welcome back")
    words: list[bytes] = []
    until(lambda: bool(words.extend(link.receive()) or words))
    assert words == [b"welcome back"]


def test_a_link_that_went_is_counted_and_the_others_still_hear(closing: ExitStack) -> None:
    hub = hub_of(closing)
    stays, goes = link_to(closing, hub.endpoint), link_to(closing, hub.endpoint)
    for link in (stays, goes):
        link.send(b"hello")
    words: list[tuple[bytes, bytes]] = []
    until(lambda: bool(words.extend(hub.messages()) or len(words) == 2))
    goes.close()

    def noticed() -> bool:
        hub.broadcast(b"news")
        hub.wait(0.005)
        return hub.counters.get("peer_gone") == 1

    until(noticed)
    until(lambda: b"news" in stays.receive())


def shares(link: ZmqLink, hub: Hub, size: int = 8000) -> bool:
    """Whether the hub has opened the link's memory by now."""
    return bool(hub.drain(1 << 20)) or link.receive() != [] or link.shares(size)


def only_place_is_sent(link: ZmqLink, hub: ZmqHub, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Offers a packet and takes it. Whether it went through memory."""
    tags: list[bytes] = []
    put = link._put
    with monkeypatch.context() as patch:
        patch.setattr(link, "_put", lambda tag, body: bool(tags.append(tag) or put(tag, body)))
        until(link.ready)
        link.offer(b"word" * 2000)
    came: list[tuple[bytes, bytes]] = []
    until(lambda: bool(came.extend(hub.drain(1 << 20)) or came))
    assert [packet for _, packet in came] == [b"word" * 2000]
    hub.release(came[0][0], len(came[0][1]))
    assert (b"P" in tags) != (b"D" in tags)
    return b"P" in tags


def test_large_packets_between_processes_of_a_machine_go_through_memory(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = hub_of(closing)
    link = link_to(closing, hub.endpoint)
    assert not link.shares(8000), "before any grant"
    until(lambda: goes_through(link, hub))
    assert not only_place_is_sent(link, hub, monkeypatch), "nobody asked for memory yet"
    until(lambda: shares(link, hub))
    for _ in range(10):
        assert only_place_is_sent(link, hub, monkeypatch)
    assert not link.shares(1 << 20), "first the hub must open larger memory"
    assert not only_place_is_sent(link, hub, monkeypatch)
    until(lambda: shares(link, hub, 1 << 20))
    assert only_place_is_sent(link, hub, monkeypatch)
    assert (link.note, link.counters, hub.counters) == ("", {}, {})


@pytest.mark.parametrize(
    ("where", "error", "note"),
    [
        ("RingWriter", OSError(28, "No space left"), "no shared memory of 20000 bytes: No space left"),
        ("RingReader", PermissionError(13, "Permission denied"), "the receiver cannot open the sender's memory"),
        ("RingReader", RemoteProtocolError("not an anonymous file"), "not an anonymous file"),
        ("RingReader", RemoteProtocolError(OTHER_MACHINE), ""),
    ],
)
def test_where_memory_cannot_be_shared_packets_are_sent_and_a_note_says_why(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch, where: str, error: Exception, note: str
) -> None:
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 0.0)

    def refuse(*_: object) -> None:
        raise error

    monkeypatch.setattr(zeromq, where, refuse)
    hub = hub_of(closing)
    link = link_to(closing, hub.endpoint)
    until(lambda: goes_through(link, hub))
    until(lambda: not shares(link, hub) and bool(link._refused))
    assert link.note.startswith(note)
    assert bool(link.note) == bool(note)
    for _ in range(3):
        assert not link.shares(8000)
        assert not only_place_is_sent(link, hub, monkeypatch)
    assert link._ring is None


def test_a_hub_that_forgot_a_link_is_told_of_its_memory_again(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = hub_of(closing)
    link = link_to(closing, hub.endpoint)
    until(lambda: goes_through(link, hub))
    until(lambda: shares(link, hub))
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", math.inf)  # so that nothing is told before it is lost
    hub._rings.clear()
    until(link.ready)
    link.offer(b"word" * 2000)
    until(lambda: not hub.drain(1 << 20) and hub.counters == {"lost_in_memory": 1})
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 0.02)
    until(lambda: bool(link.receive()) or not link._ring_open)
    until(lambda: shares(link, hub))
    assert only_place_is_sent(link, hub, monkeypatch)


def test_memory_of_links_that_went_is_let_go(closing: ExitStack) -> None:
    hub = hub_of(closing)
    stays, goes = link_to(closing, hub.endpoint), link_to(closing, hub.endpoint)
    for link in (stays, goes):
        until(lambda link=link: goes_through(link, hub))  # type: ignore[misc]
        until(lambda link=link: shares(link, hub))  # type: ignore[misc]
    assert len(hub._rings) == 2
    goes.close()
    until(lambda: not hub.drain(1 << 20) and len(hub._rings) == 1)
    hub.close()
    assert not hub._rings


def test_a_stranger_s_memory_and_places_are_refused(closing: ExitStack, raw: Raw) -> None:
    hub = hub_of(closing)
    stranger, link = raw(zmq.DEALER, hub.endpoint), link_to(closing, hub.endpoint)
    bad = [[b"M", b"short"], [b"P", b"short"], [b"P", struct.pack("<QQQ", 1, 2, 0)]]
    bad += [[b"P", struct.pack("<QQQ", 1, 2, 2**64 - 1)]]
    lost = [[b"P", struct.pack("<QQQ", 1, 2**64 - 1, size)] for size in (1, 8000, MAX_MESSAGE_BYTES)]
    for parts in (*bad, *lost, [b"M", bytes(48)]):
        stranger.send_multipart(parts)
    until(lambda: goes_through(link, hub) and hub.counters.get("lost_in_memory") == len(lost))
    assert hub.counters == {"bad_frame": len(bad), "lost_in_memory": len(lost)}
    answers = [stranger.recv_multipart()[-1]]
    while OTHER_MACHINE.encode() not in answers[-1]:
        answers.append(stranger.recv_multipart()[-1])
    assert not hub._rings


def test_an_address_that_is_not_this_host_s_is_refused_with_a_word() -> None:
    with pytest.raises(RunError, match=r"transport\.bind: cannot listen on 203\.0\.113\.9: .*wanted a local address"):
        ZmqHub("203.0.113.9", credit_bytes=WINDOW)  # a documentation address, RFC 5737


def test_hubs_take_the_free_ports_of_their_range_and_say_when_there_is_none(closing: ExitStack) -> None:
    first = int(hub_of(closing).endpoint.rsplit(":", 1)[1])
    second = hub_of(closing, ports=(first, 65535))
    last = int(second.endpoint.rsplit(":", 1)[1])
    assert last > first
    wanted = rf"transport\.ports: none of {first}-{last} is free at 127\.0\.0\.1; wanted: two for the head"
    with pytest.raises(RunError, match=wanted):
        hub_of(closing, ports=(first, last))


def test_hosts_of_other_networks_are_sent_away_before_they_have_said_anything(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    for network, here in (("127.0.0.1/32", True), ("203.0.113.0/24", False)):
        # without those of this machine, which are always let in
        monkeypatch.setattr(zeromq, "let_in", lambda allow, bind: list(allow))
        hub = hub_of(closing, allow=(network,))
        port = int(hub.endpoint.rsplit(":", 1)[1])
        stranger = closing.enter_context(socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S))
        assert stranger.recv(1) == (b"\xff" if here else b""), "the first byte of a greeting, or the end"
    monkeypatch.undo()
    hub = hub_of(closing, allow=("203.0.113.0/24",))
    link = link_to(closing, hub.endpoint)
    until(lambda: goes_through(link, hub))


def test_only_wildcards_are_replaced_by_an_address_that_others_can_reach() -> None:
    assert reachable("127.0.0.1") == "127.0.0.1"
    assert reachable("node7.cluster") == "node7.cluster"
    for wildcard in WILDCARDS:
        numbers = reachable(wildcard).split(".")
        assert len(numbers) == 4
        assert all(0 <= int(number) <= 255 for number in numbers)
        assert reachable(wildcard) not in WILDCARDS


def test_a_hub_on_all_interfaces_names_an_endpoint_that_answers(closing: ExitStack) -> None:
    hub = ZmqHub("0.0.0.0", credit_bytes=WINDOW)
    closing.callback(hub.close)
    link = link_to(closing, hub.endpoint)
    until(lambda: goes_through(link, hub))


def test_a_flood_of_one_peer_pushes_out_no_other_s_messages(closing: ExitStack) -> None:
    hub = hub_of(closing)
    flood, honest = link_to(closing, hub.endpoint), link_to(closing, hub.endpoint)
    honest.send(b"alive")
    until(lambda: hub.drain(1) == [] and bool(hub._messages))
    for k in range(MAX_CONTROL + 50):
        flood.send(b"ping")
        if k % 100 == 0:
            hub.drain(1)

    def overflowed() -> bool:
        flood.ready()
        hub.drain(1)
        return hub.counters["control_overflow"] == 50

    until(overflowed)
    messages = [message for _, message in hub.messages()]
    assert messages.count(b"alive") == 1
    assert messages.count(b"ping") == MAX_CONTROL


def test_control_messages_of_a_peer_that_wait_are_bounded_in_bytes(closing: ExitStack) -> None:
    hub = hub_of(closing)
    link = link_to(closing, hub.endpoint)
    for size in (MAX_CONTROL_BYTES + 1, MAX_CONTROL_BYTES, 1):
        link.send(bytes(size))
    until(lambda: hub.drain(1) == [] and hub.counters == {"bad_frame": 1, "control_overflow": 1})
    assert [len(message) for _, message in hub.messages()] == [1]
