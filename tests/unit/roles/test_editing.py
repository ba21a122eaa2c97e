"""The owner of edits: all of a request or none of it, by a key, in numbered events."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import write_config

from wall.commands.set import lines_of, parse_assignment
from wall.commands.set import note_of as words_of
from wall.config.loading import load
from wall.core.data import MOST_SAMPLES, NO_EDITS, SAMPLE, Batch, Edits, Event, Rect
from wall.core.errors import EditError
from wall.core.tone_mapping import Tone
from wall.packets.control import EditAnswer, EditRequest, Hello, WindowInput, parse_control, serialise
from wall.packets.notes import Note, note_of
from wall.roles.compositor import REFUSAL_SHOWN_S, Compositor
from wall.roles.edit_history import REMEMBERED, EditHistory
from wall.roles.editing import Editor, editable
from wall.roles.instructions import Broadcast, Send, Show
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan

NUMBERS = itertools.count(1)  # of requests
KEY, CLIENT = "secret", 1 << 32


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    config: Path = write_config(tmp_path_factory.mktemp("editing"))
    return make_plan(make_layout(load(config)))


def request(*assignments: tuple[str, object], key: str = KEY, listed: str = "") -> EditRequest:
    pairs, names = [list(each) for each in assignments], [listed] if listed else []
    return EditRequest(client=CLIENT, number=next(NUMBERS), key=key, assignments=pairs, listed=names)


def test_edits_are_numbered_and_hold_all_that_differs_from_the_configuration(plan: Plan) -> None:
    editor = Editor(plan)
    editor.set([("sky.strength", 2)])
    editor.set([("lights.0.intensity", [1, 2, 3])])
    assert editor.edits == Edits(2, (("lights.0.intensity", (1.0, 2.0, 3.0)), ("sky.strength", (2.0,))))
    editor.set([("sky.strength", None)])
    assert editor.edits == Edits(3, (("lights.0.intensity", (1.0, 2.0, 3.0)),))


def test_of_a_request_all_holds_or_nothing(plan: Plan) -> None:
    editor = Editor(plan)
    editor.set([("sky.strength", 2)])
    before = editor.edits
    with pytest.raises(EditError, match="want a number"):
        editor.set([("lights.0.intensity", 1), ("exposure", 1), ("sky.strength", -1)])
    assert editor.edits is before
    assert not editor.picture


def test_what_changes_nothing_has_no_number(plan: Plan) -> None:
    editor = Editor(plan)
    editor.set([("sky.strength", 2)])
    before = editor.edits
    editor.set([("sky.strength", 2.0)])
    assert editor.edits is before


def test_exposure_is_no_edit_of_the_scene(plan: Plan) -> None:
    editor = Editor(plan)
    editor.set([("exposure", 1.5)])
    assert editor.edits is NO_EDITS
    assert editor.tone(0.0).stops == 1.5
    editor.expose(100.0, 0.0)
    assert editor.tone(0.0).stops == 20.0  # the end of its range


def test_how_many_samples_there_are_is_no_new_scene(tmp_path: Path) -> None:
    """It is edited and told as all else is, where the progressive sampler is configured; the image stays the same."""
    assert MOST_SAMPLES not in editable(make_plan(make_layout(load(write_config(tmp_path)))))
    plan = make_plan(make_layout(load(write_config(tmp_path, method="progressive"))))
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    answers, (event,) = told(manager, request((MOST_SAMPLES, 64), listed=MOST_SAMPLES), 1e-4)
    assert (event.number, event.edits.most_samples(4096)) == ((0, 0), 64)
    assert [(row["value"], row["default"]) for row in answers[0].parameters] == [((64.0,), (4096.0,))]
    _, (event,) = told(manager, request(("sky.strength", 2)), 2e-2)
    assert (event.number, event.edits.number) == ((0, 1), 2)


def test_without_the_run_s_key_nothing_is_changed_or_told(plan: Plan) -> None:
    for editor, key in ((Editor(plan, key=KEY), "other"), (Editor(plan, key=KEY), ""), (Editor(plan), "")):
        answer = editor.answer(request(("sky.strength", 2), key=key, listed="*"), 0.0)
        assert answer.refused
        assert answer.parameters == []
        assert editor.edits is NO_EDITS


def test_a_list_tells_values_and_what_is_configured(plan: Plan) -> None:
    answer = Editor(plan, key=KEY).answer(request(("sky.strength", 2), listed="*"), 0.0)
    rows = {row["name"]: row for row in answer.parameters}
    assert (rows["sky.strength"]["value"], rows["sky.strength"]["default"]) == ((2.0,), (1.0,))
    assert rows["exposure"]["unit"] == "stops"


def test_a_list_can_be_of_some_names_alone(plan: Plan) -> None:
    editor = Editor(plan, key=KEY)
    answer = editor.answer(
        EditRequest(client=CLIENT, number=next(NUMBERS), key=KEY, listed=["exposure", "sky.z*", "nothing", 7]), 0.0
    )
    assert [row["name"] for row in answer.parameters] == ["exposure", "sky.zenith"]
    assert answer.left_out == 0


def test_a_list_that_no_answer_has_room_for_is_cut_and_says_so(plan: Plan) -> None:
    editor = Editor(plan, key=KEY)
    long = "m" * 240
    editor.parameters |= {
        name: replace(editor.parameters["sky.strength"], name=name) for name in (f"{long}.{k}" for k in range(20000))
    }
    answer = editor.answer(request(("exposure", 2), listed="*"), 0.0)
    assert parse_control(serialise(answer)) is not None
    assert len(answer.parameters) + answer.left_out == len(editor.parameters)
    assert answer.parameters[0]["name"] == "exposure"
    assert answer.left_out > 5000
    assert str(answer.left_out) in words_of(answer)
    assert words_of(editor.answer(request(listed="sky.*"), 0.0)) == ""


@pytest.mark.parametrize("assignments", [["x"], [["x"]], [[1, 2]], [{"a": 1}], [["x", 1, 2]], [None]])
def test_a_request_of_another_shape_is_refused(plan: Plan, assignments: list[object]) -> None:
    asked = EditRequest(client=CLIENT, number=next(NUMBERS), key=KEY, assignments=assignments)
    assert "want a name and a value" in Editor(plan, key=KEY).answer(asked, 0.0).refused


def told(manager: Manager, message: object, now: float) -> tuple[list[EditAnswer], list[Event]]:
    """What a manager answers and publishes."""
    instructions = [*manager.on_message(message, now), *manager.on_tick(now)]  # type: ignore[arg-type]
    answers = [i.message for i in instructions if isinstance(i, Send) and i.to == CLIENT]
    events = [i.message for i in instructions if isinstance(i, Broadcast) and isinstance(i.message, Event)]
    return [a for a in answers if isinstance(a, EditAnswer)], events


def test_an_edit_is_published_at_once_as_a_scene_event_and_answered(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    answers, events = told(manager, request(("sky.strength", 2)), 1e-4)
    assert [(a.refused, a.edit) for a in answers] == [("", 1)]
    (event,) = events
    assert event.scene_event == 1
    assert event.edits == Edits(1, (("sky.strength", (2.0,)),))


def test_tone_mapping_is_chosen_by_name_published_and_undone(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    name, value = parse_assignment("tone_mapping=aces")
    (answer,), (event,) = told(manager, request((name, value), listed=name), 1e-4)
    assert (event.number, event.tone) == ((0, 0), Tone(0.0, "aces"))
    assert next(lines_of(answer.parameters)).split()[:5] == ["tone_mapping", "aces", "one", "of", "none,"]
    _, (event,) = told(manager, WindowInput(rank=HEAD, commands=[{"kind": "undo"}]), 2e-2)
    assert (event.tone_mapping, manager.editor.picture) == ("none", {})
    (refused,), _ = told(manager, request(parse_assignment("tone_mapping=filmic")), 3e-2)
    assert refused.refused == "tone_mapping = filmic: want one of none, reinhard, aces, khronos_neutral"


def test_a_colour_is_taken_as_srgb_and_one_that_has_a_name_is_refused_as_a_colour(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    _, (event,) = told(manager, request(parse_assignment("sky.zenith=#ff8000")), 1e-4)
    assert event.edits.values[0][1] == pytest.approx((1.0, 0.21586, 0.0), abs=1e-5)
    (refused,), _ = told(manager, request(parse_assignment("sky.zenith=red")), 2e-2)
    assert refused.refused.startswith("sky.zenith = red: want three numbers, or one for all of them, from 0 to ")
    assert refused.refused.endswith(", or #rrggbb")


def test_exposure_is_published_without_a_new_number(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    _, (event,) = told(manager, request(("exposure", 1)), 1e-4)
    assert (event.number, event.exposure) == ((0, 0), 1.0)
    _, (event,) = told(manager, WindowInput(rank=HEAD, commands=[{"kind": "expose", "x": 0.5}]), 2e-2)
    assert (event.number, event.exposure) == ((0, 0), 1.5)


def test_a_refused_edit_publishes_nothing_and_a_page_s_is_counted(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    answers, events = told(manager, request(("sky.strenght", 2)), 1e-4)
    assert "did you mean sky.strength" in answers[0].refused
    assert events == []
    page = WindowInput(rank=HEAD, commands=[{"kind": "set", "name": "sky.strength", "numbers": [-1]}])
    assert told(manager, page, 2e-4) == ([], [])
    assert manager.dropped()["refused_edit"] == 2


def test_a_pattern_is_refused_with_the_way_to_what_it_matches(plan: Plan) -> None:
    with pytest.raises(EditError, match=r"objects\.\*\.offset: a pattern; wanted: one parameter's name"):
        Editor(plan).set([("objects.*.offset", [0, 1, 0])])


def test_a_page_shows_for_a_while_why_an_edit_was_refused(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=True, key=KEY)
    list(manager.on_tick(0.0))
    list(manager.on_message(WindowInput(rank=HEAD, commands=[{"kind": "undo"}]), 0.1))
    (note,) = [
        sent.message for sent in manager.on_tick(0.1) if isinstance(sent, Send) and isinstance(sent.message, Note)
    ]
    assert note.said == "refused: there is no edit to undo"

    head = Compositor(plan, Hello(rank=HEAD, host="", endpoint="", incarnation=0), ready=lambda _: True)
    for message in (first_event(plan, 0.0), note_of(2, "warning", "slow"), note):
        list(head.on_message(message, 0.2))
    for now, wanted in ((0.3, ("rank 2: slow", note.said)), (0.3 + REFUSAL_SHOWN_S, ("rank 2: slow",))):
        shown = [each.status.notes for each in head.on_tick(now) if isinstance(each, Show)]
        assert shown == [wanted]


def batch(number: int) -> Batch:
    return Batch(
        view=0, panel=0, rect=Rect(x=0, y=0, width=1, height=1), rank=1, sequence=number, camera_event=0, scene_event=0,
        base_time=0.0, samples=np.zeros(0, SAMPLE), edits=Edits(number),
    )  # fmt: skip


def test_samples_of_edits_that_are_not_known_wait_for_them_and_those_of_forgotten_ones_do_not() -> None:
    history = EditHistory()
    early = batch(2)
    assert history.of(2) is None
    assert history.waits(early)
    assert history.know(Edits(1)) == [early]  # asked again: it waits anew
    assert history.waits(early)
    assert history.know(Edits(2, (("x", (1.0,)),))) == [early]
    assert history.of(2) == Edits(2, (("x", (1.0,)),))
    for number in range(3, 4 + REMEMBERED):
        history.know(Edits(number))
    assert history.of(2) is None
    assert not history.waits(batch(2))


def test_edits_are_taken_back_the_newest_first_and_what_follows_at_once_together(plan: Plan) -> None:
    editor = Editor(plan)
    editor.set([("sky.strength", 2)], 1.0)
    for k in range(10):  # a slider
        editor.set([("lights.0.intensity", k)], 2.0 + 0.1 * k)
    editor.set([("exposure", 3)], 9.0)
    assert (editor.picture, len(editor.edits.values), editor.edits.number) == ({"exposure": (3.0,)}, 2, 11)
    editor.undo()
    assert (editor.picture, len(editor.edits.values), editor.edits.number) == ({}, 2, 11), "the scene is as it was"
    editor.undo()
    assert editor.edits == Edits(14, (("sky.strength", (2.0,)),)), "the number tells that something changed"
    editor.set([("sky.strength", 5)], 9.1)
    editor.undo(2)
    assert editor.edits.values == ()
    with pytest.raises(EditError, match="there is no edit to undo"):
        editor.undo()


def test_a_request_that_comes_again_is_answered_again_and_not_done_again(plan: Plan) -> None:
    editor = Editor(plan, key=KEY)
    editor.set([("sky.strength", 2)], 1.0)
    editor.set([("sky.strength", 3)], 5.0)
    once = EditRequest(client=CLIENT, number=next(NUMBERS), key=KEY, undo=1)
    first = editor.answer(once, 0.0)
    assert editor.answer(once, 0.0) is first
    assert editor.edits.values == (("sky.strength", (2.0,)),)


def test_to_undo_and_to_set_at_once_changes_nothing(plan: Plan) -> None:
    editor = Editor(plan, key=KEY)
    editor.set([("sky.strength", 2)], 1.0)
    asked = EditRequest(client=CLIENT, number=next(NUMBERS), key=KEY, undo=1, assignments=[["sky.strength", 4]])
    assert "want one of them" in editor.answer(asked, 0.0).refused
    assert editor.edits.values == (("sky.strength", (2.0,)),)
