"""Who gets a place in a running wall, and what becomes of it: the manager's side, and a renderer's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from manager_run import TEXT, Run, hello, plan_of

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.packets.control import Assignment, Hello, Membership
from wall.packets.joining import JoinAnswer, JoinRequest, Leave
from wall.roles.compositor import Compositor
from wall.roles.instructions import Admit, Died, End, Finish, Invitation, Reassign, Send, Tell, Trace
from wall.roles.joining import HELLO_S, grown
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event, make_layout
from wall.roles.reloading import check_fits
from wall.roles.renderer import Renderer
from wall.run.ports import FIRST_CLIENT

FIXED = f"{TEXT}graph: {{preset: sort-first, ranks_per_panel: 2}}\n"
BALANCED = FIXED.replace("ranks_per_panel: 2", "ranks_per_panel: 2, balance: true").replace("[32, 24]", "[32, 48]")
INVITED = Invitation(0, "all of it")
LATE_S = 2.5  # silent for so long is lost


def ask(client: int = 1, *, made: int = 0, key: str = "k", public: str = "its own") -> JoinRequest:
    return JoinRequest(
        client=FIRST_CLIENT + client, number=1, key=key, host="n", configuration=made, public=public
    )  # fmt: skip


def answer(run: Run, request: JoinRequest) -> JoinAnswer:
    """What a process is told, which also is admitted if it gets a place."""
    told = list(run.manager.on_message(request, run.now))
    [answered] = [i.message for i in told if isinstance(i, Send) and isinstance(i.message, JoinAnswer)]
    admitted = [i for i in told if isinstance(i, Admit)]
    assert admitted == ([Admit(answered.rank, request.public)] if answered.rank >= 0 else [])
    assert told[-1] == Send(request.client, answered), "it may connect once it hears that"
    return answered


def begun(text: str) -> Run:
    """Both renderers are there."""
    run = Run(plan_of(text), key="k")
    run.tell(INVITED, hello(HEAD), hello(1), hello(2), *run.beats(HEAD, 1, 2))
    return run


def joins(run: Run, rank: int, public: str = "its own") -> Hello:
    return replace(hello(rank, incarnation=7), key=public)


def assignments(said: list[tuple[int | None, object]]) -> list[Assignment]:
    return [message for to, message in said if to is None and isinstance(message, Assignment)]


def test_a_place_is_given_once_all_is_made_for_it_to_one_process_and_key_and_to_no_restart() -> None:
    run = begun(FIXED)
    run.tell(Died(2, "signal 9"))
    run.manager.joining.invitation = None
    assert list(run.manager.on_message(ask(), run.now)) == [], "it asks again"
    run.tell(INVITED)
    first = answer(run, ask(made=-1))
    assert (first.rank, first.configuration, first.told) == (-1, 0, "all of it")
    assert answer(run, ask()).rank == 2
    assert answer(run, ask()).rank == 2, "an answer that was lost"
    assert "no renderer is missing" in answer(run, ask(2)).refused
    assert run.manager.joining.ranks == {2}

    for stranger in (hello(2, incarnation=9), joins(run, 2, "another's")):
        run.tell(stranger)
        assert run.manager.lost.keys() == {2}
    said = run.tell(joins(run, 2), *run.beats(HEAD, 1, 2))
    assert run.manager.lost == {}
    assert run.manager.register.members[2].key == "its own"
    assert {to for to, message in said if not isinstance(message, JoinAnswer)} >= {2}, "it gets the state"
    assert run.manager.register.restarts[2][0].startswith("died (signal 9)")
    assert "no renderer is missing: 2 of 2" in answer(run, ask(3)).refused


def test_the_dead_come_before_the_silent_and_a_place_nobody_takes_up_is_free_again() -> None:
    run = begun(FIXED)
    run.tell(*run.beats(HEAD), after=LATE_S)
    assert run.manager.lost.keys() == {1, 2}
    run.tell(Died(2, "signal 9"))
    assert answer(run, ask(1)).rank == 2
    assert answer(run, ask(2)).rank == 1
    assert answer(run, ask(3)).refused
    run.now += HELLO_S
    assert answer(run, ask(3)).rank == 1


def test_one_that_is_started_again_is_not_missing_and_one_that_joined_and_fell_silent_is() -> None:
    run = begun(FIXED)
    run.tell(Died(2, "signal 9", again=True))
    assert answer(run, ask()).refused
    run.tell(Died(2, "signal 9"))
    assert answer(run, ask()).rank == 2
    run.tell(joins(run, 2))
    run.tell(*run.beats(HEAD, 1), after=LATE_S)
    assert answer(run, ask(2)).rank == 2


def test_who_does_not_know_the_key_gets_nothing_and_a_recorded_run_takes_nobody() -> None:
    run = begun(BALANCED)
    assert answer(run, ask(key="guessed", made=-1)) == JoinAnswer(
        client=FIRST_CLIENT + 1, number=1, refused="the key is not this run's"
    )
    recorded = Run(plan_of(BALANCED), key="k", fixed="its events are recorded")
    assert answer(recorded, ask()).refused == "nobody can join this run: its events are recorded"
    assert recorded.manager.dropped()["refused_join"] == 1


def test_with_balance_one_more_gets_rows_at_once_and_gives_them_back_when_it_leaves() -> None:
    run = begun(BALANCED)
    given = answer(run, ask())
    assert (given.rank, given.extra) == (3, 1)
    told = assignments(run.tell(*run.beats(HEAD, 1, 2), after=3.0))
    assert [each.cuts for each in told] == [[0, 24, 48]], "no rows before it is there"
    [dealt] = assignments(run.tell(joins(run, 3), *run.beats(HEAD, 1, 2, 3)))
    assert dealt.cuts == [0, 16, 32, 48]
    assert run.manager.lost == {}
    said = run.tell(Leave(rank=3))
    assert [each.cuts for each in assignments(said)] == [[0, 24, 48]]
    assert run.manager.lost[3].startswith("left")
    run.tell(*run.beats(HEAD, 1, 2), after=LATE_S)
    assert run.manager.register.missed({}) == {}, "the wall is whole without it"
    assert (run.manager.register.silences, run.manager.register.marked_s(run.now).keys()) == ({}, set())
    assert answer(run, ask(2)).rank == 3, "the place is used again"
    run.tell(joins(run, 3))
    run.tell(Leave(rank=1))
    assert 1 not in run.manager.lost, "it has not joined, and cannot leave"


def test_a_renderer_that_joins_begins_without_rows_and_one_that_is_told_to_end_says_so() -> None:
    plan = plan_of(BALANCED)
    plan = replace(plan, layout=grown(plan.layout, 1))
    role = Renderer(plan, Hello(rank=3, host="", endpoint="", incarnation=0), ready=lambda _: True)
    list(role.on_message(first_event(plan, 0.0), 0.0))
    list(role.on_message(Assignment(number=0, cuts=[0, 24, 48]), 0.0))
    beat = role._heartbeat(0.0)
    assert (beat.complete, beat.camera_event) == (True, 0), "the manager need not wait for it"
    list(role.on_message(Assignment(number=1, cuts=[0, 16, 32, 48]), 0.0))
    told = list(role.on_tick(0.0))
    assert [len(i.regions) for i in told if isinstance(i, Reassign)] == [1]
    assert [i for i in told if isinstance(i, Trace)], "the event came before"
    [region] = role.regions
    region.running.clear()
    list(role.on_message(End("interrupted"), 0.1))
    *_, beat, left, finish = role.on_tick(0.1)
    assert isinstance(beat, Send)
    assert getattr(beat.message, "last", False)
    assert (left, finish) == (Send(-1, Leave(rank=3)), Finish())


def test_compositors_know_renderers_that_cuts_name() -> None:
    plan = plan_of(BALANCED)
    head = Compositor(plan, hello(HEAD), ready=lambda _: True)
    list(head.on_message(Assignment(number=1, cuts=[0, 16, 32, 48]), 0.0))
    assert head._plan.layout.describe(3) == "r0c0 32x16+0+32"
    assert head._plan.layout.size == 4
    list(head.on_message(first_event(plan, 0.0), 0.0))
    members = tuple(hello(rank) for rank in range(4))
    list(head.on_message(Membership(members=members), 0.1))
    list(head.on_message(Assignment(number=2, cuts=[0, 24, 48]), 0.2))
    told = [i.status for i in head.on_message(Membership(members=members[:3]), 0.3) if isinstance(i, Tell)]
    assert [len(status.ranks) for status in told] == [3], "the table has no row of one that left"
    assert told[0].stale == (), "nor is a part of the wall marked for it"


def test_what_a_reload_asks_for_is_the_configuration_s_renderers_alone() -> None:
    plan: Plan = plan_of(BALANCED)
    old, same = grown(plan.layout, 2), make_layout(loads(BALANCED, path=Path("wall.yaml")))
    check_fits(old, same)
    with pytest.raises(ConfigError, match="renderers have joined"):
        check_fits(old, make_layout(loads(BALANCED.replace(", balance: true", ""), path=Path("wall.yaml"))))
    manager = Manager(plan, 0.0, still=True)
    manager.joining.extra = 2
    list(manager._adopt(replace(plan, number=1), 1.0))
    assert manager.balancer is not None
    assert manager.balancer.assignment.cuts == [0, 24, 48]
