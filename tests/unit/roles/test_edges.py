"""Edges between processes: what changed is sent where it is needed, what gave way is sent again, newest content."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from framelets import assert_equal, random_framelet, rect
from small_graphs import WHOLE, built, nodes

from wall.compositing.graph import Graph, Step
from wall.core.data import ORIGIN_STEP_S, Camera, Event, Framelet, Rect
from wall.core.errors import RemoteProtocolError
from wall.packets.control import parse_control, serialise
from wall.packets.framelets import FrameletPart
from wall.roles.edges import HELD, NEVER, Outlets, RemoteFramelet, needed_from_others, targets_of
from wall.transport.loopback import LoopbackHub, LoopbackLink

EVENT = Event(
    view=0, camera_event=1, scene_event=2, scene_time=0.5, input_time=0.0,
    camera=Camera(position=(1.0, 2.0, 3.0), world_from_wall=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
)  # fmt: skip
S0, P0, S1, P1, W, PNG = WHOLE
HEAD, REMOTE = 0, 1


@pytest.fixture(scope="module")
def graph() -> Graph:
    """The right panel's framelet is made by compositor 1, the wall by the head."""
    return built(nodes(*WHOLE, head="  compositors: 2\n"))


def send(
    outlets: Outlets, link: LoopbackLink, framelets: dict[int, Framelet], number: tuple[int, int] = EVENT.number
) -> None:
    """What a loop does with the offers of outlets."""
    for offer in outlets.send(framelets, lambda view: number):
        assert offer.to == HEAD
        assert link.offer(offer.packet) == [], "it was ready"


class Wire:
    """A remote compositor's outlets, and what the head has of them."""

    def __init__(self, graph: Graph, *, credit: int = 1 << 20) -> None:
        self.step: Step = graph.step("p1")
        self.hub = LoopbackHub(credit_bytes=credit)
        self.link = LoopbackLink(self.hub.endpoint)
        self.outlets = Outlets(graph, REMOTE, lambda target: self.link.ready())
        self.framelet = random_framelet(
            np.random.default_rng(5), self.step.rect, channels=self.step.channels, encoded=self.step.encoded
        )
        self.framelet.event = EVENT
        self.remote = RemoteFramelet(self.step)

    def change(self, *regions: Rect, number: tuple[int, int] = EVENT.number) -> None:
        self.outlets.add({self.step.index: list(regions)})
        self.send(number)

    def send(self, number: tuple[int, int] = EVENT.number) -> None:
        send(self.outlets, self.link, {self.step.index: self.framelet}, number)

    def offer(self, part: FrameletPart) -> list[FrameletPart]:
        """Offer a part though the link is not ready. Returns those that give way."""
        dropped = [parse_control(packet) for packet in self.link.offer(serialise(part))]
        return [part for part in dropped if isinstance(part, FrameletPart)]

    def arrive(self) -> list[FrameletPart]:
        parts = []
        for peer, packet in self.hub.drain(1 << 20):
            part = parse_control(packet)
            assert isinstance(part, FrameletPart)
            self.remote.insert(part)
            parts.append(part)
            self.hub.release(peer, len(packet))
        return parts


def test_each_place_knows_what_others_need_of_it_and_it_of_them(graph: Graph) -> None:
    right = graph.step("p1")
    assert targets_of(graph, REMOTE) == {right.index: (HEAD,)}
    assert targets_of(graph, HEAD) == {}
    assert [step.node.id for step in needed_from_others(graph, HEAD)] == ["p1"]
    assert needed_from_others(graph, REMOTE) == ()


def test_a_node_that_several_nodes_of_a_place_use_is_sent_there_once() -> None:
    graph = built(
        nodes(*WHOLE, "id: c, op: crop, input: p1, area: [9, 1, 4, 4]", "id: two, op: sink, kind: png, input: c",
              head="  compositors: 2\n").replace("area: [9, 1, 4, 4]", "area: [9, 1, 4, 4], on: head")
    )  # fmt: skip
    assert targets_of(graph, REMOTE) == {graph.step("p1").index: (HEAD,)}


def test_only_what_changed_is_sent_and_lands_where_it_was(graph: Graph) -> None:
    wire = Wire(graph)
    wire.change(wire.step.rect)
    (part,) = wire.arrive()
    assert part.rect == wire.step.rect
    assert_equal(wire.remote.framelet, wire.framelet)
    assert wire.remote.take_changes() == [wire.step.rect]
    assert wire.remote.take_changes() == []

    dirty = rect(10, 2, 3, 2)
    wire.framelet.colour[dirty.inside(wire.step.rect)] += 1
    wire.change(dirty)
    (part,) = wire.arrive()
    assert part.rect == dirty
    assert wire.remote.take_changes() == [dirty]
    assert_equal(wire.remote.framelet, wire.framelet)
    assert wire.outlets.idle


def test_a_rank_that_begins_anew_gets_all_that_others_have_of_it(graph: Graph) -> None:
    wire = Wire(graph)
    wire.change(wire.step.rect)
    wire.arrive()
    wire.remote = RemoteFramelet(wire.step)
    wire.outlets.renew(HEAD + 2)
    assert wire.outlets.idle, "it needs nothing of this rank"
    wire.outlets.renew(HEAD)
    assert not wire.outlets.idle
    wire.send()
    wire.arrive()
    assert_equal(wire.remote.framelet, wire.framelet)


def test_pixels_are_plain_where_memory_is_shared_and_they_are_those_of_the_update(graph: Graph) -> None:
    """Also where the framelet has changed again before they were taken."""
    wire, asked = Wire(graph), []
    wire.outlets = Outlets(
        graph, REMOTE, lambda target: wire.link.ready(), shares=lambda to, size: bool(asked.append((to, size)) or True)
    )
    wire.change(wire.step.rect)
    sent = wire.framelet.colour.copy()
    wire.framelet.colour[...] += 1
    (part,) = wire.arrive()
    assert part.plain
    assert wire.outlets.idle
    np.testing.assert_array_equal(wire.remote.framelet.colour, sent)
    assert asked == [(HEAD, len(serialise(part)))], "the largest packet that there can be"


def test_parts_of_one_update_are_shown_together_and_tell_their_number_once(graph: Graph) -> None:
    wire = Wire(graph)
    wire.change(rect(8, 0, 1, 1), rect(14, 5, 1, 1))
    first, second = (parse_control(packet) for _, packet in wire.hub.drain(1 << 20))
    assert isinstance(first, FrameletPart)
    assert isinstance(second, FrameletPart)
    assert ((first.index, first.count), (second.index, second.count)) == ((0, 2), (1, 2))

    wire.remote.insert(first)
    assert (wire.remote.changed, wire.remote.newest_event()) == (False, (-1, -1))
    wire.remote.insert(second)
    assert wire.remote.newest_event() == EVENT.number
    assert wire.remote.take_changes() == [rect(8, 0, 1, 1), rect(14, 5, 1, 1)]


def test_what_waits_for_a_part_that_gave_way_is_shown_with_the_next_update(graph: Graph) -> None:
    wire = Wire(graph)
    wire.change(rect(8, 0, 1, 1), rect(14, 5, 1, 1))
    first, _ = (parse_control(packet) for _, packet in wire.hub.drain(1 << 20))
    assert isinstance(first, FrameletPart)
    wire.remote.insert(first)
    wire.framelet.refreshed_at = 7.0
    wire.change(rect(14, 5, 1, 1))
    wire.arrive()
    assert wire.remote.take_changes() == [rect(8, 0, 1, 1), rect(14, 5, 1, 1)]


def test_what_changes_without_credit_is_sent_later_with_its_newest_content(graph: Graph) -> None:
    wire = Wire(graph, credit=1)  # one packet may be under way
    wire.change(rect(8, 0, 2, 2))
    for k in range(3):
        wire.framelet.colour[...] = k
        wire.change(rect(9 + k, 1, 2, 2))
    assert not wire.outlets.idle
    assert len(wire.arrive()) == 1
    wire.send()
    (part,) = wire.arrive()
    assert part.rect == rect(9, 1, 4, 2), "one rectangle around all of it"
    assert (wire.remote.framelet.colour[1:3, 1:5] == 2).all()
    assert wire.outlets.idle


def test_what_gave_way_at_the_link_is_sent_again(graph: Graph) -> None:
    """Two packets wait at a link without credit, the oldest gives way."""
    wire = Wire(graph, credit=1)
    regions = [rect(8 + k, k, 1, 1) for k in range(4)]
    for region in regions:  # as `send` would, had the link been ready each time
        for lost in wire.offer(FrameletPart.of(wire.step.index, wire.framelet, region)):
            wire.outlets.lose(HEAD, lost)
    assert not wire.outlets.idle
    came: list[Rect] = []
    for _ in range(4):
        came += [part.rect for part in wire.arrive()]
        wire.send()
    assert sorted(r.x for r in came) == [8, 9, 10, 11], "nothing is lost"


def test_in_lock_step_everybody_hears_of_a_frame_in_which_nothing_changed() -> None:
    lines = [*WHOLE[:5], "id: c, op: constant, panel: r0c1, colour: [1, 0, 0], on: compositor 1"]
    lines += ["id: n, op: tile, inputs: [p0, c], on: head", PNG, "id: two, op: sink, kind: png, input: n"]
    graph = built(nodes(*lines, head="  compositors: 2\n  sync: frame\n"), more="sampling: {method: framed}\n")
    constant = graph.step("c")
    hub = LoopbackHub(credit_bytes=1 << 20)
    link = LoopbackLink(hub.endpoint)
    outlets = Outlets(graph, REMOTE, lambda target: link.ready())
    framelets = {
        k: Framelet.blank(s.rect, s.channels, encoded=s.encoded)
        for k, s in enumerate(graph.steps) if s.rank == REMOTE
    }  # fmt: skip
    remote = RemoteFramelet(constant)
    for frame in range(3):
        outlets.add({}, all_due=True)
        assert not outlets.idle
        send(outlets, link, framelets, (frame, 0))
        for _, packet in hub.drain(1 << 20):
            part = parse_control(packet)
            assert isinstance(part, FrameletPart)
            if part.step == constant.index:
                remote.insert(part)
        assert remote.newest_event() == (frame, 0), "what no camera sees has its frame number too"
        assert outlets.idle


def test_times_are_counted_from_the_newest_part_s_moment() -> None:
    clear = "background: transparent, input:"
    graph = built(
        nodes(
            S0, f"id: p0, op: reconstruct, {clear} s0, on: compositor 1", "id: sb, op: samples, panel: r0c0",
            f"id: b, op: reconstruct, {clear} sb", "id: n, op: newest, inputs: [b, p0], on: head", S1, P1,
            "id: w, op: tile, inputs: [n, p1]", PNG, head="  compositors: 2\n",
        )
    )  # fmt: skip
    remote = RemoteFramelet(graph.step("p0"))
    sender = Framelet.blank(remote.step.rect, remote.step.channels, encoded=remote.step.encoded)
    for refreshed_at, row in ((10.0, 0), (10.0 + ORIGIN_STEP_S, 3)):
        sender.refreshed_at = refreshed_at
        sender.channel("time")[row] = -0.5
        remote.insert(FrameletPart.of(remote.step.index, sender, rect(0, row, 8, 1)))
    assert remote.framelet.refreshed_at == 10.0 + ORIGIN_STEP_S
    np.testing.assert_array_equal(remote.framelet.channel("time")[[0, 3], 0], [-0.5 - ORIGIN_STEP_S, -0.5])
    assert np.isneginf(remote.framelet.channel("time")[1]).all()


def test_parts_of_another_shape_are_refused(graph: Graph) -> None:
    wire = Wire(graph)
    good = FrameletPart.of(wire.step.index, wire.framelet, wire.step.rect)
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        wire.remote.insert(replace(good, rect=rect(0, 0, 8, 6)))
    assert wire.remote.newest_event() == NEVER
    assert wire.remote.take_changes() == []


def shown_at(arrivals: list[float], *, period_s: float, graph: Graph) -> list[float]:
    """When images that come at `arrivals` are shown, by a loop that looks whenever one comes or is due."""
    remote = RemoteFramelet(graph.step("p1"), period_s)
    sender = random_framelet(
        np.random.default_rng(6), remote.step.rect, channels=remote.step.channels, encoded=remote.step.encoded
    )
    sender.event = EVENT
    found, waiting = list[float](), sorted(arrivals)
    while waiting or remote.due < math.inf:
        now = min(remote.due, *waiting[:1], math.inf)
        if waiting and waiting[0] == now:
            waiting.pop(0)
            remote.insert(FrameletPart.of(remote.step.index, sender, sender.rect), now)
        remote.show(now)
        if remote.take_changes():
            found.append(now)
    assert remote.newest_event() == EVENT.number
    assert_equal(remote.framelet, sender)
    return found


def test_images_that_come_unevenly_are_shown_evenly(graph: Graph) -> None:
    came = [k / 30 + 0.004 * (k % 2) for k in range(20)]
    shown = shown_at(came, period_s=1 / 30, graph=graph)
    assert np.ptp(np.diff(came)) == pytest.approx(0.008)
    assert len(shown) == len(came)
    assert np.ptp(np.diff(shown)[1:]) < 0.003
    assert all(0.0 <= late <= HELD / 30 for late in np.subtract(shown, came))


def test_no_image_waits_for_long_and_none_after_a_pause_or_without_a_period(graph: Graph) -> None:
    assert shown_at([1.0, 1.001, 2.0], period_s=0.1, graph=graph) == pytest.approx([1.0, 1.001 + HELD * 0.1, 2.0])
    assert shown_at([1.0, 1.001, 2.0], period_s=0.0, graph=graph) == [1.0, 1.001, 2.0]


def test_nothing_waits_soon_after_an_edit(graph: Graph) -> None:
    remote, part = (
        RemoteFramelet(graph.step("p1"), 0.1),
        FrameletPart.of(1, Wire(graph).framelet, graph.step("p1").rect),
    )
    for now, due in ((1.0, 1.0), (1.01, 1.01), (1.02, 1.02), (1.03, 1.03 + HELD * 0.1)):
        remote.even_from = 1.025
        remote.insert(part, now)
        assert remote.due == pytest.approx(due)
        remote.show(due)


def test_images_that_come_while_one_waits_are_shown_with_it(graph: Graph) -> None:
    assert shown_at([1.0, 1.01, 1.02], period_s=0.1, graph=graph) == pytest.approx([1.0, 1.01 + HELD * 0.1])


def test_an_image_that_does_not_decompress_is_refused_when_it_comes_not_when_it_is_due(graph: Graph) -> None:
    remote = RemoteFramelet(graph.step("p1"), 0.1)
    part = FrameletPart.of(remote.step.index, Wire(graph).framelet, remote.step.rect)
    with pytest.raises(RemoteProtocolError, match="decompress"):
        remote.insert(replace(part, data=b"x" * len(part.data)), 1.0)
    remote.show(2.0)
    assert remote.take_changes() == []
