"""The manager: inputs become numbered events, whoever joins gets the newest one, a run ends in order."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manager_run import ELSEWHERE, TEXT, Run, hello, plan_of

from wall.config.loading import loads
from wall.core.data import Event
from wall.core.errors import RemoteProtocolError
from wall.display.window import ALL_CLOSED
from wall.geometry.steering import Command, parse
from wall.packets.control import Heartbeat, Membership, Selection, Statistics, WindowInput
from wall.packets.notes import Note, note_of
from wall.roles.director import Director
from wall.roles.instructions import End, Packet
from wall.roles.manager import HOLD_S, SETTLED_S
from wall.roles.membership import Standing
from wall.roles.plan import HEAD, Plan, make_layout, make_plan
from wall.roles.status import Latency, samplers_of

PAGE_ELSEWHERE = ELSEWHERE.replace("window, input: panel", "browser, input: panel, on: compositor 1")


def command(**words: Any) -> Command:
    return parse(words)


def test_time_moves_camera_and_scene_and_counts_both(plan: Plan) -> None:
    director = Director(plan, 10.0)
    first = director.event

    assert director.update([], 10.5)

    event = director.event
    assert (event.camera_event, event.scene_event) == (first.camera_event + 1, first.scene_event + 1)
    assert (event.scene_time, event.input_time) == (0.5, 10.5)
    assert event.camera == plan.view.camera_at(0.5)


def test_pause_stops_scene_and_path_until_it_ends(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([], 1.0)
    assert director.update([command(kind="pause")], 1.0)
    paused = director.event
    assert paused.paused
    assert not director.update([], 5.0), "nothing is new while paused"
    assert director.event is paused

    director.update([command(kind="pause")], 5.0)
    director.update([], 5.25)
    assert director.event.scene_time == pytest.approx(1.25), "the pause has not been counted"


def test_the_head_hears_of_every_rank_at_its_pace_and_not_more_often(plan: Plan) -> None:
    run, told = Run(plan), list[float]()
    run.tell(hello(1))
    for _ in range(20):
        (beat,) = run.beats(1, complete=False)
        told += [run.now for to, m in run.tell(beat, after=0.05) if isinstance(m, Heartbeat) and to == HEAD]
    assert len(told) == 10, "heartbeats are 0.1 s apart"

    (last,) = run.beats(1, last=True)
    assert (HEAD, last) in run.tell(last, after=0.01)


def test_a_kept_camera_is_recalled_and_pages_hear_of_it(plan: Plan) -> None:
    run = Run(plan)
    [told] = [m for to, m in run.tell(WindowInput(rank=HEAD, commands=[bookmark("2")])) if isinstance(m, Selection)]
    assert told.bookmarks == [2]
    kept = run.manager.events[0].camera

    run.tell(WindowInput(rank=HEAD, commands=[{"kind": "orbit", "x": 0.5, "y": 0.0}]), after=1.0)
    assert run.manager.events[0].camera != kept
    run.tell(WindowInput(rank=HEAD, commands=[bookmark("2", "recall"), bookmark("7", "recall")]), after=1.0)

    np.testing.assert_allclose(run.manager.events[0].camera.position, kept.position, atol=1e-9)
    np.testing.assert_allclose(run.manager.events[0].camera.world_from_wall, kept.world_from_wall, atol=1e-9)


def bookmark(value: str, kind: str = "bookmark") -> dict[str, str]:
    return {"kind": kind, "value": value}


def test_seeking_moves_scene_and_path_also_while_paused_and_not_before_the_beginning(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="pause")], 1.0)
    before = director.event
    assert director.update([command(kind="seek", x=2.5)], 1.0)
    assert director.event.scene_time == pytest.approx(3.5)
    assert director.event.camera == plan.view.camera_at(3.5)
    assert director.event.number > before.number
    director.update([command(kind="seek", x=-10.0)], 1.0)
    assert director.event.scene_time == 0.0
    with pytest.raises(RemoteProtocolError, match=r"seek: x = 4000.0: want a number from -3600 to 3600"):
        command(kind="seek", x=4000.0)


def test_held_view_says_once_that_it_is_paused_and_stays_where_it_is(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([], 1.0)
    moving = director.event

    assert director.hold()

    assert director.event == replace(moving, paused=True), "not a new picture, so nobody traces anything anew"
    assert not director.hold()
    assert not director.update([], 9.0)


def test_commands_that_came_together_share_one_event(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="pause")], 0.0)
    before = director.event.camera_event

    director.update([command(kind="orbit", x=0.1, y=0.0)] * 5, 0.1)

    assert director.event.camera_event == before + 1
    assert director.event.camera != plan.view.camera_at(0.0)


def test_reset_returns_to_the_path(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="pause"), command(kind="zoom", x=1.5)], 0.0)
    assert director.event.camera != plan.view.camera_at(0.0)
    director.update([command(kind="reset")], 0.1)
    assert director.event.camera == plan.view.camera_at(0.0)


def test_sampler_asked_for_travels_with_the_event(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="sampler", value="hilbert")], 0.0)
    assert director.event.sampler == "hilbert"


def test_comparing_gives_the_adaptive_sampler_its_half_and_back_what_was_there(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="pause"), command(kind="sampler", value="hilbert")], 0.0)
    alone = director.event

    director.update([command(kind="compare", value="framed")], 0.1)
    both = director.event
    director.update([command(kind="compare", value="")], 0.2)

    assert (both.sampler, both.compare) == ("adaptive", "framed")
    assert (director.event.sampler, director.event.compare) == ("hilbert", "")
    assert alone.camera_event < both.camera_event < director.event.camera_event, "each starts over"


def test_choosing_one_sampler_ends_a_comparison(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="compare", value="framed")], 0.0)
    director.update([command(kind="sampler", value="frameless")], 0.1)
    assert (director.event.sampler, director.event.compare) == ("frameless", "")


def test_in_lock_step_neither_another_sampler_nor_a_comparison_can_be_chosen() -> None:
    more = "sampling: {method: framed}\ngraph: {sync: {mode: frame}}\n"
    plan = make_plan(make_layout(loads(TEXT + more, path=Path("wall.yaml"))))
    director = Director(plan, 0.0)
    director.update([command(kind="pause"), command(kind="sampler", value="frameless")], 0.0)
    director.update([command(kind="compare", value="hilbert")], 0.1)
    assert (director.event.sampler, director.event.compare) == ("framed", "")
    assert samplers_of(plan) == ("framed",)


def test_a_statistics_request_is_told_without_starting_anything_over(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([command(kind="pause")], 0.0)
    before = director.event.number
    assert director.update([command(kind="statistics", value="on")], 0.1)
    assert director.event.statistics
    assert director.event.number == before
    assert not director.update([], 0.2)


def test_latency_counts_superseded_inputs_until_a_newer_one_is_shown(plan: Plan) -> None:
    director, latency = Director(plan, 0.0), Latency()
    for now in (1.0, 2.0, 3.0):
        director.update([], now)
        latency.published(director.event)
    latency.shown((2, 2), 3.5)
    assert list(latency.seconds) == [2.5, 1.5]
    latency.shown((3, 3), 4.0)
    assert list(latency.seconds) == [2.5, 1.5, 1.0]


def test_rank_that_joins_late_gets_the_newest_event_and_the_stop(plan: Plan) -> None:
    run = Run(plan, still=False)
    run.tell(hello(HEAD))
    for _ in range(3):
        run.tell(after=0.1)

    said = run.tell(hello(1))

    (state,) = [message for to, message in said if to == 1]
    assert isinstance(state, Event)
    assert state.camera_event == 3, "the state, not its history"
    run.tell(End("enough"))
    run.tell(after=HOLD_S)
    assert run.stopped() == [1], "the head's compositor is the last"


def test_input_at_windows_of_a_remote_compositor_steers_and_ends_the_run(elsewhere: Plan) -> None:
    run = Run(elsewhere, still=False)
    manager = run.manager
    wishes = [{"kind": "pause"}, {"kind": "zoom", "x": "much"}, 7, {"kind": "statistics", "value": "on"}]
    run.tell(WindowInput(rank=1, commands=wishes))
    run.tell(WindowInput(rank=2, commands=[{"kind": "reset"}], escape="Escape", closed=True))
    event = manager.directors[0].event
    assert (event.paused, event.statistics) == (True, True)
    assert manager.counters == {"bad_command": 2, "bad_message": 1}, "rank 2 renders"
    assert manager.ended == ""
    run.tell(WindowInput(rank=1, escape="Escape was pressed"))
    assert manager.ended == "Escape was pressed"


def test_the_end_of_the_last_window_ends_the_run(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    run.tell(WindowInput(rank=1, closed=True))
    assert run.manager.ended == ALL_CLOSED


def test_the_last_window_of_one_compositor_leaves_those_of_others_open() -> None:
    graph = ELSEWHERE + "    - {id: two, op: sink, kind: window, input: panel, on: head}\n"
    run = Run(make_plan(make_layout(loads(f"{TEXT}{graph}", path=Path("wall.yaml")))))
    run.tell(WindowInput(rank=1, closed=True))
    assert run.manager.ended == ""


def test_a_run_is_complete_when_everybody_has_said_so_for_a_while(elsewhere: Plan) -> None:
    run = Run(elsewhere, until_complete=True)
    everybody = range(run.size)
    run.tell(*run.beats(HEAD, 1), *run.beats(2, complete=False))
    run.tell(after=SETTLED_S)
    assert run.manager.ended == "", "the renderer is at work"
    run.tell(*run.beats(*everybody))
    run.tell(*run.beats(HEAD, complete=False), after=SETTLED_S / 2)
    run.tell(*run.beats(HEAD))
    run.tell(after=SETTLED_S / 2)
    assert run.manager.ended == "", "its last packets came meanwhile"
    run.tell(after=SETTLED_S)
    assert run.manager.ended == "complete"


def test_at_the_end_the_view_is_held_then_the_others_stop_then_the_head(elsewhere: Plan) -> None:
    run = Run(elsewhere, still=False, seconds=1.0)
    run.tell(hello(HEAD), hello(1), hello(2), *run.beats(HEAD, 1, 2, complete=False))
    said = run.tell(*run.beats(1, complete=False), after=1.0)
    assert run.manager.ended == "time is up"
    (held,) = [message for _, message in said if isinstance(message, Event)]
    assert held.paused
    assert run.stopped() == []
    run.tell(*run.beats(1, 2), after=0.01)
    assert run.stopped() == [1, 2], "it has all its samples"
    run.tell(*run.beats(1, last=True))
    assert run.stopped() == [1, 2]
    run.tell(*run.beats(2, last=True))
    assert run.stopped() == [1, 2, HEAD]
    assert not run.finished
    run.tell(*run.beats(HEAD, last=True))
    assert run.finished


def test_a_run_ends_though_nobody_says_a_last_word(elsewhere: Plan) -> None:
    run = Run(elsewhere)
    run.tell(End("interrupted"))
    for _ in range(60):
        run.tell(after=0.1)
    assert run.stopped() == [1, 2, HEAD]
    assert run.finished


def test_what_nobody_sends_is_counted(plan: Plan) -> None:
    run = Run(plan)
    run.tell(Packet(b"stray"), hello(7), *run.beats(9))
    assert run.manager.counters == {"stray_packet": 1, "bad_message": 2}
    assert run.manager.register.members == {}


def test_the_compositor_that_serves_the_page_hears_what_the_head_hears_and_steers() -> None:
    run = Run(plan_of(TEXT + PAGE_ELSEWHERE))
    (beat,) = run.beats(2)
    address = "http://host1:8800/?token=secret"
    server = replace(hello(1), page=address, watch=address + "2")
    said = run.tell(server, beat, note_of(2, "warning", "it is warm"))
    for kind in (Heartbeat, Note):
        assert [to for to, message in said if isinstance(message, kind)] == [HEAD, 1]
    told = [message for _, message in said + run.tell(after=0.1) if isinstance(message, Membership)]
    assert told[-1].members == (hello(1),), "others do not get the tokens"
    assert run.manager.page_server == server
    standing = Standing(server, [], run.manager.plan.layout.config.transport)
    assert server in [send.message for send in standing.beat(beat, 0.0)]
    list(standing.take(told[-1]))
    assert [send.message for send in standing.beat(beat, 1.0)] == [beat], "it is listed"
    said = run.tell(WindowInput(rank=1, commands=[{"kind": "bookmark", "value": "3"}]))
    assert [to for to, message in said if isinstance(message, Selection)] == [HEAD, 1]
    run.tell(WindowInput(rank=2, commands=[{"kind": "bookmark", "value": "4"}]))
    assert run.manager.counters == {"bad_message": 1}


def test_the_head_hears_every_heartbeat_and_everybody_the_head_s_statistics(elsewhere: Plan) -> None:
    run, statistics = Run(elsewhere), Statistics(fps=60.0, samples_per_s=1e6, latency_ms=20.0, ranks=3)
    (beat,) = run.beats(2)
    said = run.tell(beat, statistics)
    assert (HEAD, beat) in said
    assert (None, statistics) in said
