"""Choose the resolution of an image by what a machine gets done: samples a pixel and second, and time for refreshes."""

from __future__ import annotations

from wall.geometry.panels import Panel

FIRST, FEWEST = 1 << 18, 1 << 16  # pixels at most of the first image, when no rate is known; and of the coarsest
WINDOW_S, LEAST_REFRESHES = 0.5, 8  # between two choices; of jumps there are fewer in which the camera moves
POOR, RICH = 0.8, 11.0  # samples a pixel and second while the camera moves: below, coarser is better; above, finer
FEWER = 8.0  # times as many samples a pixel and second has an image of a quarter of the pixels: 7 to 8 were seen
PATIENCE = 10  # windows in which what was too fine for the machine is not tried again
ENOUGH_STILL = 0.5  # samples a pixel of a finer image, with which it begins where the camera stands
STILL_S = 0.15  # that the camera stands, where a finer image goes on from what this one shows
LONGEST_STILL_S = 2.0  # where plain surfaces want no more samples


def first_scale(panel: Panel) -> int:
    """The scale that an image of a panel begins with."""
    return scale_for(panel, FIRST)


def scale_for(panel: Panel, most: int) -> int:
    """The edge, in pixels of a panel, of the squares that are one pixel in an image of `most` pixels: a power of 2.

    1 where rows are shown one after the other: each pixel has a moment of its own.
    """
    scale, pixels = 1, panel.pixels[0] * panel.pixels[1]
    while pixels > most * scale * scale and panel.scan is None:
        scale *= 2
    return scale


class ResolutionChoice:
    """Of one image. `note` samples; `after` every refresh."""

    def __init__(self, panel: Panel) -> None:
        self._pixels, self._coarsest = panel.pixels[0] * panel.pixels[1], scale_for(panel, FEWEST)
        self.scale = self._moving = first_scale(panel)  # of now; while the camera moved last
        self._began, self._samples, self._refreshes = float("-inf"), 0, 0  # of this window
        self._still, self._patience = False, 0

    def note(self, samples: int) -> None:
        """So many samples came."""
        self._samples += samples

    def after(self, now: float, *, still: bool, stored: int, at_rest: bool = False) -> int:
        """The scale from the next refresh on: how many pixels of the panel are one, in each direction.

        `still`: the camera stood in the refresh that ended at `now`, seconds; `stored`: samples that it is of;
        `at_rest`: a finer image goes on from what this one shows.
        """
        elapsed, self._refreshes = now - self._began, self._refreshes + 1
        if still != self._still or self._began == float("-inf"):
            self._still = still
            self._begin(now, self.scale if still else self._moving)
        elif elapsed >= WINDOW_S and not still and self._refreshes >= LEAST_REFRESHES:
            self._moving = self._of_moving(self._samples / elapsed)
            self._begin(now, self._moving)
        elif elapsed >= (STILL_S if at_rest else WINDOW_S) and still and self.scale > 1:
            finer = 4.0 * self._pixels / self.scale**2
            if stored >= ENOUGH_STILL * finer or elapsed >= LONGEST_STILL_S:
                self._begin(now, self.scale // 2)
        return self.scale

    def resume(self, now: float, scale: int, *, still: bool) -> None:
        """Go on from a scale that something else chose, the camera moves or stands."""
        self._still = still
        self._moving = self._moving if still else scale
        self._begin(now, scale)

    def _of_moving(self, samples: float) -> int:
        """The scale where so many samples came a second."""
        scale, rate, self._patience = self.scale, samples * self.scale**2 / self._pixels, max(self._patience - 1, 0)
        while rate < POOR and scale < self._coarsest:
            scale, rate, self._patience = 2 * scale, FEWER * rate, PATIENCE
        return scale // 2 if rate > RICH and scale > 1 and self._patience == 0 else scale

    def _begin(self, now: float, scale: int) -> None:
        self.scale, self._began, self._samples, self._refreshes = scale, now, 0, 0
