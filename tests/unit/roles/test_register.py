"""The manager's list of ranks: who is in the run, who is lost, who took the place of a dead one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from manager_run import ELSEWHERE, TEXT, Run, hello, plan_of

from wall.packets.control import Alive, Membership
from wall.roles.instructions import Died, Disconnected, Input
from wall.roles.manager import NO_RENDERER
from wall.roles.membership import GATHER_S, REPEAT_S
from wall.roles.plan import HEAD, Plan


def test_membership_is_told_when_it_changes_and_again_and_again(plan: Plan) -> None:
    run = Run(plan)

    def told(*messages: Input, after: float) -> list[list[int]]:
        said = [message for to, message in run.tell(*messages, after=after) if isinstance(message, Membership)]
        return [[member.rank for member in message.members] for message in said]

    assert told(hello(HEAD), hello(1), after=0.0) == []
    assert told(after=GATHER_S) == [[HEAD, 1]]
    assert told(hello(1), after=GATHER_S) == [], "that is known"
    assert told(*run.beats(1), after=REPEAT_S) == [[HEAD, 1]]
    assert told(hello(1, incarnation=2), after=0.0) == []
    assert told(after=GATHER_S) == [[HEAD, 1]], "it was started anew"
    assert run.manager.register.members[1].incarnation == 2
    assert told(Died(1, "signal 9"), after=0.0) == [[HEAD]]


def test_a_late_rank_is_marked_long_before_it_is_lost(plan: Plan, elsewhere: Plan) -> None:
    run, limit = Run(elsewhere), elsewhere.layout.config.transport.marked_after_s
    assert limit == pytest.approx(0.3), "three heartbeats"
    said = run.tell(hello(HEAD), hello(1), hello(2), *run.beats(1, 2), after=GATHER_S)
    said += run.tell(*run.beats(1), after=limit - 0.01)
    said += run.tell(*run.beats(1), after=0.02)
    told = [[member.rank for member in each.members] for _, each in said if isinstance(each, Membership)]
    assert told[-1] == [HEAD, 1]
    assert run.manager.lost == {}
    said = run.tell(*run.beats(1, 2), after=0.5)
    assert [[m.rank for m in each.members] for _, each in said if isinstance(each, Membership)] == [[HEAD, 1, 2]]
    assert run.manager.register.marked_s(run.now) == pytest.approx({2: 0.5})

    run = Run(plan_of(f"{TEXT}transport: {{stale_after_s: 0}}\n"))
    run.tell(hello(HEAD), hello(1), after=1.9)
    assert run.manager.register.marked_s(run.now) == {}
    assert plan.layout.config.transport.lost_after_s == 2.0
    run.tell(after=0.2)
    assert run.manager.lost.keys() == {1}


def test_a_rank_whose_connection_has_closed_is_marked_at_once_until_it_says_something_newer(elsewhere: Plan) -> None:
    """What it had said before may come after: two processes' clocks are alike, and messages take their time."""
    run = Run(elsewhere)

    def present(said: list[tuple[int, Any]]) -> list[list[int]]:
        return [[member.rank for member in each.members] for _, each in said if isinstance(each, Membership)]

    run.tell(hello(HEAD), hello(1), hello(2), *run.beats(1, 2), after=GATHER_S)
    (late,) = run.beats(2)
    assert present(run.tell(*run.beats(1), Disconnected(2), after=0.01)) == [[HEAD, 1]]
    assert present(run.tell(*run.beats(1), late, after=0.01)) == []
    assert run.manager.lost == {}
    assert present(run.tell(*run.beats(1), replace(late, time=run.now), after=0.01)) == [[HEAD, 1, 2]]
    run.tell(*run.beats(1), Disconnected(2), after=0.01)
    run.tell(Died(2, "signal 9", again=True), hello(2, incarnation=2), *run.beats(1), after=GATHER_S)
    assert present(run.tell(*run.beats(1, 2), after=REPEAT_S)) == [[HEAD, 1, 2]]


def test_rank_that_never_spoke_is_silent_from_the_start_and_lost_until_it_speaks(elsewhere: Plan) -> None:
    run, limit = Run(elsewhere), elsewhere.layout.config.transport.lost_after_s
    run.tell(*run.beats(1), after=limit)
    assert run.manager.lost == {}
    run.tell(*run.beats(1), after=0.5)
    assert run.manager.lost == {2: f"silent for {limit + 0.5:.1f} s"}
    assert run.manager.register.silences == {2: limit + 0.5}


def test_what_the_manager_did_not_listen_to_is_no_silence(elsewhere: Plan) -> None:
    """A machine that stood still for 9 s, manager and all: what ranks said meanwhile waits to be taken in."""
    run, limit = Run(elsewhere), elsewhere.layout.config.transport.lost_after_s
    run.tell(hello(1), hello(2), *run.beats(1, 2), after=1.0)
    for step in (9.0, 0.1, 0.1, 9.0):
        run.now += step
        list(run.manager.on_tick(run.now))
        assert run.manager.lost == {}
    run.tell(*run.beats(1), after=limit)
    assert run.manager.lost.keys() == {2}


def test_a_rank_that_was_silent_and_then_ended_in_order_is_not_missed(elsewhere: Plan) -> None:
    run, limit = Run(elsewhere), elsewhere.layout.config.transport.lost_after_s
    run.tell(hello(1), hello(2), *run.beats(1, 2), after=1.0)
    run.tell(after=limit + 0.5)
    assert run.manager.register.missed(run.manager.heartbeats).keys() == {1, 2}
    for beat in run.beats(2, last=True):
        list(run.manager.on_message(beat, run.now))
    assert run.manager.register.missed(run.manager.heartbeats).keys() == {1}


def test_silent_renderers_end_no_run_unless_that_is_wanted_and_dead_ones_at_once(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    run.tell(*run.beats(1), after=86400.0)
    assert run.manager.lost.keys() == {2}
    assert run.manager.ended == ""
    run.tell(*run.beats(2))
    assert run.manager.lost == {}, "it is back, and the run is as it was"
    run.tell(Died(2, "signal 9"))
    assert run.manager.ended == NO_RENDERER

    run = Run(plan_of(f"{TEXT}transport: {{ends_after_s: 60}}\n{ELSEWHERE}"))
    run.tell(*run.beats(1), after=59.5)
    assert run.manager.ended == ""
    run.tell(*run.beats(1), after=0.5)
    assert run.manager.ended == NO_RENDERER
    run = Run(elsewhere)
    run.tell(Died(2, "signal 9"))
    assert run.manager.ended == NO_RENDERER


def test_a_rank_whose_loop_is_held_up_is_heard_of_and_all_else_is_as_it_last_said(elsewhere: Plan) -> None:
    run, transport = Run(elsewhere), elsewhere.layout.config.transport
    (beat,) = run.beats(2)
    run.tell(hello(1), hello(2), *run.beats(1), beat, after=1.0)
    step, busy_s = transport.marked_after_s / 2, 0.0
    while busy_s < 2.0 * transport.lost_after_s:
        busy_s += step
        said = run.tell(*run.beats(1), Alive(rank=2, time=run.now, busy_s=busy_s), after=step)
        assert (HEAD, replace(beat, time=run.now - step, busy_s=busy_s)) in said
    assert (run.manager.lost, run.manager.register.silences) == ({}, {})
    assert run.manager.register.busy == {2: busy_s}
    assert run.manager.register.marked_s(run.now).keys() == {2}, "it has shown nothing new for lost_after_s"
    run.tell(*run.beats(1, 2), after=step)
    assert run.manager.heartbeats[2].busy_s == 0.0
    assert run.manager.register.busy == {2: busy_s}, "the longest"
    run.tell(*run.beats(1), after=transport.lost_after_s)
    run.tell(*run.beats(1), after=0.5)
    assert run.manager.lost.keys() == {2}, "nor does its other thread speak"


def stuck_run(plan: Plan, *, after: float, **beat: Any) -> Run:
    """A run whose rank 2 says for so long that it has traced 7 samples."""
    run, began = Run(plan), 50.0
    run.tell(hello(HEAD), hello(1), hello(2), *run.beats(1, 2), after=GATHER_S)
    while run.now < began + GATHER_S + after:
        others, own = run.beats(1), replace(run.beats(2)[0], samples_traced=7)
        run.tell(*others, replace(own, **beat), after=0.1)
    return run


def test_a_rank_that_speaks_but_traces_nothing_though_it_has_work_is_marked_and_not_lost(elsewhere: Plan) -> None:
    lost_after_s = elsewhere.layout.config.transport.lost_after_s
    assert (
        stuck_run(elsewhere, after=lost_after_s - 0.2, works=True, complete=False).manager.register.marked_s(90) == {}
    )
    run = stuck_run(elsewhere, after=lost_after_s + 0.5, works=True, complete=False)
    marked = run.manager.register.marked_s(run.now)
    assert marked.keys() == {2}
    assert marked[2] == pytest.approx(0.4, abs=0.11)
    assert (run.manager.lost, run.manager.register.silences) == ({}, {})
    (note,) = [note for note in run.manager.register.take_notes() if note.level == "warning"]
    assert (note.rank, note.text[:-4]) == (2, f"lives, but has made nothing new for {lost_after_s:.0f}")
    more = replace(run.beats(2)[0], samples_traced=8, works=True)
    said = run.tell(*run.beats(1), more)
    assert [[m.rank for m in each.members] for _, each in said if isinstance(each, Membership)] == [[HEAD, 1, 2]]


def test_a_rank_whose_batches_always_take_long_is_told_of_once(elsewhere: Plan) -> None:
    run, batch_s = Run(elsewhere), 1.5 * elsewhere.layout.config.transport.lost_after_s
    run.tell(hello(HEAD), hello(1), hello(2), *run.beats(1, 2), after=GATHER_S)
    began = run.now
    while run.now < began + 10 * batch_s:
        own = replace(run.beats(2)[0], samples_traced=int((run.now - began) / batch_s), works=True, complete=False)
        run.tell(*run.beats(1), own, after=0.1)
    told = [note for note in run.manager.register.take_notes() if note.level == "warning"]
    assert [(note.rank, note.text.partition(",")[0]) for note in told] == [(2, "lives")]



def test_a_rank_at_rest_is_not_marked_nor_is_one_that_traces_however_slowly(elsewhere: Plan) -> None:
    lost_after_s = elsewhere.layout.config.transport.lost_after_s
    run = stuck_run(elsewhere, after=3 * lost_after_s, works=False, complete=True)
    for samples in (8, 9, 10):
        for _ in range(int(10 * lost_after_s) - 1):
            run.tell(*run.beats(1), replace(run.beats(2)[0], samples_traced=samples, works=True), after=0.1)
    assert run.manager.register.marked_s(run.now) == {}


def test_rank_that_was_only_late_is_not_lost_and_one_that_died_stays_lost(elsewhere: Plan) -> None:
    run, limit = Run(elsewhere), elsewhere.layout.config.transport.lost_after_s
    run.tell(*run.beats(2), after=limit + 1.0)
    assert run.manager.lost.keys() == {1}
    run.tell(*run.beats(1))
    assert run.manager.lost == {}
    run.tell(Died(1, "signal 9"), *run.beats(1))
    assert run.manager.lost == {1: f"died (signal 9) after {limit + 1.0:.1f} s"}


def test_a_rank_that_takes_the_place_of_a_dead_one_is_in_the_run_again(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    register = run.manager.register
    run.tell(hello(1), hello(2), *run.beats(1, 2), after=1.0)
    run.tell(Died(2, "signal 9", again=True))
    assert run.manager.lost == {2: "died (signal 9) after 1.0 s"}
    assert run.manager.ended == "", "the only renderer, but it comes"
    assert not register.excused(2)
    run.tell(hello(2), *run.beats(2))
    assert run.manager.lost.keys() == {2}, "what the dead one had said before"
    run.tell(hello(2, incarnation=2))
    assert run.manager.lost == {}
    assert 2 not in run.manager.heartbeats, "those of the dead one"
    assert register.restarts == {2: ["died (signal 9) after 1.0 s"]}
    told = [(note.rank, note.level, note.text) for note in run.manager.register.take_notes()]
    assert told[-1] == (2, "warning", "died (signal 9) after 1.0 s and was started again")
    run.tell(Died(2, "signal 9"))
    assert run.manager.ended == NO_RENDERER, "it is not started again for ever"


def test_what_a_rank_dropped_before_it_died_stays_counted(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    beat, again = run.beats(2)[0], hello(2, incarnation=2)
    run.tell(hello(2), replace(beat, dropped={"late": 5}), Died(2, "signal 9", again=True), again, again)
    assert run.manager.dropped() == {"late": 5}
    run.tell(replace(beat, dropped={"late": 2, "no_credit": 1}))
    assert run.manager.dropped() == {"late": 7, "no_credit": 1}


def test_a_rank_that_dies_before_it_speaks_is_not_waited_for(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    run.tell(hello(2), Died(2, "signal 9", again=True))
    assert run.manager.ended == ""
    run.tell(Died(2, "exit code 1"))
    assert run.manager.ended == NO_RENDERER
