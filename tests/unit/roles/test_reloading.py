"""A reload as the manager leads it: in its stages, refused as a whole, and never without an end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError, EditError
from wall.packets.control import (
    Adopt,
    EditAnswer,
    EditRequest,
    Event,
    Heartbeat,
    Hello,
    Prepare,
    Prepared,
    Selection,
    WindowInput,
)
from wall.roles.instructions import Broadcast, Changed, Died, Instruction, Make, PlanMade, Send
from wall.roles.manager import Manager
from wall.roles.plan import Layout, Plan, make_layout, make_plan
from wall.roles.reloading import ADOPT_S, AGAIN_S, PREPARE_S, check_fits

TEXT = """\
version: 1
scene: {source: courtyard}
wall:
  panels:
    - {id: a, pixels: [32, 24], corners: {lower_left: [0, 0, 0], lower_right: [0.4, 0, 0], upper_left: [0, 0.3, 0]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 4}}]
graph: {ranks_per_panel: 2, sinks: [png, window]}
transport: {lost_after_s: 5}
"""
KEY, CLIENT = "secret", 1 << 33
RANKS = 3  # the head and two renderers


def layout_of(text: str) -> Layout:
    return make_layout(loads(text, name="new.yaml", path=Path("new.yaml")))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(layout_of(TEXT))


class Led:
    """A manager, and what it says."""

    def __init__(self, plan: Plan) -> None:
        self.now, self.manager = 0.0, Manager(plan, 0.0, still=True, key=KEY)
        for rank in range(plan.layout.size):
            self.tell(Hello(rank=rank, host="", endpoint="", incarnation=1))

    def tell(self, message: object) -> list[Instruction]:
        return list(self.manager.on_message(message, self.now))  # type: ignore[arg-type]

    def tick(self, seconds: float = 0.0) -> list[Instruction]:
        self.now += seconds
        for rank in range(RANKS):
            self.beat(rank, self.manager.plan.number)
        return list(self.manager.on_tick(self.now))

    def beat(self, rank: int, configuration: int) -> None:
        self.tell(Heartbeat(rank=rank, time=self.now, configuration=configuration))

    def adopted(self, asked: list[Instruction]) -> list[object]:
        """What clients are answered once all ranks have adopted what was asked for."""
        (make,) = (each for each in asked if isinstance(each, Make))
        number = make.wanted.number
        made = make_plan(make_layout(loads(make.wanted.text, name="new.yaml", path=Path(make.wanted.path))))
        self.tell(PlanMade(number, replace(made, number=number)))
        for rank in range(RANKS):
            self.tell(Prepared(rank=rank, number=number))
        self.tick(0.1)
        for rank in range(RANKS):
            self.beat(rank, number)
        return said(self.manager.on_tick(self.now), EditAnswer)

    def ask(self, number: int = 1, key: str = KEY) -> list[Instruction]:
        return self.tell(EditRequest(client=CLIENT, number=number, key=key, configuration=TEXT, path="new.yaml"))


def said(instructions: Iterable[Instruction], kind: type) -> list[object]:
    """The messages of one kind among some instructions."""
    messages = [each.message for each in instructions if isinstance(each, Send | Broadcast)]
    return [message for message in messages if isinstance(message, kind)]


def refusals(instructions: Iterable[Instruction]) -> list[str]:
    return [answer.refused for answer in said(instructions, EditAnswer) if isinstance(answer, EditAnswer)]


def numbered(plan: Plan, number: int) -> Plan:
    return Plan(layout=plan.layout, scene=plan.scene, views=plan.views, number=number)


def test_all_ranks_prepare_then_all_adopt_then_events_go_on_with_higher_numbers(plan: Plan) -> None:
    led = Led(plan)
    led.manager.editor.set([("exposure", 1.0), ("sky.strength", 0.5)])
    before = led.tick(0.1)
    newest = max(event.camera_event for event in said(before, Event) if isinstance(event, Event))
    (make,) = led.ask()
    assert make == Make(Prepare(number=1, text=TEXT, path="new.yaml"))
    assert not led.ask(), "asked again while it is under way"
    assert not said(led.tick(0.1), Prepare)
    led.tell(PlanMade(1, numbered(plan, 1)))
    assert said(led.tick(0.1), Prepare) == [make.wanted]
    assert not said(led.tick(AGAIN_S / 2), Prepare)
    assert said(led.tick(AGAIN_S), Prepare) == [make.wanted], "a copy may have been lost"
    led.tell(Prepared(rank=0, number=1))
    led.tell(Prepared(rank=2, number=1))
    assert not said(led.tick(0.1), Adopt), "rank 1 is not ready"
    led.tell(Prepared(rank=1, number=1))
    led.tick(0.01)
    adopting = led.tick(AGAIN_S)
    assert said(adopting, Adopt) == [Adopt(number=1, since=newest + 1)]
    assert not said(adopting, Event), "none that ranks of two configurations would share"
    led.beat(0, 1)
    assert not refusals(list(led.manager.on_tick(led.now)))
    for rank in range(RANKS):
        led.beat(rank, 1)
    done = list(led.manager.on_tick(led.now))
    (answer,) = said(done, EditAnswer)
    assert isinstance(answer, EditAnswer)
    assert (answer.client, answer.number, answer.refused) == (CLIENT, 1, "")
    assert answer.edit == led.manager.editor.count
    events = [event for event in said(done, Event) if isinstance(event, Event)]
    assert [event.camera_event for event in events] == [newest + 1]
    assert events[0].paused
    assert events[0].exposure == 1.0
    assert dict(events[0].edits.values) == {"sky.strength": (0.5,)}, "edits that the new scene takes stay"
    assert led.manager.plan.number == 1
    with pytest.raises(EditError, match="no edit to undo"):
        led.manager.editor.undo()


def test_cameras_that_were_kept_are_kept_beyond_a_change_of_the_configuration(plan: Plan) -> None:
    led = Led(plan)
    led.tell(WindowInput(rank=0, commands=[{"kind": "orbit", "x": 0.5, "y": 0.0}]))
    led.tick(0.1)
    led.tell(WindowInput(rank=0, commands=[{"kind": "bookmark", "value": "2"}]))
    led.tick(0.1)
    kept = led.manager.events[0].camera
    led.adopted(led.ask())
    led.tell(WindowInput(rank=0, commands=[{"kind": "reset"}]))
    led.tick(0.1)
    assert led.manager.events[0].camera != kept
    assert led.manager.commands.selection == Selection(bookmarks=[2])
    led.tell(WindowInput(rank=0, commands=[{"kind": "recall", "value": "2"}]))
    led.tick(0.1)
    np.testing.assert_allclose(led.manager.events[0].camera.position, kept.position, atol=1e-9)


def test_changes_of_the_configuration_are_made_once_and_taken_back(plan: Plan) -> None:
    led, change = Led(plan), "views.0.refresh_hz=5"
    request = EditRequest(client=CLIENT, number=1, key=KEY, changes=[change])
    (changed,) = led.adopted(led.tell(request))
    assert led.manager.plan.views[0].refresh_hz == 5
    assert led.tell(request) == [Send(CLIENT, changed)], "said again: answered again, and not done again"

    led.manager.editor.set([("exposure", 1.0)])
    back = EditRequest(client=CLIENT, number=2, key=KEY, undo=1)
    assert said(led.tell(back), EditAnswer), "the newest edit first: a parameter's"
    assert not led.manager.editor.picture
    (undone,) = led.adopted(led.tell(back := replace(back, number=3)))
    assert led.manager.plan.layout.loaded.config == plan.layout.loaded.config
    assert led.tell(back) == [Send(CLIENT, undone)]
    assert refusals(led.tell(replace(back, number=4))) == ["there is no edit to undo"]


def test_a_refusal_of_changes_names_no_line_which_nobody_wrote(plan: Plan) -> None:
    led = Led(plan)
    (make,) = led.tell(EditRequest(client=CLIENT, number=1, key=KEY, changes=["views.0.refresh_hz=-5"]))
    with pytest.raises(ConfigError, match=r"^new.yaml:1:\d+: views\[0\].refresh_hz = -5") as refused:
        loads(make.wanted.text, name="new.yaml")
    (why,) = refusals(led.tell(PlanMade(1, None, str(refused.value))))
    assert why.startswith("new.yaml: views[0].refresh_hz = -5: ")


def test_what_is_asked_with_a_configuration_is_not_dropped_in_silence(plan: Plan) -> None:
    led = Led(plan)
    both = EditRequest(client=CLIENT, number=1, key=KEY, changes=["views-=map"], assignments=[["exposure", 1]])
    assert refusals(led.tell(both)) == ["changes and assignments at once: want one of them"]
    nobody = EditRequest(client=0, number=0, key=KEY, undo=1)
    assert refusals(led.tell(nobody)) == ["there is no edit to undo"]


def test_a_viewer_takes_a_configuration_back(plan: Plan) -> None:
    led = Led(plan)
    led.adopted(led.tell(EditRequest(client=CLIENT, number=1, key=KEY, changes=["scene.source=gallery"])))
    led.adopted(led.tell(WindowInput(rank=0, commands=[{"kind": "undo"}])))
    assert led.manager.plan.layout.loaded.config == plan.layout.loaded.config
    led.tell(WindowInput(rank=0, commands=[{"kind": "undo"}]))
    assert led.manager.counters["refused_edit"] == 1


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (["views-=map"], "views-=map: map is not in it; there are: main"),
        ([7], "7: is no text; wanted: PATH=VALUE, PATH+=VALUE or PATH-=VALUE"),
    ],
)
def test_changes_that_cannot_be_made_are_refused_with_a_reason(plan: Plan, changes: list[object], why: str) -> None:
    led = Led(plan)
    assert refusals(led.tell(EditRequest(client=CLIENT, number=1, key=KEY, changes=changes))) == [why]
    assert said(led.tick(1.0), Event), "all goes on"


def test_a_rank_that_is_started_again_meanwhile_has_to_prepare_once_more(plan: Plan) -> None:
    led = Led(plan)
    led.ask()
    led.tell(PlanMade(1, numbered(plan, 1)))
    led.tick(0.1)
    led.tell(Prepared(rank=1, number=1))
    led.tell(Died(1, "signal 9", again=True))
    led.tell(Prepared(rank=0, number=1))
    led.tell(Prepared(rank=2, number=1))
    led.tick(0.1)
    assert not said(led.tick(AGAIN_S), Adopt), "it comes, and knows nothing"
    assert led.manager.newest_plan.number == 0
    led.tell(Hello(rank=1, host="", endpoint="", incarnation=2))
    led.tell(Prepared(rank=1, number=1))
    since = led.manager.events[0].camera_event + 1
    assert said(led.tick(AGAIN_S), Adopt)
    assert (led.manager.newest_plan.number, led.manager.newest_plan.since) == (1, since), "of one that starts now"


@pytest.mark.parametrize("who", ["the head", "rank 1"])
def test_what_one_rank_refuses_changes_nothing(plan: Plan, who: str) -> None:
    led = Led(plan)
    led.ask()
    if who == "the head":
        refused = refusals(led.tell(PlanMade(1, None, "new.yaml:1:1: wrong")))
    else:
        led.tell(PlanMade(1, numbered(plan, 1)))
        led.tick(0.1)
        led.tell(Prepared(rank=0, number=1))
        refused = refusals(led.tell(Prepared(rank=1, number=1, refused="new.yaml:1:1: wrong")))
    assert refused == ["new.yaml:1:1: wrong" if who == "the head" else "rank 1: new.yaml:1:1: wrong"]
    assert said(led.tick(1.0), Event)
    assert led.manager.plan is plan
    assert led.ask(2) == [Make(Prepare(number=2, text=TEXT, path="new.yaml"))], "the next may follow"


def test_a_second_one_a_wrong_key_and_a_run_that_keeps_its_configuration_are_refused(plan: Plan) -> None:
    led = Led(plan)
    assert refusals(led.ask(key="guessed")) == ["the key is not this run's"]
    led.ask()
    assert refusals(led.ask(2)) == ["another configuration is being loaded; wanted: one after the other"]
    led.manager = Manager(plan, 0.0, still=True, key=KEY, fixed="its events are recorded")
    assert refusals(led.ask()) == ["this run keeps its configuration: its events are recorded"]
    led.tell(Changed(TEXT, "new.yaml"))
    led.tick()
    said = "this run keeps its configuration: its events are recorded"
    assert [note.text for note in led.manager.register.take_notes()] == [said]
    assert led.manager.register.take_notes() == []


def test_a_file_saved_while_another_configuration_is_loaded_follows_it(plan: Plan) -> None:
    led = Led(plan)
    asked = led.ask()
    assert not led.tell(Changed("half", "wall.yaml"))
    assert not led.tell(Changed(TEXT, "wall.yaml")), "the newest text is the one that counts"
    assert led.adopted(asked)
    begun = Make(Prepare(number=2, text=TEXT, path="wall.yaml"))
    assert [each for each in led.tick() if isinstance(each, Make)] == [begun]
    assert not [each for each in led.tick() if isinstance(each, Make)], "once"


def test_who_dies_meanwhile_is_not_waited_for(plan: Plan) -> None:
    led = Led(plan)
    led.ask()
    led.tell(PlanMade(1, numbered(plan, 1)))
    led.manager.register.lost[1] = "died"
    led.tell(Prepared(rank=0, number=1))
    assert not said(led.tick(AGAIN_S), Adopt), "rank 2 lives"
    led.tell(Prepared(rank=2, number=1))
    led.tick(0.1)
    assert said(led.tick(AGAIN_S), Adopt)


def test_neither_preparing_nor_adopting_lasts_for_ever(plan: Plan) -> None:
    led = Led(plan)
    led.ask()
    assert refusals(led.tick(PREPARE_S + 1)) == [f"the head has not prepared it within {PREPARE_S:g} s"]
    led.ask(2)
    led.tell(PlanMade(2, numbered(plan, 2)))
    led.tick(0.1)
    led.tell(Prepared(rank=0, number=2))
    assert refusals(led.tick(PREPARE_S + 1)) == [f"rank 1 has not prepared it within {PREPARE_S:g} s"]
    led.ask(3)
    led.tell(PlanMade(3, numbered(plan, 3)))
    led.tick(0.1)
    for rank in range(RANKS):
        led.tell(Prepared(rank=rank, number=3))
    led.tick(0.1)
    assert not said(led.tick(ADOPT_S / 2), Event)
    assert said(led.tick(ADOPT_S), Event), "rank 1 goes over when it can"


def test_a_rank_that_is_none_cannot_answer(plan: Plan) -> None:
    led = Led(plan)
    led.tell(Prepared(rank=7, number=0))
    assert led.manager.counters["bad_message"] == 1


CHANGES = {
    "panels": ("pixels: [32, 24]", "pixels: [33, 24]", "new.yaml:4:3: wall: has other panels or pixels"),
    "renderers": ("ranks_per_panel: 2", "ranks_per_panel: 3", "wants 1 compositor and 3 renderers; this"),
    "transport": ("lost_after_s: 5", "lost_after_s: 6", "transport: differs from that of the run"),
    "output": ("transport:", "output: {directory: elsewhere}\ntransport:", "output: differs from that of the run"),
    "sinks": ("[png, window]", "[window]", "graph: rank 0 has other sinks or windows"),
    "windows": ("pixels: [32, 24]", "display: ':7', pixels: [32, 24]", "graph: rank 0 has other sinks or windows"),
    "hosts": ("pixels: [32, 24]", "host: elsewhere, pixels: [32, 24]", "wall: wants other hosts than this run"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_processes_and_displays_cannot_become_is_refused(plan: Plan, change: str) -> None:
    was, becomes, says = CHANGES[change]
    assert was in TEXT
    with pytest.raises(ConfigError) as caught:
        check_fits(plan.layout, layout_of(TEXT.replace(was, becomes, 1)))
    assert says in str(caught.value)


def test_scene_views_and_calibration_may_all_differ(plan: Plan) -> None:
    text = TEXT.replace("source: courtyard", "source: spheres").replace(
        "pixels: [32", "colour: {gamma: 2}, pixels: [32"
    )
    text = text.replace("}}]\n", "}}, {id: map, viewport: {left: 0, top: 0, width: 0.5, height: 0.5}}]\n")
    check_fits(plan.layout, layout_of(text))
