"""Tiles of samplers on their way to an overlay: sent while a viewer shows them, the newest kept, others' refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import Event, Rect, StatisticsImage
from wall.core.errors import RemoteProtocolError, RunError
from wall.packets.control import parse_control, serialise
from wall.packets.samples import is_samples
from wall.roles.composition import Composition
from wall.roles.instructions import Dropped, Trace
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.statistics import STATISTICS_PERIOD_S, tiles_of
from wall.run.loop import Loop
from wall.run.single_process import Wire, hello_of
from wall.run.tracers import Tracers
from wall.sampling.tiles import Measured
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

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
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of().scene)


class Rank:
    """A renderer whose workers are stepped in turn; `packets` are those that it offers while it has credit."""

    def __init__(self, plan: Plan, tracer_scene: TracerScene) -> None:
        self.clock, self.credit = ManualClock(1.0), True
        self.role = Renderer(plan, hello_of(FIRST), lambda target: self.credit)
        self.wire = Wire()
        tracers = Tracers(plan, tracer_scene, FIRST, self.clock, threads=False)
        self._loop = Loop(self.role, self.wire, self.clock, tracers=tracers)

    def step(self, event: Event) -> list[bytes]:
        """A step of every worker. Returns what it offers."""
        self._loop.tell(event)
        self._loop.turn()
        packets, self.wire.packets = self.wire.packets, []
        return packets

    def tiles(self, event: Event) -> list[StatisticsImage]:
        """What a step of every worker brings forth beside samples."""
        messages = [parse_control(packet) for packet in self.step(event) if not is_samples(packet)]
        return [message for message in messages if isinstance(message, StatisticsImage)]


def event_of(plan: Plan, *, statistics: bool = True) -> Event:
    return replace(first_event(plan, 0.0), statistics=statistics)


@pytest.mark.parametrize("tiling", ["grid", "cut"])
@pytest.mark.parametrize("threads", [1, 3])
def test_the_tiles_of_all_threads_share_out_the_region(threads: int, tiling: str, tracer_scene: TracerScene) -> None:
    plan = plan_of(threads=threads, tiling=tiling)
    rank = Rank(plan, tracer_scene)
    sent: list[StatisticsImage] = []
    for _ in range(2):
        rank.clock.advance(STATISTICS_PERIOD_S)
        sent = rank.tiles(event_of(plan))
    covered = np.zeros((36, 40), int)
    for x, y, width, height in sent[-1].rects.tolist():
        covered[y : y + height, x : x + width] += 1
    rect = plan.layout.region(FIRST).rect
    inside = np.zeros((36, 40), int)
    inside[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width] = 1
    assert (covered == inside).all()
    assert (sent[-1].rank, sent[-1].panel, sent[-1].compared) == (FIRST, 0, False)


def test_tiles_are_sent_5_times_a_second_while_a_viewer_shows_them(tracer_scene: TracerScene) -> None:
    rank, sent = Rank(plan_of(), tracer_scene), []
    for k in range(240):
        sent += rank.tiles(event_of(plan_of(), statistics=k < 120))
        rank.clock.advance(1 / 120)
    assert len(sent) == 5


def test_what_fails_names_the_batch_and_the_life_of_its_rank(
    tracer_scene: TracerScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of()
    tracers = Tracers(plan, tracer_scene, FIRST, ManualClock(1.0), threads=False, life=2)
    monkeypatch.setattr(tracers.workers[0], "sampler", None)
    with pytest.raises(RunError, match=r"rank 1, batch 0@2: AttributeError.*wall replay FOLDER --rank 1 --batch 0@2$"):
        tracers.start(Trace(0, event_of(plan)))


def test_without_credit_no_tiles_are_sent(tracer_scene: TracerScene) -> None:
    rank = Rank(plan_of(), tracer_scene)
    assert [is_samples(packet) for packet in rank.step(event_of(plan_of(), statistics=False))] == [True]
    rank.credit = False
    for _ in range(3):
        rank.clock.advance(STATISTICS_PERIOD_S)
        assert rank.step(event_of(plan_of())) == []


def test_tiles_that_gave_way_are_not_traced_again(tracer_scene: TracerScene) -> None:
    role, event = Renderer(plan_of(), hello_of(FIRST), lambda target: True), event_of(plan_of())
    list(role.on_message(event, 0.0))
    list(role.on_message(Dropped(0, serialise(image_of())), 0.0))
    (trace,) = (instruction for instruction in role.on_tick(0.0) if isinstance(instruction, Trace))
    assert trace.lost == ()


def image_of(rank: int = FIRST, *, rect: Rect | None = None) -> StatisticsImage:
    rect = rect or plan_of().layout.region(rank).rect
    one = np.ones(1, np.float32)
    return tiles_of(rank, 0, [Measured(np.array([[rect.x, rect.y, rect.width, rect.height]], np.uint16), one, one)])


def test_a_panel_keeps_the_newest_tiles_of_every_rank() -> None:
    compositor = Composition(plan_of(), 0)
    small = replace(plan_of().layout.region(FIRST).rect, height=4)
    for image in (image_of(), image_of(SECOND), image_of(rect=small)):
        compositor.insert(serialise(image))
    kept = compositor.layers[0].reprojected.tiles_of
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
    compositor = Composition(plan_of(), 0)
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        compositor.insert(serialise(wrong(image_of())))
    assert not compositor.layers[0].reprojected.tiles_of
