"""Adaptive frameless rendering as published: K-D cut, crosshairs, reprojected deep buffers, space-time scatter filters.

Dayal, Woolley, Watson, Luebke, EGSR 2005, and Woolley et al., "The Ultimate Display: Where Will All the Pixels Come
From?", IEEE Computer 2005. The EGSR text was not at hand; what follows was rebuilt from the article, re-implementations
and memory.

From the sources: tiles picked with equal probability and positions in them at random; samples weigh exp(-3.47 age) in a
tile's variance; two tiles merged and one split every 25 samples; five rays of a crosshair and a sixth, later, at the
same position, all counted; a few old samples reprojected for each new one, all at every refresh; filter extents
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
from functools import partial

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramelessMethod, Maps, fill_holes
from wall.study.quality.kernels import afr as kernels
from wall.study.quality.kernels import afr_image as image_kernels
from wall.study.quality.method import Method, Setup

SAMPLES_A_PIXEL = 8  # kept
SMALLEST_TILE = 4  # pixels; a crosshair fills most of it
SAMPLES_A_STEP = 25  # between two changes of the cut
LEAST_TILES, FIRST_TILES = 32, 256
BALANCED = 1.2  # ratio of spatial to temporal change within which the number of tiles stays
EPOCH_S = 4.0  # weights grow by exp(3.47 EPOCH_S) = 1e6 before they are brought back
FILTER_SAMPLES = 2.0  # in a filter's volume; the published 1 gave 1 to 5 % more error, 4 from 2 % less to 3 % more


def tree_of(width: int, height: int) -> kernels.Tree:
    """The K-D tree of a panel; its sums are empty."""
    n = 2 * width * height
    room = kernels.Tree(
        rect=np.zeros((n, 4), np.int32), child=np.zeros((n, 2), np.int32), parent=np.zeros(n, np.int32),
        cell_of=np.zeros((height, width), np.int32), sums=np.zeros((n, kernels.SUMS)),
    )  # fmt: skip
    n = kernels.build_tree(SMALLEST_TILE, room)
    used = {name: getattr(room, name)[:n].copy() for name in ("rect", "child", "parent", "sums")}
    return room._replace(**used)


class AdaptiveFrameless:
    """A Renderer: the sampler and the reconstruction of 2005."""

    coherent = False  # crosshairs lie anywhere

    def __init__(self, setup: Setup, *, follow_objects: bool) -> None:
        width, height = setup.size
        self._setup, self._maps = setup, Maps(setup, follow_objects=follow_objects)
        self._tree = tree_of(width, height)
        n, capacity = len(self._tree.parent), SAMPLES_A_PIXEL * width * height
        self._cut = kernels.Cut(nodes=np.zeros(n, np.int32), slot=np.full(n, -1, np.int32))
        self._cut.slot[0], self._tiles = 0, 1
        self._ring = kernels.SampleRing(
            position=np.full((capacity, 4), -1.0, np.float32), radiance=np.zeros((capacity, 3), np.float32),
            state=np.zeros((capacity, 7)), cell=np.full(capacity, -1, np.int32), cursors=np.zeros(3, np.int64),
        )  # fmt: skip
        self._centres = kernels.Centres(np.full((n, 4), -1.0, np.float32), np.zeros((n, 2), np.float32))
        self._image = image_kernels.Image(
            tile_of=np.zeros(n, np.int32), screen=np.zeros((capacity, 3), np.float32),
            nearest=np.zeros((height, width), np.float32), recent=np.zeros(n), extent=np.zeros((n, 3), np.float32),
            sums=np.zeros((height, width, 4), np.float32),
        )  # fmt: skip
        self._epoch, self._mean_age, self._crosses, self._unstepped = 0.0, 0.1, 0, 0
        self._aimed: kernels.Crosshairs | None = None  # under way

    def choose(self, count: int, event: Event, now: float) -> Float32:
        """See Renderer."""
        crosses = count // (kernels.CROSS + 1)
        xy = np.empty((crosses * (kernels.CROSS + 1), 2), np.float32)
        self._aimed = kernels.Crosshairs(
            np.empty(crosses, np.int32), np.empty(crosses + 1, np.int32), np.empty((crosses, 2), np.float32)
        )
        rays = kernels.aim(
            self._cut, self._tiles, self._tree.rect, self._setup.seed, self._crosses, self._centres,
            self._maps.of(event).panel_from_object, xy, self._aimed,
        )  # fmt: skip
        self._crosses += crosses
        return xy[:rays]

    def take(self, samples: Samples, event: Event, now: float) -> None:
        """See Renderer."""
        slopes = np.zeros((len(samples), 4), np.float32)
        aimed = self._aimed if self._aimed and self._aimed.begin[-1] == len(samples) else None  # no sample was dropped
        if aimed:
            kernels.gradients(samples, aimed, now, self._centres.value, slopes)
        if now - self._epoch > EPOCH_S:
            self._rebase(now)
        ring, first = self._ring, int(self._ring.cursors[kernels.OVERWRITE])
        weight = math.exp(kernels.AGEING * (now - self._epoch))
        kernels.store(samples, slopes, weight, now, self._maps.of(event), self._tree, ring)
        if aimed:
            kernels.remember(aimed, first, ring.position, self._centres)
        self._retile(len(samples) if self._aimed else SAMPLES_A_STEP * FIRST_TILES, now)

    def image(self, event: Event, now: float) -> Float32:
        """See Renderer."""
        tree, ring, made = self._tree, self._ring, self._image
        image_kernels.tiles_of_cells(tree, self._cut.slot, made.tile_of)
        table = self._maps.of(event).panel_from_object
        self._mean_age = image_kernels.project(ring, table, now, tree.cell_of, made)
        image_kernels.extents(self._cut.nodes[: self._tiles], tree, self._fading(now), FILTER_SAMPLES, made)
        image_kernels.scatter(ring, now, tree.cell_of, made)
        image_kernels.normalise(made.sums)
        fill_holes(made.sums)
        shown: Float32 = made.sums[:, :, :3]
        return shown

    def _retile(self, samples: int, now: float) -> None:
        """Take the steps that so many new samples allow; those of the free image make the first tiles."""
        self._unstepped += samples
        steps, self._unstepped = divmod(self._unstepped, SAMPLES_A_STEP)
        most, fading = (len(self._tree.parent) + 1) // 2, self._fading(now)
        for _ in range(steps):
            trend = self._trend() if self._aimed else 1
            self._tiles = kernels.adjust(self._cut, self._tiles, self._tree, fading, trend, LEAST_TILES, most)

    def _trend(self) -> int:
        """Whether tiles should become more (1), fewer (-1) or stay as many (0)."""
        root, pixels = self._tree.sums[0], self._tree.cell_of.size
        spatial = (root[kernels.SLOPE_X] + root[kernels.SLOPE_Y]) / 2 * math.sqrt(pixels / self._tiles)
        temporal = root[kernels.SLOPE_T] * self._mean_age
        return int(spatial > temporal * BALANCED) - int(temporal > spatial * BALANCED)

    def _fading(self, now: float) -> float:
        return math.exp(-kernels.AGEING * (now - self._epoch))

    def _rebase(self, now: float) -> None:
        """Bring weights, which only grow, back to 1 for the present."""
        fading = self._fading(now)
        self._tree.sums[:] *= fading
        self._ring.state[:, kernels.STORED_WEIGHT] *= fading
        self._epoch = now


def afr2005(follow_objects: bool, setup: Setup) -> FramelessMethod:
    """Returns adaptive frameless rendering as published in 2005."""
    return FramelessMethod(setup, AdaptiveFrameless(setup, follow_objects=follow_objects))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "afr2005": partial(afr2005, False),
    "afr2005_object": partial(afr2005, True),
}
