"""One layer of a panel at its compositor: packets in, a framelet out, only what changed is redone."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from wall.config.sampling import AdaptiveSampling
from wall.core.data import Batch, Event, StatisticsImage
from wall.deepbuffer.arrivals import Arrivals
from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.display.base import PanelPicture
from wall.geometry.cameras import PanelView
from wall.reconstruction.channels import Coverage, blank_framelet, show_newest, show_reprojected
from wall.reconstruction.choice import Choice, Reprojected, Wish, choose, display, make_reconstruction
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import GpuError
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.compared import Compared
from wall.roles.plan import Plan
from wall.roles.statistics import statistics_image_of

EARLY_BATCHES = 1024  # kept until their event is followed, at the next refresh: what hundreds of ranks send meanwhile


class PanelCompositor:
    """`follow` events, `insert` batches as they come, `refresh` at every display refresh.

    What is shown is what the viewer asked for, whichever packets come: those of a sampler that is no longer asked for
    are left out and counted, those of one that this panel has not heard of yet wait until it has.
    """

    def __init__(self, plan: Plan, index: int, *, reconstruction: Wish | None = None) -> None:
        """`reconstruction` overrides the configuration's. Raises GpuError if that asks for a GPU in vain."""
        graph = plan.layout.graph
        self.layer, step = graph.layers[index], graph.step(graph.layers[index].node)
        self.panel = panel = plan.layout.wall.panels[self.layer.panel]
        self.framelet = blank_framelet(panel, step.channels, encoded=step.encoded, order=step.order)
        self._plain = not graph.beyond_bytes(self.layer)
        self._wish: Wish = (reconstruction or plan.layout.config.reconstruction) if self._plain else "cpu"
        self.reconstruction: Choice | None = choose("gpu") if self._wish == "gpu" else None  # chosen when it is needed
        self._plan, self._panel_view = plan, PanelView(plan.view_of(panel), panel)
        self._coverage: Coverage | None = None  # beside the reprojected picture of a transparent layer
        self._reprojected: Reprojected | None = None  # made when the first adaptive batch comes
        self._given_up = False
        self._shown: Event | None = None  # of the newest picture
        self.tiles_of: dict[int, StatisticsImage] = {}  # of each renderer, its newest while a viewer shows them
        width, height = panel.pixels
        self.buffer = PixelBuffer(width, height)  # samples that are shown where they were traced
        self._arrivals = Arrivals(width, height)  # of samples that are reprojected
        self._version = 0  # of what is shown
        self._picture: PanelPicture | None = None
        self.compared: Compared | None = None  # while two samplers are compared: the second one's picture
        self._compared_version = 0  # of its next picture
        self._method: str = plan.layout.sampling.method  # asked for
        self._compare = ""  # with it
        self._since = self._followed = 0  # camera events: of the first that asked for these two, of the newest
        self._anew = False  # the next refresh shows all of the reprojected picture, not only what changed
        self._early: deque[Batch] = deque()

    @property
    def _adaptive(self) -> bool:
        """Whether the first picture is made by reprojection: the adaptive sampler's, or compared by depth."""
        return self._method == "adaptive" or bool(self._compare) or self.layer.reprojects

    def follow(self, event: Event) -> None:
        """Show the sampler that `event` names, or two. `event`: one that was published, not a predicted one."""
        was, self._followed = self._adaptive, event.camera_event
        method = event.sampler or self._plan.layout.sampling.method
        if (method, event.compare) != (self._method, self._compare):
            self._since = event.camera_event
        if event.compare != self._compare:
            self._compare_with(event.compare)
        self._method, self._compare = method, event.compare
        if was != self._adaptive:
            self._anew = self._reprojected is not None
            if was and self._reprojected is not None:  # what was shown stays until samples of the other sampler come
                self.buffer.show_image(self._reprojected.radiance, self._arrivals.times)
            self.buffer.take_dirty()
        early, self._early = self._early, deque()
        for batch in early:
            self.insert(batch)

    def _compare_with(self, method: str) -> None:
        if self.compared is not None:
            self._compared_version = self.compared.picture().version + 1
            self.buffer.counters.merge(self.compared.buffer.counters.counts)
            self.buffer.samples_shown += self.compared.buffer.samples_shown
        self.compared = Compared(self.panel, method, version=self._compared_version) if method else None

    def insert(self, batch: Batch) -> None:
        """Keep a batch for its picture; count it as late or early where there is none."""
        current = not batch.adaptive and batch.camera_event >= self._since
        if self._adaptive and (batch.adaptive or (current and self.layer.reprojects)):
            self._take(batch)
        elif batch.camera_event > self._followed:  # whose it is, its event will say
            self._wait(batch)
        elif current and self.compared is not None:
            self.compared.buffer.insert(batch)
        elif current and not self._adaptive:
            self._take(batch)
        else:
            self.buffer.counters.add("late", len(batch.samples))

    def _wait(self, batch: Batch) -> None:
        if len(self._early) < EARLY_BATCHES:
            self._early.append(batch)
        else:
            self.buffer.counters.add("early", len(batch.samples))

    def _take(self, batch: Batch) -> None:
        if not (batch.adaptive or self.layer.reprojects) or self._given_up:
            self.buffer.insert(batch)
            return
        self.buffer.counters.add("outside", self._arrivals.note(batch))
        if self._reprojected is None:
            self._reprojected = self._new_picture()
        samples = batch.samples
        if self._coverage is not None:
            samples, covered = self._coverage.split(samples)
            self._coverage.insert(covered, batch.base_time, batch)
        try:
            self._reprojected.insert(samples, batch.base_time, batch)
        except GpuError as error:
            self._give_up(error)

    def _new_picture(self) -> Reprojected:
        sampling, eye = self._plan.layout.sampling, self._panel_view.eye
        kept = sampling.samples_per_pixel if isinstance(sampling, AdaptiveSampling) else SAMPLES_PER_PIXEL
        if self.layer.transparent:
            self._coverage = Coverage(self.panel, eye, self._plan.scene, samples_per_pixel=kept)
        scene = self._plan.scene
        made, self.reconstruction = make_reconstruction(self._wish, self.panel, eye, scene, samples_per_pixel=kept)
        if not self._plain:
            self.reconstruction = Choice(on="cpu", why="the graph needs more of it than display bytes")
        return made

    def _give_up(self, error: GpuError) -> Reprojected:
        """The GPU is lost with the samples it held: the CPU goes on from an empty deep buffer.

        Where a GPU was insisted on, the error is raised; samples that still come are shown where they were traced.
        """
        self.buffer.counters.add("gpu_lost")
        if self._wish == "gpu":
            self._reprojected, self._given_up = None, True
            raise error
        self._wish = "cpu"
        self._reprojected = shown = self._new_picture()
        self.reconstruction = Choice(on="cpu", why=error.problem)
        return shown

    def refresh(self, event: Event, now: float) -> NDArray[np.bool_]:
        """Bring the framelet up to date. Returns the 16-pixel tiles that changed, (rows, columns) bool.

        Samples of the adaptive sampler are placed anew under `event`; others are shown where they were traced.
        Raises GpuError if a GPU was asked for and is lost.
        """
        dirty = self.buffer.take_dirty()
        if self._adaptive and self._reprojected is not None:
            self._shown = self._panel_view(event)
            dirty = self._reproject(self._reprojected, self._shown, now)
        elif dirty.any():
            self.framelet.stamp(now)
            show_newest(self.buffer, dirty, self.layer.transparent, self.framelet)
        if dirty.any():
            self.framelet.event = event
            self._version += 1
        return dirty

    def _reproject(self, shown: Reprojected, event: Event, now: float) -> NDArray[np.bool_]:
        try:
            shown.refresh(event, now)
            dirty = shown.take_dirty() | self._anew
            if self._coverage is not None:
                dirty |= self._coverage.refresh(event, now)
            self._anew = False
            if dirty.any() and (self._plain or not isinstance(shown, Reconstruction)):
                display(shown, dirty, self.framelet.colour)
            elif dirty.any() and isinstance(shown, Reconstruction):
                self.framelet.stamp(now)
                show_reprojected(shown, self._coverage, dirty, self.framelet)
            return dirty
        except GpuError as error:
            return self._reproject(self._give_up(error), event, now)

    def has_frame(self, number: tuple[int, int]) -> bool:
        """Whether every rank has brought a whole frame of that event, or of a newer one."""
        frames = self.buffer.frames
        return all(rank in frames and frames[rank] >= number for rank in self.layer.ranks)

    def statistics_images(self, now: float) -> list[StatisticsImage]:
        """How old and how dense the samples of its pictures are, one StatisticsImage a picture.

        Raises GpuError if a GPU was asked for and is lost.
        """
        found = [self._statistics_image(now)]
        if self.compared is not None:
            found.append(statistics_image_of(self.compared.buffer, [], self.panel.index, compared=True, now=now))
        return found

    def _statistics_image(self, now: float) -> StatisticsImage:
        if not self._adaptive or self._reprojected is None or self._shown is None:
            return statistics_image_of(
                self.buffer, [], self.panel.index, compared=False, now=now
            )  # samples without tiles
        try:
            tiles = list(self.tiles_of.values())
            return statistics_image_of(self._reprojected, tiles, self.panel.index, compared=False, now=now)
        except GpuError as error:
            self._give_up(error)
            return self._statistics_image(now)

    @property
    def samples_shown(self) -> int:
        """Samples that came and were used."""
        return self.buffer.samples_shown + self._arrivals.samples_shown

    @property
    def newest_event(self) -> tuple[int, int]:
        """The newest event of which a sample was used."""
        return max(self.buffer.newest_event, self._arrivals.newest_event)

    @property
    def on_gpu(self) -> bool:
        """Whether its picture is on a GPU: then it belongs to the thread that inserts."""
        return isinstance(self._reprojected, GpuReconstruction)

    @property
    def tiles(self) -> tuple[int, int]:
        """Rows and columns of 16-pixel tiles."""
        width, height = self.panel.pixels
        return -(-height // TILE), -(-width // TILE)

    def oldest_sample(self, now: float) -> float | None:
        """Age in seconds of the oldest sample shown; None while a pixel never had one."""
        reprojects = self._adaptive and self._reprojected is not None
        age = self._arrivals.oldest_sample(now) if reprojects else self.buffer.oldest_sample(now)
        return age if math.isfinite(age) else None

    def picture(self) -> PanelPicture:
        """What the layer alone shows after the last refresh, as display bytes."""
        if self._picture is None or self._picture.version != self._version:
            rgb = self.framelet.colour
            if not self.framelet.encoded:
                rgb = np.empty(rgb.shape, np.uint8)
                update_display(self.framelet.colour, np.ones(self.tiles, np.bool_), TILE, rgb)
            screen = self.panel.screen
            self._picture = PanelPicture(id=self.panel.id, rgb=rgb.copy(), screen=screen, version=self._version)
        return self._picture
