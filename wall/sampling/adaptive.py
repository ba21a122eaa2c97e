"""Adaptive frameless sampling: rays where the picture is expected to gain most, judged from the picture itself.

After Dayal, Woolley, Watson and Luebke, "Adaptive Frameless Rendering", 2005: tiles of the region are chosen by what
another sample is worth there. Gradients come from the reconstruction beneath the rays, without rays of their own, and
every new ray is also a probe: where it contradicts what was shown, its surroundings draw rays at once.
"""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np

from wall.core.data import Event, Float32, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.cut import Cut
from wall.sampling.kernels import adaptive as kernels
from wall.sampling.kernels import tiling as kernels_tiling
from wall.sampling.tiles import Division, Grid, Measured

FLOOR_MOVING, FLOOR_STILL = 3e-5, 1e-5  # squared display units; see docs/lab/quality.md
PACKETS_A_STEP = 4  # between two changes of the cut: of 64 rays
ENOUGH = 0.5 / 255.0  # half a step of 8 bits


class Beneath(Protocol):
    """The picture that the sampler judges by: reconstruction.picture.Picture."""

    radiance: Float32  # (h, w, 3)
    gathered: Float32  # (h + 2, w + 2, 4)
    still: Float32  # (h, w, 8)
    residual: Float32  # (rows, columns) of 16-pixel tiles: mean change of lighting that new samples find there
    nothing_moves: bool

    def refresh(self, event: Event, now: float) -> None: ...

    def insert(self, samples: Samples, base_time: float, event: Event) -> None: ...


class AdaptiveSampler:
    """Chooses for one region. `replan` after every refresh of the picture beneath; complete when no pixel gains."""

    coherent = False  # its packets span 16 pixels: at edges every ray goes its own way

    def __init__(
        self,
        rect: Rect,
        beneath: Beneath,
        *,
        batch: int,
        seed: int,
        tiling: Literal["grid", "cut"] = "grid",
        uniform: bool = False,
    ) -> None:
        """`uniform`: every pixel is worth the same, to measure what choosing is worth."""
        self._uniform = uniform
        self.beneath = beneath
        self._rect, self._batch, self._seed, self._sequence = rect, batch, seed, 0
        shape = (rect.height, rect.width)
        self._value, self._contrast = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self._density, self._score = np.zeros(shape, np.float32), np.ones(shape, np.float32)
        self.division: Division = (Cut if tiling == "cut" else Grid)(rect.width, rect.height)
        self._visits = np.zeros(shape, np.uint16)
        self._floor = np.float32(FLOOR_MOVING)

    def replan(self) -> None:
        """Score every pixel anew from the picture beneath."""
        if self._uniform:
            return
        b, (_, sums, tile_of, _) = self.beneath, self.division.tiles
        kernels.brightness(b.radiance, self._value)
        if b.nothing_moves:
            self._floor = np.float32(FLOOR_STILL)
            kernels.score_still(
                self._value, b.still, self._floor, np.float32(ENOUGH), self._contrast, self._density, self._score,
                tile_of, sums,
            )  # fmt: skip
        else:
            self._floor = np.float32(FLOOR_MOVING)
            kernels.score_moving(
                self._value, b.gathered, b.still, self._floor, self._contrast, self._density, self._score, tile_of, sums
            )
        self.division.balance(self._contrast, 0.0 if b.nothing_moves else float(b.residual.mean()))

    def measure(self) -> Measured:
        """What is known of each tile since the last replan."""
        listed, rects = self.division.listed, self.division.tiles.rects
        spatial, temporal, density = np.empty((3, len(listed)), np.float32)
        kernels_tiling.measure(
            rects, listed, self._contrast, self.beneath.residual, self._density, spatial, temporal, density
        )
        placed = rects[listed] + np.array([self._rect.x, self._rect.y, 0, 0])
        return Measured(rects=placed.astype(np.uint16), spatial=spatial, temporal=temporal, density=density)

    def forget(self, xy: Float32) -> None:
        """These never arrived: their pixels count as holes."""
        _, sums, tile_of, _ = self.division.tiles
        kernels.miss(xy, self._rect.x, self._rect.y, self._score, tile_of, sums)

    def choose(self, newest: Event, rays: int | None = None) -> Targets | None:
        packets = max(1, (self._batch if rays is None else rays) // kernels.PACKET)
        xy = np.empty((packets * kernels.PACKET, 2), np.float32)
        self._sequence += 1
        self.division.adjust(self._score, max(1, packets // PACKETS_A_STEP))
        rects, sums, _, order = self.division.tiles
        filled = kernels.draw(
            self._score, rects, order, sums, packets, self._seed, self._sequence, self._visits, self._rect.x,
            self._rect.y, xy,
        )  # fmt: skip
        return Targets(xy=xy[:filled], event=newest) if filled else None

    def observe(self, samples: Samples) -> None:
        if self._uniform:
            return
        _, sums, tile_of, _ = self.division.tiles
        kernels.learn(
            samples, self._rect.x, self._rect.y, self._floor, self.beneath.still, self.beneath.nothing_moves,
            np.float32(ENOUGH), self._contrast, self._density, self._score, tile_of, sums,
        )  # fmt: skip
