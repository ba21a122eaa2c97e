"""What a refresh of a moving image costs on this machine's GPU, and shared out to threads; display values included."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Samples
from wall.deepbuffer.deep_buffer import SORT_EVERY
from wall.geometry.panels import Panel
from wall.reconstruction.channels import Coverage, blank_framelet, show_reprojected
from wall.reconstruction.choice import Wish, make_reconstruction
from wall.reconstruction.gpu.device import GpuError, device
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.plan import Plan, first_event
from wall.study.speed.record import SEED, Row, bounded, compared, median, skipped
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

METRIC, UNIT = "gpu_refresh", "ms"
PIXELS, SOFTWARE_PIXELS = (1920, 1080), (480, 270)  # a program on the CPU gets a sixteenth
SAMPLES_PER_PIXEL = 4
LIMIT_MS = 4.0
THREADS, MOST_THREADS, LEAST_GAIN = "reconstruct_threads", 4, 3.0
STEP = 0.002  # world units that the eye slides at every refresh
REFRESH_S = 1.0 / 60.0
BATCH = 65536
SETTLING = 3  # refreshes before, for shaders and caches


def measure(rounds: int) -> list[Row]:
    """The courtyard with 4 stored samples a pixel; the eye slides at every refresh, and every sample moves."""
    bar = f"value <= {LIMIT_MS:g}"
    try:
        gpu = device()
    except GpuError as error:
        return [skipped(METRIC, UNIT, bar, error.problem)]
    width, height = PIXELS if gpu.real else SOFTWARE_PIXELS
    plan = plan_of("courtyard")
    panel = replace(plan.layout.wall.panels[0], pixels=(width, height))
    event = first_event(plan, 0.0)
    samples = _samples(plan, panel, event)
    on_gpu = GpuReconstruction(panel, plan.view.eye, plan.scene, samples_per_pixel=SAMPLES_PER_PIXEL)
    [took] = _refreshes([on_gpu], samples, event, rounds)
    on_cpu = Reconstruction(panel, plan.view.eye, plan.scene, detects_change=False, samples_per_pixel=SAMPLES_PER_PIXEL)
    [cpu] = _refreshes([on_cpu], samples, event, min(rounds, 3))
    note = f"{gpu.renderer}, courtyard at {width}x{height}, {on_gpu.count / (width * height):.1f} samples a pixel"
    more = {"renderer": gpu.renderer, "width": width, "height": height, "cpu_ms": round(median(cpu), 2)}
    layers: tuple[tuple[str, Wish, int], ...] = (("layer_ms", "gpu", rounds), ("layer_cpu_ms", "cpu", min(rounds, 3)))
    for name, wish, some in layers:
        [layer] = _refreshes([_Layer(wish, panel, plan)], samples, event, some)
        more[name] = round(median(layer), 2)
    row = bounded(METRIC, median(took), LIMIT_MS, unit=UNIT, below=True, note=note, **more)
    if gpu.real:
        return [row]
    return [replace(row, met=None, ratio=None, note=f"{note}; the bar is for a GPU, this is a program on the CPU")]


class _Layer:
    """A layer with linear light, depth and alpha, as one that is compared by depth has."""

    def __init__(self, wish: Wish, panel: Panel, plan: Plan) -> None:
        self._image, covers, _ = make_reconstruction(
            wish, panel, plan.view.eye, plan.scene, samples_per_pixel=SAMPLES_PER_PIXEL, transparent=True
        )
        assert covers is not None
        self._coverage, self.rect = Coverage(covers), self._image.rect
        self._framelet = blank_framelet(panel, frozenset({"colour", "depth", "alpha"}), encoded=False, order=0)

    def insert(self, samples: Samples, base_time: float, event: Event) -> None:
        colours, covered = self._coverage.split(samples)
        self._image.insert(colours, base_time, event)
        self._coverage.insert(covered, base_time, event)

    def refresh(self, event: Event, now: float) -> None:
        self._image.refresh(event, now)
        self._dirty = self._coverage.refresh(event, now)

    def take_dirty(self) -> NDArray[np.bool_]:
        return self._dirty | self._image.take_dirty()

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8]) -> None:
        """Make the channels; bytes come behind the node that compares them."""
        show_reprojected(self._image, self._coverage, dirty, self._framelet)


def in_threads(rounds: int) -> list[Row]:
    """Time of a refresh by one thread, over that by as many as there are cores, up to four; in turn."""
    count = min(len(os.sched_getaffinity(0)), MOST_THREADS)
    if count < 2:
        return [skipped(THREADS, UNIT, f"ratio >= {LEAST_GAIN:g}", "it needs two cores")]
    plan = plan_of("courtyard")
    panel = replace(plan.layout.wall.panels[0], pixels=PIXELS)
    event = first_event(plan, 0.0)
    samples = _samples(plan, panel, event)
    images = [
        Reconstruction(
            panel, plan.view.eye, plan.scene, detects_change=False, samples_per_pixel=SAMPLES_PER_PIXEL, threads=threads
        )
        for threads in (1, count)
    ]
    alone, shared = map(_by_sorts, _refreshes(images, samples, event, 2 * SORT_EVERY * rounds))
    note = f"courtyard at {PIXELS[0]}x{PIXELS[1]}, {SAMPLES_PER_PIXEL} samples a pixel; one thread over {count}"
    row = compared(THREADS, alone, shared, unit=UNIT, at_least=LEAST_GAIN, note=note, threads=count)
    return [row if count == MOST_THREADS else replace(row, bar="", met=None)]


def _by_sorts(took: list[float]) -> list[float]:
    """Means over the refreshes from one sort of the stored samples to the next."""
    return [sum(took[k : k + SORT_EVERY]) / SORT_EVERY for k in range(0, len(took), SORT_EVERY)]


def _samples(plan: Plan, panel: Panel, event: Event) -> Samples:
    """So many a pixel at random positions, by the tracer."""
    width, height = panel.pixels
    tracer = Tracer(make_tracer_scene(plan.scene), panel, plan.view.eye, coherent=True)
    tracer.set_event(event)
    xy = np.random.default_rng(SEED).random((SAMPLES_PER_PIXEL, height, width, 2)).astype(np.float32)
    xy += np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    corner = np.nextafter(np.array([width, height], np.float32), np.float32(0.0))
    xy_inside = np.minimum(xy.reshape(-1, 2), corner)
    traced = [tracer.trace(xy_inside[k : k + BATCH])[0].copy() for k in range(0, len(xy_inside), BATCH)]
    samples = np.concatenate(traced)
    samples["time"] = samples["change"] = 0.0
    return samples


def _refreshes(
    images: Sequence[GpuReconstruction | Reconstruction | _Layer], samples: Samples, event: Event, rounds: int
) -> list[list[float]]:
    """Of each image, milliseconds from each of `rounds` events to the last display value; they take turns."""
    for image in images:
        for first in range(0, len(samples), BATCH):
            image.insert(samples[first : first + BATCH].copy(), 0.0, event)
    rgb = np.zeros((images[0].rect.height, images[0].rect.width, 3), np.uint8)
    x, y, z = event.camera.position
    took: list[list[float]] = [[] for _ in images]
    for k in range(SETTLING + rounds):
        camera = replace(event.camera, position=(x + STEP * k, y, z))
        moved = replace(event, camera_event=k, camera=camera)
        for image, own in zip(images, took, strict=True):
            began = time.perf_counter()
            image.refresh(moved, REFRESH_S * (k + 1))
            image.display(image.take_dirty(), rgb)
            own.append(1e3 * (time.perf_counter() - began))
    return [own[SETTLING:] for own in took]
