"""Borders that move: they end where all have the same to do, nobody waits, and no pixel is lost on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Event
from wall.core.errors import ConfigError
from wall.packets.control import Assignment, Heartbeat, Hello
from wall.roles.balance import EVEN, PERIOD_S, Balancer
from wall.roles.compositor import Compositor
from wall.roles.instructions import Broadcast, Reassign, Send, Trace, Traced, Work
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Layout, Plan, first_event, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.status import status_of
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [40, {rows}], size: [0.4, 0.3], bezel: 0.02}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}}}]
sampling: {{method: {method}, samples_per_batch: 256, threads: {threads}}}
graph: {{preset: sort-first, ranks_per_panel: {ranks}, balance: {balance}}}
"""


def layout_of(
    *, rows: int = 480, method: str = "framed", ranks: int = 1, balance: str = "true", threads: int = 1
) -> Layout:
    text = TEXT.format(rows=rows, method=method, ranks=ranks, balance=balance, threads=threads)
    return make_layout(loads(text, path=Path("wall.yaml")))


def beats(balancer: Balancer, layout: Layout, density: np.ndarray, speeds: list[float]) -> dict[int, Heartbeat]:
    """What renderers say where each row costs `density`, on machines of these speeds."""
    assert layout.strips is not None
    layout = layout.assigned(balancer.assignment.cuts)
    said = {}
    for rank, speed in zip(layout.renderers(), speeds, strict=True):
        costs = {}
        for region in layout.regions_of(rank):
            top = layout.strips.top(region)
            costs[str(region.layer)] = round(1e9 * density[top : top + region.rect.height].sum() / speed)
        said[rank] = Heartbeat(rank=rank, time=0.0, assignment=balancer.assignment.number, costs=costs)
    return said


def evenness(said: dict[int, Heartbeat]) -> float:
    costs = [sum(beat.costs.values()) for beat in said.values()]
    return sum(costs) / len(costs) / max(costs)


LOADS = {
    "one panel": np.concatenate([np.full(480, 5.0), np.full(480, 1.0)]),
    "one corner": np.concatenate([np.full(240, 0.1), np.full(240, 13.0), np.full(480, 0.1)]),
    "a ramp": np.linspace(0.1, 4.0, 960),
}


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("slow", [1.0, 0.25])
def test_a_loaded_wall_comes_close_to_a_perfect_split_and_rests(load: str, ranks: int, slow: float) -> None:
    """Within ten moves 0.85 of it, on machines of one speed or two."""
    layout, now = layout_of(ranks=ranks), 0.0
    balancer, speeds = Balancer(layout, now), [slow, *[1.0] * (2 * ranks - 1)]
    for turn in range(30):
        now += PERIOD_S
        said = beats(balancer, layout, LOADS[load], speeds)
        moved = balancer.on_tick(said, (), ((turn, 0),), now) is not None
        assert turn < 20 or not moved, "it does not swing to and fro"
    assert evenness(said) >= 0.85
    assert balancer.assignment.number <= 10


def test_costs_that_are_measured_badly_are_believed_together() -> None:
    """Each is off by a fifth, up or down: no border moves for that alone, and strips come close to a perfect split."""
    layout, load, rng = layout_of(ranks=2), LOADS["one panel"], np.random.default_rng(1)
    balancer, found, moves = Balancer(layout, 0.0), [], []
    for turn in range(200):
        said = beats(balancer, layout, load, (1.0 + rng.choice([-0.2, 0.2], 4)).tolist())
        balancer.on_tick(said, (), ((turn, 0),), (turn + 1) * PERIOD_S)
        found.append(evenness(beats(balancer, layout, load, [1.0] * 4)))
        moves.append(balancer.assignment.number)
    assert np.mean(found[10:]) >= 0.85
    assert moves[-1] <= 65


def test_what_cannot_be_even_makes_borders_move_ever_more_rarely() -> None:
    """Eight ranks, a slow one among them, for 20 rows that have nearly all of the load: strips are at least 8 rows."""
    layout = layout_of(ranks=4)
    balancer, load = Balancer(layout, 0.0), np.concatenate([np.full(460, 0.1), np.full(20, 99.0), np.full(480, 0.1)])
    for turn in range(200):
        said = beats(balancer, layout, load, [0.25, *[1.0] * 7])
        balancer.on_tick(said, (), ((turn, 0),), turn * PERIOD_S)
    assert balancer.assignment.number <= 20


def test_nothing_moves_at_rest_before_all_have_measured_or_where_one_is_lost() -> None:
    layout = layout_of()
    balancer = Balancer(layout, 0.0)
    said = beats(balancer, layout, LOADS["one panel"], [1.0, 1.0])
    first, second = sorted(said)
    events = iter(((number, 0),) for number in range(100))
    assert balancer.on_tick(said, (), next(events), 0.5 * PERIOD_S) is None, "too early"
    assert balancer.on_tick({first: said[first]}, (), next(events), PERIOD_S) is None, "one has said nothing"
    idle = Heartbeat(rank=second, time=0.0)
    assert balancer.on_tick(said | {second: idle}, (), next(events), 2 * PERIOD_S) is None, "one has not measured"
    last = next(events)
    balancer.on_tick({}, (), last, 4 * PERIOD_S)
    assert balancer.on_tick(said, (), last, 5 * PERIOD_S) is None, "nothing moves"
    assert balancer.on_tick(said, (), next(events), 6 * PERIOD_S) is not None
    assert balancer.on_tick(said, (), next(events), 7 * PERIOD_S) is None, "costs of regions before"


@pytest.mark.parametrize("lost", [(2,), (2, 3), (1, 4)])
def test_the_rows_of_a_lost_renderer_are_the_others_at_once_and_it_gets_some_when_it_is_back(lost: tuple[int]) -> None:
    layout = layout_of(ranks=2)
    balancer = Balancer(layout, 0.0)
    assert balancer.on_tick({}, (), (), 0.1) is None
    assignment = balancer.on_tick({}, lost, (), 0.2)
    assert assignment is not None
    rendered = layout.assigned(assignment.cuts)
    assert [not rendered.regions_of(rank) for rank in layout.renderers()] == [r in lost for r in layout.renderers()]
    assert sum(region.rect.area for of_rank in rendered.regions for region in of_rank) == 2 * 40 * 480
    assert balancer.on_tick({}, lost, (), 0.3) is None, "once"
    assert balancer.on_tick({}, (), (), 0.4) is None, "one that is back waits for its turn"
    back = balancer.on_tick({}, (), (), 10.0)
    assert back is not None
    assert all(layout.assigned(back.cuts).regions)
    assert balancer.on_tick({}, tuple(layout.renderers()), (), 10.1) is None, "nobody is left"


def test_a_renderer_without_a_strip_rests_and_takes_one_up(plan: Plan) -> None:
    role = Renderer(plan, Hello(rank=1, host="", endpoint="", incarnation=0), ready=lambda _: True)
    event = first_event(plan, 0.0)
    list(role.on_message(event, 0.0))
    list(role.on_message(Assignment(number=1, cuts=[0, 0, 128]), 0.1))
    assert [i.regions for i in role.on_tick(0.1) if isinstance(i, Reassign)] == [()]
    assert (role.due > 0.1, role.complete) == (True, True)
    assert role._heartbeat(0.2).costs == {}
    list(role.on_message(Assignment(number=2, cuts=[0, 64, 128]), 0.3))
    told = list(role.on_tick(0.3))
    assert [len(i.regions) for i in told if isinstance(i, Reassign)] == [1]
    assert [i.event for i in told if isinstance(i, Trace)] == [event], "of which it heard before"


def test_small_differences_move_nothing() -> None:
    layout = layout_of()
    balancer = Balancer(layout, 0.0)
    density = np.concatenate([np.full(480, 1.0 / EVEN), np.full(480, 1.0)])
    assert balancer.on_tick(beats(balancer, layout, density, [1.0, 1.0]), (), ((1, 0),), PERIOD_S) is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("preset: sort-last", "borders move between parts of one picture; accepted: sort-first"),
        ("preset: sort-first, sync: frame", "borders move between parts of one picture"),
        ("preset: sort-first, ranks_per_panel: 64", "128 renderers for 118 strips of 8 rows; accepted: up to 118"),
    ],
)
def test_what_cannot_be_balanced_is_refused(change: str, said: str) -> None:
    text = TEXT.format(rows=480, method="framed", ranks=1, balance="true", threads=1)
    text = text.replace("preset: sort-first, ranks_per_panel: 1", change)
    with pytest.raises(ConfigError, match=said):
        make_layout(loads(text, path=Path("wall.yaml")))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(layout_of(rows=64, method="framed"))


@pytest.fixture(scope="module")
def scene(plan: Plan) -> TracerScene:
    return make_tracer_scene(plan.scene)


@pytest.mark.parametrize("method", ["framed", "frameless", "hilbert"])
def test_borders_that_move_change_no_pixel(plan: Plan, scene: TracerScene, method: str) -> None:
    """Under each event borders move twice while batches are under way; the image is that of fixed borders."""
    fixed = make_plan(layout_of(rows=64, method=method, balance="false"))
    wanted = SingleProcess(fixed, make_tracer_scene(fixed.scene), at_renderers=False).until_complete()
    moving = make_plan(layout_of(rows=64, method=method))
    single = SingleProcess(moving, scene)
    for number, cuts in enumerate(([0, 40, 128], [0, 96, 128], [0, 24, 128]), 1):
        for loop in single._renderers:
            loop.tell(Assignment(number=number, cuts=cuts))
        for _ in range(4):
            single.step()
    shown = single.until_complete()
    assert [loop.role._followed for loop in single._renderers] == [3, 3]
    for one, other in zip(shown, wanted, strict=True):
        assert np.array_equal(one.rgb, other.rgb)


def test_a_renderer_takes_its_strip_up_between_two_batches(plan: Plan) -> None:
    role = Renderer(plan, Hello(rank=2, host="", endpoint="", incarnation=0), ready=lambda _: True)
    event = first_event(plan, 0.0)
    list(role.on_message(event, 0.0))
    [trace] = [i for i in role.on_tick(0.0) if isinstance(i, Trace)]
    list(role.on_message(Assignment(number=2, cuts=[0, 40, 128]), 0.1))
    list(role.on_message(Assignment(number=1, cuts=[0, 96, 128]), 0.1))  # an old one comes late
    list(role.on_message(Assignment(number=3, cuts=[0, 41, 128]), 0.1))  # nobody sends that
    assert not [i for i in role.on_tick(0.1) if isinstance(i, Reassign | Trace)], "the worker is busy"
    list(role.on_message(Traced(trace.worker, event, b"packet", Work(samples=256, demand=1.0), seconds=0.1), 0.2))
    told = list(role.on_tick(0.2))
    [reassign] = [i for i in told if isinstance(i, Reassign)]
    assert [(r.layer, r.rect.y, r.rect.height) for r in reassign.regions] == [(0, 40, 24), (1, 0, 64)]
    assert [i for i in told if isinstance(i, Trace)], "it goes on under the newest event"
    assert (role.done.samples, role._heartbeat(0.3).samples_of) == (256, {"main": 256})
    assert role._heartbeat(0.3).assignment == 2
    assert role._heartbeat(0.3).dropped == {"bad_message": 1}


def test_workers_that_end_by_turns_come_to_rest_for_an_assignment(plan: Plan) -> None:
    threads = make_plan(layout_of(rows=64, threads=2))
    role = Renderer(threads, Hello(rank=2, host="", endpoint="", incarnation=0), ready=lambda _: True)
    event = first_event(threads, 0.0)
    list(role.on_message(event, 0.0))
    running = [i for i in role.on_tick(0.0) if isinstance(i, Trace)]
    assert len(running) == 2
    list(role.on_message(Assignment(number=1, cuts=[0, 40, 128]), 0.0))
    told = []
    for turn in range(4):
        if running:
            list(role.on_message(Traced(running.pop(0).worker, event, b"packet", Work(samples=1)), 0.01 * turn))
        told += list(role.on_tick(0.01 * turn))
        running += [i for i in told[-4:] if isinstance(i, Trace) and role._followed == 0]
    assert role._followed == 1
    beats = [i.message for i in told if isinstance(i, Send) and isinstance(i.message, Heartbeat)]
    assert beats[-1].assignment == 1, "said at once"


def test_a_region_that_stays_goes_on_as_it_was(plan: Plan) -> None:
    role = Renderer(plan, Hello(rank=1, host="", endpoint="", incarnation=0), ready=lambda _: True)
    list(role.on_message(first_event(plan, 0.0), 0.0))
    before = role.regions[0]
    list(role.on_message(Assignment(number=1, cuts=[0, 96, 128]), 0.1))
    list(role.on_tick(0.1))
    assert role.regions[0] is before
    assert [region.region.layer for region in role.regions] == [0, 1]


def test_the_manager_tells_everyone_and_who_comes_late(plan: Plan) -> None:
    manager = Manager(plan, 0.0, still=False)
    hello = Hello(rank=1, host="", endpoint="", incarnation=1)
    told = [i.message for i in manager.on_message(hello, 0.0) if isinstance(i, Send)]
    assert Assignment(number=0, cuts=[0, 64, 128]) in told
    sent: list[Assignment] = []
    for step in range(40):
        now = 0.1 * step
        for rank, cost in ((1, 900), (2, 100)):
            newest = sent[-1].number if sent else 0
            beat = Heartbeat(rank=rank, time=now, assignment=newest, costs={str(rank - 1): cost})
            list(manager.on_message(beat, now))
        told = [i.message for i in manager.on_tick(now) if isinstance(i, Broadcast)]
        sent += [message for message in told if isinstance(message, Assignment) and message.number > len(sent)]
    assert sent
    assert sent[0].cuts[1] < 64, "the loaded rank gets less"


def test_the_table_of_ranks_says_where_the_strips_are(plan: Plan) -> None:
    head = Compositor(plan, Hello(rank=HEAD, host="", endpoint="", incarnation=0), ready=lambda _: True)
    list(head.on_message(Assignment(number=1, cuts=[0, 40, 128]), 0.0))
    event: Event = first_event(plan, 0.0)
    status = status_of(head._plan, event, {}, {}, head.latency, now=0.0, seconds=0.0, refreshes_per_s=0.0, oldest={})
    assert [rank.region for rank in status.ranks[1:]] == ["r0c0 40x40+0+0", "r0c0 40x24+0+40; r0c1 40x64+0+0"]
    list(head.on_message(Assignment(number=2, cuts=[0, 1, 128]), 0.0))
    assert head.composition.counters["bad_message"] == 1
