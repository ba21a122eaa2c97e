"""Show the samples of a deep buffer as they look under another camera, on the CPU or a GPU that may be lost."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.compositing.graph import Layer
from wall.config.sampling import AdaptiveSampling
from wall.core.data import Batch, Event, Float32, Framelet, StatisticsImage
from wall.deepbuffer.arrivals import Arrivals
from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL
from wall.geometry.cameras import PanelView
from wall.reconstruction.channels import Coverage, show_reprojected
from wall.reconstruction.choice import Choice, LayerReconstruction, Wish, choose, make_reconstruction, why_not_on_gpu
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.reconstruction.gpu.device import GpuError
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.plan import Plan
from wall.roles.resolution import first_scale
from wall.roles.statistics import statistics_image_of
from wall.roles.tone import configured_tone
from wall.scene.needs import needs

AnyImage: TypeAlias = LayerReconstruction | DynamicResolution
PIXELS_A_THREAD = 1 << 18  # of an image; with less threads gain little: docs/lab/speed.md


def threads_of(plan: Plan, layer: Layer) -> int:
    """How many threads share the making of a layer's image: as many as its process has cores for.

    Of a small image a share takes less time than a thread needs to begin with it.
    """
    width, height = plan.layout.wall.traced[layer.traced].pixels
    layers = len(plan.layout.graph.layers_on(layer.compositor))
    return max(1, min(int(plan.cores / layers), width * height // PIXELS_A_THREAD))


def _by_threads(choice: Choice, threads: int) -> Choice:
    """The same choice, with how many threads share the work where several do."""
    return replace(choice, why=f"{choice.why}; {threads} threads") if choice.on == "cpu" and threads > 1 else choice


class ReprojectedLayer:
    """A deep buffer with its reconstruction, made when it is first needed, and the image that it is shown in.

    A GPU that is lost takes its samples with it: the CPU goes on from an empty deep buffer. Where a GPU was insisted
    on, GpuError is raised instead and `given_up` is set.
    """

    def __init__(self, plan: Plan, layer: Layer, framelet: Framelet, counters: Counter[str], wish: Wish | None) -> None:
        """`wish` overrides the configuration's. Raises GpuError if that asks for a GPU in vain."""
        self._plan, self._layer, self._framelet, self._counters = plan, layer, framelet, counters
        self._panel = plan.layout.wall.traced[layer.traced]
        self._panel_view = PanelView(plan.view_of(self._panel), self._panel)
        self._display_bytes_only = not plan.layout.graph.beyond_bytes(layer)
        asked = wish or plan.layout.config.reconstruction_of(layer.view)
        self._why_cpu = "" if asked == "cpu" else why_not_on_gpu(plan.scene_of(layer.view), self._panel)
        self._wish: Wish = "cpu" if self._why_cpu else asked
        self.choice: Choice | None = choose("gpu") if self._wish == "gpu" else None  # else when samples come
        self.reconstruction: AnyImage | None = None
        self._coverage: Coverage | None = None  # of a transparent layer
        self.arrivals = Arrivals(*self._panel.pixels)
        self.given_up = False
        self.show_all = False  # at the next refresh, not only what changed
        self.tiles_of: dict[int, StatisticsImage] = {}  # of each renderer, its newest while a viewer shows them
        self._refreshed = False
        self._tone = configured_tone(plan.layout.config.views[layer.view])  # of the image that the framelet shows

    def shared(self) -> DynamicResolution:
        """At the layer's renderer: the reconstruction that its adaptive sampler inserts samples into."""
        reconstruction = self.reconstruction or self._make()
        assert isinstance(reconstruction, DynamicResolution)
        return reconstruction

    @property
    def shows(self) -> bool:
        """Whether there is an image to show."""
        made = self.reconstruction is not None
        return made and not (self._layer.at_renderer and self.arrivals.samples_shown == 0)

    @property
    def on_gpu(self) -> bool:
        """Whether a GPU reconstructs: then only the thread that inserts may refresh."""
        return isinstance(self.reconstruction, GpuReconstruction)

    @property
    def weights(self) -> Float32 | None:
        """(h / 4, w / 4), rounded up: weight of the samples in each 4x4 pixels; None on a GPU, where it stays."""
        made = self.reconstruction
        return made.block_weights() if isinstance(made, Reconstruction | DynamicResolution) else None

    def insert(self, batch: Batch) -> None:
        """Store a batch in the deep buffer, unless the sampler has done that: it shares the buffer at the renderer.

        Raises GpuError if a GPU was insisted on and is lost.
        """
        self._counters += Counter(outside=self.arrivals.note(batch))
        if self._layer.at_renderer:
            return
        reconstruction = self.reconstruction or self._make()
        samples = batch.samples
        try:
            if self._coverage is not None:
                samples, covered = self._coverage.split(samples)
                self._coverage.insert(covered, batch.base_time, batch)
            reconstruction.insert(samples, batch.base_time, batch)
        except GpuError as error:
            self._give_up(error)

    def _make(self) -> AnyImage:
        sampling = self._plan.layout.sampling_of(self._layer.view)
        scene = self._plan.scene_of(self._layer.view)
        eye, panel = self._panel_view.eye, self._panel
        kept = sampling.samples_per_pixel if isinstance(sampling, AdaptiveSampling) else SAMPLES_PER_PIXEL
        threads = threads_of(self._plan, self._layer)
        if self._layer.at_renderer:
            changes = needs(scene).change_detection
            self.reconstruction = DynamicResolution(
                panel, eye, scene, detects_change=changes, samples_per_pixel=kept, threads=threads,
                scale=first_scale(panel),
            )  # fmt: skip
            self.choice = Choice(on="cpu", why="at its renderer")
            return self.reconstruction
        image, covers, choice = make_reconstruction(
            self._wish, panel, eye, scene,
            samples_per_pixel=kept, threads=threads, transparent=self._layer.transparent,
        )  # fmt: skip
        self.reconstruction, self._coverage = image, None if covers is None else Coverage(covers)
        self.choice = _by_threads(Choice(on="cpu", why=self._why_cpu) if self._why_cpu else choice, threads)
        if self._framelet.albedo is not None and isinstance(image, Reconstruction):
            image.describe_surfaces()
        return image

    def keep(self, share: float) -> None:
        """At the renderer: keep that share of the samples that are kept where refreshes are made in time."""
        self.shared().keep(share)

    def covers(self, event: Event) -> float:
        """At the renderer: the share of the image that stored samples would show under an event, roughly."""
        return self.shared().covers(self._panel_view(event).camera)

    def _give_up(self, error: GpuError) -> None:
        self._counters["gpu_lost"] += 1
        if self._wish == "gpu":
            self.reconstruction, self.given_up = None, True
            raise error
        self._wish = "cpu"
        self._make()
        self.choice = Choice(on="cpu", why=error.problem)

    def refresh(self, event: Event, now: float) -> NDArray[np.bool_]:
        """Reproject the samples to `event` and write what changed to the framelet.

        Returns the 16-pixel tiles that changed, (rows, columns) bool. Raises GpuError if a GPU was insisted on and is
        lost.
        """
        assert self.reconstruction is not None
        self._refreshed = True
        try:
            return self._show(self.reconstruction, self._panel_view(event), now)
        except GpuError as error:
            self._give_up(error)
            return self.refresh(event, now)

    def _show(self, reconstruction: AnyImage, event: Event, now: float) -> NDArray[np.bool_]:
        reconstruction.refresh(event, now)
        dirty, tone = reconstruction.take_dirty() | self.show_all | (event.tone != self._tone), event.tone
        if self._coverage is not None:
            dirty |= self._coverage.refresh(event, now)
        self.show_all, self._tone = False, tone
        framelet = self._framelet
        if not dirty.any():
            return dirty
        if self._display_bytes_only or isinstance(reconstruction, DynamicResolution):
            reconstruction.display(dirty, framelet.colour, tone=tone)
        else:
            framelet.stamp(now)
            show_reprojected(reconstruction, self._coverage, dirty, framelet, tone=tone)
        return dirty

    def statistics_image(self, now: float) -> StatisticsImage | None:
        """Age and density of its samples, for the renderers' tiles; None before it was first refreshed.

        Raises GpuError if a GPU was insisted on and is lost.
        """
        if self.reconstruction is None or not self._refreshed:
            return None
        try:
            tiles = list(self.tiles_of.values())
            return statistics_image_of(self.reconstruction, tiles, self._panel.index, compared=False, now=now)
        except GpuError as error:
            self._give_up(error)
            return self.statistics_image(now)
