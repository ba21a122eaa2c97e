"""The Render Cache: points with a colour, reprojected and filtered at every refresh; rays where the image is old.

Walter, Drettakis, Parker 1999; Walter, Drettakis, Greenberg 2002 (7x7 prefilter, bytes of age). As there: 1.5 points a
pixel, one shown a pixel, depth cull against 3x3, weights 4/2/1, priorities by age with error diffusion, ageing where a
new sample disagrees. Recalled or chosen here, none of it to the method's harm: the constants below, that a point is
replaced by the sample of the pixel it is shown at, that pixels without any neighbour are filled by push-pull instead of
staying black, that rays are traced at the newest input although their pixels were chosen at the last refresh.

`render_cache` keeps points of the world, as the original; `render_cache_object` points of objects, which follow rigid
motion: the stronger one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramelessMethod, Maps, fill_holes
from wall.study.quality.kernels import render_cache as kernels
from wall.study.quality.method import Method, Setup
from wall.study.quality.pixel_plan import PixelPlan

POINTS_A_PIXEL = 1.5
AGE_AT_TURN = 128.0  # reached by an undisturbed point when its turn comes again


class RenderCache:
    """Render cache: reprojects cached points and samples where they are old or missing."""

    coherent = False  # pixels of a batch lie anywhere

    def __init__(self, setup: Setup, *, follow_objects: bool) -> None:
        width, height = setup.size
        self._maps = Maps(setup, follow_objects=follow_objects)
        capacity = int(POINTS_A_PIXEL * width * height)
        owner, self._kept = np.full((2, height, width), -1, np.int32)
        self._cache = kernels.Cache(
            position=np.full((capacity, 4), -1.0, np.float32), radiance=np.zeros((capacity, 3), np.float32),
            age=np.zeros(capacity, np.float32), pixel=np.full(capacity, -1, np.int32), owner=owner,
            depth=np.full((height, width), np.inf, np.float32),
        )  # fmt: skip
        self._priority = np.ones((height, width), np.float32)
        self._image = np.zeros((height, width, 4), np.float32)
        self._plan = PixelPlan(self._priority, setup.seed)
        self._cursor = 0
        self._wanted = setup.rate / setup.refresh_hz
        self._since = 0  # rays since the last refresh

    def choose(self, count: int, event: Event, now: float) -> Float32:
        """Returns up to `count` pixel centres to trace next, (n, 2) float32."""
        pixels = self._plan.take(count, self._wanted)
        xy: Float32 = (pixels + 0.5).astype(np.float32)
        return xy

    def take(self, samples: Samples, event: Event, now: float) -> None:
        """Stores traced samples in the cache, over the oldest entries."""
        self._since += len(samples) if now > 0.0 else 0  # the free image says nothing of the rate
        self._cursor = kernels.store(samples, self._maps.of(event), self._cache, self._cursor)

    def image(self, event: Event, now: float) -> Float32:
        """Returns the image of the reprojected points, (h, w, 3) linear RGB."""
        cache = self._cache
        turn = self._since / cache.owner.size  # how much of the image was sampled since
        np.minimum(cache.age + np.float32(AGE_AT_TURN * turn), kernels.OLDEST, out=cache.age)
        kernels.project_points(cache, self._maps.of(event).panel_from_object)
        kernels.cull(cache.owner, cache.depth, self._kept)
        kernels.interpolate(self._kept, cache.radiance, cache.age, self._image, self._priority)
        if not self._image[:, :, 3].all():
            fill_holes(self._image)
        self._wanted, self._since = max(self._since, 1), 0
        self._plan.make(self._wanted)
        return self._image[:, :, :3]


def render_cache(follow_objects: bool, setup: Setup) -> FramelessMethod:
    """Returns the render cache as a frameless method."""
    return FramelessMethod(setup, RenderCache(setup, follow_objects=follow_objects))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "render_cache": partial(render_cache, False),
    "render_cache_object": partial(render_cache, True),
}
