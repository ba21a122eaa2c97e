"""Where an image is shown on its renderer's machine, the renderer makes it: as good, from one deep buffer, and sent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import Camera
from wall.core.errors import ConfigError
from wall.geometry.twist import rotation_by
from wall.packets.control import Heartbeat, parse_control
from wall.packets.framelets import FrameletPart
from wall.packets.samples import is_samples
from wall.roles import refinement
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.compositor import Compositor
from wall.roles.instructions import Input, Packet, Send
from wall.roles.plan import (
    Layout,
    Plan,
    first_event,
    make_layout,
    make_plan,
    reconstructed_at_renderers,
    why_not_at_renderer,
)
from wall.roles.renderer_image import LONGEST_SWEEP_S, RendererImage
from wall.roles.sample_budget import LEAST_SHARE
from wall.run.single_process import SingleProcess, hello_of
from wall.run.tracers import Tracers
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [{pixels}], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}}}]
sampling: {{method: {method}, threads: {threads}}}
graph: {graph}
reconstruction: {reconstruction}
"""
NODES = """
  nodes:
    - {{op: samples, id: s0, panel: r0c0}}
    - {{op: reconstruct, id: p0, input: s0{on}}}
    - {{op: samples, id: s1, panel: r0c1}}
    - {{op: reconstruct, id: p1, input: s1{on}}}
    - {{op: tile, id: wall, inputs: [p0, p1]}}
    - {{op: sink, id: files, kind: png, input: wall}}
"""
HERE = ["here"] * 3


def layout_of(graph: str = "sort-first", **changes: Any) -> Layout:
    values = {"method": "adaptive", "pixels": "48, 32", "threads": 1, "reconstruction": "cpu"}
    return make_layout(loads(TEXT.format(graph=graph, **(values | changes)), path=Path("wall.yaml")))


def plan_of(graph: str = "sort-first", **changes: Any) -> Plan:
    return make_plan(layout_of(graph, **changes))


def nodes(on: str = "") -> str:
    return NODES.format(on=f", on: {on}" if on else "")


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return make_tracer_scene(plan_of().scene)


@pytest.mark.parametrize(
    ("graph", "options", "why"),
    [
        ("sort-first", {}, ""),
        (nodes("renderer"), {}, ""),
        (nodes("head"), {}, "`on: head` asks for it"),
        ("{preset: sort-first, ranks_per_panel: 2}", {}, "2 ranks render it"),
        ("{preset: sort-first, sync: frame}", {"method": "framed"}, "its frames are shown in lock step"),
        ("sort-first", {"threads": 2}, "2 threads render it"),
        ("sort-first", {"reconstruction": "gpu"}, "the compositor's GPU reconstructs"),
        ("sort-first", {"reconstruction": "auto"}, ""),  # whatever GPU there is: docs/lab/speed.md
    ],
)
def test_renderer_makes_the_image_unless_something_stands_against_it(
    graph: str, options: dict[str, Any], why: str
) -> None:
    layout = layout_of(graph, **options)
    assert {why_not_at_renderer(layout, layer) for layer in layout.graph.layers} == {why}

    placed = reconstructed_at_renderers(layout, ["here"] * layout.size)

    assert [layer.at_renderer for layer in placed.graph.layers] == [not why] * 2
    assert [placed.graph.step(layer.node).rank for layer in placed.graph.layers] == [
        layer.ranks[0] if not why else 0 for layer in layout.graph.layers
    ]


def test_sort_last_needs_more_than_display_bytes() -> None:
    layout = layout_of("{preset: sort-last, ranks_per_panel: 2}")
    assert all("depth" in why_not_at_renderer(layout, layer) for layer in layout.graph.layers)


@pytest.mark.parametrize("row_time", ["", ", row_time: 1e-5"])
def test_rows_that_have_moments_are_never_the_gpu_s(monkeypatch: pytest.MonkeyPatch, row_time: str) -> None:
    """Nor is any image that its renderer can make, whatever GPU there is."""
    monkeypatch.setattr("wall.reconstruction.choice.gpu_nodes", lambda: ["/dev/dri/renderD128"])
    text = TEXT.format(method="adaptive", pixels="48, 32", threads=1, reconstruction="auto", graph="sort-first")
    layout = make_layout(loads(text.replace("[0.4, 0.3]", f"[0.4, 0.3]{row_time}"), path=Path("wall.yaml")))
    assert {why_not_at_renderer(layout, layer) for layer in layout.graph.layers} == {""}


def test_samples_travel_to_another_machine_unless_the_image_is_asked_for() -> None:
    machines = ["here", "here", "there"]
    layers = reconstructed_at_renderers(layout_of(), machines).graph.layers
    asked = reconstructed_at_renderers(layout_of(nodes("renderer")), machines).graph.layers

    assert [layer.at_renderer for layer in layers] == [True, False]
    assert [layer.at_renderer for layer in asked] == [True, True]


def test_renderer_that_cannot_make_the_image_is_refused_with_the_reason() -> None:
    with pytest.raises(ConfigError, match=r":9:\d+: graph.nodes\[1\].on = .renderer.*2 threads render it"):
        layout_of(nodes("renderer"), threads=2)


@pytest.mark.parametrize("method", ["framed", "frameless", "hilbert"])
def test_images_have_the_same_bits_wherever_they_are_made(
    method: str, tracer_scene: TracerScene, compiled_only: None
) -> None:
    here, travelling = (
        images(plan_of(method=method), tracer_scene),
        images(plan_of(nodes("head"), method=method), tracer_scene),
    )

    assert here.std() > 10
    np.testing.assert_array_equal(here, travelling)


def test_adaptive_image_at_rest_is_as_close_wherever_it_is_made(tracer_scene: TracerScene, compiled_only: None) -> None:
    """Samples that travel are rounded, and their sampler's noise differs: the images agree within a code or so."""
    small = "24, 16"
    here, travelling = (images(plan_of(graph, pixels=small), tracer_scene) for graph in ("sort-first", nodes("head")))

    difference = here.astype(float) - travelling.astype(float)
    assert here.std() > 10
    assert np.sqrt((difference**2).mean()) < 1.5


def images(plan: Plan, scene: TracerScene) -> NDArray[np.uint8]:
    return np.stack([image.rgb for image in SingleProcess(plan, scene).until_complete()])


class OneRenderer:
    """The first renderer of a plan on one machine, stepped by hand."""

    def __init__(self, tracer_scene: TracerScene, *, credit: bool = True) -> None:
        plan = plan_of()
        self.plan = replace(plan, layout=reconstructed_at_renderers(plan.layout, HERE))
        self.clock, self.credit = ManualClock(), credit
        self.images = RendererImage(self.plan, 1, lambda rank: self.credit, self.clock)
        (self.image,) = self.images.images
        self.tracers = Tracers(self.plan, tracer_scene, 1, self.clock, threads=False, image=self.images)
        self.event = first_event(self.plan, 0.0)
        self.image.follow(self.event)

    def trace(self) -> int:
        """Samples of one batch, which the image gets."""
        batch = self.tracers.workers[0].trace(self.event)
        if batch is None:
            return 0
        self.image.insert(batch)
        return len(batch.samples)

    def refresh(self) -> list[bytes]:
        """What is sent by a refresh."""
        self.clock.advance(0.1)
        return self.images_sent()

    def images_sent(self) -> list[bytes]:
        """What is sent now."""
        return [offer.packet for offer in self.images.on_tick(self.clock.now())]


def test_sampler_and_image_share_one_deep_buffer_and_no_sample_is_sent(
    tracer_scene: TracerScene, compiled_only: None
) -> None:
    one = OneRenderer(tracer_scene)
    sampler = one.tracers.workers[0].sampler
    assert isinstance(sampler, AdaptiveRenderer)
    assert sampler.reconstruction is one.image.reconstruction
    one.refresh()

    traced = one.trace()
    packets = one.refresh()

    assert traced > 0
    assert one.image.reconstruction.count == traced
    assert one.images.composition.samples_shown() == traced
    assert packets
    assert not any(is_samples(packet) for packet in packets)
    parts = [parse_control(packet) for packet in packets]
    assert all(isinstance(part, FrameletPart) and part.event is not None for part in parts)


def test_only_the_refresh_of_the_image_replans_the_sampler(tracer_scene: TracerScene, compiled_only: None) -> None:
    one = OneRenderer(tracer_scene)
    one.refresh()
    one.trace()
    before = one.image.reconstruction.refreshes
    for _ in range(3):
        one.clock.advance(1.0)
        one.trace()
    assert one.image.reconstruction.refreshes == before

    one.refresh()
    assert one.image.reconstruction.refreshes == before + 1


def test_without_credit_changes_wait_and_a_dropped_part_is_sent_again(
    tracer_scene: TracerScene, compiled_only: None
) -> None:
    one = OneRenderer(tracer_scene, credit=False)
    one.refresh()
    one.trace()
    assert one.refresh() == []
    assert not one.image.complete

    one.credit = True
    (packet,) = one.refresh()
    one.images.composition.lose(0, packet)
    (again,) = one.refresh()

    first, second = parse_control(packet), parse_control(again)
    assert isinstance(first, FrameletPart)
    assert isinstance(second, FrameletPart)
    assert first.rect == second.rect


def test_image_is_complete_when_nothing_is_missing_and_all_is_sent(
    tracer_scene: TracerScene, compiled_only: None
) -> None:
    one = OneRenderer(tracer_scene)
    one.refresh()
    while one.trace():
        assert not one.image.complete, "its samples are not shown yet"
        one.refresh()

    one.refresh()
    one.refresh()

    assert one.image.complete
    one.image.follow(one.event)
    assert one.image.complete, "the manager only repeats the newest event"
    one.image.follow(replace(one.event, camera_event=1))
    assert not one.image.complete


def test_refreshes_that_come_late_are_made_of_fewer_samples_and_of_all_once_they_are_in_time(
    tracer_scene: TracerScene, compiled_only: None
) -> None:
    one = OneRenderer(tracer_scene)
    kept, period = 2.0 * one.image.reconstruction.rect.area, one.image.view.period  # two a pixel, as configured

    batch = one.trace()  # its samples have the same age: all are kept or none

    assert kept <= stored_after(one, 100, period) < kept + batch
    assert LEAST_SHARE * kept <= stored_after(one, 100, 1.5 * period) < LEAST_SHARE * kept + batch
    assert kept <= stored_after(one, 200, period) < kept + batch


def stored_after(one: OneRenderer, refreshes: int, seconds: float) -> int:
    """Samples of the image after so many refreshes, so far apart, with a batch before each."""
    for _ in range(refreshes):
        one.trace()
        move(one, seconds)
    return int((one.image.reconstruction.stored().confidence[: one.image.reconstruction.count] > 0.0).sum())


def move(one: OneRenderer, seconds: float) -> None:
    """Refresh so much later, under another event."""
    one.clock.advance(seconds)
    event = one.event
    x, y, z = event.camera.position
    camera = replace(event.camera, position=(x + 1e-4, y, z))
    one.event = replace(event, camera_event=event.camera_event + 1, camera=camera)
    one.image.follow(one.event)
    list(one.images.on_tick(one.clock.now()))


def test_after_a_jump_the_image_stays_until_a_coarse_one_is_whole_which_then_becomes_finer(
    tracer_scene: TracerScene, compiled_only: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refinement, "FEWEST", 12 * 8)
    one = OneRenderer(tracer_scene)
    one.refresh()
    while one.trace():
        one.refresh()
    image = one.image
    for _ in range(100):  # a ray takes a millisecond: coarse images are paid for
        one.clock.advance(0.064)
        image.refinement.traced(64, one.clock.now() - 0.064, one.clock.now(), swept=False)
    before, refreshes = codes_of(one), image.reconstruction.refreshes

    jump(one, 0.5 * np.pi)
    assert image.reconstruction.scale == 4
    assert one.images.hurries
    assert len(one.images_sent()) == 0
    assert image.reconstruction.refreshes == refreshes, "nothing is shown before it is swept"
    assert one.trace() == 12 * 8
    assert len(one.images_sent()) > 0
    assert not one.images.hurries
    assert image.reconstruction.refreshes == refreshes + 1
    assert np.abs(codes_of(one).astype(int) - before).mean() > 5, "another view"
    assert image.reconstruction.block_weights().min() > 0, "without holes"

    scales = [image.reconstruction.scale]
    while image.refinement.active:
        one.trace()
        one.refresh()
        scales.append(image.reconstruction.scale)
    assert sorted(set(scales), reverse=True) == [4, 2], "what takes more than half a second is left to the sampler"
    assert scales == sorted(scales, reverse=True)


def test_a_head_tells_of_its_rest_not_of_each_image(tracer_scene: TracerScene, compiled_only: None) -> None:
    one, beats = OneRenderer(tracer_scene), list[Heartbeat]()
    head = Compositor(one.plan, hello_of(0), lambda rank: True)

    def tell(*messages: Input) -> None:
        asked = [each for message in messages for each in head.on_message(message, one.clock.now())]
        asked += head.on_tick(one.clock.now())
        beats.extend(i.message for i in asked if isinstance(i, Send) and isinstance(i.message, Heartbeat))

    tell(one.event)
    images = 0
    for _ in range(12):
        one.trace()
        one.clock.advance(0.034)
        tell(*(packets := [Packet(packet) for packet in one.images_sent()]))
        images += len(packets)
        one.clock.advance(0.034)
        tell()
    assert images >= 8
    assert len(beats) <= 9, "in 0.8 s, every 0.1 s"
    assert not any(beat.complete for beat in beats)
    for _ in range(30):
        one.clock.advance(0.01)
        tell()
    assert beats[-1].complete


def test_a_camera_that_moves_a_little_is_no_jump(tracer_scene: TracerScene, compiled_only: None) -> None:
    one = OneRenderer(tracer_scene)
    one.refresh()
    for _ in range(8):
        one.trace()
        one.refresh()

    jump(one, 0.1)

    assert not one.image.refinement.active


def test_what_jumps_again_and_again_is_shown_nevertheless(tracer_scene: TracerScene, compiled_only: None) -> None:
    one = OneRenderer(tracer_scene)
    one.refresh()
    for _ in range(8):
        one.trace()
        one.refresh()
    refreshes, period = one.image.reconstruction.refreshes, one.image.view.period

    for k in range(60):
        one.clock.advance(period)
        jump(one, 0.5 * np.pi * (k + 1))
        list(one.images.on_tick(one.clock.now()))

    assert one.image.reconstruction.refreshes - refreshes >= 60 * period / (LONGEST_SWEEP_S + 2 * period) - 1


def jump(one: OneRenderer, turn: float) -> None:
    """The camera of the first event turned about the y axis."""
    first = first_event(one.plan, 0.0)
    rotation = first.camera.rotation() @ rotation_by(np.array([0.0, turn, 0.0]))
    camera = Camera.of(first.camera.origin(), rotation)
    one.event = replace(one.event, camera_event=one.event.camera_event + 1, camera=camera)
    one.image.follow(one.event)


def codes_of(one: OneRenderer) -> NDArray[np.uint8]:
    """What is shown."""
    shown: NDArray[np.uint8] = next(iter(one.images.composition.layers.values())).framelet.colour.copy()
    return shown
