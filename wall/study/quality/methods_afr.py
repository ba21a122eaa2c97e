"""Adaptive frameless rendering as published: K-D cut, crosshairs, reprojected deep buffers, space-time scatter filters.

Dayal, Woolley, Watson, Luebke, EGSR 2005, and Woolley et al., "The Ultimate Display: Where Will All the Pixels Come
From?", IEEE Computer 2005. The EGSR text was not at hand; what follows was rebuilt from the article, re-implementations
and memory.

From the sources: tiles picked with equal probability and places in them at random; samples weigh exp(-3.47 age) in a
tile's variance; two tiles merged and one split every 25 samples; five rays of a crosshair and a sixth, later, at the
same place, all counted; a few old samples reprojected for each new one, all at every refresh; filter extents
e_x d_x = e_y d_y = e_t d_t, e_x e_y e_t = V = 1 / (samples a pixel in the last second); 3 sigma Gaussian in space,
exponential in time, scattered.

Recalled: the number of tiles grows while colour change by pixel times mean tile width is above colour change by second
times mean sample age, and shrinks while it is below.

Changed in its favour: a filter's volume holds two samples, chosen on three of the scenes it is measured on.

Inferred: importance = variance times area, with room for what was not yet seen; the sixth ray goes where the old
centre's point is seen now, so that only change of colour counts, not motion; bounds of extents and gradients; eight
samples a pixel stored; what nothing reaches is filled by push-pull.

`afr2005` reprojects points of the world under the camera; `afr2005_object` points of objects: a stronger variant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Samples
from wall.reconstruction.pose import Pose
from wall.study.quality.baseline import FramelessMethod, WorldPose, pose_of, world_pose_of
from wall.study.quality.filling import fill_holes
from wall.study.quality.kernels import afr as kernels
from wall.study.quality.kernels import afr_image as picture_kernels
from wall.study.quality.method import Method, Setup

SAMPLES_A_PIXEL = 8  # kept
SMALLEST_TILE = 4  # pixels; a crosshair fills most of it
SAMPLES_A_STEP = 25  # between two changes of the cut
LEAST_TILES, FIRST_TILES = 32, 256
BALANCED = 1.2  # ratio of spatial to temporal change within which the number of tiles stays
EPOCH_S = 4.0  # weights grow by exp(3.47 EPOCH_S) = 1e6 before they are brought back
FILTER_SAMPLES = 2.0  # in a filter's volume; the published 1 gave 1 to 5 % more error, 4 from 2 % less to 3 % more


class Tree:
    """The K-D tree of the panel and the cut through it."""

    def __init__(self, width: int, height: int) -> None:
        n = 2 * width * height
        rect, child, parent = np.zeros((n, 4), np.int32), np.zeros((n, 2), np.int32), np.zeros(n, np.int32)
        self.cell_of = np.zeros((height, width), np.int32)
        n = kernels.build_tree(width, height, SMALLEST_TILE, rect, child, parent, self.cell_of)
        self.rect, self.child, self.parent = rect[:n].copy(), child[:n].copy(), parent[:n].copy()
        self.sums = np.zeros((n, kernels.SUMS))
        self.cut, self.spot, self.count = np.zeros(n, np.int32), np.full(n, -1, np.int32), 1
        self.spot[0] = 0
        self.tile_of = np.zeros(n, np.int32)

    def step(self, trend: int, fading: float) -> None:
        self.count = kernels.adjust(
            self.cut, self.count, self.spot, self.rect, self.child, self.parent, self.sums, fading, trend, LEAST_TILES,
            (len(self.parent) + 1) // 2,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class _Aimed:
    """The crosshairs under way; see kernels_afr.aim."""

    tile: NDArray[np.int32]
    begin: NDArray[np.int32]
    then: Float32


class AdaptiveFrameless:
    coherent = False  # crosshairs lie anywhere

    def __init__(self, setup: Setup, *, follow_objects: bool) -> None:
        width, height = setup.size
        self._setup, self._follow = setup, follow_objects
        self._tree = Tree(width, height)
        n, capacity = len(self._tree.parent), SAMPLES_A_PIXEL * width * height
        self._place = np.full((capacity, 4), -1.0, np.float32)
        self._colour = np.zeros((capacity, 3), np.float32)
        self._state = np.zeros((capacity, 7))
        self._cell = np.full(capacity, -1, np.int32)
        self._screen = np.zeros((capacity, 3), np.float32)
        self._hands = np.zeros(3, np.int64)
        self._last_place, self._last_value = np.full((n, 4), -1.0, np.float32), np.zeros((n, 2), np.float32)
        self._recent, self._extent = np.zeros(n), np.zeros((n, 3), np.float32)
        self._nearest = np.zeros((height, width), np.float32)
        self._gathered = np.zeros((height, width, 4), np.float32)
        self._epoch, self._mean_age, self._crosses, self._unstepped = 0.0, 0.1, 0, 0
        self._aimed: _Aimed | None = None
        self._pose: tuple[Event, Pose | WorldPose] | None = None

    def choose(self, count: int, event: Event, now: float) -> Float32:
        crosses = count // (kernels.CROSS + 1)
        xy = np.empty((crosses * (kernels.CROSS + 1), 2), np.float32)
        tile, begin = np.empty(crosses, np.int32), np.empty(crosses + 1, np.int32)
        then = np.empty((crosses, 2), np.float32)
        tree, table = self._tree, self._pose_of(event).panel_from_object
        rays = kernels.aim(
            tree.cut, tree.count, tree.rect, self._setup.seed, self._crosses, self._last_place, self._last_value,
            table, xy, tile, begin, then,
        )  # fmt: skip
        self._crosses += crosses
        self._aimed = _Aimed(tile=tile, begin=begin, then=then)
        return xy[:rays]

    def take(self, samples: Samples, event: Event, now: float) -> None:
        slopes = np.zeros((len(samples), 4), np.float32)
        aimed = self._aimed if self._aimed and self._aimed.begin[-1] == len(samples) else None  # no sample was dropped
        if aimed:
            kernels.gradients(samples, aimed.tile, aimed.begin, aimed.then, now, self._last_value, slopes)
        if now - self._epoch > EPOCH_S:
            self._rebase(now)
        pose, tree, first = self._pose_of(event), self._tree, int(self._hands[0])
        kernels.store(
            samples, slopes, math.exp(kernels.AGEING * (now - self._epoch)), now, pose.frame, pose.corner,
            pose.object_from_eye, pose.panel_from_object, tree.cell_of, tree.parent, tree.sums, self._place,
            self._colour, self._state, self._cell, self._hands,
        )  # fmt: skip
        if aimed:
            kernels.remember(aimed.tile, aimed.begin, first, self._place, self._last_place)
        self._retile(len(samples) if self._aimed else SAMPLES_A_STEP * FIRST_TILES, now)

    def picture(self, event: Event, now: float) -> Float32:
        tree, count = self._tree, int(self._hands[2])
        picture_kernels.tiles_of_cells(tree.rect, tree.child, tree.parent, tree.spot, tree.tile_of)
        self._mean_age = picture_kernels.look(
            self._place, self._state, count, self._pose_of(event).panel_from_object, now, tree.cell_of, tree.tile_of,
            self._screen, self._nearest, self._recent,
        )  # fmt: skip
        picture_kernels.extents(
            tree.cut, tree.count, tree.rect, tree.parent, tree.sums, self._fading(now), self._recent, FILTER_SAMPLES,
            self._extent,
        )  # fmt: skip
        picture_kernels.scatter(
            self._screen, self._colour, self._state, count, now, self._nearest, tree.cell_of, tree.tile_of,
            self._extent, self._gathered,
        )  # fmt: skip
        picture_kernels.normalise(self._gathered)
        fill_holes(self._gathered)
        return self._gathered[:, :, :3]

    def _retile(self, samples: int, now: float) -> None:
        """The steps that so many new samples are worth; the free picture's make the first tiles."""
        self._unstepped += samples
        steps, self._unstepped = divmod(self._unstepped, SAMPLES_A_STEP)
        for _ in range(steps):
            self._tree.step(self._trend() if self._aimed else 1, self._fading(now))

    def _trend(self) -> int:
        root = self._tree.sums[0]
        spatial = (root[kernels.SLOPE_X] + root[kernels.SLOPE_Y]) / 2 * math.sqrt(self._nearest.size / self._tree.count)
        temporal = root[kernels.SLOPE_T] * self._mean_age
        return int(spatial > temporal * BALANCED) - int(temporal > spatial * BALANCED)

    def _fading(self, now: float) -> float:
        return math.exp(-kernels.AGEING * (now - self._epoch))

    def _rebase(self, now: float) -> None:
        """Bring weights, which only grow, back to 1 for the present."""
        fading = self._fading(now)
        self._tree.sums *= fading
        self._state[:, 1] *= fading
        self._epoch = now

    def _pose_of(self, event: Event) -> Pose | WorldPose:
        if self._pose is None or self._pose[0] is not event:
            made = pose_of(self._setup, event) if self._follow else world_pose_of(self._setup, event)
            self._pose = (event, made)
        return self._pose[1]


def afr2005(follow_objects: bool, setup: Setup) -> FramelessMethod:
    return FramelessMethod(setup, AdaptiveFrameless(setup, follow_objects=follow_objects))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "afr2005": partial(afr2005, False),
    "afr2005_object": partial(afr2005, True),
}
