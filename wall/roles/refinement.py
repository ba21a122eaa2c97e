"""After a jump an image begins coarse and whole, and becomes finer sweep by sweep.

Where most of a panel is unknown, samples at places that scores pick leave holes, which are filled from afar. So the
first rays are a sweep of an image of few pixels, as many as a refresh pays for on this machine; then of one of twice as
many in each direction, and so on. An image of more pixels is shown once each of them has a sample.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.data import Float32
from wall.geometry.panels import Panel, of_fewer_pixels
from wall.sampling.sweep import Sweep

FIRST_PERIODS = 1.5  # refresh intervals that the first sweep and its image may take
FEWEST = 1 << 10  # pixels at least of the first image, about
LONGEST_S = 0.5  # a finer sweep that would take longer is not begun
RAY_S, PIXEL_S = 1e-6, 1e-7  # seconds of a core for a ray, and a pixel of a refresh, while none was measured
PAUSE_S = 0.2  # between two batches: after a longer time there was nothing to trace
REMEMBERED_S = 0.5  # of time that was spent weighs most
NOWHERE: Float32 = np.empty((0, 2), np.float32)


class Cost:
    """What one of something costs, seconds: all that was spent lately over all that came of it."""

    def __init__(self, each: float) -> None:
        """`each`: expected while nothing is known."""
        self._spent, self._count = REMEMBERED_S, REMEMBERED_S / each

    def add(self, count: float, seconds: float) -> None:
        """So many took so long together."""
        kept = math.exp(-seconds / REMEMBERED_S)
        self._spent, self._count = kept * self._spent + seconds, kept * self._count + count

    @property
    def each(self) -> float:
        """Seconds."""
        return self._spent / self._count


class Refinement:
    """Of one image. Pure: `begin` after a jump, `take` rays, `shown` after each refresh."""

    def __init__(self, panel: Panel, period: float, cores: float = 1.0) -> None:
        """`period`: seconds between refreshes; `cores`: that this process has, as far as that is known."""
        self._panel, self._period = panel, period
        self._rays, self._pixels_made = (Cost(each / min(cores, 1.0)) for each in (RAY_S, PIXEL_S))
        self._traced_at, self._refreshing_s = -math.inf, 0.0  # the newest batch; spent on refreshes since
        self.scale = 1  # of the image that is swept: pixels of the panel that are one, in each direction
        self.active = self.first = False  # `first`: no image of it was shown yet
        self._sweep: Sweep | None = None
        self._known = NOWHERE  # positions of all sweeps
        self.swept = False  # each pixel of the image has had its ray

    def traced(self, rays: int, began: float, now: float, *, swept: bool) -> None:
        """So many rays were chosen, traced and stored from `began` on; `swept`: they are of the sweep.

        They cost what passed since those before, refreshes left out: others who want the cores take time between, too.
        """
        since = now - self._traced_at - self._refreshing_s
        self._rays.add(rays, since if since < PAUSE_S else now - began)
        self._traced_at, self._refreshing_s = now, 0.0
        if swept and self._sweep is not None:
            self.swept = self._sweep.left == 0

    def refreshed(self, scale: int, seconds: float) -> None:
        """A refresh of an image of that scale took so long."""
        self._pixels_made.add(self._pixels(scale), seconds)
        self._refreshing_s += seconds

    def begin(self, finest: int) -> int:
        """Begin after a jump, with no sample. Returns the scale of the first image; `finest`: the least it may be."""
        self.scale = finest
        most = FIRST_PERIODS * self._period / (self._rays.each + self._pixels_made.each)
        while self._pixels(self.scale) > most and self._pixels(2 * self.scale) >= FEWEST:
            self.scale *= 2
        self.active = self.first = True
        self._known = NOWHERE
        self._begin_sweep()
        return self.scale

    def take(self, rays: int) -> Float32:
        """Positions of the next rays, (n, 2) float32 panel pixels; none while there is nothing to sweep."""
        return self._sweep.take(rays) if self._sweep is not None else NOWHERE

    def shown(self, *, still: bool) -> None:
        """After a refresh: begin the next sweep if this one is shown; end where the camera moves, or sweeps take long.

        The finest image is not swept beyond: `scale` is its own where it is affordable, and the sampler fills it.
        """
        self.first, finer = False, self.scale // 2
        if not still:
            self.end()
        elif self.swept:
            self.scale = finer if finer and self._cost(finer) <= LONGEST_S else self.scale
            if self.scale == finer > 1:
                self._begin_sweep()
            else:
                self.end()

    def end(self) -> None:
        """Leave the rest to the sampler."""
        self.active = self.first = self.swept = False
        self._sweep = None

    def _begin_sweep(self) -> None:
        panel = of_fewer_pixels(self._panel, 1.0 / self.scale)
        self._sweep, self.swept = Sweep(self._panel.pixels, panel.pixels, self._known), False
        self._known = np.concatenate([self._known, self._sweep.xy])

    def _cost(self, scale: int) -> float:
        """Seconds that the rays of a finer sweep take."""
        return 0.75 * self._pixels(scale) * self._rays.each

    def _pixels(self, scale: int) -> float:
        return self._panel.pixels[0] * self._panel.pixels[1] / scale**2
