"""The compositor, at the head and elsewhere: a refresh is of one event, and everybody hears what they need of it."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

import pytest
from flat_batches import RECT, flat, plan_of
from flat_batches import TEXT as ONE_PANEL

from wall.config.loading import loads
from wall.core.data import Edits, Event
from wall.display.base import LATENCY_LIMITS_S
from wall.operators.overlay import PLACEHOLDERS, Overlay
from wall.packets.control import Heartbeat, Hello, Membership, Statistics, Stop, WindowInput, parse_control
from wall.packets.framelets import FrameletPart
from wall.packets.notes import note_of
from wall.packets.samples import encode
from wall.roles.compositor import LAST_S, Compositor
from wall.roles.instructions import MANAGER, Finish, Input, Instruction, Offer, Packet, Presented, Send, Show, Tell
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.roles.status import statistics_of
from wall.run.single_process import hello_of

T = TypeVar("T")
TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
graph: {compositors: 2, sinks: [png]}
sampling: {method: adaptive}
"""
VIEWS = TEXT[TEXT.index("views") : TEXT.index("graph")]
SKY = """\
graph:
  compositors: 2
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: objects, op: reconstruct, input: s, background: transparent, on: compositor 1}
    - {id: sky, op: sky, panel: r0c0, on: head}
    - {id: picture, op: depth, inputs: [objects, sky], on: compositor 1}
    - {id: files, op: sink, kind: png, input: picture}
"""
OVERLAY = """\
graph:
  compositors: 2
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: picture, op: reconstruct, input: s, on: compositor 1}
    - {id: text, op: overlay, input: picture, text: '{fps} {ranks}', on: compositor 1}
    - {id: window, op: sink, kind: window, input: text}
"""


class Rank:
    """A compositor, the time, and what it asks for."""

    def __init__(self, plan: Plan, rank: int = HEAD, *, credit: bool = True) -> None:
        self.plan, self.now = plan, 100.0
        self.role = Compositor(plan, hello_of(rank), lambda target: credit)

    def tell(self, *messages: Input, after: float = 0.1) -> list[Instruction]:
        """Give it messages and, a while later, a tick; images that it shows are presented."""
        asked: list[Instruction] = []
        for message in messages:
            asked += self.role.on_message(message, self.now)
        self.now += after
        for instruction in self.role.on_tick(self.now):
            asked.append(instruction)
            if isinstance(instruction, Show):
                asked += self.role.on_message(Presented(), self.now)
        return asked


def of(kind: type[T], asked: list[Instruction]) -> list[T]:
    """The instructions, or the messages sent, of a kind."""
    return [i for i in (*asked, *(i.message for i in asked if isinstance(i, Send))) if isinstance(i, kind)]


def one_panel(graph: str) -> Plan:
    return plan_of(ONE_PANEL[: ONE_PANEL.index("sampling")] + "sampling: {method: adaptive}\n" + graph)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def alone() -> Plan:
    """One panel, all on the head."""
    return plan_of()


def test_a_refresh_is_of_the_newest_event_in_all_its_parts(plan: Plan) -> None:
    head, event = Rank(plan), first_event(plan, 0.0)
    for number, compare in enumerate(("frameless", "")):
        asked = replace(event, camera_event=number + 1, compare=compare, sampler="adaptive")
        (show,) = of(Show, head.tell(asked, after=1.0))
        (image,) = show.images
        assert (image.camera_event, show.status.compare) == (number + 1, compare)
        second = [panel.id for panel in image.compared]
        assert second == ([panel.id for panel in image.panels] if compare else []), "each on its own panel, or none"


def test_the_status_has_what_each_rank_has_done_and_the_host_of_one_that_is_gone(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    hellos = [Hello(rank=k, host=f"host{k}", endpoint="", incarnation=1) for k in range(2)]
    head.tell(event, Membership(members=tuple(hellos)))
    head.tell(replace(event, camera_event=1, input_time=head.now))
    beat = Heartbeat(rank=1, time=head.now - 0.4, samples_traced=7, credit=9, cpu_seconds=2.5, seconds=1.0)
    batch = replace(flat(0.5, replace(event, camera_event=1), adaptive=True), base_time=head.now, relightable=True)
    head.tell(Packet(encode(batch)), after=0.04)
    notes = [note_of(1, "warning", f"note {k}") for k in range(5)]
    (show,) = of(Show, head.tell(*notes, beat, Membership(members=tuple(hellos[:1])), after=1.0))
    assert show.status.notes == tuple(f"rank 1: note {k}" for k in range(1, 5)), "the newest"
    _, renderer = show.status.totals
    assert (renderer.host, renderer.samples, renderer.credit, renderer.cpu_s) == ("host1", 7, 9, 2.5)
    assert renderer.silent_s == pytest.approx(1.44)
    assert sum(show.status.latency_counts) == 1
    assert show.status.latency_counts[LATENCY_LIMITS_S.index(0.15)] == 1
    assert show.status.latency_sum_s == pytest.approx(0.14)
    assert show.status.refreshes == head.role.refreshes > 0


def test_a_rank_that_is_busy_is_told_from_one_that_is_silent(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    head.tell(event, Membership(members=tuple(Hello(rank=k, host="", endpoint="", incarnation=1) for k in range(2))))
    for after, busy_s in ((0.5, 4.0), (alone.layout.config.transport.lost_after_s, 0.0)):
        beat = Heartbeat(rank=1, time=head.now, busy_s=4.0)
        (show,) = of(Show, head.tell(*[beat] * (busy_s > 0.0), after=after))
        assert show.status.ranks[1].busy_s == busy_s


def test_an_older_event_changes_nothing(plan: Plan) -> None:
    head, event = Rank(plan), first_event(plan, 0.0)
    head.tell(replace(event, camera_event=5))
    (show,) = of(Show, head.tell(event))
    assert show.images[0].camera_event == 5


def test_samples_of_another_clock_are_refused_though_their_edits_are_not_known_yet(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    head.tell(event)
    batch = replace(flat(0.5, event, adaptive=False), base_time=1e6, edits=Edits(1))
    head.tell(Packet(encode(batch)))
    assert head.role.composition.counters["bad_packet"] == 1
    head.tell(replace(event, scene_event=1, edits=Edits(1)))
    assert head.role.composition.counters["bad_packet"] == 1


def test_views_are_refreshed_at_their_rate_whatever_comes_meanwhile(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    period = 1.0 / alone.view.refresh_hz
    shown = [len(of(Show, head.tell(event, after=period / 10))) for _ in range(100)]
    assert sum(shown) == pytest.approx(10, abs=1)
    assert head.role.due == pytest.approx(head.now, abs=1.01 * period)


def test_the_head_is_complete_when_all_of_the_newest_event_is_shown_and_rests(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    batch = replace(flat(0.5, event, adaptive=True), base_time=head.now, relightable=True)

    def complete(asked: list[Instruction]) -> list[bool]:
        return [beat.complete for beat in of(Heartbeat, asked)]

    head.tell(event)
    assert not any(complete(head.tell(Packet(encode(batch))))), "its samples have just come"
    assert complete(head.tell()) == [True]
    assert not any(complete(head.tell(replace(event, camera_event=1), after=1.0))), "none of the next event has come"


def test_a_compositor_is_complete_when_what_others_need_is_sent() -> None:
    plan = one_panel(SKY)
    for credit in (False, True):
        remote = Rank(plan, 1, credit=credit)
        remote.role.composition._nodes.outlets.add({plan.layout.graph.step("picture").index: [RECT]})
        (beat,) = of(Heartbeat, remote.tell(first_event(plan, 0.0)))
        assert beat.complete == credit


def test_what_the_head_makes_reaches_the_compositor_that_shows_it() -> None:
    plan = one_panel(SKY)
    (offer,) = of(Offer, Rank(plan).tell(first_event(plan, 0.0)))
    part = parse_control(offer.packet)
    assert isinstance(part, FrameletPart)
    assert (offer.to, part.step) == (1, plan.layout.graph.step("sky").index)


def test_at_the_end_the_head_shows_what_still_came_as_of_the_newest_event(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    batch = replace(flat(1.0, event, adaptive=True), base_time=head.now, relightable=True)
    head.tell(event)
    for k in range(3):
        asked = head.tell(Stop(reason="end"), Packet(encode(replace(batch, sequence=k))), after=0.001)
        assert not of(Finish, asked), "packets come"
    asked = head.tell(after=0.001)
    (show,), (beat,) = of(Show, asked), of(Heartbeat, asked)
    assert show.images[0].panels[0].rgb.min() > 200
    assert beat.last
    assert asked[-1] == Finish()


def test_packets_without_end_do_not_keep_the_head_from_ending(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    batch = encode(replace(flat(1.0, event, adaptive=True), base_time=head.now))
    head.tell(event, Stop(reason="end"))
    assert of(Finish, head.tell(Packet(batch), after=LAST_S))


def test_away_from_the_head_the_end_is_a_last_word() -> None:
    plan = one_panel(SKY)
    asked = Rank(plan, 1).tell(first_event(plan, 0.0), Stop(reason="end"))
    assert of(Show, asked) == []
    assert [beat.last for beat in of(Heartbeat, asked)] == [True]
    assert asked[-1] == Finish()


def test_window_input_is_forwarded_and_an_end_of_the_run_is_repeated(alone: Plan) -> None:
    rank, wish = Rank(alone), WindowInput(rank=HEAD, commands=[{"kind": "reset"}])
    end, beat_s = WindowInput(rank=HEAD, closed=True), alone.layout.config.transport.heartbeat_s
    assert Send(MANAGER, wish) in rank.tell(wish)
    assert Send(MANAGER, wish) not in rank.tell(after=beat_s)
    assert Send(MANAGER, end) in rank.tell(end)
    assert Send(MANAGER, end) in rank.tell(after=beat_s)


def test_an_overlay_away_from_the_head_shows_the_numbers_that_the_head_tells() -> None:
    plan = one_panel(OVERLAY)
    head, remote, event = Rank(plan), Rank(plan, 1), first_event(plan, 0.0)
    [index] = [step.index for step in plan.layout.graph.steps if isinstance(step.node, Overlay)]
    framelets = remote.role.composition._nodes.executor.framelets
    remote.tell(event)
    before = framelets[index].colour.copy()
    asked = head.tell(event)
    (told,), (show,) = of(Statistics, asked), of(Show, asked)
    assert told == statistics_of(show.status)
    remote.tell(told)
    assert (framelets[index].colour != before).any(), "dashes before"


def test_there_is_a_statistic_for_each_placeholder_of_an_overlay() -> None:
    assert tuple(field.name for field in fields(Statistics)) == PLACEHOLDERS


def test_second_images_come_of_all_panels_or_of_none(plan: Plan) -> None:
    """The head's own panel begins a comparison with an event; framelets of other compositors' may come sooner."""
    head, event = Rank(plan), first_event(plan, 0.0)
    assert head.role.composition.compared() == []
    list(head.role.on_message(replace(event, compare="framed", sampler="adaptive", camera_event=1), head.now))
    (own,) = head.role.composition.layers.values()
    assert own.compared is not None
    (shown,) = head.role.composition.compared()
    assert len(shown.images()) == 2


def test_every_absence_of_a_rank_is_told_once_however_short(alone: Plan) -> None:
    head = Rank(alone)
    everybody = tuple(Hello(rank=k, host="", endpoint="", incarnation=1) for k in range(alone.layout.size))

    def stale(*messages: Input) -> list[int]:
        asked = head.tell(*messages)
        return [len(each.status.stale) for each in asked if isinstance(each, Show)]

    assert stale(first_event(alone, 0.0), Membership(members=everybody[:1]))[-1] == 0, "nobody else has come yet"
    assert stale(Membership(members=everybody))[-1] == 0
    assert stale(Membership(members=everybody[:1]), Membership(members=everybody))[-1] == 1
    assert stale(Membership(members=everybody))[-1] == 0


def test_who_is_absent_is_told_before_the_next_image(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    everybody = tuple(Hello(rank=k, host="", endpoint="", incarnation=1) for k in range(alone.layout.size))

    def told(*messages: Input) -> list[tuple[type, int]]:
        asked = [instruction for each in messages for instruction in head.role.on_message(each, head.now)]
        return [(type(each), len(each.status.stale)) for each in asked if isinstance(each, Show | Tell)]

    assert told(event, Membership(members=everybody)) == [(Tell, 0)]
    assert told(Membership(members=everybody)) == [], "nothing new"
    assert told(Membership(members=everybody[:1])) == [(Tell, 1)]


@pytest.mark.parametrize(("marks", "told"), [("", [0, 1, 0]), ("transport: {stale_after_s: 0}\n", [0, 0, 0])])
def test_a_compositor_with_windows_marks_there_who_is_absent(marks: str, told: list[int]) -> None:
    plan = one_panel(OVERLAY + marks)
    remote, event = Rank(plan, 1), first_event(plan, 0.0)
    everybody = tuple(Hello(rank=k, host="", endpoint="", incarnation=1) for k in range(plan.layout.size))
    stale = [
        len(of(Show, remote.tell(event, Membership(members=members)))[-1].status.stale)
        for members in (everybody, everybody[:2], everybody)
    ]
    assert stale == told


def test_latency_is_measured_once_everybody_is_there(alone: Plan) -> None:
    head, event = Rank(alone), first_event(alone, 0.0)
    batch = replace(flat(1.0, event, adaptive=True), base_time=head.now)
    moved: list[Event] = [replace(event, camera_event=k, input_time=head.now) for k in range(3)]
    ranks = (Hello(rank=k, host="", endpoint="", incarnation=1) for k in range(alone.layout.size))
    head.tell(moved[0], Membership(members=tuple(ranks)))
    head.tell(moved[1], moved[2])
    assert not head.role.latency.seconds, "none of their samples has come"
    head.tell(Packet(encode(replace(batch, camera_event=2))), after=1.0)
    assert list(head.role.latency.seconds) == pytest.approx([1.2, 1.2], abs=0.01)
