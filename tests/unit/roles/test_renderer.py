"""The renderer: workers trace the newest event, rest when nothing is missing, and look again when something is lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import SAMPLE, Batch, Event
from wall.packets.control import Heartbeat, Hello, Membership, Stop
from wall.packets.samples import encode
from wall.roles.instructions import (
    MANAGER,
    Connect,
    Dropped,
    Finish,
    Input,
    Instruction,
    Offer,
    Restart,
    Send,
    Trace,
    Traced,
    Work,
)
from wall.roles.membership import head_lost_s
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.roles.renderer import LOOK_AGAIN_S, Renderer

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: frameless, threads: 2}
"""
RANK = 1
TURN_S = 0.001


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


class Rank:
    """A renderer of two workers, and what it asks for."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.now, self.credit = plan, 10.0, True
        self.hello = Hello(rank=RANK, host="a", endpoint="", incarnation=1)
        self.role = Renderer(plan, self.hello, lambda target: self.credit and target == HEAD)

    def tell(self, *messages: Input, after: float = TURN_S) -> list[Instruction]:
        """Give it messages and a tick."""
        self.now += after
        asked: list[Instruction] = []
        for message in messages:
            asked += self.role.on_message(message, self.now)
        return asked + list(self.role.on_tick(self.now))


def packet_of(worker: int) -> bytes:
    """One sample, of one of two workers."""
    event = Event(view=0, camera_event=0, scene_event=0, scene_time=0.0, input_time=0.0, camera=Batch.camera)
    samples = np.zeros(1, SAMPLE)
    samples["xy"] = 0.5
    rect = make_layout(loads(TEXT, path=Path("wall.yaml"))).region(RANK).rect
    return encode(
        Batch(
            view=0, panel=0, rect=rect, rank=RANK, sequence=2 + worker, camera_event=event.camera_event,
            scene_event=0, base_time=0.0, samples=samples,
        )
    )  # fmt: skip


def traced(trace: Trace, packet: bytes | None) -> Traced:
    return Traced(trace.worker, trace.event, packet, Work())


def traces(asked: list[Instruction]) -> list[Trace]:
    return [instruction for instruction in asked if isinstance(instruction, Trace)]


def said(asked: list[Instruction]) -> Iterator[Heartbeat]:
    return (i.message for i in asked if isinstance(i, Send) and isinstance(i.message, Heartbeat))


def test_a_renderer_of_two_threads_rests_when_both_find_nothing_missing(plan: Plan) -> None:
    """Answers come one at a time, as threads end: each would begin anew while the other is at work."""
    rank, event = Rank(plan), first_event(plan, 0.0)
    running = traces(rank.tell(event))
    assert [trace.worker for trace in running] == [0, 1]
    beats: list[Heartbeat] = []
    begun = 0
    for _ in range(1000):  # a second
        asked = rank.tell(traced(running.pop(0), None)) if running else rank.tell()
        beats += said(asked)
        running += traces(asked)
        begun += len(traces(asked))
    assert begun <= 2 * (1.0 / LOOK_AGAIN_S + 1), "it looks again, and rests in between"
    assert rank.role.complete
    complete = [beat.complete for beat in beats]
    assert complete == sorted(complete), "complete once, and from then on"


def test_a_new_event_wakes_all_workers_and_is_not_complete(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    rank.tell(*(traced(trace, None) for trace in traces(rank.tell(event))))
    assert rank.role.complete
    newer = replace(event, camera_event=1)
    assert [trace.event for trace in traces(rank.tell(newer))] == [newer] * 2
    assert not rank.role.complete
    assert traces(rank.tell(event)) == [], "an older one changes nothing"


def test_a_worker_that_brings_samples_goes_on_at_once(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    first, _ = traces(rank.tell(event))
    asked = rank.tell(traced(first, packet_of(0)))
    assert Offer(HEAD, packet_of(0)) in asked
    assert [trace.worker for trace in traces(asked)] == [0]


def test_without_credit_nobody_begins(plan: Plan) -> None:
    rank = Rank(plan)
    rank.credit = False
    assert traces(rank.tell(first_event(plan, 0.0))) == []
    assert rank.role.due < rank.now + LOOK_AGAIN_S
    rank.credit = True
    assert len(traces(rank.tell())) == 2


def test_a_heartbeat_says_whether_there_is_something_to_trace(plan: Plan) -> None:
    rank, event, second = Rank(plan), first_event(plan, 0.0), 1.0
    rank.credit = False
    rank.tell(event)
    (beat,) = said(rank.tell(after=second))
    assert beat.works, "and nowhere to send it to"
    rank.credit = True
    running = traces(rank.tell(after=second))
    (beat,) = said(rank.tell(after=second))
    assert beat.works, "workers that do not come back"
    rank.tell(*(traced(trace, None) for trace in running))
    for _ in range(5):
        looks = [traced(trace, None) for trace in traces(rank.tell(after=second))]
        (beat,) = said(rank.tell(*looks, after=second))
        assert not beat.works, "nothing is missing"
    (beat,) = said(rank.tell(replace(event, camera_event=1), after=second))
    assert beat.works


def test_what_was_dropped_wakes_the_worker_that_traced_it(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    rank.tell(*(traced(trace, None) for trace in traces(rank.tell(event))))
    (again,) = traces(rank.tell(Dropped(HEAD, packet_of(1))))
    assert (again.worker, again.lost) == (1, (packet_of(1),))
    assert not rank.role.complete


def test_another_sampler_begins_when_all_workers_are_idle(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    first, second = traces(rank.tell(event))
    chosen = replace(event, sampler="hilbert", camera_event=1)
    assert not [i for i in rank.tell(chosen, traced(first, None)) if isinstance(i, Restart | Trace)]
    asked = [i for i in rank.tell(traced(second, packet_of(1))) if isinstance(i, Restart | Trace)]
    assert asked == [Restart("hilbert", ""), Trace(0, chosen), Trace(1, chosen)]


def test_at_the_end_running_workers_finish_before_the_last_word(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    first, second = traces(rank.tell(event))
    assert not traces(rank.tell(Stop(reason="end"), traced(first, packet_of(0))))
    assert not any(beat.answers for beat in said(rank.tell()))
    last = replace(traced(second, packet_of(1)), work=Work(answers=(0.25, 0.5)))
    asked = rank.tell(last)
    assert Offer(HEAD, packet_of(1)) in asked
    assert isinstance(asked[-1], Finish)
    *_, final = said(asked)
    assert (final.last, final.answers) == (True, [0.25, 0.5])


def test_it_says_hello_until_the_membership_lists_it_and_connects_by_it(plan: Plan) -> None:
    rank, beat_s = Rank(plan), plan.layout.config.transport.heartbeat_s
    hello = Send(MANAGER, rank.hello)
    assert hello in rank.tell()
    assert hello in rank.tell(after=beat_s)
    head = Hello(rank=HEAD, host="h", endpoint="tcp://h:1", incarnation=1)
    own = Hello(rank=RANK, host="a", endpoint="", incarnation=1)
    connect = Connect(HEAD, "tcp://h:1")
    assert connect in rank.tell(Membership(members=(head, replace(own, incarnation=7))))
    assert hello in rank.tell(after=beat_s), "that was another incarnation of it"
    assert connect not in rank.tell(Membership(members=(own,)))
    assert connect not in rank.tell(Membership(members=(head, own))), "it was only silent"
    assert hello not in rank.tell(after=beat_s)
    assert Connect(HEAD, "tcp://h:2", anew=True) in rank.tell(
        Membership(members=(replace(head, endpoint="tcp://h:2", incarnation=2), own))
    )


def test_a_role_that_follows_knows_who_began_anew_since_the_one_before(plan: Plan) -> None:
    before, after = Rank(plan), Rank(plan)
    head = Hello(rank=HEAD, host="h", endpoint="tcp://h:1", incarnation=1)
    before.tell(Membership(members=(head,)))
    after.role.standing.succeed(before.role.standing)
    last = Rank(plan)
    last.role.standing.succeed(after.role.standing)
    assert Connect(HEAD, "tcp://h:1") in after.tell(Membership(members=(head,))), "it has what was sent before"
    anew = Membership(members=(replace(head, endpoint="tcp://h:2", incarnation=2),))
    assert Connect(HEAD, "tcp://h:2", anew=True) in last.tell(anew), "it is not, though no role between connected to it"


def test_a_compositor_that_begins_anew_gets_all_samples_again_once_no_worker_traces(plan: Plan) -> None:
    rank, event = Rank(plan), first_event(plan, 0.0)
    head = Hello(rank=HEAD, host="h", endpoint="tcp://h:1", incarnation=1)
    own = Hello(rank=RANK, host="a", endpoint="", incarnation=1)
    first, second = traces(rank.tell(Membership(members=(head, own)), event))
    assert not traces(rank.tell(traced(first, None)))  # nothing is missing
    again = Membership(members=(replace(head, incarnation=2), own))
    assert not [i for i in rank.tell(again) if isinstance(i, Restart | Trace)], "one is at work"
    asked = [i for i in rank.tell(again, traced(second, None)) if isinstance(i, Restart | Trace)]
    assert asked == [Restart("frameless", ""), Trace(0, event), Trace(1, event)]
    assert not list(said(rank.tell(traced(first, None))))  # not complete: the other is at work
    assert [beat.complete for beat in said(rank.tell(traced(second, None)))] == [True]
    assert not traces(rank.tell(again)), "that is known"


def test_it_ends_when_the_manager_has_been_silent_for_too_long(plan: Plan) -> None:
    rank, limit = Rank(plan), head_lost_s(plan.layout.config.transport)
    rank.tell(first_event(plan, 0.0))
    assert not [i for i in rank.tell(after=limit - 0.05) if isinstance(i, Finish)]
    assert not [i for i in rank.tell(after=0.1) if isinstance(i, Finish)], "this rank itself may have paused"
    assert not [i for i in rank.tell(first_event(plan, 0.0), after=0.1) if isinstance(i, Finish)], "it had"
    rank.tell(after=limit + 0.1)
    (end,) = (i for i in rank.tell(after=0.1) if isinstance(i, Finish))
    assert f"rank {RANK}: nothing from the head" in end.failure
