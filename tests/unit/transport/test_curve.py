"""With keys a hub hears the ranks of its run alone, each in its own name; strangers get nothing in."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest
import zmq

from wall.transport import sockets, zeromq
from wall.transport.base import GUEST, NOBODY
from wall.transport.curve import KeyPair, Keys
from wall.transport.zeromq import ZmqHub, ZmqLink

DEADLINE_S = 10.0
WINDOW = 10_000
REQUESTS = "key of requests"
HEAD, FIRST, SECOND = range(3)


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture(scope="module")
def keys() -> list[Keys]:
    return Keys.of_all(3)


def hub_of(closing: ExitStack, keys: Keys) -> ZmqHub:
    hub = ZmqHub("127.0.0.1", credit_bytes=WINDOW, keys=keys)
    closing.callback(hub.close)
    return hub


def link_to(closing: ExitStack, hub: ZmqHub, keys: Keys | None, *, to: int = HEAD) -> ZmqLink:
    link = ZmqLink(hub.endpoint, rank=1, keys=keys, to=to)
    closing.callback(link.close)
    return link


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def refusals_of(closing: ExitStack, hub: ZmqHub) -> Callable[[], int]:
    """How many handshakes have failed at a hub since this was asked before."""
    failures = zmq.EVENT_HANDSHAKE_FAILED_AUTH | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    monitor = hub._socket.get_monitor_socket(failures | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL)
    closing.callback(monitor.close, 0)
    closing.callback(hub._socket.disable_monitor)

    def count() -> int:
        found = 0
        while monitor.poll(0):
            monitor.recv_multipart()
            found += 1
        return found

    return count


def test_strangers_get_nothing_in_and_the_run_goes_on(closing: ExitStack, keys: list[Keys]) -> None:
    hub = hub_of(closing, keys[HEAD])
    other = KeyPair.new()
    strangers = {
        "no key": None,
        "a key of its own": replace(keys[FIRST], own=other),
        "a rank's name, another secret": replace(keys[FIRST], own=replace(other, public=keys[FIRST].own.public)),
        "another hub's key": replace(keys[FIRST], ranks=(other.public,)),
        "the key of requests, where no guests are let in": Keys.of_guest(REQUESTS, keys[HEAD].own.public),
    }
    refusals, links = refusals_of(closing, hub), []
    for name, own in strangers.items():
        refusals()
        links.append(link_to(closing, hub, own))
        links[-1].send(name.encode())
        until(refusals)
        links[-1]._socket.disconnect(hub.endpoint)  # or it would try again and again
        until(lambda: not refusals())
    honest = link_to(closing, hub, keys[FIRST])
    honest.send(b"honest")
    words: list[bytes] = []
    until(lambda: words.extend(word for _, word in hub.messages()) or words)
    hub.broadcast(b"to all")
    until(lambda: honest.receive() == [b"to all"])
    words += [word for _, word in hub.messages()]
    assert words == [b"honest"]
    assert [link.receive() for link in links] == [[]] * len(links)
    assert not hub.counters


def test_what_is_sent_cannot_be_read_on_the_way(closing: ExitStack, keys: list[Keys]) -> None:
    seen = {}
    for name, own in (("open", None), ("encrypted", keys[FIRST])):
        hub = ZmqHub("127.0.0.1", credit_bytes=WINDOW, keys=keys[HEAD] if own else None)
        closing.callback(hub.close)
        tap = Tap(int(hub.endpoint.rsplit(":", 1)[1]))
        closing.callback(tap.close)
        link = ZmqLink(tap.endpoint, rank=1, keys=own)
        closing.callback(link.close)
        link.send(b"a secret word")
        until(lambda hub=hub: hub.messages())
        seen[name] = b"a secret word" in bytes(tap.seen)
    assert seen == {"open": True, "encrypted": False}


def test_a_hub_knows_who_speaks_also_after_a_goodbye(closing: ExitStack, keys: list[Keys]) -> None:
    hub = hub_of(closing, keys[HEAD].with_guests(REQUESTS))
    senders = {b"1": keys[FIRST], b"2": keys[SECOND], b"guest": Keys.of_guest(REQUESTS, keys[HEAD].own.public)}
    for word, own in senders.items():
        link = link_to(closing, hub, own)
        link.send(word)
        link.close()
    said: list[tuple[bytes, bytes]] = []
    until(lambda: said.extend(hub.messages()) or len(said) == len(senders))
    assert {word: hub.proven(peer) for peer, word in said} == {b"1": FIRST, b"2": SECOND, b"guest": GUEST}
    assert hub.proven(b"never heard") == NOBODY


def test_a_rank_cannot_take_over_another_s_link(
    closing: ExitStack, keys: list[Keys], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zeromq.os, "urandom", bytes)  # both links have one name
    hub = hub_of(closing, keys[HEAD])
    words: list[bytes] = []
    honest = link_to(closing, hub, keys[FIRST])
    honest.send(b"honest")
    until(lambda: words.extend(word for _, word in hub.messages()) or words)
    forger = link_to(closing, hub, keys[SECOND])
    forger.send(b"forged")
    until(lambda: words.extend(word for _, word in hub.messages()) or hub.counters["stranger"] >= 2)  # it asks, too
    assert words == [b"honest"]


def test_a_connection_that_does_not_say_who_it_is_is_closed(
    closing: ExitStack, keys: list[Keys], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "HANDSHAKE_MS", 50)
    hub = hub_of(closing, keys[HEAD])
    silent = closing.enter_context(socket.create_connection(("127.0.0.1", int(hub.endpoint.rsplit(":", 1)[1]))))
    silent.settimeout(DEADLINE_S)
    while silent.recv(1024):  # its greeting, then the end
        pass
    honest = link_to(closing, hub, keys[FIRST])
    honest.send(b"honest")
    until(hub.messages)


def test_a_rank_s_place_goes_to_another_key_and_who_came_too_early_tries_again(
    closing: ExitStack, keys: list[Keys], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "HANDSHAKE_MS", 100)
    hub = hub_of(closing, keys[HEAD])
    joined, refusals = replace(keys[FIRST], own=KeyPair.new()), refusals_of(closing, hub)
    early = link_to(closing, hub, joined)
    early.send(b"early")
    until(refusals)
    hub.admit(FIRST, joined.own.public)
    said: list[tuple[bytes, bytes]] = []
    until(lambda: said.extend(hub.messages()) or said)
    assert [(hub.proven(peer), word) for peer, word in said] == [(FIRST, b"early")]
    refusals()
    former = link_to(closing, hub, keys[FIRST])
    former.send(b"former")
    until(refusals)
    assert hub.messages() == []


class Tap:
    """Passes one connection on to a port of this machine, and keeps what comes by it."""

    def __init__(self, port: int) -> None:
        self.seen = bytearray()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self._port, self._ends = port, [self._listener]
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        near, _ = self._listener.accept()
        far = socket.create_connection(("127.0.0.1", self._port))
        self._ends += [near, far]
        for source, sink in ((near, far), (far, near)):
            threading.Thread(target=self._pass_on, args=(source, sink), daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(1 << 16):
                self.seen += data
                sink.sendall(data)
        except OSError:
            pass  # closed

    def close(self) -> None:
        for end in self._ends:
            end.close()
