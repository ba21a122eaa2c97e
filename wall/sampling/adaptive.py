"""Adaptive frameless sampling: rays where they are expected to reduce the error of the reconstruction most.

After Dayal, Woolley, Watson and Luebke, "Adaptive Frameless Rendering", 2005: pixels are chosen by the expected
error reduction of another sample there. Gradients come from the reconstruction, without rays of their own, and
every new ray is also a gradient sample: where it contradicts what was shown, its surroundings draw rays at once.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from wall.core.data import Event, Float32, Rect, Samples
from wall.core.tone_mapping import AS_IT_IS, WHITES, Tone
from wall.deepbuffer.feedback import Feedback
from wall.sampling.base import Targets
from wall.sampling.cut import Cut
from wall.sampling.kernels import adaptive as kernels
from wall.sampling.kernels import scores as kernels_scores
from wall.sampling.tiles import Division, Grid, Measured

FLOOR_MOVING, FLOOR_STILL = np.float32(3e-5), np.float32(1e-5)  # squared display units; see docs/lab/quality.md
EVERY = 4  # pixels, across and down: one is looked at to know what all of them want
PACKETS_A_STEP = 4  # of 64 rays, between two changes of the cut
# pixels, edge of the square that a sample stands for: less than 1, since its neighbours are splatted to the same pixels
FOOTPRINT_MOVING, FOOTPRINT_STILL = 0.5, 0.25
ENOUGH = np.float32(0.5 / 255.0)  # display units: half a step of 8 bits


class AdaptiveSampler:
    """Chooses for one region. `replan` after every refresh of its reconstruction; complete when no pixel gains."""

    coherent = False  # its packets span a tile or more: at edges every ray goes its own way

    def __init__(
        self,
        rect: Rect,
        feedback: Feedback,
        *,
        batch: int,
        seed: int,
        tiling: Literal["grid", "cut"] = "grid",
        uniform: bool = False,
    ) -> None:
        """`feedback` is of the reconstruction that the samples go to, for `observe` before the first `replan`.

        `uniform`: every pixel gains the same, to measure what choosing gains.
        """
        self._uniform, self._feedback = uniform, feedback
        self._rect, self._batch, self._sequence = rect, batch, 0
        shape = (rect.height, rect.width)
        contrast, density, score = np.zeros((3, *shape), np.float32)
        score[:] = 1.0
        self._scores = kernels_scores.Scores(contrast, density, score)
        self._pixels = kernels.Pixels(np.zeros(shape, np.uint16), seed, rect.x, rect.y)
        self.division: Division = (Cut if tiling == "cut" else Grid)(rect.width, rect.height)
        self._floor, self._footprint = FLOOR_MOVING, FOOTPRINT_MOVING
        self._tone = shown_as(AS_IT_IS)

    def replan(self, feedback: Feedback) -> None:
        """Score every pixel anew."""
        self._feedback = feedback
        if self._uniform:
            return
        scores, accumulation = self._scores, feedback.accumulation
        if feedback.nothing_moves:
            self._floor, self._footprint = FLOOR_STILL, FOOTPRINT_STILL
            kernels_scores.score_still(feedback.resolved, accumulation, self._floor, ENOUGH, self._tone, scores)
        else:
            self._floor, self._footprint = FLOOR_MOVING, FOOTPRINT_MOVING
            kernels_scores.score_moving(
                feedback.resolved, feedback.sample_density, accumulation, feedback.accumulating.any(axis=1),
                self._floor, self._tone, scores,
            )  # fmt: skip
        change = 0.0 if feedback.nothing_moves else float(feedback.temporal_gradient.mean())
        self.division.balance(scores.contrast, change)

    def measure(self) -> Measured:
        """What is known of each tile since the last replan."""
        (rects, _, tile_of, order), scores = self.division.tiles, self._scores
        areas = rects[order, 2] * rects[order, 3]
        contrast, density = (
            np.bincount(tile_of.ravel(), image.ravel(), len(rects))[order] / areas
            for image in (np.sqrt(scores.contrast), scores.density)
        )
        placed = rects[order] + np.array([self._rect.x, self._rect.y, 0, 0])
        return Measured(placed.astype(np.uint16), contrast.astype(np.float32), density.astype(np.float32))

    @property
    def score(self) -> Float32:
        """(h, w) expected error reduction of one more sample in each pixel, squared display units."""
        score: Float32 = self._scores.score
        return score

    @property
    def demand(self) -> float:
        """How many samples its pixels want, up to a factor, however many they have: what to divide work by.

        A sample's expected error reduction falls with the square of their number, and the least error is where it is
        even. So a pixel wants as many as the root of what a second sample would reduce. Of one pixel in EVERY^2.
        """
        contrast = self._scores.contrast[::EVERY, ::EVERY]
        return EVERY * EVERY * float(np.sqrt(0.5 * contrast + FLOOR_MOVING).sum())

    def forget(self, samples: Samples) -> None:
        """Score the pixels of these samples as holes until the next replan; the reconstruction forgets them too."""
        kernels_scores.mark_lost(samples, self._rect.x, self._rect.y, self._scores.score)

    def choose(self, newest: Event, rays: int | None = None) -> Targets | None:
        """The next `rays`, in whole packets and at least one; None where no pixel gains, under the exposure before."""
        packets = max(1, (self._batch if rays is None else rays) // kernels.PACKET)
        xy = np.empty((packets * kernels.PACKET, 2), np.float32)
        self._sequence, self._tone = self._sequence + 1, shown_as(newest.tone)
        score = self._scores.score
        self.division.adjust(score, max(1, packets // PACKETS_A_STEP))
        filled = kernels.draw(score, self.division.tiles, self._pixels, self._sequence, xy)
        if not filled:
            return None
        return Targets(xy=xy[:filled], event=newest, footprint=self._footprint)

    def observe(self, samples: Samples) -> None:
        """Update scores by samples that the reconstruction has taken in, and has written their `change` to."""
        if not self._uniform:
            kernels_scores.learn(
                samples, self._rect.x, self._rect.y, self._feedback.accumulation, self._feedback.nothing_moves,
                self._floor, ENOUGH, self._tone, self._scores,
            )  # fmt: skip


def shown_as(tone: Tone) -> kernels_scores.ShownAs:
    """How light is shown, as kernels take it."""
    return kernels_scores.ShownAs(tone.gain, tone.code, np.float32(WHITES[tone.code]))
