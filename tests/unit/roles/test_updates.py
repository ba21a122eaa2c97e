"""Updates of the scene: what comes at once shares one; views share all; with a barrier the slowest sets the rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import Event
from wall.core.errors import ConfigError
from wall.packets.control import Heartbeat, Hello, WindowInput
from wall.roles.instructions import Broadcast
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan, on_one_machine, reconstructed_at_renderers
from wall.roles.renderer_image import RendererImage
from wall.roles.updates import EditsTaken, UpdatesShown

RENDERER, TICK_S = 1, 1 / 120  # two updates a refresh of the faster view
TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: {columns}, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}}}
views:
  - {{id: fast, viewport: {{left: 0, top: 0, width: 0.5, height: 1}}, refresh_hz: 60}}
  - {{id: slow, viewport: {{left: 0.5, top: 0, width: 0.5, height: 1}}, refresh_hz: 5}}
sampling: {{method: framed, threads: {threads}}}
barrier: {barrier}
"""


def plan_of(*, barrier: bool, columns: int = 1, threads: int = 1) -> Plan:
    text = TEXT.format(barrier=str(barrier).lower(), columns=columns, threads=threads)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


def test_edits_are_together_that_one_update_takes_in() -> None:
    taken = EditsTaken()
    for edits, changed in ((0, True), (1, True), (4, True), (4, False), (5, True)):
        taken.update(edits, changed=changed)
    assert (taken.updates, taken.edits, taken.together) == (4, 5, 3)


def test_an_update_is_shared_that_several_views_show_and_counted_once() -> None:
    shown = UpdatesShown()
    for view, update in ((0, 1), (0, 2), (1, 2), (2, 2), (0, 2), (0, 4), (1, 5), (2, 4)):
        shown.show(view, update)
    assert (shown.shown, shown.shared) == (4, 2), "1 and 5 by one view, 2 and 4 by several"


class Edited:
    """A manager whose scene is edited, and the events that it tells."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.manager = plan, Manager(plan, 0.0, still=True)
        for rank in (HEAD, RENDERER):
            list(self.manager.on_message(Hello(rank=rank, host="a", endpoint="", incarnation=1), 0.0))
        self.at(0.0)

    def at(self, now: float, strength: float | None = None) -> list[float]:
        """A tick, after an edit of the sky. Returns the strengths that the first view is told."""
        if strength is not None:
            command = {"kind": "set", "name": "sky.strength", "numbers": [strength]}
            list(self.manager.on_message(WindowInput(rank=HEAD, commands=[command]), now))
        told = [told.message for told in self.manager.on_tick(now) if isinstance(told, Broadcast)]
        events = [event for event in told if isinstance(event, Event) and event.view == 0]
        return [dict(event.edits.values)["sky.strength"][0] for event in events if event.edits.values]

    def shows(self, now: float, *, behind: int = 0) -> None:
        """The renderer says what it shows: the newest events, or so many scene events before."""
        numbers = [event.number for event in self.manager.events]
        camera, scene = (sum(number[k] for number in numbers) for k in (0, 1))
        beat = Heartbeat(rank=RENDERER, time=now, camera_event=camera, scene_event=scene - behind)
        list(self.manager.on_message(beat, now))


def test_an_edit_is_told_at_once_and_those_that_follow_share_the_next_update() -> None:
    wall = Edited(plan_of(barrier=False))
    ticks = [(k + 0.1) * TICK_S for k in range(1, 21)]
    for now in ticks[:10]:
        wall.at(now)
    assert wall.at(ticks[9] + 0.001, 2.0) == [2.0]
    assert [wall.at(ticks[9] + 0.001 * k, 1.0 + k) for k in (2, 3, 4)] == [[], [], []]
    assert wall.manager.due <= ticks[10], "and it looks again when they are due"
    assert wall.at(ticks[10]) == [5.0]
    for now in ticks[11:]:
        wall.at(now)
    assert wall.at(ticks[-1] + 0.001, 7.0) == [7.0]
    taken = wall.manager.taken
    assert (taken.edits, taken.updates, taken.together) == (5, 3, 3)


def test_with_a_barrier_an_update_waits_until_all_views_have_shown_the_one_before() -> None:
    wall = Edited(plan_of(barrier=True))
    wall.shows(0.0)
    assert wall.at(0.1, 2.0) == [2.0]
    assert [wall.at(0.2 + 0.1 * k, 3.0 + k) for k in range(3)] == [[], [], []]
    wall.shows(0.5, behind=1)
    assert wall.at(0.51) == [], "one of two views does not show it yet"
    wall.shows(0.6)
    assert wall.at(0.61) == [5.0]
    assert wall.manager.taken.together == 3


def refreshes(plan: Plan) -> list[int]:
    """Of each view in a second of ticks each 5 ms, in which nothing takes time."""
    clock = ManualClock()
    plan = on_one_machine(plan)
    image = RendererImage(plan, RENDERER, lambda to: True, clock)
    for k in range(200):
        for own in image.images:
            own.follow(replace(first_event(plan, 0.0, own.view.index), scene_event=k))
        if clock.now() >= image.due:
            list(image.on_tick(clock.now()))
        clock.advance(0.005)
    return [own.view.refreshes for own in image.images]


def test_views_have_their_own_rates_and_with_a_barrier_that_of_the_slowest(compiled_only: None) -> None:
    fast, slow = refreshes(plan_of(barrier=False))
    assert (fast, slow) == (pytest.approx(60, abs=2), pytest.approx(5, abs=1))
    fast, slow = refreshes(plan_of(barrier=True))
    assert fast == slow == pytest.approx(5, abs=1)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"columns": 2}, "barrier = true: 2 renderers; accepted: a wall of one"),
        ({"threads": 2}, "barrier = true: its renderer cannot make all images: 2 threads render it"),
    ],
)
def test_a_barrier_is_refused_where_one_renderer_does_not_make_all_images(
    changes: dict[str, int], expected: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_of(barrier=True, **changes)
    assert expected in str(refused.value)


def test_a_barrier_is_refused_between_machines() -> None:
    with pytest.raises(ConfigError, match=r"barrier = true: .*on two machines"):
        reconstructed_at_renderers(plan_of(barrier=True).layout, ["here", "there"])
