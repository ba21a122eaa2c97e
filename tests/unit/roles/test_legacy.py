"""A manager that takes another one's place goes on where that one was, with numbers that nobody has heard of."""

from __future__ import annotations

import pickle
from dataclasses import replace

from manager_run import Run

from wall.packets.control import WindowInput
from wall.roles.legacy import NUMBERS_AHEAD, inherit, legacy_of, plan_after
from wall.roles.plan import HEAD, Plan


def test_a_view_stays_as_its_users_have_made_it(plan: Plan) -> None:
    before = Run(plan, still=False, seconds=30.0)
    commands = [
        {"kind": "zoom", "x": 0.5}, {"kind": "bookmark", "value": "2"}, {"kind": "orbit", "x": 0.2, "y": 0.1},
        {"kind": "seek", "x": 7.0}, {"kind": "expose", "x": 1.0}, {"kind": "sampler", "value": "framed"},
        {"kind": "pause"},
    ]  # fmt: skip
    before.manager.editor.set([("sky.zenith", [0.9, 0.1, 0.1])])
    before.tell(WindowInput(rank=HEAD, commands=commands), after=1.0)
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
    assert after.manager.register.restarts == {HEAD: ["died (signal 9)"]}
    after.tell(WindowInput(rank=HEAD, commands=[{"kind": "recall", "value": "2"}]), after=1.0)
    assert after.manager.events[0].camera != now.camera, "that was before the orbit"
    after.tell(after=25.0)
    assert after.manager.ended == "time is up", "30 s after the run began, not the second manager"
