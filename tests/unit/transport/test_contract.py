"""What every transport promises, run over the loopback and over ZeroMQ."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from wall.core.errors import LocalProtocolError
from wall.transport import zeromq
from wall.transport.base import MAX_CONTROL, MAX_MESSAGE_BYTES, Hub, Link
from wall.transport.credit import QUEUED_PACKETS
from wall.transport.factory import connect, open_hub
from wall.transport.zeromq import ZmqHub

KINDS = ("loopback", "zmq")
DEADLINE_S = 10.0  # a loaded machine is slow, a deadlock is longer
POLL_S = 0.002
WINDOW = 10_000
ALL = 1 << 24


class Ends:
    """A hub, its links, and polling with a deadline in place of sleeping."""

    def __init__(self, kind: str) -> None:
        self.hub: Hub = open_hub(kind, "127.0.0.1", credit_bytes=WINDOW)
        self.links: list[Link] = []

    def link(self) -> Link:
        self.links.append(connect(self.hub.endpoint, rank=len(self.links)))
        return self.links[-1]

    def ready_link(self) -> Link:
        link = self.link()
        self.until(lambda: bool(self.hub.drain(ALL)) or link.ready())  # a hub works only while it is called
        return link

    def until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, f"hub {self.hub.counters}, links {[link.counters for link in self.links]}"
            self.hub.wait(POLL_S)

    def next_of(self, link: Link) -> bytes:
        """The one data packet that comes next, consumed."""
        came: list[tuple[bytes, bytes]] = []

        def arrived() -> bool:
            link.ready()  # a link works only while it is called
            came.extend(self.hub.drain(ALL))
            return bool(came)

        self.until(arrived)
        ((peer, data),) = came
        self.hub.release(peer, len(data))
        return data

    def all_before(self, link: Link, word: bytes) -> list[tuple[bytes, bytes]]:
        """Every data packet that the link has sent: what came before a control message sent after them."""
        came: list[tuple[bytes, bytes]] = []
        link.send(word)

        def spoken() -> bool:
            words = [message for _, message in self.hub.messages()]
            came.extend(self.hub.drain(ALL))
            return word in words

        self.until(spoken)
        return came

    def close(self) -> None:
        for link in self.links:
            link.close()
        self.hub.close()


@pytest.fixture(params=KINDS)
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    pair = Ends(request.param)
    yield pair
    pair.close()


def packet(k: int, size: int = 1000) -> bytes:
    return k.to_bytes(4, "little") + bytes(size - 4)


def number(data: bytes) -> int:
    return int.from_bytes(data[:4], "little")


def test_a_hub_that_waits_is_woken_by_what_comes_at_a_link(ends: Ends) -> None:
    link, other = ends.ready_link(), open_hub("zmq", "127.0.0.1", credit_bytes=WINDOW)
    ends.hub.broadcast(b"news")
    began = time.monotonic()
    if isinstance(ends.hub, ZmqHub):
        other.wait(DEADLINE_S, link)
        assert time.monotonic() - began < DEADLINE_S, "it was not the time that was over"
    assert link.receive() == [b"news"]
    other.close()


def test_another_thread_sends_beside_a_link_s_own_and_no_message_is_torn(ends: Ends) -> None:
    link, count = ends.ready_link(), 300
    own, others = ([b"%s %d" % (who, k) for k in range(count)] for who in (b"own", b"other"))
    beside = threading.Thread(target=lambda: [link.send_beside(message) for message in others])
    beside.start()
    came: list[bytes] = []
    for k, message in enumerate(own):
        link.send(message)
        link.receive()
        if k % 16 == 0:
            link.wait(0.001)
        ends.hub.broadcast(b"news")
        came += [message for _, message in ends.hub.messages()]

    def all_came() -> bool:
        came.extend(message for _, message in ends.hub.messages())
        return len(came) == 2 * count

    ends.until(all_came)
    beside.join(DEADLINE_S)
    for sent in (own, others):
        assert [message for message in came if message in sent] == sent, "each in its order"
    link.close()
    link.send_beside(b"late")  # is no error: its thread could not know
    ends.hub.wait(0.05)
    assert not ends.hub.counters.get("bad_frame")


def test_credit_bounds_the_bytes_under_way_and_the_oldest_waiting_packet_gives_way(ends: Ends) -> None:
    link = ends.ready_link()
    dropped = [number(old) for k in range(100) for old in link.offer(packet(k))]
    came = ends.all_before(link, b"sent")
    assert [number(data) for _, data in came] == list(range(10))
    assert dropped == list(range(10, 100 - QUEUED_PACKETS))
    assert link.counters == {"no_credit": 88}
    assert link.credit.left < len(packet(0))
    for peer, data in came:
        ends.hub.release(peer, len(data))
    rest: list[int] = []

    def waiting_ones_came() -> bool:
        link.ready()
        rest.extend(number(data) for _, data in ends.hub.drain(ALL))
        return len(rest) == QUEUED_PACKETS

    ends.until(waiting_ones_came)
    assert rest == [98, 99]


def test_a_link_is_ready_while_a_packet_would_be_sent_at_once(ends: Ends) -> None:
    link = ends.ready_link()
    sent = 0
    while link.ready():
        assert link.offer(packet(sent)) == []
        sent += 1
    assert sent == 10
    came = ends.all_before(link, b"sent")
    assert not link.ready()
    for peer, data in came:
        ends.hub.release(peer, len(data))
    ends.until(link.ready)


def test_a_packet_above_the_window_goes_when_nothing_else_is_under_way(ends: Ends) -> None:
    link = ends.ready_link()
    link.offer(packet(0, 5 * WINDOW))
    link.offer(packet(1, 5 * WINDOW))
    ((peer, first),) = ends.all_before(link, b"sent")
    assert number(first) == 0
    ends.hub.release(peer, len(first))
    assert number(ends.next_of(link)) == 1


def test_a_large_packet_after_a_small_one_does_not_wait_to_ask(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zeromq, "ASK_AGAIN_S", 1e9)
    link = ends.ready_link()
    for k in range(5):
        link.offer(packet(2 * k, 100))
        assert number(ends.next_of(link)) == 2 * k
        link.offer(packet(2 * k + 1, WINDOW))
        assert number(ends.next_of(link)) == 2 * k + 1


def test_large_packets_come_as_they_were_sent_also_through_memory(ends: Ends) -> None:
    """Of every size: beside the ring, in it, across its end, and larger than it was made for."""
    link, rng, sizes = ends.ready_link(), np.random.default_rng(1), [1, 4095, 4096, 9000, 30_000, 30_001, 4097, 70_000]
    assert isinstance(link.shares(30_000), bool)
    ends.until(lambda: link.shares(30_000) or bool(ends.hub.drain(ALL)) or bool(link.receive()))
    for size in sizes * 3:
        data = rng.bytes(size)
        assert link.offer(data) == []
        assert ends.next_of(link) == data
        ends.until(lambda: link.ready() or bool(ends.hub.drain(ALL)))
    assert (link.counters, ends.hub.counters) == ({}, {})


def test_control_messages_keep_their_order_both_ways(ends: Ends) -> None:
    link = ends.ready_link()
    words = [b"%d" % k for k in range(200)]
    for word in words:
        link.send(word)
    up: list[tuple[bytes, bytes]] = []
    ends.until(lambda: bool(up.extend(ends.hub.messages()) or len(up) == 200))
    assert [word for _, word in up] == words
    for word in words:
        ends.hub.send(up[0][0], word)
    down: list[bytes] = []
    ends.until(lambda: bool(down.extend(link.receive()) or len(down) == 200))
    assert down == words


def test_control_messages_pass_when_there_is_no_credit(ends: Ends) -> None:
    link = ends.ready_link()
    while link.ready():
        link.offer(packet(0))
    link.send(b"still here")
    words: list[tuple[bytes, bytes]] = []
    ends.until(lambda: bool(words.extend(ends.hub.messages()) or words))
    ends.hub.send(words[0][0], b"so am I")
    down: list[bytes] = []
    ends.until(lambda: bool(down.extend(link.receive()) or down))
    assert down == [b"so am I"]


def test_a_broadcast_reaches_everyone_who_has_spoken_and_late_joiners_from_then_on(ends: Ends) -> None:
    heard: dict[int, list[bytes]] = {0: [], 1: [], 2: []}
    first, second = ends.ready_link(), ends.ready_link()
    for link in (first, second):
        ends.all_before(link, b"hello")
    ends.hub.broadcast(b"early")
    late = ends.ready_link()
    ends.all_before(late, b"hello")
    ends.hub.broadcast(b"late")

    def all_heard() -> bool:
        for k, link in enumerate((first, second, late)):
            heard[k] += link.receive()
        return all(b"late" in words for words in heard.values())

    ends.until(all_heard)
    assert heard == {0: [b"early", b"late"], 1: [b"early", b"late"], 2: [b"late"]}


def test_a_message_to_someone_unknown_is_counted(ends: Ends) -> None:
    ends.hub.send(b"nobody", b"hello?")
    ends.hub.release(b"nobody", 100)
    assert ends.hub.counters == {"peer_gone": 1}


def test_oversize_messages_are_refused_where_they_are_made(ends: Ends) -> None:
    link, huge = ends.ready_link(), bytes(MAX_MESSAGE_BYTES + 1)
    ends.all_before(link, b"hello")
    for send in (link.offer, link.send, ends.hub.broadcast):
        with pytest.raises(LocalProtocolError, match=f"at most {MAX_MESSAGE_BYTES}"):
            send(huge)
    assert link.ready()


def test_control_messages_that_nobody_reads_are_bounded_and_counted(ends: Ends) -> None:
    link = ends.ready_link()
    for k in range(MAX_CONTROL + 10):
        link.send(b"%d" % k)
        if k % 100 == 0:
            ends.hub.drain(ALL)

    def overflowed() -> bool:
        link.ready()  # sends what its socket had no room for
        ends.hub.drain(ALL)
        return ends.hub.counters.get("control_overflow") == 10

    ends.until(overflowed)
    up = ends.hub.messages()
    assert [word for _, word in up] == [b"%d" % k for k in range(10, MAX_CONTROL + 10)]

    def link_overflowed() -> bool:
        for _ in range(100):  # a socket that is slow may be full: the hub drops and counts, the link fills up later
            ends.hub.send(up[0][0], b"news")
        link.ready()
        return link.counters.get("control_overflow", 0) > 0

    ends.until(link_overflowed)
    assert len(link.receive()) == MAX_CONTROL


def test_links_share_a_slow_hub_and_packets_stay_young(ends: Ends) -> None:
    """The hub consumes one packet a tick, three links offer one each: three times too many.

    At most 10 packets of each link are under way and 2 wait, so that a packet is consumed within 3 * 10 + 3 ticks or
    gives way. Sockets may hold one back while the test ticks on, so three times as much is allowed; without credit
    the last would be 200 ticks old.
    """
    links = [ends.ready_link() for _ in range(3)]
    oldest, taken = 0, dict.fromkeys(range(3), 0)
    backlog: list[tuple[bytes, bytes]] = []

    def something_came() -> bool:
        for link in links:
            link.ready()  # takes in its grants
        backlog.extend(ends.hub.drain(1))
        return bool(backlog)

    for tick in range(300):
        for k, link in enumerate(links):
            link.offer(packet(tick * 4 + k))
        ends.until(something_came)
        peer, data = backlog.pop(0)
        ends.hub.release(peer, len(data))
        oldest = max(oldest, tick - number(data) // 4)
        taken[number(data) % 4] += 1
    assert oldest <= 3 * (3 * 10 + QUEUED_PACKETS + 1)
    assert min(taken.values()) >= 30  # nobody starves


def test_a_waiting_hub_and_a_waiting_link_wake_when_something_comes(ends: Ends) -> None:
    began, came = time.monotonic(), threading.Event()

    def rank() -> None:
        link = connect(ends.hub.endpoint, rank=7)
        link.send(b"hello")
        while not link.receive() and time.monotonic() - began < DEADLINE_S:
            link.wait(DEADLINE_S)
        came.set()
        link.close()

    thread = threading.Thread(target=rank)
    thread.start()
    words: list[tuple[bytes, bytes]] = []
    while not words and time.monotonic() - began < DEADLINE_S:
        ends.hub.wait(DEADLINE_S)
        words += ends.hub.messages()
    ends.hub.send(words[0][0], b"welcome")
    thread.join()
    assert came.is_set()
    assert time.monotonic() - began < DEADLINE_S / 2


@pytest.mark.parametrize("kind", KINDS)
def test_closing_twice_leaves_no_thread_and_no_socket(kind: str) -> None:
    Ends(kind).close()  # what the libraries keep for ever is there now
    before = open_things()
    for _ in range(3):
        pair = Ends(kind)
        link = pair.ready_link()
        link.offer(packet(1))
        link.send(b"last words")
        pair.close()
        pair.close()
    assert open_things() == before


@pytest.mark.parametrize("kind", KINDS)
def test_a_link_that_comes_after_the_hub_has_closed_has_no_credit_and_raises_nothing(kind: str) -> None:
    """A rank that starts slowly in a short run meets ranks that have ended."""
    hub = open_hub(kind, "127.0.0.1", credit_bytes=WINDOW)
    hub.close()
    link = connect(hub.endpoint, rank=0)
    link.send(b"anybody?")

    gave_way = [dropped for number in range(QUEUED_PACKETS + 1) for dropped in link.offer(packet(number))]

    assert gave_way == [packet(0)]
    assert not link.ready()
    assert link.receive() == []
    with pytest.raises(LocalProtocolError):  # as of a link that has a hub
        link.send(bytes(MAX_MESSAGE_BYTES + 1))
    link.close()


def test_closing_without_a_hub_takes_a_bounded_time() -> None:
    hub = open_hub("zmq", "127.0.0.1", credit_bytes=WINDOW)
    hub.close()
    link = connect(hub.endpoint, rank=0)
    link.send(b"anybody?")
    began = time.monotonic()
    link.close()
    assert time.monotonic() - began < 2.0


def open_things() -> tuple[int, int]:
    """Threads of this process, and its file descriptors that are sockets, pipes or event counters."""
    links = []
    for fd in os.listdir("/proc/self/fd"):
        try:
            links.append(os.readlink(f"/proc/self/fd/{fd}"))
        except FileNotFoundError:  # the folder's own
            continue
    kinds = ("socket:", "pipe:", "anon_inode:")
    return len(os.listdir("/proc/self/task")), sum(link.startswith(kinds) for link in links)
