"""Tapestry: samples are the vertices of a triangle mesh around the eye, which is drawn at every refresh.

Simmons and Séquin, "Tapestry: A dynamic mesh-based display representation for interactive rendering" (2000). The
paper's text was not at hand; what follows was rebuilt from the abstracts of it and of Simmons's thesis (2001), and from
memory. As there: the mesh has Delaunay topology as seen from the eye and covers all of the image; it is reprojected
when the eye moves, and what then lies behind it is removed; new samples are wanted in triangles that are large, differ
in colour or depth between their corners, or are old, in proportion to that.

Changed: the triangles are made anew at every refresh, in the image plane, by scipy.spatial.Delaunay, where the original
inserts and removes vertices on a sphere: a better mesh, for more CPU time, which Qhull takes most of. Before that the
last mesh, without triangles that bridge two surfaces, is drawn under the new camera: vertices behind it are removed.

Chosen in the method's favour: up to four vertices a pixel, the newest of each quarter; four points a pixel are drawn
and averaged; a triangle that bridges surfaces shows the nearest vertex, a long one, as of uncovered places, the farther
surface; corners age where a new sample contradicts what is shown, and vertices that nothing confirms are removed.

`tapestry` keeps points of the world, as the original; `tapestry_object` points of objects: the stronger one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramelessMethod, Maps, fill_holes
from wall.study.quality.kernels import tapestry as kernels
from wall.study.quality.method import Method, Setup

VERTICES_A_PIXEL = 4.0  # kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What was chosen by hindsight, of those tried on three scenes at 400k rays a second."""

    age: float = 0.02  # of a triangle's weight, for each turn
    bridging: float = 0.6
    least: float = 0.02
    contrast: float = 1.0
    power: float = 1.0  # of the area
    doubt: float = 4.0  # turns that vertices age around a sample that contradicts


BEST = Tuning()
REJECTED = 1.25  # positions chosen for each that is wanted: some lie outside of the image


class Tapestry:
    """A Renderer: the mesh of samples."""

    coherent = False  # triangles of a batch lie anywhere

    def __init__(self, setup: Setup, *, follow_objects: bool, tuning: Tuning = BEST) -> None:
        width, height = setup.size
        self._setup, self._maps = setup, Maps(setup, follow_objects=follow_objects)
        self._tuning = tuning
        capacity = kernels.FRAME + int(VERTICES_A_PIXEL * width * height)
        self._vertices = kernels.Vertices(
            position=np.full((capacity, 4), -1.0, np.float32), radiance=np.zeros((capacity, 3), np.float32),
            age=np.zeros(capacity, np.float32), screen=np.full((capacity, 3), -1.0, np.float32),
            meshed=np.zeros(capacity, np.uint8),
        )  # fmt: skip
        self._mesh = _mesh(0)
        around = 2 * int(kernels.MARGIN)
        self._cells = np.empty((kernels.CELLS * (height + around), kernels.CELLS * (width + around)), np.int32)
        self._depth = np.zeros((height, width), np.float32)
        self._points = np.zeros((kernels.SUBPIXELS * height, kernels.SUBPIXELS * width, 4), np.float32)
        self._image = np.zeros((height, width, 4), np.float32)
        self._chosen, self._triangle = np.zeros((0, 2), np.float32), np.zeros(0, np.int32)
        self._at = self._cursor = self._plans = self._since = 0
        self._wanted = setup.rate / setup.refresh_hz
        self._taken: NDArray[np.int32] | None = None  # triangles of what was chosen last

    def choose(self, count: int, event: Event, now: float) -> Float32:
        """See Renderer."""
        if not len(self._mesh.corners):
            self.image(event, now)
        elif self._at >= len(self._chosen):
            self._plan()
        first, self._at = self._at, min(self._at + count, len(self._chosen))
        self._taken = self._triangle[first : self._at]
        return self._chosen[first : self._at]

    def take(self, samples: Samples, event: Event, now: float) -> None:
        """See Renderer."""
        if self._taken is not None and len(self._taken) == len(samples):  # no sample was dropped
            turns = np.float32(self._tuning.doubt)
            kernels.doubt(samples, self._taken, self._image, self._vertices, self._mesh, turns)
        self._since += len(samples) if now > 0.0 else 0  # the free image says nothing of the rate
        self._cursor = kernels.store(samples, self._maps.of(event), self._vertices, self._cursor)

    def image(self, event: Event, now: float) -> Float32:
        """See Renderer."""
        height, width = self._depth.shape
        vertices = self._vertices
        np.add(vertices.age, np.float32(self._since / self._depth.size), out=vertices.age)
        kernels.project(vertices, self._maps.of(event).panel_from_object, width, height)
        kernels.cover(vertices, self._mesh, self._depth)
        count = kernels.thin_out(vertices, self._depth, self._cells)
        self._triangulate(count)
        kernels.draw(vertices, self._mesh, self._points)
        kernels.average(self._points, self._image)
        if not self._image[:, :, 3].all():
            fill_holes(self._image)
        self._wanted, self._since = self._since or self._wanted, 0
        self._plan()
        return self._image[:, :, :3]

    def _triangulate(self, count: int) -> None:
        """Join the vertices that are left by a new mesh; without one where there are none, or all on a line."""
        numbers, points = np.empty(count, np.int32), np.empty((count, 2))
        kernels.list_points(self._vertices, numbers, points)
        try:
            simplices = Delaunay(points).simplices if count >= kernels.CORNERS else np.empty((0, 3), np.int32)
        except QhullError:
            simplices = np.empty((0, 3), np.int32)
        self._mesh = _mesh(len(simplices))
        kernels.link(simplices, numbers, self._vertices, self._mesh)

    def _plan(self) -> None:
        """Choose the positions of about one refresh."""
        height, width = self._depth.shape
        self._plans += 1
        wanted, own = math.ceil(REJECTED * self._wanted), self._tuning
        self._chosen, self._triangle = np.empty((2 * wanted, 2), np.float32), np.empty(2 * wanted, np.int32)
        values = np.array([own.age, own.bridging, own.least, own.contrast], np.float32)
        total = kernels.weigh(self._vertices, self._mesh, width, height, values, np.float32(own.power))
        seed = self._setup.seed * 1_000_003 + self._plans
        if total > 0.0:
            size = np.array((width, height), np.float32)
            count = kernels.choose(self._vertices, self._mesh, total / wanted, seed, size, self._chosen, self._triangle)
        else:  # there is no mesh: anywhere
            count = wanted
            self._chosen[:count] = np.random.default_rng(seed).random((count, 2)) * (width, height)
            self._triangle[:count] = -1
        self._chosen, self._triangle, self._at = self._chosen[:count], self._triangle[:count], 0


def _mesh(triangles: int) -> kernels.Mesh:
    """An empty mesh of so many triangles."""
    corners, weight = np.zeros((triangles, 3), np.int32), np.zeros(triangles)
    return kernels.Mesh(corners=corners, bridging=np.zeros(triangles, np.uint8), weight=weight)


def tapestry(follow_objects: bool, setup: Setup) -> FramelessMethod:
    """Returns the tapestry as a frameless method."""
    return FramelessMethod(setup, Tapestry(setup, follow_objects=follow_objects))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "tapestry": partial(tapestry, False),
    "tapestry_object": partial(tapestry, True),
}
