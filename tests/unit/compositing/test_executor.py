"""The executor: only what changed is done again, and it is what doing all of it again would give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from framelets import EVERY, random_framelet, rect
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from small_graphs import PANEL0, PANEL1, WHOLE, built, nodes

from wall.compositing.executor import Executor, merged, same_time
from wall.compositing.graph import Graph, Step
from wall.config.graph import SkyNode
from wall.core.data import STILL, Camera, Event, Framelet, Rect
from wall.operators.arrange import Crop, Tile
from wall.operators.base import Operator
from wall.operators.depth import Depth
from wall.operators.over import Over
from wall.operators.selection import Newest

FRAME = 24  # pixels of an edge of the frame that random framelets lie in
KINDS = {"depth": Depth, "over": Over, "newest": Newest, "tile": Tile}


@st.composite
def rects(draw: st.DrawFn, inside: Rect | None = None) -> Rect:
    r = inside or rect(0, 0, FRAME, FRAME)
    x, y = draw(st.integers(r.x, r.right - 1)), draw(st.integers(r.y, r.bottom - 1))
    return rect(x, y, draw(st.integers(1, r.right - x)), draw(st.integers(1, r.bottom - y)))


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    """Three framelets that lie anywhere, then operators of any that come before."""
    steps: list[Step] = []
    for k in range(3):
        node = SkyNode(op="sky", id=f"n{k}", panel="p")
        steps.append(_step(steps, node, (), draw(rects()), EVERY, draw(st.integers(-2, 2))))
    for k in range(3, draw(st.integers(4, 8))):
        op = draw(st.sampled_from([*KINDS, "crop"]))
        needs = Crop.NEEDS if op == "crop" else KINDS[op].NEEDS
        fitting = [s.index for s in steps if needs <= s.channels]
        if op == "crop":
            inputs: Sequence[int] = [draw(st.sampled_from(fitting))]
            r = draw(rects())
            made: Operator = Crop(op="crop", id=f"n{k}", input=f"n{inputs[0]}", area=(r.x, r.y, r.width, r.height))
        elif not fitting:
            continue
        else:
            inputs = draw(st.lists(st.sampled_from(fitting), min_size=1, max_size=3))
            made = KINDS[op].model_validate({"op": op, "id": f"n{k}", "inputs": tuple(f"n{i}" for i in inputs)})
        order = min(steps[i].order for i in inputs)
        where = made.rect([steps[i].rect for i in inputs])
        steps.append(_step(steps, made, inputs, where, made.gives([steps[i].channels for i in inputs]), order))
    return Graph(nodes=(), steps=tuple(steps), layers=(), compositors=1)


def _step(
    before: list[Step],
    node: Operator | SkyNode,
    inputs: Sequence[int],
    where: Rect,
    channels: frozenset[str],
    order: int,
) -> Step:
    return Step(
        index=len(before), node=node, inputs=tuple(inputs), rank=0, rect=where, channels=channels, encoded=False,
        computes=False, order=order, panels=(),
    )  # fmt: skip


def sources_of(graph: Graph, seed: int) -> dict[int, Framelet]:
    rng = np.random.default_rng(seed)
    sources = [s for s in graph.steps if not s.inputs]
    return {s.index: random_framelet(rng, s.rect, order=s.order) for s in sources}


@given(graph=graphs(), seed=st.integers(0, 1 << 30), data=st.data())
@settings(max_examples=30, deadline=None, derandomize=True)
def test_doing_only_what_changed_gives_what_doing_all_would(graph: Graph, seed: int, data: st.DataObject) -> None:
    sources = sources_of(graph, seed)
    executor = Executor(graph, 0, sources, Path())
    executor.step({k: [f.rect] for k, f in sources.items()}, None)
    for turn in range(2):
        changed = {}
        for k, fresh in sources_of(graph, seed + 1 + turn).items():
            changed[k] = data.draw(st.lists(rects(inside=sources[k].rect), max_size=3))
            for region in changed[k]:
                for name in EVERY:
                    here = region.inside(fresh.rect)
                    sources[k].channel(name)[here] = fresh.channel(name)[here]
        executor.step(changed, None)

    whole = Executor(graph, 0, sources, Path())
    whole.step({k: [f.rect] for k, f in sources.items()}, None)
    for s in graph.steps:
        for name in s.channels:
            one, all_of_it = executor.framelets[s.index].channel(name), whole.framelets[s.index].channel(name)
            np.testing.assert_array_equal(one, all_of_it, err_msg=f"{s.node!r} {name}")


def executor_of(graph: Graph) -> tuple[Executor, dict[int, Framelet]]:
    """All of a graph's nodes, fed by blank framelets where its panels' are."""
    made = {
        s.index: Framelet.blank(s.rect, s.channels, encoded=s.encoded)
        for s in graph.steps
        if not isinstance(s.node, Operator) and s.channels and s.users
    }
    return Executor(graph, 0, made, Path()), made


def test_an_unchanged_input_costs_nothing_downstream() -> None:
    graph = built(nodes(*WHOLE))
    executor, sources = executor_of(graph)
    assert executor.step({}, None) == {}
    assert executor.step({k: [] for k in sources}, None) == {}
    assert executor.pixels == 0


def test_a_changed_region_costs_its_own_pixels_in_every_node_after_it_and_is_told() -> None:
    graph = built(nodes(*WHOLE))
    executor, _ = executor_of(graph)
    left, wall = graph.step("p0").index, graph.step("w").index
    dirty = rect(2, 1, 4, 3)
    assert executor.step({left: [dirty]}, None) == {left: [dirty], wall: [dirty]}
    assert executor.pixels == 12


def test_what_needs_no_input_is_made_once() -> None:
    graph = built(
        nodes(*PANEL0, "id: c, op: constant, panel: r0c1, colour: [1, 0, 1]", WHOLE[4].replace("p1", "c"), WHOLE[5])
    )
    executor, _ = executor_of(graph)
    constant, wall = graph.step("c"), graph.step("w").index
    assert executor.step({}, None) == {constant.index: [constant.rect], wall: [constant.rect]}
    assert (executor.framelets[wall].colour[:, 8:] == [255, 0, 255]).all()
    assert executor.pixels == 2 * constant.rect.area
    assert executor.step({}, None) == {}


def test_light_is_computed_with_and_bytes_are_shown_within_a_code_of_their_rounding() -> None:
    graph = built(
        nodes(*PANEL0, *PANEL1, "id: c, op: colour, input: p0, gain: 0.5", "id: w, op: tile, inputs: [c, p1]", WHOLE[5])
    )
    executor, sources = executor_of(graph)
    source, out = graph.step("p0"), graph.step("c")
    assert (source.encoded, out.encoded) == (False, True)
    values = np.random.default_rng(3).random((6, 8, 3), np.float32)
    sources[source.index].colour[...] = values
    executor.step({source.index: [rect(0, 0, 8, 3)]}, None)
    half = values.astype(np.float64) / 2
    wanted = 255 * np.where(half <= 0.0031308, 12.92 * half, 1.055 * half ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    shown = executor.framelets[out.index].colour
    assert np.abs(shown[:3] - wanted[:3]).max() <= 1.0
    assert (shown[3:] == 0).all(), "outside of the region nothing is written"


def two_layers() -> Graph:
    """Two layers of the left panel, compared by depth."""
    clear = "background: transparent, input:"
    return built(
        nodes(
            "id: sa, op: samples, panel: r0c0", f"id: a, op: reconstruct, {clear} sa",
            "id: sb, op: samples, panel: r0c0", f"id: b, op: reconstruct, {clear} sb",
            "id: d, op: depth, inputs: [a, b]", *PANEL1, "id: w, op: tile, inputs: [d, p1]", WHOLE[5],
        )
    )  # fmt: skip


def test_only_framelets_of_another_moment_are_moved() -> None:
    graph = two_layers()
    a, b = graph.step("a"), graph.step("b")
    sources = {s.index: Framelet.blank(s.rect, s.channels, encoded=s.encoded) for s in (a, b, graph.step("p1"))}
    moved: list[tuple[int, Event, int]] = []

    def move(framelet: Framelet, event: Event, panel: int, fill: bool) -> Framelet:
        moved.append((next(k for k, f in sources.items() if f is framelet), event, panel))
        return framelet

    def at(number: int, x: float) -> Event:
        camera = Camera(position=(x, 0.0, 0.0), world_from_wall=STILL.world_from_wall)
        return Event(view=0, camera_event=number, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)

    now = at(2, 1.0)
    sources[a.index].event, sources[b.index].event = at(1, 1.0), at(1, 0.5)
    executor = Executor(graph, 0, sources, Path(), move)
    executor.step({a.index: [a.rect]}, now)
    assert moved == [(b.index, now, 0)], "another number of the same camera and scene time is the same moment"
    assert executor.framelets[graph.step("d").index].event == now
    assert same_time(at(1, 1.0), now)


def test_an_event_of_another_view_moves_nothing() -> None:
    """Framelets of all views' panels come in at the refresh of any of them."""
    graph = two_layers()
    graph = replace(graph, layers=tuple(replace(layer, view=1) for layer in graph.layers))
    a, b = graph.step("a"), graph.step("b")
    sources = {s.index: Framelet.blank(s.rect, s.channels, encoded=s.encoded) for s in (a, b, graph.step("p1"))}
    moved: list[Event] = []

    def move(framelet: Framelet, event: Event, panel: int, fill: bool) -> Framelet:
        moved.append(event)
        return framelet

    def at(view: int, x: float) -> Event:
        camera = Camera(position=(x, 0.0, 0.0), world_from_wall=STILL.world_from_wall)
        return Event(view=view, camera_event=1, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)

    executor = Executor(graph, 0, sources, Path(), move)
    sources[a.index].event = sources[b.index].event = at(1, 1.0)
    executor.step({a.index: [a.rect]}, at(0, 9.0))
    executor.step({}, at(1, 1.0))
    executor.step({a.index: [a.rect]}, at(0, 9.0))
    assert moved == []
    sources[b.index].event = at(1, 0.5)
    executor.step({b.index: [b.rect]}, at(0, 9.0))
    assert moved == [at(1, 1.0)], "to the newest moment of its own view"


def test_what_was_made_of_a_guess_or_for_another_moment_is_made_anew() -> None:
    graph = two_layers()
    a, b, d = graph.step("a"), graph.step("b"), graph.step("d")
    sources = {s.index: Framelet.blank(s.rect, s.channels, encoded=s.encoded) for s in (a, b, graph.step("p1"))}

    def at(x: float) -> Event:
        camera = Camera(position=(x, 0.0, 0.0), world_from_wall=STILL.world_from_wall)
        return Event(view=0, camera_event=1, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)

    def guess(framelet: Framelet, event: Event, panel: int, fill: bool) -> Framelet:
        return Framelet.blank(framelet.rect, framelet.channels)

    executor, dirty = Executor(graph, 0, sources, Path(), guess), rect(2, 1, 2, 2)
    sources[a.index].event, sources[b.index].event = at(1.0), at(0.0)
    assert executor.step({a.index: [dirty]}, at(1.0))[d.index] == [d.rect], "nothing was shown before"
    sources[b.index].event = at(1.0)
    assert executor.step({b.index: [dirty]}, at(1.0))[d.index] == [d.rect], "the rest of b was a guess"
    assert executor.step({b.index: [dirty]}, at(1.0))[d.index] == [dirty]
    sources[a.index].event = sources[b.index].event = at(2.0)
    assert executor.step({b.index: [dirty]}, at(2.0))[d.index] == [d.rect], "the rest shows the moment before"


def test_times_of_light_count_from_the_same_moment_as_those_of_its_bytes() -> None:
    lines = [line.replace("input: s0", "input: s0, background: transparent") for line in PANEL0]
    other = ["id: sb, op: samples, panel: r0c0", "id: b, op: reconstruct, input: sb"]
    graph = built(nodes(*lines, *other, "id: c, op: colour, input: p0, gain: 0.5",
                        "id: n, op: newest, inputs: [c, b]", "id: e, op: encode, input: n", *PANEL1,
                        "id: w, op: tile, inputs: [e, p1]", WHOLE[5]))  # fmt: skip
    executor, sources = executor_of(graph)
    source, colour = graph.step("p0"), graph.step("c")
    framelet = sources[source.index]
    assert framelet.time is not None
    framelet.time[...], framelet.refreshed_at = -5.0, 1000.0
    framelet.event = Event(view=0, camera_event=1, scene_event=0, scene_time=0.0, input_time=0.0, camera=STILL)
    executor.step({source.index: [source.rect]}, None)
    made = executor.framelets[colour.index]
    assert made.time is not None
    assert (made.refreshed_at, made.time[0, 0]) == (1000.0, -5.0)


@given(regions=st.lists(rects(), max_size=6))
def test_merged_regions_hold_the_same_pixels_or_all_of_a_box_that_is_mostly_dirty(regions: list[Rect]) -> None:
    def marked(some: list[Rect]) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        found = np.zeros((FRAME, FRAME), np.bool_)
        for r in some:
            found[r.inside(rect(0, 0, FRAME, FRAME))] = True
        return found

    before, after = marked(regions), marked(merged(regions))
    assert (after | ~before).all()
    assert len(merged(regions)) <= len(regions)
    if len(merged(regions)) > 1:
        assert (after == before).all()


def test_a_curved_image_is_made_anew_where_the_eye_has_moved(random_numbers: np.random.Generator) -> None:
    surface = "surface: {type: cylinder, radius: 1, angles: [-30, 30], heights: [0, 0.6]}"
    wall = f"wall: {{panels: [{{id: r0c0, pixels: [40, 24], {surface}}}]}}"
    lines = (*PANEL0, "id: c, op: curve, input: p0, panel: r0c0", "id: png, op: sink, kind: png, input: c")
    graph = built(nodes(*lines), wall=wall, view="eye: [0, 0.3, 0], tracking: {reach: 0.2}")
    p0 = graph.step("p0")
    flat = random_framelet(random_numbers, p0.rect, channels=p0.channels, encoded=p0.encoded)
    executor, made = Executor(graph, 0, {p0.index: flat}, Path()), list[NDArray[np.uint8]]()
    for number, eye in enumerate([(0.0, 0.0, 0.0), (0.1, -0.1, 0.2), (0.0, 0.0, 0.0)]):
        camera = replace(STILL, eye=eye)
        flat.event = Event(view=0, camera_event=number, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)
        executor.step({p0.index: [rect(0, 0, 8, 8)]}, flat.event)  # the rest is as it was
        made.append(executor.framelets[graph.step("c").index].colour.copy())

    assert np.array_equal(made[0], made[2])
    moved = (made[0] != made[1]).any(axis=2)
    assert moved[:, 30:].mean() > 0.9
