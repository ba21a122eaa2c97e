"""Tiles on their way: made when due, sent where credit allows, the newest kept, others' refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.config.loading import loads
from wall.core.data import Rect, Tiling
from wall.core.errors import RemoteProtocolError
from wall.packets.samples import is_samples
from wall.packets.tiling import decode_tiling, encode_tiling, is_tiling
from wall.roles.compositor import Compositor
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import ManualClock
from wall.run.control import Control
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene
from wall.transport.loopback import LoopbackHub, LoopbackLink

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 36], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: adaptive, samples_per_batch: 64, threads: THREADS, tiling: TILING}
graph: {preset: sort-first, ranks_per_panel: 2}
"""
FIRST, SECOND = 1, 2  # the renderers' ranks


@cache
def plan_of(*, threads: int = 1, tiling: str = "grid") -> Plan:
    text = TEXT.replace("THREADS", str(threads)).replace("TILING", tiling)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of()


@pytest.fixture(scope="module")
def tracer_scene(plan: Plan) -> TracerScene:
    return make_tracer_scene(plan.scene)


def workers_of(plan: Plan, tracer_scene: TracerScene, clock: ManualClock) -> list[Worker]:
    samplers = make_samplers(plan, "", plan.layout.region(FIRST), clock)
    return [Worker(plan, tracer_scene, FIRST, clock, samplers, k) for k in range(len(samplers))]


def tiles_sent(worker: Worker, plan: Plan) -> list[Tiling]:
    """What a step brings forth."""
    worker.step(first_event(plan, 0.0))
    packet = worker.tiling()
    return [decode_tiling(packet)] if packet is not None else []


@pytest.mark.parametrize("tiling", ["grid", "cut"])
@pytest.mark.parametrize("threads", [1, 3])
def test_the_tiles_of_all_threads_share_out_the_region(threads: int, tiling: str, tracer_scene: TracerScene) -> None:
    plan = plan_of(threads=threads, tiling=tiling)
    sent = [tiles for worker in workers_of(plan, tracer_scene, ManualClock(1.0)) for tiles in tiles_sent(worker, plan)]
    covered = np.zeros((36, 40), int)
    for tiles in sent:
        for x, y, width, height in tiles.rects.tolist():
            covered[y : y + height, x : x + width] += 1
    rect = plan.layout.region(FIRST).rect
    inside = np.zeros((36, 40), int)
    inside[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width] = 1
    assert (covered == inside).all()
    assert len({tiles.sequence for tiles in sent}) == threads


def test_a_rank_sends_its_tiles_at_most_15_times_a_second(plan: Plan, tracer_scene: TracerScene) -> None:
    clock = ManualClock(1.0)
    (worker,) = workers_of(plan, tracer_scene, clock)
    sent = []
    for _ in range(240):
        sent += tiles_sent(worker, plan)
        clock.advance(1 / 240)
    assert 12 <= len(sent) <= 15
    assert [tiles.sequence for tiles in sent] == list(range(1, len(sent) + 1))


def test_what_is_sent_is_what_the_picture_beneath_knows(plan: Plan, tracer_scene: TracerScene) -> None:
    """The grid's squares in their order, within half a step of the wire's eighths of an octave (4.4 %)."""
    clock = ManualClock(1.0)
    (worker,) = workers_of(plan, tracer_scene, clock)
    tiles_sent(worker, plan)
    known = worker.sampler.picture.residual  # type: ignore[attr-defined]
    known[:] = np.arange(known.size, dtype=np.float32).reshape(known.shape)
    clock.advance(0.1)
    (tiles,) = tiles_sent(worker, plan)
    assert known.size == 6
    assert_allclose(tiles.temporal, np.arange(6), rtol=0.045)


def tiling_of(rank: int = FIRST, *, rect: Rect | None = None, at: float = 1.0) -> Tiling:
    rect = rect or plan_of().layout.region(rank).rect
    one = np.ones(1, np.float32)
    return Tiling(
        view=0, panel=0, rect=rect, rank=rank, sequence=1, camera_event=0, scene_event=0, base_time=at,
        rects=np.array([[rect.x, rect.y, rect.width, rect.height]], np.uint16), spatial=one, temporal=one, density=one,
    )  # fmt: skip


def test_a_panel_keeps_the_newest_tiles_of_every_rank_and_counts_late_ones(plan: Plan) -> None:
    panel = PanelCompositor(plan, 0)
    newest = tiling_of(at=2.0)
    for tiling in (tiling_of(at=1.0), newest, tiling_of(at=1.5), tiling_of(SECOND, at=1.0)):
        panel.take_tiling(tiling)
    assert {rank: kept.base_time for (rank, _), kept in panel.tilings.items()} == {FIRST: 2.0, SECOND: 1.0}
    assert panel.tilings[FIRST, newest.rect] is newest
    assert panel.buffer.counters.counts["late_tilings"] == 1


def test_tiles_of_another_number_of_threads_replace_those_they_lie_over(plan: Plan) -> None:
    panel = PanelCompositor(plan, 0)
    rect = plan.layout.region(FIRST).rect
    upper, lower = replace(rect, height=8), replace(rect, y=rect.y + 8, height=rect.height - 8)
    panel.take_tiling(tiling_of(SECOND))
    for cut in ([rect], [upper, lower], [rect]):
        for part in cut:
            panel.take_tiling(tiling_of(rect=part))
        assert {key[1] for key in panel.tilings if key[0] == FIRST} == set(cut)
    assert SECOND in {rank for rank, _ in panel.tilings}


@pytest.mark.parametrize(
    "wrong",
    [
        lambda t: replace(t, rank=0),
        lambda t: replace(t, rank=7),
        lambda t: replace(t, rank=SECOND),
        lambda t: replace(t, rect=replace(t.rect, width=t.rect.width + 1)),
    ],
)
def test_tiles_that_are_not_of_their_ranks_region_are_refused(plan: Plan, wrong: Callable[[Tiling], Tiling]) -> None:
    panel = PanelCompositor(plan, 0)
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        panel.take_tiling(wrong(tiling_of()))
    assert not panel.tilings


@pytest.fixture
def ends(
    plan: Plan, tracer_scene: TracerScene
) -> Iterator[Callable[[int], tuple[LoopbackHub, LoopbackLink, Renderer]]]:
    """A renderer at one end of a connection with so much credit, its control link beside it."""
    opened: list[LoopbackHub | LoopbackLink] = []

    def make(credit: int) -> tuple[LoopbackHub, LoopbackLink, Renderer]:
        hub, head = LoopbackHub(credit_bytes=credit), LoopbackHub(credit_bytes=1)
        outbox, line = LoopbackLink(hub.endpoint), LoopbackLink(head.endpoint)
        opened.extend((outbox, line, hub, head))
        control = Control(line, plan, FIRST, same_clock=True)
        return hub, outbox, Renderer(plan, tracer_scene, FIRST, control, outbox)

    yield make
    for end in opened:
        end.close()


def offered(renderer: Renderer, plan: Plan) -> list[bytes]:
    packets = list(renderer._step(first_event(plan, 0.0)))
    for packet in packets:
        renderer._offer(packet)
    return packets


def test_tiles_go_before_the_samples_of_their_step_and_reach_the_panel(
    plan: Plan, ends: Callable[[int], tuple[LoopbackHub, LoopbackLink, Renderer]]
) -> None:
    hub, _, renderer = ends(1 << 20)
    kinds = [(is_tiling(packet), is_samples(packet)) for packet in offered(renderer, plan)]
    assert kinds == [(True, False), (False, True)]

    compositor = Compositor(plan, 0, hub, {})
    assert compositor.take_in() == 2

    assert [rank for rank, _ in compositor.layers[0].tilings] == [FIRST]
    assert not compositor.counters.counts
    assert compositor.bytes == renderer._bytes, "tiles are paid for like samples"


def test_without_credit_no_tiles_are_made_and_samples_give_way_to_samples_only(
    plan: Plan, ends: Callable[[int], tuple[LoopbackHub, LoopbackLink, Renderer]]
) -> None:
    _, outbox, renderer = ends(200)  # bytes: a packet may go when nothing is under way, then no more
    offered(renderer, plan)
    for _ in range(6):
        assert [is_tiling(packet) for packet in offered(renderer, plan)] == [False]
    assert outbox.counters.counts["no_credit"] >= 4


def test_tiles_that_gave_way_are_not_traced_again(
    plan: Plan, ends: Callable[[int], tuple[LoopbackHub, LoopbackLink, Renderer]]
) -> None:
    _, outbox, renderer = ends(1)
    for at in range(6):
        renderer._offer(encode_tiling(tiling_of(at=float(at))))
    assert outbox.counters.counts["no_credit"] > 0


def test_a_compositor_counts_tiles_of_a_panel_it_has_not_got(plan: Plan) -> None:
    hub = LoopbackHub(credit_bytes=1 << 16)
    link = LoopbackLink(hub.endpoint)
    link.offer(encode_tiling(replace(tiling_of(), panel=5)))
    compositor = Compositor(plan, 0, hub, {})
    assert compositor.take_in() == 1
    assert compositor.counters.counts == {"bad_packet": 1}
    link.close()
    hub.close()
