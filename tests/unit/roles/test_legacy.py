"""A manager that takes another one's place goes on where that one was, with numbers that nobody has heard of."""

from __future__ import annotations

import pickle
from dataclasses import replace

from manager_run import Run, hello

from wall.packets.control import EditAnswer, EditRequest, Prepare, Prepared, Selection, WindowInput
from wall.roles.instructions import Make, PlanMade
from wall.roles.legacy import NUMBERS_AHEAD, inherit, legacy_of, plan_after
from wall.roles.plan import HEAD, Plan

KEY, CLIENT = "secret", 1 << 33


def test_a_view_stays_as_its_users_have_made_it(plan: Plan) -> None:
    before = Run(plan, still=False, seconds=30.0)
    commands = [
        {"kind": "zoom", "x": 0.5}, {"kind": "bookmark", "value": "2"}, {"kind": "orbit", "x": 0.2, "y": 0.1},
        {"kind": "seek", "x": 7.0}, {"kind": "expose", "x": 1.0}, {"kind": "sampler", "value": "framed"},
        {"kind": "pause"},
    ]  # fmt: skip
    before.manager.editor.set([("sky.zenith", [0.9, 0.1, 0.1])])
    before.tell(WindowInput(rank=HEAD, commands=commands), after=1.0)
    before.manager.register.restarts[1] = ["died (signal 11)"]
    (event,) = before.manager.events
    legacy = pickle.loads(pickle.dumps(legacy_of(before.manager)))  # as heads do

    after = Run(plan_after(plan, legacy), still=False, seconds=30.0)
    inherit(after.manager, legacy, "died (signal 9)")
    told = after.tell(after=5.0)

    (now,) = after.manager.events
    same = {"camera_event": 0, "scene_event": 0, "input_time": 0.0}
    assert replace(now, edits=event.edits, **same) == replace(event, **same)
    assert now.edits.values == event.edits.values
    assert now.edits.number > event.edits.number + NUMBERS_AHEAD // 2
    assert now.camera_event > event.camera_event + NUMBERS_AHEAD // 2
    assert now in [message for _, message in told]
    assert after.manager.register.restarts == {1: ["died (signal 11)"], HEAD: ["died (signal 9)"]}
    after.tell(WindowInput(rank=HEAD, commands=[{"kind": "recall", "value": "2"}]), after=1.0)
    assert after.manager.events[0].camera != now.camera, "that was before the orbit"
    after.tell(after=25.0)
    assert after.manager.ended == "time is up", "30 s after the run began, not the second manager"


def heir(plan: Plan, before: Run) -> Run:
    """The run's next manager."""
    legacy = pickle.loads(pickle.dumps(legacy_of(before.manager)))
    after = Run(plan_after(plan, legacy), key=KEY)
    inherit(after.manager, legacy, "died (signal 9)")
    return after


def request(number: int, **wanted: object) -> EditRequest:
    return EditRequest(client=CLIENT, number=number, key=KEY, **wanted)  # type: ignore[arg-type]


def test_what_pages_share_goes_on(plan: Plan) -> None:
    before = Run(plan, key=KEY)
    commands = [{"kind": "bookmark", "value": "2"}, {"kind": "select", "x": 0.5, "y": 0.5}]
    before.tell(WindowInput(rank=HEAD, commands=commands))
    shared = before.manager.commands.selection
    assert shared.bookmarks == [2]
    assert any(shared.names)

    after = heir(plan, before)
    assert (HEAD, shared) in after.tell(hello(HEAD))
    assert Selection() not in [message for _, message in Run(plan).tell(hello(HEAD))]
    recall = request(1, commands=[{"kind": "recall", "value": "2"}])
    assert [said.refused for _, said in after.tell(recall) if isinstance(said, EditAnswer)] == [""]


def test_a_request_that_comes_again_is_not_done_again(plan: Plan) -> None:
    before = Run(plan, key=KEY)
    wanted = request(7, commands=[{"kind": "expose", "x": 1.0}], listed=["exposure"])
    ((_, first),) = [each for each in before.tell(wanted) if isinstance(each[1], EditAnswer)]
    after = heir(plan, before)
    ((_, again),) = [each for each in after.tell(wanted) if isinstance(each[1], EditAnswer)]
    assert again == first
    assert again.parameters, "listed anew"


def test_no_configuration_gets_a_number_that_ranks_have_heard_of(plan: Plan) -> None:
    """One was being prepared when the head died; the next manager adopts another, which the one after does not redo."""

    def asked(run: Run, text: str) -> Prepare:
        (made,) = run.manager.on_message(request(7, configuration=text), run.now)
        assert isinstance(made, Make)
        return made.wanted

    before = Run(plan, key=KEY)
    prepared = asked(before, "one")
    after = heir(plan, before)
    wanted = asked(after, "another")
    assert wanted.number > prepared.number + NUMBERS_AHEAD // 2
    last = heir(plan, after)
    assert asked(last, "another").number > wanted.number, "it was not adopted, so it is tried again"

    list(after.manager.on_message(PlanMade(wanted.number, replace(plan, number=wanted.number), ""), after.now))
    for rank in range(plan.layout.size):
        after.tell(Prepared(rank=rank, number=wanted.number))
    after.tell()
    assert after.manager.reloading.adopting
    again = list(heir(plan, after).manager.on_message(request(7, configuration="another"), after.now))
    assert [type(each.message) for each in again] == [EditAnswer]
