"""The manager: inputs become numbered events, and whoever joins late gets the newest one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from wall.config.loading import loads
from wall.core.data import Event
from wall.geometry.steering import Command, parse
from wall.packets.control import Hands, Hello, Stop, parse_control, serialise
from wall.roles.manager import Director, Latency, Manager, samplers_of
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.clock import HeadClock, ManualClock
from wall.transport.loopback import LoopbackHub, LoopbackLink

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 4}}]
"""
ELSEWHERE = """\
graph:
  compositors: 2
  nodes:
    - {id: samples, op: samples, panel: r0c0}
    - {id: panel, op: reconstruct, input: samples, on: compositor 1}
    - {id: window, op: sink, kind: window, input: panel}
"""
PATIENCE = 400  # waits of 10 ms


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


@pytest.fixture
def elsewhere() -> Manager:
    """Of a panel that compositor 1 shows in a window; its thread does not run."""
    plan = make_plan(make_layout(loads(f"{TEXT}{ELSEWHERE}", path=Path("wall.yaml"))))
    return Manager(plan, LoopbackHub(credit_bytes=1 << 16), ManualClock(50.0), list, still=True)


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


def test_held_view_says_once_that_it_is_paused_and_stays_where_it_is(plan: Plan) -> None:
    director = Director(plan, 0.0)
    director.update([], 1.0)
    moving = director.event

    assert director.hold()

    assert director.event == replace(moving, paused=True), "not a new picture, so nobody traces anything anew"
    assert not director.hold()
    assert not director.update([], 9.0)


def test_events_wait_for_the_head_in_their_order_and_the_last_one_is_at_rest(plan: Plan) -> None:
    manager = Manager(plan, LoopbackHub(credit_bytes=1 << 16), HeadClock(), lambda: [], still=False)
    manager.start()
    for _ in range(PATIENCE):
        if len(manager.recent) > 3:
            break
        manager.join(0.01)
    manager.hold()
    for _ in range(PATIENCE):
        if manager.event.paused:
            break
        manager.join(0.01)
    manager.stop()

    numbers = [event.number for event in manager.recent]
    assert numbers == sorted(numbers)
    assert manager.recent[-1] is manager.event
    assert [event.paused for event in manager.recent] == [False] * (len(numbers) - 1) + [True]


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
    hub = LoopbackHub(credit_bytes=1 << 16)
    manager = Manager(plan, hub, HeadClock(), lambda: [], still=False)
    manager.start()
    early = LoopbackLink(hub.endpoint)
    early.send(serialise(Hello(rank=1, role="renderer", region="", pid=1, host="a")))
    while manager.event.camera_event < 3:
        early.wait(0.01)
        early.receive()

    late = LoopbackLink(hub.endpoint)
    late.send(serialise(Hello(rank=2, role="renderer", region="", pid=2, host="b")))
    first = next_message(late)
    manager.stop()
    last = [parse_control(data) for data in late.receive()]

    assert isinstance(first, Event)
    assert first.camera_event >= 3, "the state, not its history"
    assert isinstance(last[-1], Stop)
    assert not manager.is_alive()
    assert manager.failure is None


def test_rank_that_never_spoke_is_silent_from_the_start(plan: Plan) -> None:
    clock = ManualClock(50.0)
    manager = Manager(plan, LoopbackHub(credit_bytes=1 << 16), clock, lambda: [], still=True)
    assert manager.silent(51.0, 2.0) == {}
    assert manager.silent(53.0, 2.0) == {1: 3.0}


def test_hands_at_another_compositor_s_windows_steer_and_end_the_run(elsewhere: Manager) -> None:
    link = LoopbackLink(elsewhere._hub.endpoint)
    wishes = [{"kind": "pause"}, {"kind": "zoom", "x": "much"}, 7, {"kind": "statistics", "value": "on"}]
    for commands in (json.dumps(wishes), "no list"):
        link.send(serialise(Hands(rank=1, commands=commands)))
    link.send(serialise(Hands(rank=2, commands='[{"kind": "reset"}]', escape="Escape", closed=True)))
    link.send(serialise(Hands(rank=1, escape="Escape was pressed")))

    elsewhere._listen()

    assert elsewhere._asked == [command(kind="pause"), command(kind="statistics", value="on")]
    assert elsewhere.counters.counts == {"bad_command": 2, "bad_message": 2}, "rank 2 renders"
    assert (elsewhere.escape, elsewhere.closed) == ("Escape was pressed", frozenset())


def next_message(link: LoopbackLink) -> object:
    for _ in range(PATIENCE):
        for data in link.receive():
            return parse_control(data)
        link.wait(0.01)
    pytest.fail("nothing came")
