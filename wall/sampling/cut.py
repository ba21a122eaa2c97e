"""The K-D cut: a region divided into tiles of about equal importance, changed in small steps.

After Dayal, Woolley, Watson and Luebke 2005 (as told in Woolley et al., "The Ultimate Display: Where Will All the
Pixels Come From?", IEEE Computer 2005): the leaves of a K-D tree are the tiles; unimportant siblings are merged and
important tiles split, a few at a time, so that small tiles gather where much is to be gained.

How many tiles: "when temporal colour gradients dominate, the number of tiles drops; when spatial gradients dominate, it
increases" (there, in short). The rule behind it, as recalled, holds the change over a tile and over a sample's life
in balance,

    (dC/ds) S = K (dC/dt) T,    S = sqrt(A / N): mean edge of N tiles over A pixels;  T: mean age of samples.

dC/ds is the mean contrast of the reconstruction to its neighbours, display units a pixel. (dC/dt) T needs no gradients
of its own: it is the change that new samples find against the samples shown, whose age is T. So the balance is at

    N* = A (dC/ds / (K (dC/dt) T))^2,

and N moves GAIN of the way to it (of log N) at every refresh. K is ours: samples that follow camera and objects leave
so little change in time (a tenth of one pixel's contrast) that with K = 1 space would always dominate.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.data import Float32
from wall.sampling.kernels import cut as kernels
from wall.sampling.kernels.adaptive import Tiles

FINE, COARSE = 16, 40  # pixels, mean edge of the most and the fewest tiles
BALANCE = 200.0  # K: puts the four scenes of `measure quality` between FINE and COARSE
GAIN = 0.125  # of the way to balance, at every refresh


class Cut:
    """A Division: leaves of a K-D tree over (h, w) pixels."""

    def __init__(self, width: int, height: int) -> None:
        area = width * height
        self._range = (max(1.0, area / COARSE**2), max(1.0, area / FINE**2))
        least = kernels.LEAST_EDGE
        capacity = 2 * max(1, width // least) * max(1, height // least)  # no cut can have more leaves than half of it
        vacant, order, parent = np.zeros((3, capacity), np.int32)
        self.tree = kernels.Tree(
            child=np.zeros((capacity, 2), np.int32), parent=parent, vacant=vacant, order=order,
            state=np.zeros(4, np.int64),
        )  # fmt: skip
        self.wanted = math.sqrt(self._range[0] * self._range[1])
        self.tiles = Tiles(
            rects=np.zeros((capacity, 4), np.int32), sums=np.zeros(capacity, np.float64),
            tile_of=np.zeros((height, width), np.int32), order=order[:1],
        )  # fmt: skip
        kernels.plant(width, height, self.tiles, self.tree)
        while self.adjust(np.ones((height, width), np.float32), capacity):
            pass

    def adjust(self, score: Float32, steps: int) -> int:
        """Take at most `steps` splits and merges; returns how many."""
        taken = kernels.adjust(score, self.wanted, steps, self.tiles, self.tree)
        if taken:
            self.tiles = self.tiles._replace(order=self.tree.order[: self.tree.state[kernels.LEAVES]])
        return int(taken)

    def balance(self, contrast: Float32, change: float) -> None:
        """Take one step of the rule. contrast : (h, w) float32, squared display units; change : display units"""
        slope = float(np.sqrt(contrast).mean())
        edge = min(max(BALANCE * change / max(slope, 1e-6), FINE), COARSE)  # S at the balance
        goal = max(1.0, contrast.size / edge**2)
        self.wanted *= (goal / self.wanted) ** GAIN
