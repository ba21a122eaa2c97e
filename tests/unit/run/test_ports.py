"""A rank's ways to others: strays are counted, sleep lasts, and another host's rank learns the head's time first."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import pytest
from packet_examples import batch_of, plain_samples

from wall.core.data import Framelet, Rect
from wall.core.errors import RunError
from wall.packets.control import (
    MAX_ANSWER_BYTES,
    EditAnswer,
    EditRequest,
    Heartbeat,
    Hello,
    Membership,
    Ping,
    Pong,
    Statistics,
    Stop,
    WindowInput,
    parse_control,
    serialise,
)
from wall.packets.framelets import FrameletPart
from wall.packets.notes import Note
from wall.packets.samples import encode
from wall.roles.instructions import MANAGER, Disconnected, Packet
from wall.run.clock import HeadClock
from wall.run.ports import REPLACED, Ports
from wall.transport.base import FIRST_CLIENT, GUEST, PAGE, Hub
from wall.transport.curve import Keys
from wall.transport.factory import connect, open_hub
from wall.transport.loopback import LoopbackHub, LoopbackLink
from wall.transport.probe import REFUSALS
from wall.transport.zeromq import ZmqHub, ZmqLink

KINDS = ("loopback", "zmq")
AHEAD_S = -1e5  # the head's machine started later


def comes_true(condition: Callable[[], bool]) -> bool:
    limit = time.monotonic() + 5.0
    while not condition():
        if time.monotonic() > limit:
            return False
    return True


def sleeps(ports: Ports) -> bool:
    began = time.monotonic()
    ports.wait(0.1)
    return time.monotonic() - began > 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_a_stray_control_message_at_a_data_hub_is_counted_and_its_owner_sleeps_again(kind: str) -> None:
    control, data = (open_hub(kind, "127.0.0.1", credit_bytes=1 << 20) for _ in range(2))
    ports = Ports(0, HeadClock(), hub=data, manager=connect(control.endpoint, rank=0))
    stray = connect(data.endpoint, rank=1)
    stray.send(serialise(Stop(reason="an enemy's")))
    assert comes_true(lambda: list(ports.receive()) == [] and bool(ports.drops()))
    assert ports.drops() == {"stray_message": 1}
    assert sleeps(ports)
    close(stray, ports, control)


def test_a_rank_ends_where_the_head_s_port_refuses_it_and_not_where_the_head_is_only_silent() -> None:
    control = open_hub("zmq", "127.0.0.1", credit_bytes=1 << 20)
    rank = Ports(1, HeadClock(), hub=None, manager=connect(control.endpoint, rank=1))
    rank._heard -= 50.0
    assert rank._probe is not None
    for _ in range(2 * REFUSALS):  # the kernel takes the connection, whatever the head's process does
        assert list(rank.receive()) == []
        rank._probe._due = 0.0
        time.sleep(0.01)
    control.close()
    with pytest.raises(RunError, match="rank 1: the head has ended without a word"):
        comes_true(lambda: list(rank.receive()) != [])
    rank.close()


def test_why_memory_is_not_shared_is_said_once() -> None:
    control, data = (open_hub("loopback", "127.0.0.1", credit_bytes=1 << 20) for _ in range(2))
    ports = Ports(3, HeadClock(), hub=None, manager=connect(control.endpoint, rank=3))
    assert not ports.shares(0, 100), "there is no link yet"
    ports.connect(0, data.endpoint)
    assert ports.shares(0, 100)
    link = ports._links[0]
    link.shares = lambda size: False  # type: ignore[method-assign]
    link.note = "no shared memory of 9 bytes: full"
    assert not ports.shares(0, 100)
    assert not ports.shares(0, 100)
    told = [parse_control(data) for _, data in control.messages()]
    text = "images for rank 0 are compressed and sent: no shared memory of 9 bytes: full"
    assert told == [Note(rank=3, level="warning", text=text)]
    close(ports, control, data)


@pytest.mark.parametrize("kind", KINDS)
def test_a_stray_packet_at_the_control_hub_is_taken_and_its_owner_sleeps_again(kind: str) -> None:
    control = open_hub(kind, "127.0.0.1", credit_bytes=1 << 20)
    ports, stray = Ports(MANAGER, HeadClock(), hub=control), connect(control.endpoint, rank=1)
    stray.offer(b"stray")
    came: list[object] = []

    def arrived() -> bool:
        stray.ready()  # a link works only while it is called
        came.extend(ports.receive())
        return bool(came)

    assert comes_true(arrived)
    assert came == [Packet(b"stray")]
    assert sleeps(ports)
    close(stray, ports)


def test_nobody_asks_in_the_name_of_the_page() -> None:
    control = LoopbackHub(credit_bytes=1)
    ports, link = Ports(MANAGER, HeadClock(), hub=control), LoopbackLink(control.endpoint)
    told = list[EditAnswer]()
    ports.answer_page = told.append
    link.send(serialise(EditRequest(client=PAGE, number=1, key="k", undo=1)))
    assert list(ports.receive()) == []
    assert ports.drops() == {"stranger": 1}
    answer = EditAnswer(client=PAGE, number=1, refused="", edit=2)
    ports.send(PAGE, answer)
    assert told == [answer]
    assert list(link.receive()) == []
    close(link, ports)


def test_viewers_ask_through_the_rank_that_serves_the_page_alone() -> None:
    control = LoopbackHub(credit_bytes=1)
    ports, page, stranger = Ports(MANAGER, HeadClock(), hub=control), *(LoopbackLink(control.endpoint) for _ in "ab")
    ports.page_rank = 1
    for rank, link in ((1, page), (2, stranger)):
        link.send(serialise(Heartbeat(rank=rank, time=0.0)))
        link.send(serialise(EditRequest(client=PAGE, number=rank, key="k", undo=1)))
    came = [message for message in ports.receive() if isinstance(message, EditRequest)]
    assert came == [EditRequest(client=PAGE, number=1, key="k", undo=1)]
    assert ports.drops() == {"stranger": 1}
    answer = EditAnswer(client=PAGE, number=1, refused="", edit=2)
    ports.send(PAGE, answer)
    told = list[EditAnswer]()
    rank = Ports(1, HeadClock(), hub=None, manager=page)
    rank.answer_page = told.append
    assert list(rank.receive()) == []
    assert told == [answer]
    assert list(stranger.receive()) == []
    close(rank, stranger, ports)


def test_the_manager_knows_at_once_whose_connection_has_closed_without_a_goodbye() -> None:
    """A process that is killed: its kernel closes what it had open. One that ends in order is told of by itself."""
    control = open_hub("zmq", "127.0.0.1", credit_bytes=1)
    ports, links = Ports(MANAGER, HeadClock(), hub=control), [connect(control.endpoint, rank=k) for k in range(3)]
    came = list[object]()

    def receives(*wanted: object) -> bool:
        came.extend(ports.receive())
        return all(one in came for one in wanted)

    assert receives()
    beats = [Heartbeat(rank=k, time=0.0) for k in range(3)]
    for link, beat in zip(links, beats, strict=True):
        link.send(serialise(beat))
    assert comes_true(lambda: receives(*beats))
    links[0].close()
    assert isinstance(links[2], ZmqLink)
    links[2]._socket.close(linger=0)
    links[2]._context.term()
    assert comes_true(lambda: receives(Disconnected(2)))
    links[1].send(serialise(Heartbeat(rank=1, time=1.0)))
    assert comes_true(lambda: receives(Heartbeat(rank=1, time=1.0)))
    assert came.count(Disconnected(2)) == 1
    assert [one for one in came if isinstance(one, Disconnected)] == [Disconnected(2)]
    close(links[1], ports)


def test_a_rank_speaks_by_the_link_by_which_it_spoke_first_as_long_as_that_is_open() -> None:
    control = LoopbackHub(credit_bytes=1)
    ports, honest, stranger = Ports(MANAGER, HeadClock(), hub=control), *(LoopbackLink(control.endpoint) for _ in "ab")
    beats = [Heartbeat(rank=1, time=float(k)) for k in range(3)]
    honest.send(serialise(beats[0]))
    assert list(ports.receive()) == [beats[0]]
    stranger.send(serialise(WindowInput(rank=1, escape="a stranger's")))
    stranger.send(serialise(Statistics(fps=1.0, samples_per_s=1.0, latency_ms=1.0, ranks=1)))
    assert [type(message) for message in ports.receive()] == [Statistics]
    assert ports.drops() == {"stranger": 1}
    honest.close()
    stranger.send(serialise(beats[2]))
    assert list(ports.receive()) == [beats[2]], "the rank has begun anew"
    close(stranger, ports)


def test_a_compositor_knows_a_key_before_its_owner_comes_and_later_by_the_membership(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    control, data = LoopbackHub(credit_bytes=1), LoopbackHub(credit_bytes=1)
    ports, admitted = Ports(0, HeadClock(), hub=data, manager=LoopbackLink(control.endpoint)), list[tuple[int, str]]()
    monkeypatch.setattr(data, "admit", lambda rank, key: admitted.append((rank, key)))
    coming = Hello(rank=2, host="", endpoint="", incarnation=0, key="of 2")
    control.broadcast(serialise(coming))
    assert list(ports.receive()) == []
    members = replace(coming, incarnation=7), Hello(rank=1, host="", endpoint="", incarnation=8)
    control.broadcast(serialise(Membership(members=members)))
    assert len(list(ports.receive())) == 1
    assert admitted == [(2, "of 2")] * 2
    close(ports, control)


def test_samples_in_another_rank_s_name_are_left_out() -> None:
    control, data = LoopbackHub(credit_bytes=1), LoopbackHub(credit_bytes=1 << 20)
    ports = Ports(0, HeadClock(), hub=data, manager=LoopbackLink(control.endpoint))
    honest, stranger = LoopbackLink(data.endpoint), LoopbackLink(data.endpoint)
    packet, forged = (encode(batch_of(plain_samples(n))) for n in (1, 2))
    honest.offer(packet)
    assert list(ports.receive()) == [Packet(packet)]
    stranger.offer(forged)
    honest.offer(packet)
    assert list(ports.receive()) == [Packet(packet)]
    assert ports.drops() == {"stranger": 1}
    for incarnation in (5, 6):
        control.broadcast(
            serialise(Membership(members=(Hello(rank=2, host="", endpoint="", incarnation=incarnation),)))
        )
        assert len(list(ports.receive())) == 1
    stranger.offer(forged)
    assert list(ports.receive()) == [Packet(forged)], "the rank was started again"
    close(honest, stranger, ports)


@pytest.mark.parametrize("encrypted", [False, True])
def test_framelets_are_taken_from_the_rank_that_makes_them_alone(encrypted: bool) -> None:
    keys: list[Keys] | list[None] = Keys.of_all(4) if encrypted else [None] * 4
    hub = ZmqHub("127.0.0.1", credit_bytes=1 << 20, keys=keys[0])
    ports = Ports(MANAGER, HeadClock(), hub=hub)
    ports.expect([0, 2, 3])
    links = {rank: ZmqLink(hub.endpoint, rank=rank, keys=keys[rank]) for rank in (2, 3)}
    framelet = Framelet.blank(Rect(x=0, y=0, width=2, height=2), frozenset({"colour"}), encoded=True)
    of_2, of_3 = (serialise(FrameletPart.of(step, framelet, framelet.rect)) for step in (1, 2))

    def came(sender: int, packet: bytes, *, refused: int = 0) -> list[object]:
        before, found = ports.drops()["stranger"], list[object]()
        assert comes_true(lambda: found.extend(ports.receive()) or links[sender].ready())
        links[sender].offer(packet)
        assert comes_true(
            lambda: found.extend(ports.receive()) or bool(found) or ports.drops()["stranger"] == before + 1
        )
        assert ports.drops()["stranger"] == before + refused
        return found

    assert came(2, of_2) == [Packet(of_2)]
    assert came(3, of_2, refused=1) == [], "another rank's"
    assert came(3, of_3) == [Packet(of_3)]
    assert came(2, of_3, refused=1) == []
    ports.expect([0, 3, 2])
    assert came(3, of_2) == [Packet(of_2)], "another graph, by which it is that rank's"
    close(*links.values(), ports)


def test_with_keys_nobody_speaks_in_another_s_name() -> None:
    keys = Keys.of_all(4)
    hub = ZmqHub("127.0.0.1", credit_bytes=1 << 20, keys=keys[0].with_guests("key of requests"))
    ports = Ports(MANAGER, HeadClock(), hub=hub)
    senders = {k: ZmqLink(hub.endpoint, rank=k, keys=keys[k]) for k in range(3)}
    senders[GUEST] = ZmqLink(hub.endpoint, rank=9, keys=Keys.of_guest("key of requests", keys[0].own.public))
    statistics = Statistics(fps=1.0, samples_per_s=1.0, latency_ms=1.0, ranks=1)
    request = EditRequest(client=FIRST_CLIENT, number=1, key="k")
    packet = encode(batch_of(plain_samples(1)))  # of rank 2
    own = {0: statistics, 1: Heartbeat(rank=1, time=0.0), 2: Heartbeat(rank=2, time=0.0), GUEST: request}
    for others in (*own.values(), Heartbeat(rank=3, time=0.0)):
        for who, sender in senders.items():
            if own[who] != others:
                sender.send(serialise(others))
    for who, sender in senders.items():
        sender.send(serialise(own[who]))
    came: list[object] = []
    offered = set(senders)

    def all_came() -> bool:
        for who in [who for who in offered if senders[who].ready()]:
            senders[who].offer(packet)
            offered.remove(who)
        came.extend(ports.receive())
        return len(came) == len(own) + 1 and ports.drops()["stranger"] == 16 + len(senders) - 1

    assert comes_true(all_came), (came, ports.drops())
    assert came.count(Packet(packet)) == 1
    assert all(message in came for message in own.values())
    close(*senders.values(), ports)


def test_who_was_a_rank_is_told_to_end_once_its_place_is_another_s() -> None:
    control, data = LoopbackHub(credit_bytes=1), LoopbackHub(credit_bytes=1 << 20)
    ports, former, joined = Ports(MANAGER, HeadClock(), hub=control), *(LoopbackLink(control.endpoint) for _ in "ab")
    compositor = Ports(0, HeadClock(), hub=data, manager=LoopbackLink(control.endpoint))
    thawed, new = (LoopbackLink(data.endpoint) for _ in "ab")
    packet, beat = encode(batch_of(plain_samples(1))), Heartbeat(rank=2, time=0.0)
    former.send(serialise(beat))
    assert list(ports.receive()) == [beat]
    thawed.offer(packet)
    ports.broadcast(Membership(members=(Hello(rank=2, host="", endpoint="", incarnation=5),)))
    assert len(list(compositor.receive())) == 2

    ports.admit(2, "")
    former.send(serialise(beat))
    assert list(ports.receive()) == []
    assert parse_control(former.receive()[-1]) == Stop(reason=REPLACED)
    ports.broadcast(Membership(members=(Hello(rank=2, host="", endpoint="", incarnation=6),)))
    assert len(list(compositor.receive())) == 1
    thawed.offer(packet)
    assert list(compositor.receive()) == [], "it speaks first, and is not heard"
    new.offer(packet)
    joined.send(serialise(beat))
    assert list(compositor.receive()) == [Packet(packet)]
    assert list(ports.receive()) == [beat]
    assert (ports.drops(), compositor.drops()) == ({"stranger": 1}, {"stranger": 1})
    close(joined, former, new, thawed, ports, compositor)


@pytest.mark.parametrize("value", [float("inf"), "x" * MAX_ANSWER_BYTES])
def test_an_answer_that_does_not_fit_its_message_ends_nothing(value: object) -> None:
    control = LoopbackHub(credit_bytes=1)
    ports, link = Ports(MANAGER, HeadClock(), hub=control), LoopbackLink(control.endpoint)
    link.send(serialise(EditRequest(client=FIRST_CLIENT, number=1, key="k")))
    assert len(list(ports.receive())) == 1
    ports.send(
        FIRST_CLIENT, EditAnswer(client=FIRST_CLIENT, number=1, refused="", edit=3, parameters=[{"value": value}])
    )
    (answer,) = map(parse_control, link.receive())
    assert isinstance(answer, EditAnswer)
    assert "edit 3 holds, but the answer cannot be sent" in answer.refused
    assert ports.drops() == {"answer_without_format": 1}
    close(link, ports)


def test_the_manager_answers_whoever_spoke_by_its_rank() -> None:
    control = LoopbackHub(credit_bytes=1)
    ports, links = Ports(MANAGER, HeadClock(), hub=control), [LoopbackLink(control.endpoint) for _ in range(2)]
    for rank, link in enumerate(links):
        link.send(serialise(Heartbeat(rank=rank, time=0.0)))
    assert len(list(ports.receive())) == 2
    ports.send(1, Stop(reason="for one"))
    ports.broadcast(Stop(reason="for all"))
    heard = [[parse_control(data) for data in link.receive()] for link in links]
    assert heard == [[Stop(reason="for all")], [Stop(reason="for one"), Stop(reason="for all")]]
    close(*links, ports)


def test_no_message_before_the_heads_time_is_known() -> None:
    control, clock = LoopbackHub(credit_bytes=1), HeadClock()
    ports = Ports(1, clock, hub=None, manager=LoopbackLink(control.endpoint), ping_s=0.01)
    control.broadcast(serialise(Stop(reason="soon")))
    waiting = threading.Thread(target=ports.synchronise)
    waiting.start()
    waiting.join(0.05)
    assert waiting.is_alive()
    answered = 0
    while waiting.is_alive():
        answered += answer(control)
    assert answered
    assert abs(clock.now() - (time.monotonic() + AHEAD_S)) < 1.0
    assert list(ports.receive()) == [Stop(reason="soon")], "it was kept"
    assert comes_true(lambda: list(ports.receive()) == [] and answer(control) > 0), "pings go on"
    close(ports, control)


def test_on_the_heads_own_machine_nobody_asks_for_the_time() -> None:
    control = LoopbackHub(credit_bytes=1)
    ports = Ports(1, HeadClock(), hub=None, manager=LoopbackLink(control.endpoint))
    ports.synchronise()
    assert list(ports.receive()) == []
    assert control.messages() == []
    close(ports, control)


def answer(control: Hub) -> int:
    """Answer pings as the manager does, with the time of another host."""
    pings = [(peer, parse_control(data)) for peer, data in control.messages()]
    for peer, ping in pings:
        assert isinstance(ping, Ping)
        control.send(peer, serialise(Pong(sent=ping.sent, head_time=time.monotonic() + AHEAD_S)))
    return len(pings)


def close(*closable: object) -> None:
    for one in closable:
        one.close()  # type: ignore[attr-defined]
