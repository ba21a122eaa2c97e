"""Choose the resolution of an image by what a machine gets done: samples a pixel and second, and time for refreshes."""

from __future__ import annotations

from wall.geometry.panels import Panel

WHOLE = 1 << 18  # pixels of an image that is always made of all of them
WINDOW_S = 0.5  # between two choices
POOR = 0.3  # samples a pixel and second: with fewer a moving image of a quarter of the pixels is better
RICH = 2.0  # times that are expected of a finer one, or it would soon be coarse again
ENOUGH_STILL = 0.5  # samples a pixel of a finer image, with which it begins where nothing moves
LONGEST_STILL_S = 2.0  # where plain surfaces want no more samples


def coarsest(panel: Panel) -> int:
    """The edge, in pixels of a panel, of the squares that are one pixel in its coarsest image: a power of 2.

    1 where rows are shown one after the other: each pixel has a moment of its own.
    """
    scale, pixels = 1, panel.pixels[0] * panel.pixels[1]
    while pixels > WHOLE * scale * scale and panel.scan is None:
        scale *= 2
    return scale


class ResolutionChoice:
    """Of one image. `note` samples; `after` every refresh. It begins coarse, since nothing is known."""

    def __init__(self, panel: Panel) -> None:
        self._pixels, self._coarsest = panel.pixels[0] * panel.pixels[1], coarsest(panel)
        self.scale = self._moving = self._coarsest  # of now; of the last image that moved
        self._began, self._busy, self._samples = float("-inf"), 0.0, 0  # of this window; seconds of its refreshes
        self._still = False

    def note(self, samples: int) -> None:
        """So many samples came."""
        self._samples += samples

    def after(self, now: float, took: float, *, still: bool, stored: int) -> int:
        """The scale from the next refresh on: how many pixels of the panel are one, in each direction.

        `took`: seconds of the refresh that ended at `now`; `still`: nothing moved in it; `stored`: samples it is of.
        """
        if self._coarsest == 1:
            return 1
        if still != self._still or self._began == float("-inf"):
            self._still = still
            self._begin(now, self.scale if still else self._moving)
            return self.scale
        self._busy += took
        elapsed = now - self._began
        if elapsed >= WINDOW_S:
            finer = 4.0 * self._pixels / self.scale**2
            if not still:
                self._moving = self._of_moving(self._samples / elapsed, self._busy / elapsed)
                self._begin(now, self._moving)
            elif self.scale > 1 and (stored >= ENOUGH_STILL * finer or elapsed >= LONGEST_STILL_S):
                self._begin(now, self.scale // 2)
        return self.scale

    def _of_moving(self, samples: float, busy: float) -> int:
        """The scale where so many samples came a second, and refreshes took that share of the time."""
        scale, rate = self.scale, samples * self.scale**2 / self._pixels
        while rate < POOR and scale < self._coarsest:
            scale, rate = 2 * scale, 4.0 * rate
        left = max(1.0 - 4.0 * busy, 0.0) / max(1.0 - busy, 1e-6)  # of the time for rays, in a finer image
        return scale // 2 if scale > 1 and scale == self.scale and 0.25 * rate * left > RICH * POOR else scale

    def _begin(self, now: float, scale: int) -> None:
        self.scale, self._began, self._busy, self._samples = scale, now, 0.0, 0
