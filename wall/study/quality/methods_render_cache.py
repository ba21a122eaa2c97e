"""The Render Cache: points with a colour, reprojected and filtered at every refresh; rays where the picture is old.

Walter, Drettakis, Parker 1999; Walter, Drettakis, Greenberg 2002 (7x7 prefilter, bytes of age). As there: 1.5 points a
pixel, one shown a pixel, depth cull against 3x3, weights 4/2/1, priorities by age with error diffusion, ageing where a
new sample disagrees. Recalled or chosen here, none of it to the method's harm: the constants below, that a point is
replaced by the sample of the pixel it is shown at, that pixels without any neighbour are filled by push-pull instead of
staying black, that rays are traced at the newest input although their pixels were chosen at the last refresh.

`render_cache` keeps points of the world, as the original; `render_cache_object` points of objects, which follow rigid
motion: the stronger one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.reconstruction.pose import Pose
from wall.study.quality.baseline import FramelessMethod, WorldPose, pose_of, world_pose_of
from wall.study.quality.filling import fill_holes
from wall.study.quality.kernels import render_cache as kernels
from wall.study.quality.method import Method, Setup

POINTS_A_PIXEL = 1.5
AGE_AT_TURN = 128.0  # reached by an undisturbed point when its turn comes again
HIDDEN_AGES = 32.0  # a refresh, beside
LEAST_CHANGE, FULL_CHANGE = 0.03, 0.25  # of the square root of radiance: noise; a different surface
CHANGE_AGES = 160.0  # at most, at once
CHANGE_REACH = 2  # pixels around a sample that disagrees


class RenderCache:
    coherent = False  # pixels of a batch lie anywhere

    def __init__(self, setup: Setup, *, follow_objects: bool) -> None:
        width, height = setup.size
        self._setup, self._follow = setup, follow_objects
        capacity = int(POINTS_A_PIXEL * width * height)
        self._place = np.full((capacity, 4), -1.0, np.float32)
        self._colour = np.zeros((capacity, 3), np.float32)
        self._age = np.zeros(capacity, np.float32)
        self._seat = np.full(capacity, -1, np.int32)
        self._owner, self._kept = np.full((2, height, width), -1, np.int32)
        self._depth = np.full((height, width), np.inf, np.float32)
        self._priority = np.ones((height, width), np.float32)
        self._picture = np.zeros((height, width, 4), np.float32)
        self._chosen = np.zeros((width * height, 2), np.int32)
        self._count = self._at = self._hand = self._plans = 0
        self._wanted = setup.rate / setup.refresh_hz
        self._since = 0  # rays since the last refresh
        self._pose: tuple[Event, Pose | WorldPose] | None = None

    def choose(self, count: int, event: Event, now: float) -> Float32:
        if self._at >= self._count:
            self._plan()
        pixels = self._chosen[self._at : min(self._at + count, self._count)]
        self._at += len(pixels)
        xy: Float32 = (pixels + 0.5).astype(np.float32)
        return xy

    def take(self, samples: Samples, event: Event, now: float) -> None:
        pose = self._pose_of(event)
        self._since += len(samples) if now > 0.0 else 0  # the free picture says nothing of the rate
        self._hand = kernels.store(
            samples, pose.frame, pose.corner, pose.object_from_eye, self._place, self._colour, self._age, self._owner,
            self._seat, self._hand, np.float32(LEAST_CHANGE), np.float32(FULL_CHANGE), CHANGE_REACH,
            np.float32(CHANGE_AGES),
        )  # fmt: skip

    def picture(self, event: Event, now: float) -> Float32:
        table = self._pose_of(event).panel_from_object
        turn = self._since / self._owner.size  # how much of the picture was sampled since
        self._age += np.float32(AGE_AT_TURN * turn)
        np.minimum(self._age, kernels.OLDEST, out=self._age)
        kernels.project_points(
            self._place, self._age, table, self._owner, self._depth, self._seat, np.float32(HIDDEN_AGES)
        )
        kernels.cull(self._owner, self._depth, self._kept)
        kernels.interpolate(self._kept, self._colour, self._age, self._picture, self._priority)
        if not self._picture[:, :, 3].all():
            fill_holes(self._picture)
        self._wanted, self._since = max(self._since, 1), 0
        self._plan()
        return self._picture[:, :, :3]

    def _plan(self) -> None:
        """Choose the pixels of about one refresh, in random order."""
        self._plans += 1
        first_error = self._plans * 0.6180339887 % 1.0 - 0.5
        wanted = float(math.ceil(self._wanted))
        self._count = kernels.choose_pixels(self._priority, wanted, first_error, self._chosen)
        self._at = 0
        kernels.shuffle_rows(self._chosen, self._count, self._setup.seed * 1_000_003 + self._plans)

    def _pose_of(self, event: Event) -> Pose | WorldPose:
        if self._pose is None or self._pose[0] is not event:
            made = pose_of(self._setup, event) if self._follow else world_pose_of(self._setup, event)
            self._pose = (event, made)
        return self._pose[1]


def render_cache(follow_objects: bool, setup: Setup) -> FramelessMethod:
    return FramelessMethod(setup, RenderCache(setup, follow_objects=follow_objects))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "render_cache": partial(render_cache, False),
    "render_cache_object": partial(render_cache, True),
}
