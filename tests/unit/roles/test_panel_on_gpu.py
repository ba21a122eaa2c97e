"""A panel whose image is made on a GPU, and what happens when the GPU is lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flat_batches import rgb_of

from wall.config.loading import loads
from wall.core.data import Batch, Event, Rect
from wall.reconstruction.gpu import device
from wall.reconstruction.gpu.device import Device, GpuError
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.composition import Composition
from wall.roles.layer import PanelCompositor
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: {columns}, rows: 1, pixels: {pixels}, size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}}}]
sampling: {{method: adaptive}}
reconstruction: {wish}
"""
INVALID = 1  # no capability of OpenGL: asking for it is a GL_INVALID_ENUM


LAYERS = """\
graph:
  nodes:
    - {id: s, op: samples, panel: r0c0, range: [0.5, 1]}
    - {id: r, op: reconstruct, input: s, background: transparent}
    - {id: sky, op: sky, panel: r0c0}
    - {id: both, op: depth, inputs: [r, sky]}
    - {id: files, op: sink, kind: png, input: both}
"""


def plan_of(wish: str, *, columns: int = 1, pixels: str = "[20, 12]", graph: str = "") -> Plan:
    text = TEXT.format(wish=wish, columns=columns, pixels=pixels) + graph
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture
def anything_is_a_gpu(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """So that `auto` takes llvmpipe where there is nothing better."""
    (tmp_path / "renderD128").touch()
    monkeypatch.setattr(device, "NODES", (str(tmp_path / "renderD128"),))
    monkeypatch.setattr(device, "SOFTWARE", ())


def batch_of(plan: Plan, event: Event, index: int = 0) -> Batch:
    """Every pixel's centre once, by the tracer."""
    panel = plan.layout.wall.panels[index]
    tracer = Tracer(make_tracer_scene(plan.scene), panel, plan.view.eye, coherent=False)
    tracer.set_event(event)
    x, y = np.meshgrid(np.arange(panel.pixels[0]) + 0.5, np.arange(panel.pixels[1]) + 0.5)
    samples = tracer.trace(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32))[0].copy()
    samples["change"] = 0.0
    return Batch(
        view=0, rect=Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1]), rank=1, panel=index, sequence=1,
        camera_event=event.camera_event, scene_event=event.scene_event, base_time=0.0,
        camera=event.camera, scene_time=event.scene_time, adaptive=True, samples=samples,
    )  # fmt: skip


def shown_on_gpu(graph: str = "") -> tuple[Plan, PanelCompositor, Event]:
    """A panel under `auto` with one sample a pixel, refreshed once."""
    plan = plan_of("auto", graph=graph)
    panel, event = PanelCompositor(plan, 0), first_event(plan, 0.0)
    panel.insert(batch_of(plan, event))
    panel.refresh(event, 0.0)
    return plan, panel, event


def begun_on_cpu(event: Event, graph: str = "") -> PanelCompositor:
    """A panel on the CPU that was refreshed once without samples, as after a GPU is lost, and once with a batch."""
    plan = plan_of("cpu", graph=graph)
    panel, batch = PanelCompositor(plan, 0), batch_of(plan, moved(event, 2))
    panel.insert(replace(batch, samples=batch.samples[:0]))
    panel.refresh(moved(event, 1), 0.01)
    panel.insert(batch)
    panel.refresh(moved(event, 2), 0.2)
    return panel


def lose(opengl: Device) -> None:
    """Let OpenGL report an error, as it does when memory ends or a driver is reset."""
    opengl.context.enable_direct(INVALID)


def test_a_whole_run_shows_the_same_display_values_as_on_the_cpu(opengl: Device, compiled_only: None) -> None:
    """Adaptive until nothing is left to do: the sampler's own image is on the CPU, so both trace the same rays."""
    shown = {}
    for wish in ("cpu", "gpu"):
        plan = plan_of(wish, pixels="[36, 22]")
        chain = SingleProcess(plan, make_tracer_scene(plan.scene))
        shown[wish] = chain.until_complete()[0].rgb.astype(int)
        assert str(chain.layers[0].reprojected.choice).startswith(wish)
    assert len(np.unique(shown["cpu"])) > 50
    apart = np.abs(shown["cpu"] - shown["gpu"]).max(axis=-1)
    assert (apart > 1).mean() <= 0.008, "only where rounding decides which sample is hidden, see docs/guide/accuracy.md"
    assert apart.max() <= 8


def test_two_panels_of_one_compositor_are_both_made_on_the_gpu(opengl: Device, compiled_only: None) -> None:
    """On the CPU each panel is refreshed by a thread of its own; OpenGL's images stay with theirs."""
    shown = {}
    for wish in ("cpu", "gpu"):
        plan = plan_of(wish, columns=2)
        compositor = Composition(plan, HEAD)
        event = first_event(plan, 0.0)
        for number in range(3):
            for index, panel in compositor.layers.items():
                panel.insert(batch_of(plan, moved(event, number), index))
            compositor.refresh(moved(event, number), 0.02 * number)
        assert len(compositor.statistics_images(0.1, comparing=False)) == 2
        assert {panel.reprojected.on_gpu for panel in compositor.layers.values()} == {wish == "gpu"}
        shown[wish] = np.stack([image.rgb.astype(int) for image in compositor.shown()[0].images()])
    assert len(np.unique(shown["cpu"])) > 50
    assert np.abs(shown["cpu"] - shown["gpu"]).max() <= 1


def test_a_lost_gpu_under_auto_leaves_the_image_to_the_cpu_and_is_counted(
    opengl: Device, anything_is_a_gpu: None, compiled_only: None
) -> None:
    plan, panel, event = shown_on_gpu()
    assert panel.reprojected.choice is not None
    assert panel.reprojected.choice.on == "gpu"
    assert rgb_of(panel).any()

    lose(opengl)
    panel.refresh(moved(event, 1), 0.01)

    assert panel.reprojected.choice.on == "cpu"
    assert "GL_INVALID_ENUM" in panel.reprojected.choice.why
    assert panel.counters["gpu_lost"] == 1
    assert not rgb_of(panel).any(), "the samples were the GPU's: the CPU's deep buffer starts empty"
    panel.insert(batch_of(plan, moved(event, 2)))
    panel.refresh(moved(event, 2), 0.2)
    on_cpu = begun_on_cpu(event)
    assert np.abs(rgb_of(panel).astype(int) - rgb_of(on_cpu)).max() <= 1
    assert panel.counters["gpu_lost"] == 1


def test_a_gpu_that_is_lost_while_somebody_looks_at_ages_leaves_them_and_the_image_to_the_cpu(
    opengl: Device, anything_is_a_gpu: None, compiled_only: None
) -> None:
    _, panel, _ = shown_on_gpu()
    assert panel.statistics_images(0.1)[0].age.any()

    lose(opengl)
    on_cpu = panel.statistics_images(0.1)[0]

    assert panel.reprojected.choice is not None
    assert panel.reprojected.choice.on == "cpu"
    assert panel.counters["gpu_lost"] == 1
    assert not on_cpu.age.any(), "the samples were the GPU's"
    assert not on_cpu.density.any()


@pytest.mark.parametrize("while_inserting", [False, True])
def test_a_gpu_that_is_lost_with_the_coverage_of_a_layer_leaves_both_to_the_cpu(
    opengl: Device, anything_is_a_gpu: None, monkeypatch: pytest.MonkeyPatch, compiled_only: None, while_inserting: bool
) -> None:
    """Samples that come while the GPU is lost are lost with it, even if only one of the two images saw the error."""
    plan, panel, event = shown_on_gpu(LAYERS)
    assert panel.reprojected.on_gpu
    assert isinstance(panel.reprojected._coverage.image, GpuReconstruction)
    assert {0.0, 1.0} <= set(np.unique(panel.framelet.channel("alpha")))
    assert np.isfinite(panel.framelet.channel("depth")).any()

    if while_inserting:

        def fails(*_: object) -> None:
            raise GpuError("the driver was reset", wanted="another")

        monkeypatch.setattr(panel.reprojected._coverage.image, "insert", fails)
        panel.insert(batch_of(plan, moved(event, 1)))
    else:
        lose(opengl)
    panel.refresh(moved(event, 1), 0.01)

    assert panel.counters["gpu_lost"] == 1
    assert isinstance(panel.reprojected.reconstruction, Reconstruction)
    assert isinstance(panel.reprojected._coverage.image, Reconstruction)
    assert not panel.framelet.channel("alpha").any(), "the samples were the GPU's"
    assert np.isinf(panel.framelet.channel("depth")).all()
    panel.insert(batch_of(plan, moved(event, 2)))
    panel.refresh(moved(event, 2), 0.2)
    on_cpu = begun_on_cpu(event, LAYERS)
    assert on_cpu.framelet.channel("alpha").any()
    for name in ("colour", "alpha", "depth", "object_id"):
        np.testing.assert_array_equal(panel.framelet.channel(name), on_cpu.framelet.channel(name))


def test_a_gpu_without_memory_for_the_coverage_leaves_all_of_the_layer_to_the_cpu(
    opengl: Device, anything_is_a_gpu: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = list[str]()

    class Full(GpuReconstruction):
        def __init__(self, *args: Any, **keys: Any) -> None:
            made.append("one")
            if len(made) > 1:
                raise GpuError("memory ends", wanted="smaller panels")
            super().__init__(*args, **keys)

    monkeypatch.setattr("wall.reconstruction.choice.GpuReconstruction", Full)
    _, panel, _ = shown_on_gpu(LAYERS)
    assert made == ["one", "one"]
    assert isinstance(panel.reprojected.reconstruction, Reconstruction)
    assert isinstance(panel.reprojected._coverage.image, Reconstruction)
    assert str(panel.reprojected.choice) == "cpu (memory ends)"
    assert panel.counters["gpu_lost"] == 0


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        (("{source: courtyard}", "{source: courtyard, integrator: {method: path}}"), "the noise of paths is filtered"),
        (("[0.4, 0.3]", "[0.4, 0.3], row_time: 1e-4"), "on a GPU all rows of an image show one moment"),
    ],
)
@pytest.mark.parametrize("graph", ["", LAYERS], ids=["display bytes", "a layer"])
def test_what_a_gpu_cannot_make_is_left_to_the_cpu_with_the_reason(
    opengl: Device, anything_is_a_gpu: None, changed: tuple[str, str], why: str, graph: str
) -> None:
    for wish, said in (("auto", why), ("cpu", "asked for")):
        text = TEXT.format(wish=wish, columns=1, pixels="[8, 6]").replace(*changed) + graph
        plan = make_plan(make_layout(loads(text, path=Path("wall.yaml"))))
        panel, event = PanelCompositor(plan, 0), first_event(plan, 0.0)
        panel.insert(replace(batch_of(plan, event), samples=batch_of(plan, event).samples[:0]))
        assert isinstance(panel.reprojected.reconstruction, Reconstruction)
        assert panel.reprojected.choice is not None
        assert panel.reprojected.choice.on == "cpu"
        assert said in panel.reprojected.choice.why


def test_a_lost_gpu_that_was_insisted_on_ends_the_run_with_what_the_driver_said(
    opengl: Device, compiled_only: None
) -> None:
    plan = plan_of("gpu")
    panel, event = PanelCompositor(plan, 0), first_event(plan, 0.0)
    panel.insert(batch_of(plan, event))
    lose(opengl)
    with pytest.raises(GpuError, match="reports GL_INVALID_ENUM; wanted: a driver that goes on working"):
        panel.refresh(event, 0.0)
    panel.insert(batch_of(plan, event))  # the end of a run takes in and shows once more what there is
    panel.refresh(event, 0.1)
    assert (rgb_of(panel) > 0).mean() > 0.5


def moved(event: Event, number: int) -> Event:
    """Another event of the same view."""
    return replace(event, camera_event=number, scene_event=number)
