"""One panel at its compositor: packets in, display values out, only what changed is redone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.config.schema import AdaptiveSampling
from wall.data import SAMPLE, Batch, Event, Samples
from wall.deepbuffer.buffer import DeepBuffer
from wall.deepbuffer.kernels import TILE
from wall.display.base import PanelPicture
from wall.processes.plan import Plan
from wall.reconstruction.choice import Choice, Reprojected, Wish, choose, display, make_picture
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import GpuError
from wall.reconstruction.picture import SAMPLES_PER_PIXEL


class PanelCompositor:
    """`insert` batches as they come, `refresh` at every display refresh."""

    def __init__(self, plan: Plan, index: int, *, reconstruction: Wish | None = None) -> None:
        """`reconstruction` overrides the configuration's. Raises GpuError if that asks for a GPU in vain."""
        self._wish: Wish = reconstruction or plan.layout.config.reconstruction
        self.reconstruction: Choice | None = choose("gpu") if self._wish == "gpu" else None  # chosen when it is needed
        self.panel = panel = plan.layout.wall.panels[index]
        self._plan = plan
        self._reprojected: Reprojected | None = None  # made when the first adaptive batch comes
        self._adaptive = self._given_up = False
        width, height = panel.pixels
        self.buffer = DeepBuffer(width, height)
        self._rgb = np.zeros((height, width, 3), np.uint8)
        self._picture = self._hand_over(version=0)

    def insert(self, batch: Batch) -> None:
        self.buffer.insert(batch)
        self._adaptive = batch.adaptive and not self._given_up
        if self._adaptive:
            if self._reprojected is None:
                self._reprojected = self._new_picture()
            try:
                self._reprojected.insert(batch.samples, batch.base_time, batch)
            except GpuError as error:
                self._give_up(error, batch)

    def _new_picture(self) -> Reprojected:
        sampling, view = self._plan.layout.sampling, self._plan.view
        kept = sampling.samples_per_pixel if isinstance(sampling, AdaptiveSampling) else SAMPLES_PER_PIXEL
        made, self.reconstruction = make_picture(
            self._wish, self.panel, view.eye, self._plan.scene, samples_per_pixel=kept
        )
        return made

    def _give_up(self, error: GpuError, event: Batch | Event) -> Reprojected:
        """The GPU is lost: the CPU goes on from the newest sample of every pixel.

        Where a GPU was insisted on, those samples are shown where they were traced, and the error is raised.
        """
        self.buffer.counters.add("gpu_lost")
        if self._wish == "gpu":
            self._reprojected, self._given_up = None, True
            update_display(self.buffer.radiance, np.ones(self.tiles, np.bool_), TILE, self._rgb)
            self._picture = self._hand_over(version=self._picture.version + 1)
            raise error
        self._wish = "cpu"
        self._reprojected = shown = self._new_picture()
        self.reconstruction = Choice(on="cpu", why=error.problem)
        samples, newest = _newest(self.buffer)
        shown.insert(samples, newest, event)
        return shown

    def refresh(self, event: Event, now: float) -> NDArray[np.bool_]:
        """Bring display values up to date. Returns the 16-pixel tiles that changed, (rows, columns) bool.

        Samples of the adaptive sampler are placed anew under `event`; others are shown where they were traced.
        Raises GpuError if a GPU was asked for and is lost.
        """
        dirty = self.buffer.take_dirty()
        if self._adaptive and self._reprojected is not None:
            dirty = self._reproject(self._reprojected, event, now)
        elif dirty.any():
            update_display(self.buffer.radiance, dirty, TILE, self._rgb)
        if dirty.any():
            self._picture = self._hand_over(version=self._picture.version + 1)
        return dirty

    def _reproject(self, shown: Reprojected, event: Event, now: float) -> NDArray[np.bool_]:
        try:
            shown.refresh(event, now)
            dirty = shown.take_dirty()
            if dirty.any():
                display(shown, dirty, self._rgb)
            return dirty
        except GpuError as error:
            return self._reproject(self._give_up(error, event), event, now)

    @property
    def tiles(self) -> tuple[int, int]:
        """Rows and columns of 16-pixel tiles."""
        width, height = self.panel.pixels
        return -(-height // TILE), -(-width // TILE)

    def oldest_sample(self, now: float) -> float | None:
        """Age in seconds of the oldest sample shown; None while a pixel never had one."""
        age = self.buffer.oldest_sample(now)
        return age if math.isfinite(age) else None

    def picture(self) -> PanelPicture:
        """What the panel shows after the last refresh."""
        return self._picture

    def _hand_over(self, *, version: int) -> PanelPicture:
        rgb = self._rgb.copy()  # sinks keep what they get: never written again
        return PanelPicture(id=self.panel.id, rgb=rgb, screen=self.panel.screen, version=version)


def _newest(buffer: DeepBuffer) -> tuple[Samples, float]:
    """What every pixel shows, as samples of the pixels' centres, and the time of the newest."""
    shown = np.isfinite(buffer.records["time"])
    records = buffer.records[shown]
    newest = float(records["time"].max(initial=-np.inf))
    samples = np.zeros(len(records), SAMPLE)
    samples["xy"] = np.argwhere(shown)[:, ::-1] + 0.5
    samples["radiance"], samples["depth"], samples["object"] = records["shown"], records["depth"], records["object"]
    samples["time"] = records["time"] - newest
    return samples, newest
