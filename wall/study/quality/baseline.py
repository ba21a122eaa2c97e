"""What rival methods share: frames or single rays on the virtual clock, matrices, filling of holes.

A framed method has a `Display`, which is given whole frames; a frameless one has a `Renderer`, which chooses every ray.
Neither sees the clock.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wall.core.data import SAMPLE, Event, Float32, Float64, Rect, Samples
from wall.deepbuffer.kernels.reproject import object_tables
from wall.deepbuffer.pose import Pose
from wall.geometry.frusta import ray_frame
from wall.sampling.ownership import block_order
from wall.study.quality.kernels import warp as kernels_warp
from wall.study.quality.kernels.maps import PointMaps
from wall.study.quality.method import Inputs, MeteredTracer, Setup, centres

ROUNDING_RAYS = 1e-6  # a ray that is done but for the rounding of times is done
AVERAGED_FOOTPRINT = 0.5  # pixels, of samples that are averaged on the way to a pixel; the best for `adaptive` too
R2 = np.array([0.7548776662466927, 0.5698402909980532])  # the plastic number's powers; M. Roberts 2018


def object_maps(setup: Setup, event: Event) -> PointMaps:
    """Matrices for points of objects."""
    pose = Pose.at(setup.panel, setup.plan.view.eye, setup.plan.scene, event.camera, event.scene_time)
    return PointMaps(pose.frame, pose.corner, pose.object_from_eye, pose.panel_from_object)


def world_maps(setup: Setup, event: Event) -> PointMaps:
    """Matrices for points of the world: row 0 the sky, row 1 all else. Its origin is the eye's position at time 0."""
    frame = ray_frame(setup.panel, setup.plan.view.eye, event.camera)
    corner = np.array(setup.panel.screen, np.float64)
    anchor = np.eye(4)[None]
    anchor[0, :3, 3] = setup.plan.view.camera_at(0.0).origin()
    anchor.setflags(write=False)  # as poses of scenes are: one compiled kernel serves both
    there, back = np.empty((2, 2, 12), np.float32)
    object_tables(anchor, event.camera.origin(), frame, corner, there, back)
    return PointMaps(frame, corner, there, back)


class Maps:
    """Matrices of the newest event that was asked for."""

    def __init__(self, setup: Setup, *, follow_objects: bool) -> None:
        """`follow_objects`: points belong to objects, else to the world."""
        self._setup, self._made = setup, object_maps if follow_objects else world_maps
        self._newest: tuple[Event, PointMaps] | None = None

    def of(self, event: Event) -> PointMaps:
        """Matrices of an event."""
        if self._newest is None or self._newest[0] is not event:
            self._newest = event, self._made(self._setup, event)
        return self._newest[1]


class Display(Protocol):
    """The display's side of a framed method."""

    jittered: bool  # frames of the same event differ, so that another one adds information

    def take(self, raster: Samples, event: Event) -> None:
        """A frame is complete: (rows, columns) SAMPLE, traced under `event`."""
        ...

    def image(self, event: Event) -> Float32:
        """(h, w, 3) float32 linear RGB, shown when `event` is the newest."""
        ...


class FramedMethod:
    """Frames one after the other, each under the event it began with, shown from its last ray on: double buffering.

    A frame has `grid` = (columns, rows) rays, spread evenly over the panel; jittered ones move together over their
    cells by the R2 sequence.
    """

    def __init__(self, setup: Setup, grid: tuple[int, int], display: Display) -> None:
        columns, rows = grid
        self._rate, self._display, self._grid = setup.rate, display, grid
        self._cells = block_order(Rect(x=0, y=0, width=columns, height=rows), worker=0, workers=1)
        self._spacing = np.array(setup.size, np.float64) / grid
        self._footprint = AVERAGED_FOOTPRINT if display.jittered else float(self._spacing.max())
        self._inputs, self._tracer = Inputs(setup.plan), MeteredTracer(setup, coherent=True)
        self._raster = np.zeros((rows, columns), SAMPLE)
        self._now, self._frame, self._done, self._allowed = 0.0, 0, 0.0, 0
        self._step = setup.input_step_s
        self._event: Event | None = self._inputs.event_at(0.0)
        self._finish(self._event)
        self._tracer.reset()
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        """Renders frames up to time `until`, in seconds, at the set rate or with `rays` in all."""
        rate = self._rate if rays is None else max(0, rays - self._allowed) / max(until - self._now, 1e-9)
        self._allowed = int(self._rate * until) if rays is None else rays
        while self._now < until:
            if self._event is None:
                event = self._inputs.event_at(self._now)
                if event is self._last and not self._display.jittered:  # the image is complete
                    self._now = min(self._now + self._step, until)
                    continue
                self._event, self._done = event, 0.0
            left = len(self._cells) - self._done
            if (until - self._now) * rate < left - ROUNDING_RAYS:
                self._done += (until - self._now) * rate
                self._now = until
                break
            self._now += left / rate
            self._finish(self._event)
        self.rays, self.secondary, self.bytes = self._tracer.counts
        self.rays += int(self._done + ROUNDING_RAYS) if self._event is not None else 0

    def show(self, time: float) -> Float32:
        """Returns what the display shows at `time`, (h, w, 3) linear RGB."""
        return self._display.image(self._inputs.event_at(time))

    def _finish(self, event: Event) -> None:
        """Trace the frame under way. A sample that is dropped leaves the pixel's one of the frame before."""
        self._frame += 1
        xy = self._positions()
        samples = self._tracer.trace(
            xy, event, self._now, frame=self._frame, frame_samples=len(xy), footprint=self._footprint
        )
        columns, rows = self._grid
        x, y = (samples["xy"] / self._spacing).astype(np.int64).T
        self._raster[np.minimum(y, rows - 1), np.minimum(x, columns - 1)] = samples
        self._display.take(self._raster, event)
        self._last, self._event = event, None

    def _positions(self) -> Float32:
        offset: Float64 = np.full(2, 0.5)
        if self._display.jittered:
            offset = np.clip((0.5 + (self._frame - 1) * R2) % 1.0, 0.01, 0.99)
        xy: Float32 = ((self._cells + offset) * self._spacing).astype(np.float32)
        return xy


class Renderer(Protocol):
    """A method that chooses every ray by itself."""

    coherent: bool

    def choose(self, count: int, event: Event, now: float) -> Float32:
        """(n, 2) float32 panel pixels, about `count` of them: what is beyond is owed to the next call."""
        ...

    def take(self, samples: Samples, event: Event, now: float) -> None:
        """What came of the positions chosen last."""
        ...

    def image(self, event: Event, now: float) -> Float32:
        """(h, w, 3) float32 linear RGB under `event`."""
        ...


class FramelessMethod:
    """Rays of at most Setup.input_step_s share an event, are traced at that span's end and count at once."""

    def __init__(self, setup: Setup, renderer: Renderer) -> None:
        self._rate, self._renderer = setup.rate, renderer
        self._inputs, self._tracer = Inputs(setup.plan), MeteredTracer(setup, coherent=renderer.coherent)
        self._now, self._owed, self._allowed = 0.0, 0.0, 0
        self._step = setup.input_step_s
        event = self._inputs.event_at(0.0)
        renderer.take(self._tracer.trace(centres(setup), event, 0.0), event, 0.0)
        self._tracer.reset()
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        """Traces batches up to time `until`, in seconds, at the set rate or with `rays` in all."""
        rate = self._rate if rays is None else max(0, rays - self._allowed) / max(until - self._now, 1e-9)
        self._allowed = int(self._rate * until) if rays is None else rays
        while self._now < until:
            end = min(self._now + self._step, until)
            self._owed += rate * (end - self._now)
            self._now = end
            if self._owed + ROUNDING_RAYS < 1.0:
                continue
            event = self._inputs.event_at(end)
            xy = self._renderer.choose(int(self._owed + ROUNDING_RAYS), event, end)
            if len(xy):
                self._owed -= len(xy)
                samples = self._tracer.trace(xy, event, end, footprint=AVERAGED_FOOTPRINT)
                self._renderer.take(samples, event, end)
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def show(self, time: float) -> Float32:
        """Returns what the display shows at `time`, (h, w, 3) linear RGB."""
        return self._renderer.image(self._inputs.event_at(time), time)


def fill_holes(image: Float32) -> None:
    """Fill holes from the pixels around, near ones first: push-pull (Gortler et al. 1996).

    image : (h, w, 4) float32 colour and weight 0..1, in place: what the weight lacks comes from coarser levels
    """
    levels = [image]
    while max(levels[-1].shape[:2]) > 1:
        height, width = levels[-1].shape[:2]
        levels.append(np.empty((-(-height // 2), -(-width // 2), 4), np.float32))
        kernels_warp.pull(levels[-2], levels[-1])
    for fine, coarse in zip(levels[-2::-1], levels[:0:-1], strict=True):
        kernels_warp.push(coarse, fine)
