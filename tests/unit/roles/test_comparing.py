"""Two samplers on one budget, two images: half of the rays each, nothing mixed, everything given back at the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_batches import RECT, TEXT, flat, plan_of, refresh, rgb_of, second

from wall.core.data import Batch, Event, Framelet, Rect
from wall.core.errors import RemoteProtocolError
from wall.packets.control import parse_control, serialise
from wall.packets.framelets import FrameletPart
from wall.packets.samples import decode, encode
from wall.roles.composition import Composition
from wall.roles.compositor import Compositor
from wall.roles.instructions import Offer, Packet
from wall.roles.layer import PanelCompositor
from wall.roles.plan import HEAD, Plan, first_event
from wall.roles.statistics import tiles_of
from wall.run.single_process import SingleProcess, hello_of
from wall.sampling.tiles import Measured
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of()


@pytest.fixture(scope="module")
def tracer_scene(plan: Plan) -> TracerScene:
    return make_tracer_scene(plan.scene)


def test_tiles_of_a_statistics_image_are_those_that_the_adaptive_sampler_goes_by_else_a_grid(plan: Plan) -> None:
    panel, event = PanelCompositor(plan, 0), first_event(plan, 0.0)
    one = np.ones(1, np.float32)
    panel.reprojected.tiles_of[1] = tiles_of(1, 0, [Measured(np.array([[0, 0, 40, 24]], np.uint16), one, one)])
    panel.insert(flat(1.0, event, adaptive=True))
    refresh(panel, event)
    assert panel.statistics_images(1.0)[0].rects.tolist() == [[0, 0, 40, 24]]

    chosen = replace(event, sampler="frameless", camera_event=1)
    panel.follow(chosen)
    panel.insert(flat(1.0, chosen, adaptive=False, sequence=2))
    refresh(panel, chosen)
    assert panel.statistics_images(1.0)[0].rects.tolist() == [
        [0, 0, 16, 16], [16, 0, 16, 16], [32, 0, 8, 16], [0, 16, 16, 8], [16, 16, 16, 8], [32, 16, 8, 8],
    ]  # fmt: skip


def test_each_sampler_makes_its_own_image(plan: Plan) -> None:
    panel, event = PanelCompositor(plan, 0), replace(first_event(plan, 0.0), compare="frameless", camera_event=1)
    panel.follow(event)
    for k in range(2):
        panel.insert(flat(1.0, event, adaptive=True, sequence=2 * k))
        panel.insert(flat(0.0031308, event, adaptive=False, sequence=2 * k + 1))
        refresh(panel, event)
    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)
    assert second(panel).mean() == pytest.approx(0.0031308 * 12.92 * 255, abs=1)  # IEC 61966-2-1, the straight part


def test_the_second_image_begins_as_the_first_one_looks(plan: Plan) -> None:
    panel, event = PanelCompositor(plan, 0), replace(first_event(plan, 0.0), sampler="adaptive")
    panel.follow(event)
    panel.insert(flat(0.5, event, adaptive=True))
    refresh(panel, event)
    both = replace(event, compare="frameless", camera_event=1)
    panel.follow(both)
    refresh(panel, both)
    assert second(panel).min() > 0
    np.testing.assert_array_equal(second(panel), rgb_of(panel))


def test_after_the_end_late_samples_of_the_other_one_change_nothing(plan: Plan) -> None:
    panel, event = PanelCompositor(plan, 0), replace(first_event(plan, 0.0), compare="frameless", camera_event=1)
    panel.follow(event)
    panel.insert(flat(1.0, event, adaptive=True))
    panel.insert(flat(0.1, event, adaptive=False, sequence=2))
    refresh(panel, event)
    alone = replace(event, compare="", camera_event=2)
    panel.follow(alone)
    before = rgb_of(panel).mean()

    panel.insert(flat(0.1, event, adaptive=False, sequence=3))
    refresh(panel, alone)

    assert panel.compared is None
    assert rgb_of(panel).mean() == before == pytest.approx(255, abs=1)
    assert panel.counters["late"] == RECT.area
    chosen = replace(alone, sampler="frameless", camera_event=3)
    panel.follow(chosen)
    panel.insert(flat(0.0, chosen, adaptive=False, sequence=4))
    refresh(panel, chosen)
    assert rgb_of(panel).mean() == 0, "a sampler that is chosen afterwards is shown"


def test_second_images_of_two_comparisons_never_have_the_same_version(plan: Plan) -> None:
    composition, event, seen = Composition(plan, HEAD), first_event(plan, 0.0), []
    for k in range(3):
        both = replace(event, compare="frameless", camera_event=2 * k + 1)
        composition.follow(both)
        composition.insert(encode(flat(0.5, both, adaptive=False)))
        composition.refresh(both, 1.0)
        seen.append(composition.compared()[0].images()[0].version)
        composition.follow(replace(event, camera_event=2 * k + 2))
    assert seen == sorted(set(seen))


def test_nothing_is_kept_for_a_second_image_when_nobody_compares(plan: Plan) -> None:
    panel = PanelCompositor(plan, 0)
    assert panel.compared is None
    assert len(panel.statistics_images(1.0)) == 1


@pytest.mark.parametrize("other", ["framed", "frameless", "hilbert"])
def test_a_process_spends_half_of_its_rays_on_each_and_all_on_one_afterwards(
    plan: Plan, tracer_scene: TracerScene, other: str, compiled_only: None
) -> None:
    single = SingleProcess(plan, tracer_scene)
    (worker,) = single.workers
    single.event = replace(single.event, compare=other, camera_event=1)
    for k in range(24):
        single.event = replace(single.event, camera_event=k + 1)  # it moves: nobody is ever done
        single.step()
    assert worker.work.compared == pytest.approx(worker.work.samples / 2, abs=128)
    (panel,) = single.layers.values()
    refresh(panel, single.event)
    assert second(panel).std() > 10
    assert rgb_of(panel).std() > 10

    assert worker.measure_tiles() is not None, "the adaptive sampler has tiles all the same"
    before = worker.work.compared
    single.event = replace(single.event, compare="", camera_event=100)
    for _ in range(4):
        assert single.step() == 128
    assert worker.work.compared == before
    assert panel.compared is None


def test_another_sampler_to_compare_with_is_shown_too(tracer_scene: TracerScene, compiled_only: None) -> None:
    """The second image that sinks get stood still once the sampler was changed while two were compared."""
    plan, shown = plan_of(TEXT.replace("samples_per_batch: 128", "samples_per_batch: 1024")), []
    for others in (["framed"], ["frameless", "framed"]):
        single = SingleProcess(plan, tracer_scene)
        for k, other in enumerate(others, start=1):
            single.event = replace(single.event, compare=other, camera_event=k)
            for _ in range(40):
                single.step()
        x, y, z = single.event.camera.position
        elsewhere = replace(single.event.camera, position=(x + 0.5, y, z))  # at rest both samplers show the same
        single.event = replace(single.event, camera_event=9, camera=elsewhere)
        for _ in range(80):  # ms: two refreshes; a frame takes two batches
            single.step()
        (image,) = single.composition.compared()[0].images()
        shown.append(image.rgb)
    assert shown[0].std() > 10
    assert np.array_equal(*shown)


@pytest.mark.parametrize("threads", [1, 2])
def test_what_comes_after_a_comparison_is_as_if_there_had_been_none(threads: int, compiled_only: None) -> None:
    text = TEXT.replace("samples_per_batch", f"threads: {threads}, samples_per_batch")
    plan = plan_of(text)
    tracer_scene = make_tracer_scene(plan.scene)
    compared, fresh = SingleProcess(plan, tracer_scene), SingleProcess(plan, tracer_scene)
    compared.event = replace(compared.event, compare="framed", camera_event=1)
    for _ in range(30):
        compared.step()
    assert np.isfinite(compared.layers[0].compared.buffer.records["time"]).all()  # type: ignore[union-attr]

    images = []
    for single in (compared, fresh):
        single.event = replace(single.event, sampler="frameless", compare="", camera_event=2)
        images.append(single.until_complete()[0].rgb)

    assert images[1].std() > 10
    assert np.array_equal(*images)


def test_lost_samples_come_back_to_the_sampler_that_chose_them(
    plan: Plan, tracer_scene: TracerScene, compiled_only: None
) -> None:
    """Both are traced to the end of a still view, every third packet is lost: framed shows every pixel all the same."""
    single = SingleProcess(plan, tracer_scene, at_renderers=False)
    (worker,), (panel,) = single.workers, single.layers.values()
    single.event = replace(single.event, compare="framed", camera_event=1)
    single.step()
    for k in range(400):
        packet = worker.step(single.event)
        if packet is None:
            break
        batch = decode(packet)
        if k % 3 == 0 and k < 60:
            worker.forget(batch)
        else:
            panel.insert(batch)
    assert panel.compared is not None
    assert np.isfinite(panel.compared.buffer.records["time"]).all()


ELSEWHERE = """\
graph:
  compositors: 2
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: p, op: reconstruct, input: s, on: compositor 1}
    - {id: png, op: sink, kind: png, input: p}
"""


class Pair:
    """A compositor that has the only panel, 1 if it is not named, and what the other one composes of it."""

    def __init__(self, graph: str = ELSEWHERE, *, maker: int = 1) -> None:
        plan, other = plan_of(TEXT + graph), 1 - maker
        self.remote, self.head = Compositor(plan, hello_of(maker), lambda rank: rank == other), Composition(plan, other)
        self.rank, self.now = plan.layout.renderers()[0], 0.0

    def show(self, event: Event, *batches: Batch) -> None:
        self.now += 1.0
        self.head.follow(event)
        for message in (event, *(Packet(encode(replace(batch, rank=self.rank))) for batch in batches)):
            assert list(self.remote.on_message(message, self.now)) == []
        for instruction in self.remote.on_tick(self.now):
            if isinstance(instruction, Offer):
                self.head.insert(instruction.packet)
        self.head.refresh(event, self.now)


PAGE_ELSEWHERE = ELSEWHERE.replace("on: compositor 1", "on: head").replace(
    "kind: png, input: p", "kind: browser, input: p, on: compositor 1"
)


@pytest.mark.parametrize(("graph", "maker"), [(ELSEWHERE, 1), (PAGE_ELSEWHERE, HEAD)], ids=["head", "page elsewhere"])
def test_a_remote_compositor_sends_both_images_and_statistics_only_while_asked(
    plan: Plan, graph: str, maker: int
) -> None:
    pair, event = Pair(graph, maker=maker), first_event(plan, 0.0)
    pair.show(event, flat(1.0, event, adaptive=True))
    assert pair.head.statistics_images(0.0, comparing=False) == ()

    both = replace(event, compare="frameless", camera_event=1, statistics=True)
    pair.show(both, flat(1.0, both, adaptive=True), flat(0.0031308, both, adaptive=False, sequence=2))

    (first,), (other,) = (shown[0].images() for shown in (pair.head.shown(), pair.head.compared()))
    assert first.rgb.mean() == pytest.approx(255, abs=1)
    assert other.rgb.mean() == pytest.approx(0.0031308 * 12.92 * 255, abs=1)
    statistics_images = pair.head.statistics_images(0.0, comparing=True)
    assert [statistics_image.compared for statistics_image in statistics_images] == [False, True]
    assert (statistics_images[1].density == 129).all()  # code of 2^0 samples a pixel: 1 + 8 octaves of 16 steps
    assert [statistics_image.compared for statistics_image in pair.head.statistics_images(0.0, comparing=False)] == [
        False
    ]


def test_a_statistics_image_of_other_tiles_is_refused(plan: Plan) -> None:
    panel = PanelCompositor(plan, 0)
    good = panel.statistics_images(1.0)[0]
    head = Composition(plan, HEAD)
    head.insert(serialise(good))
    for wrong in (replace(good, age=good.age[:1], density=good.density[:1]), replace(good, rects=good.rects + 9)):
        with pytest.raises(RemoteProtocolError, match="statistics_image"):
            head.insert(serialise(wrong))


def test_a_framelet_keeps_whether_it_is_of_the_second_image() -> None:
    black = Framelet.blank(Rect(x=0, y=0, width=4, height=4), frozenset({"colour"}), encoded=True)
    for compared in (False, True):
        sent = FrameletPart.of(0, black, black.rect, compared=compared)
        assert parse_control(serialise(sent)) == sent
