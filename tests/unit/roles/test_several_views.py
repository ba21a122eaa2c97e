"""Several views on one wall: the same rays as one, a camera each, and shares of a renderer's time by weight."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Event
from wall.geometry.steering import parse
from wall.packets.control import Hello, WindowInput
from wall.roles.director import Director
from wall.roles.instructions import Broadcast, Trace, Traced, Work
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan, on_one_machine
from wall.roles.renderer import Renderer
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [40, 30], size: [0.4, 0.3], bezel: 0.02}}}}
views:
  - {main}
{others}
sampling: {{method: {method}, samples_per_batch: 256}}
"""
EYE = "eye: [0, 0, 0.8], camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}"
MAIN = f"{{id: main, {EYE}}}"
INSET = "viewport: {left: 0.25, top: 0.1, width: 0.5, height: 0.4}"
ABOVE = "camera: {position: [0, 20, 0.1], target: [0, 0, 0]}"


def plan_of(*others: str, method: str = "framed", main: str = MAIN) -> Plan:
    text = TEXT.format(main=main, others="\n".join(f"  - {{{other}}}" for other in others), method=method)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of().scene)


def shown(plan: Plan, scene: TracerScene, **options: bool) -> list[np.ndarray]:
    return [image.rgb for image in SingleProcess(plan, scene, **options).until_complete()]


@pytest.mark.parametrize("at_renderers", [True, False])
def test_an_inset_of_the_same_view_leaves_no_trace(
    tracer_scene: TracerScene, compiled_only: None, at_renderers: bool
) -> None:
    """Same eye, same camera, pixels traced at fixed places: the wall looks as with one view, bit for bit."""
    alone = shown(plan_of(), tracer_scene, at_renderers=at_renderers)
    both = shown(plan_of(f"id: map, {INSET}, {EYE}"), tracer_scene, at_renderers=at_renderers)
    for one, other in zip(alone, both, strict=True):
        assert len(np.unique(one)) > 50
        np.testing.assert_array_equal(one, other)


def test_an_adaptive_inset_of_the_same_view_is_as_near(tracer_scene: TracerScene, compiled_only: None) -> None:
    """Its samples lie elsewhere in their pixels, and know nothing of those around it."""

    def after_some_steps(plan: Plan) -> np.ndarray:
        chain = SingleProcess(plan, tracer_scene)
        for _ in range(60):
            chain.step()
        return np.stack([image.rgb for image in chain.composition.shown()[0].images()]).astype(float)

    alone = after_some_steps(plan_of(method="adaptive"))
    both = after_some_steps(plan_of(f"id: map, {INSET}, {EYE}", method="adaptive"))
    assert len(np.unique(both)) > 50
    assert np.sqrt(np.square(alone - both).mean()) < 12.0


def test_an_inset_covers_just_its_rectangle(tracer_scene: TracerScene, compiled_only: None) -> None:
    alone = shown(plan_of(), tracer_scene)
    both = shown(plan_of(f"id: map, {INSET}, {ABOVE}"), tracer_scene)
    alike = [(one == other).all(axis=-1) for one, other in zip(alone, both, strict=True)]
    inside = np.s_[3:15, 21:40], np.s_[3:15, 0:19]
    for same, part in zip(alike, inside, strict=True):
        assert same[part].mean() < 0.5
        same[part] = True
        assert same.all()


def test_a_view_with_panels_of_its_own_is_what_it_is_alone(tracer_scene: TracerScene, compiled_only: None) -> None:
    alone = shown(plan_of(main=f"{{id: map, eye: [0.2, 0, 0.8], {ABOVE}}}"), tracer_scene)
    both = shown(plan_of(f"id: map, panels: [r0c1], eye: [0.2, 0, 0.8], {ABOVE}"), tracer_scene)
    np.testing.assert_array_equal(both[1], alone[1])
    np.testing.assert_array_equal(both[0], shown(plan_of(), tracer_scene)[0])


def test_steering_one_view_leaves_the_other_where_it_is() -> None:
    plan = plan_of(f"id: map, {INSET}, {ABOVE}")
    manager = Manager(plan, 0.0, still=True)
    list(manager.on_message(Hello(rank=HEAD, host="a", endpoint="", incarnation=1), 0.0))
    drag = {"kind": "orbit", "x": 0.1, "y": 0.0}
    seen: dict[int, Event] = {}
    for now, commands in ((0.1, []), (0.2, [drag | {"view": 1}]), (0.3, [drag])):
        list(manager.on_message(WindowInput(rank=HEAD, commands=commands), now))
        before = dict(seen)
        news = [i.message for i in manager.on_tick(now) if isinstance(i, Broadcast)]
        seen |= {event.view: event for event in news if isinstance(event, Event)}
        if commands:
            steered = parse(commands[0]).view
            assert seen[steered].camera != before[steered].camera
            assert seen[1 - steered].camera == before[1 - steered].camera


def test_a_view_that_follows_has_the_camera_of_the_other_however_it_is_steered() -> None:
    """Drags of either turn both; samplers are their own."""
    plan = plan_of(f"id: copy, {INSET}, camera: {{follow: main}}", "id: last, panels: [r0c1], camera: {follow: copy}")
    assert plan.views[2].camera_at(1.0) == plan.views[0].camera_at(1.0)
    manager = Manager(plan, 0.0, still=True)
    list(manager.on_message(Hello(rank=HEAD, host="a", endpoint="", incarnation=1), 0.0))
    list(manager.on_tick(0.1))
    before = manager.events[0].camera
    for view, now in ((2, 0.2), (0, 0.3)):
        commands = [
            {"kind": "orbit", "x": 0.1, "y": 0.0, "view": view},
            {"kind": "sampler", "value": "hilbert", "view": 1},
        ]
        list(manager.on_message(WindowInput(rank=HEAD, commands=commands), now))
        list(manager.on_tick(now))
        cameras = [event.camera for event in manager.events]
        assert cameras[0] != before
        assert cameras == [cameras[0]] * 3
        before = cameras[0]
    assert [event.sampler for event in manager.events] == ["framed", "hilbert", "framed"]


def steered(manager: Manager, now: float, *commands: dict[str, object]) -> list[float]:
    """The views' times after what a user asked for."""
    list(manager.on_message(WindowInput(rank=HEAD, commands=list(commands)), now))
    list(manager.on_tick(now))
    return [event.scene_time for event in manager.events]


def test_views_have_the_first_ones_time_another_ones_shifted_or_their_own() -> None:
    """Whoever steers a view's time steers it where it is; without a view named, all times stop and go on alike."""
    plan = plan_of(
        f"id: map, {INSET}, camera: {{follow: main}}",
        f"id: ago, {INSET}, time: {{follow: main, offset_s: -5}}",
        f"id: then, {INSET}, time: {{offset_s: 12, paused: true}}",
        f"id: own, {INSET}, time: own",
        f"id: later, {INSET}, time: {{follow: then, offset_s: 1}}",
    )
    assert [event.scene_time for event in (first_event(plan, 0.0, k) for k in range(6))] == [0, 0, 0, 12, 0, 13]
    manager = Manager(plan, 0.0, still=False)
    list(manager.on_message(Hello(rank=HEAD, host="a", endpoint="", incarnation=1), 0.0))
    assert steered(manager, 2.0) == [2, 2, 0, 12, 2, 13], "never before the beginning"
    assert steered(manager, 6.0) == [6, 6, 1, 12, 6, 13]
    assert steered(manager, 7.0, {"kind": "seek", "x": 3.0, "view": 2}) == [10, 10, 5, 12, 7, 13]
    assert steered(manager, 8.0, {"kind": "seek", "x": 1.0, "view": 5}) == [11, 11, 6, 13, 8, 14]
    steered(manager, 9.0, {"kind": "pause", "view": 1})
    assert [event.paused for event in manager.events] == [True, True, True, True, False, True]
    assert steered(manager, 10.0) == [12, 12, 7, 13, 10, 14]
    steered(manager, 11.0, {"kind": "pause"})
    assert not any(event.paused for event in manager.events)
    assert steered(manager, 12.0, {"kind": "seek", "x": -9.0}) == [4, 4, 0, 5, 3, 6]


def test_times_go_on_under_another_configuration() -> None:
    """Of a view whose time is configured as before, and of the first, whichever that is now."""

    def directors(plan: Plan, before: dict[str, Director]) -> dict[str, Director]:
        made: list[Director] = []
        for k, view in enumerate(plan.views):
            made.append(Director(plan, 0.0, k, made, before.get(view.id, next(iter(before.values()), None))))
        return {director.name: director for director in made}

    def own(offset: float) -> str:
        return f"id: own, {INSET}, time: {{offset_s: {offset}}}"

    ago = f"id: ago, {INSET}, time: {{follow: main, offset_s: -5}}"
    known = directors(plan_of(ago, own(30)), {})
    for director in known.values():
        director.update([], 8.0)
    known["own"].update([parse({"kind": "pause"})], 9.0)
    assert [director.time for director in known.values()] == [8, 3, 39]

    same = directors(plan_of(ago, own(30)), known)
    assert [director.event.scene_time for director in same.values()] == [8, 3, 39]
    assert [director.paused for director in same.values()] == [False, False, True]
    other = directors(plan_of(own(70), main=f"{{id: ago, {EYE}}}"), known)
    assert [director.time for director in other.values()] == [3, 70]


@pytest.mark.parametrize("method", ["framed", "adaptive"])
def test_a_view_of_another_moment_shows_what_the_wall_shows_then(
    tracer_scene: TracerScene, compiled_only: None, method: str
) -> None:
    """One renderer has both in turn: objects stand where each view's time has them, bit for bit."""

    def ended(*others: str, main: str = EYE) -> list[np.ndarray]:
        chain = SingleProcess(plan_of(*others, method=method, main=f"{{id: main, {main}}}"), tracer_scene)
        for _ in range(40):
            chain.step()
        return [image.rgb for image in chain.composition.shown()[0].images()]

    alone, then = ended(), ended(main=f"{EYE}, time: {{offset_s: 3}}")
    both = ended(f"id: then, panels: [r0c1], {EYE}, time: {{offset_s: 3}}")
    assert (alone[1] != then[1]).any(), "it moves"
    np.testing.assert_array_equal(both[0], alone[0])
    np.testing.assert_array_equal(both[1], then[1])


class Rank:
    """A renderer with a region of each of two views, whose batches take so many seconds."""

    def __init__(self, plan: Plan, seconds: tuple[float, float]) -> None:
        self.plan, self.seconds, self.now = plan, seconds, 0.0
        self.role = Renderer(plan, Hello(rank=1, host="", endpoint="", incarnation=1), lambda to: True)
        self.spent = Counter[int]()  # seconds by view
        for view in (0, 1):
            list(self.role.on_message(first_event(plan, 0.0, view), 0.0))

    def turn(self, missing: tuple[bool, bool] = (True, True)) -> None:
        """A tick; `missing`: which views have anything to trace."""
        for instruction in self.role.on_tick(self.now):
            if isinstance(instruction, Trace):
                view = instruction.event.view
                took = self.seconds[view] if missing[view] else 0.0
                self.now += took
                self.spent[view] += took  # type: ignore[assignment]
                packet = b"" if missing[view] else None
                traced = Traced(instruction.worker, instruction.event, packet, Work(), seconds=took)
                list(self.role.on_message(traced, self.now))


@pytest.mark.parametrize("seconds", [(0.001, 0.001), (0.001, 0.02), (0.02, 0.001)])
def test_views_share_a_renderers_time_by_their_weights(seconds: tuple[float, float]) -> None:
    """However long their batches take; off by a batch at most."""
    rank = Rank(plan_of(f"id: map, {INSET}, {ABOVE}, weight: 0.25"), seconds)
    while rank.now < 10.0:
        rank.turn()
    assert rank.spent[1] / rank.now == pytest.approx(0.2, abs=0.02 / 10.0 + 1e-9)


def test_a_view_that_rested_has_saved_nothing(compiled_only: None) -> None:
    """It gets its share from when it moves again, not all of the time until it has caught up."""
    rank = Rank(plan_of(f"id: map, {INSET}, {ABOVE}"), (0.001, 0.001))
    while rank.now < 5.0:
        rank.turn((True, False))
    assert rank.spent[1] == 0.0
    moved = replace(first_event(rank.plan, 5.0, 1), camera_event=1)
    list(rank.role.on_message(moved, rank.now))
    before = rank.now
    while rank.now < before + 1.0:
        rank.turn()
    assert rank.spent[1] == pytest.approx(0.5, abs=0.01)


def test_a_rank_has_images_of_all_its_views_or_of_none() -> None:
    one_machine = on_one_machine(plan_of(f"id: map, {INSET}, {ABOVE}"))
    assert all(layer.at_renderer for layer in one_machine.layout.graph.layers)
    with_threads = on_one_machine(plan_of(f"id: map, {INSET}, {ABOVE}, sampling: {{method: framed, threads: 2}}"))
    assert not any(layer.at_renderer for layer in with_threads.layout.graph.layers)
