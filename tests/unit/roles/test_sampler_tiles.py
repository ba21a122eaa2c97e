"""Tiles of samplers on their way to an overlay: sent while a viewer shows them, the newest kept, others' refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Event, Rect, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.packets.control import parse_control, serialise
from wall.packets.samples import is_samples
from wall.roles.compositor import Compositor
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.statistics import STATISTICS_PERIOD_S, tiles_of
from wall.run.clock import ManualClock
from wall.run.control import Control
from wall.sampling.tiles import Measured
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

Ends = tuple[LoopbackHub, Renderer, ManualClock]


@cache
def plan_of(*, threads: int = 1, tiling: str = "grid") -> Plan:
    text = TEXT.replace("THREADS", str(threads)).replace("TILING", tiling)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of().scene)


@pytest.fixture
def ends(tracer_scene: TracerScene) -> Iterator[Callable[..., Ends]]:
    """A hub and, at the other end of a connection with so much credit, a renderer; its control link beside it."""
    opened: list[LoopbackHub | LoopbackLink | Renderer] = []

    def make(plan: Plan, *, credit: int = 1 << 20) -> Ends:
        hub, head, clock = LoopbackHub(credit_bytes=credit), LoopbackHub(credit_bytes=1), ManualClock(1.0)
        outbox, line = LoopbackLink(hub.endpoint), LoopbackLink(head.endpoint)
        control = Control(line, plan, FIRST, same_clock=True)
        control.clock = clock  # type: ignore[assignment]
        renderer = Renderer(plan, tracer_scene, FIRST, control, outbox)
        opened.extend((renderer, outbox, line, hub, head))
        return hub, renderer, clock

    yield make
    for end in opened:
        end.close()


def event_of(plan: Plan, *, statistics: bool = True) -> Event:
    return replace(first_event(plan, 0.0), statistics=statistics)


def tiles_sent(hub: LoopbackHub, renderer: Renderer, event: Event) -> list[StatisticsImage]:
    """What a step of every thread brings forth beside samples."""
    for packet in renderer._step(event):
        renderer._offer(packet)
    messages = []
    for peer, packet in hub.drain(1 << 20):
        hub.release(peer, len(packet))
        if not is_samples(packet):
            message = parse_control(packet)
            assert isinstance(message, StatisticsImage)
            messages.append(message)
    return messages


@pytest.mark.parametrize("tiling", ["grid", "cut"])
@pytest.mark.parametrize("threads", [1, 3])
def test_the_tiles_of_all_threads_share_out_the_region(threads: int, tiling: str, ends: Callable[..., Ends]) -> None:
    plan = plan_of(threads=threads, tiling=tiling)
    hub, renderer, clock = ends(plan)
    sent: list[StatisticsImage] = []
    while not sent or len(renderer._tiles) < threads:
        clock.advance(STATISTICS_PERIOD_S)
        sent = tiles_sent(hub, renderer, event_of(plan))
    clock.advance(STATISTICS_PERIOD_S)
    while not (sent := tiles_sent(hub, renderer, event_of(plan))):
        pass
    covered = np.zeros((36, 40), int)
    for x, y, width, height in sent[-1].rects.tolist():
        covered[y : y + height, x : x + width] += 1
    rect = plan.layout.region(FIRST).rect
    inside = np.zeros((36, 40), int)
    inside[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width] = 1
    assert (covered == inside).all()
    assert (sent[-1].rank, sent[-1].panel, sent[-1].compared) == (FIRST, 0, False)


def test_tiles_are_sent_5_times_a_second_while_a_viewer_shows_them(ends: Callable[..., Ends]) -> None:
    hub, renderer, clock = ends(plan_of())
    sent = []
    for k in range(240):
        sent += tiles_sent(hub, renderer, event_of(plan_of(), statistics=k < 120))
        clock.advance(1 / 120)
    assert len(sent) == 5


def test_without_credit_no_tiles_are_sent(ends: Callable[..., Ends]) -> None:
    hub, renderer, clock = ends(plan_of(), credit=200)  # bytes: a packet may go when nothing is under way, then no more
    packets = list(renderer._step(event_of(plan_of(), statistics=False)))
    for packet in packets:
        renderer._offer(packet)
    for _ in range(3):
        clock.advance(STATISTICS_PERIOD_S)
        list(renderer._step(event_of(plan_of())))
    assert [is_samples(packet) for _, packet in hub.drain(1 << 20)] == [True]


def test_tiles_that_gave_way_are_not_traced_again(ends: Callable[..., Ends]) -> None:
    _, renderer, _ = ends(plan_of(), credit=1)
    for _ in range(6):
        renderer._offer(serialise(image_of()))
    assert renderer._outbox.counters.counts["no_credit"] > 0


def image_of(rank: int = FIRST, *, rect: Rect | None = None) -> StatisticsImage:
    rect = rect or plan_of().layout.region(rank).rect
    one = np.ones(1, np.float32)
    return tiles_of(rank, 0, [Measured(np.array([[rect.x, rect.y, rect.width, rect.height]], np.uint16), one, one)])


def test_a_panel_keeps_the_newest_tiles_of_every_rank() -> None:
    compositor = Compositor(plan_of(), 0, LoopbackHub(credit_bytes=0), {})
    small = replace(plan_of().layout.region(FIRST).rect, height=4)
    for image in (image_of(), image_of(SECOND), image_of(rect=small)):
        compositor.insert(serialise(image))
    kept = compositor.layers[0].tiles_of
    assert {rank: image.bounds.height for rank, image in kept.items()} == {
        FIRST: 4,
        SECOND: image_of(SECOND).bounds.height,
    }


@pytest.mark.parametrize(
    "wrong",
    [
        lambda image: replace(image, rank=7),
        lambda image: replace(image, rank=SECOND),
        lambda image: replace(image, panel=5),
        lambda image: replace(image, rects=image.rects + np.array([0, 0, 1, 0], np.uint16)),
    ],
)
def test_tiles_that_are_not_of_their_ranks_region_are_refused(
    wrong: Callable[[StatisticsImage], StatisticsImage],
) -> None:
    compositor = Compositor(plan_of(), 0, LoopbackHub(credit_bytes=0), {})
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        compositor.insert(serialise(wrong(image_of())))
    assert not compositor.layers[0].tiles_of
