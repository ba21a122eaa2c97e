"""Trees over many lights: their order, made once from where lights stand at rest, and their bounds, which follow.

The order is that of a K-D tree in place and size, so that large lights stand apart from small ones. It stays as it is
when lights move: what is chosen is then less well aimed, and never wrong. See kernels.light_tree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import LUMINANCE
from wall.core.data import Float32, Float64
from wall.scene.model import PointLight, Shading, SpotLight
from wall.tracing.kernels import light_tree as kernels
from wall.tracing.kernels.light_tree import WIDTH, WIDTH_BITS
from wall.tracing.kernels.values import Emitters, LightTree, ManyLights, Surfaces

Kind: TypeAlias = Literal["point_lights", "spot_lights"]  # of a Shading

DIAMETERS = 2.0  # of a light count as much as so many of the units by which places differ
WIDEST_EDGE = 1.0 - 1e-3  # greatest EDGE of narrow spots
LOOSE_EDGE = 1e-5  # by which EDGE is less than a spot's


def make_tree(places: Float64, radii: Float64 | None = None) -> LightTree:
    """A tree with empty slots over lights at `places` (m, 3), with their radii (m,); None: they are points."""
    sizes = np.zeros(len(places)) if radii is None else DIAMETERS * radii
    order = _order(np.column_stack([places, sizes]))
    counts = [-(-len(order) // WIDTH)]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // WIDTH))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return LightTree(
        nodes=np.zeros((sum(counts), kernels.COLUMNS), np.float32),
        first=np.cumsum([0, *counts[:0:-1]]).astype(np.int64),
        order=order,
        place=place,
        offset=np.zeros(3, np.float32),
    )


def _order(points: Float64) -> NDArray[np.int64]:
    """(m,) int64 of points (m, d): halves along their longest extent, cut where nodes of the tree end."""
    order = np.arange(len(points))
    ahead = [(0, len(points))]
    while ahead:
        start, end = ahead.pop()
        count, step = end - start, WIDTH
        if count <= WIDTH:
            continue
        while step * WIDTH < count:
            step *= WIDTH
        here = order[start:end]
        own = points[here]
        middle = max(1, round(count / 2 / step)) * step
        axis = int(np.argmax(np.ptp(own, axis=0)))
        order[start:end] = here[np.argpartition(own[:, axis], middle)]
        ahead += [(start, start + middle), (start + middle, end)]
    return order


def emitter_tree(emitters: Emitters, surfaces: Surfaces, world_from_object: Float64) -> LightTree:
    """A tree over the triangles of `emitters` where they are at rest, with empty slots. `surfaces`: with vertices."""
    vertices = surfaces.vertices
    assert vertices is not None  # where there are emitters
    table = surfaces.meshes.mesh_table[emitters.instance].astype(np.int64)
    numbers = np.arange(len(emitters.instance)) - emitters.first[emitters.instance]
    corners = vertices[surfaces.meshes.triangles[table[:, 0] + numbers].astype(np.int64) + table[:, 1, None]]
    matrices = world_from_object[emitters.instance]
    world = np.einsum("mij,mkj->mki", matrices[:, :3, :3], corners.astype(np.float64)) + matrices[:, None, :3, 3]
    middles = world.mean(axis=1)
    radii = np.sqrt(((world - middles[:, None]) ** 2).sum(axis=2).max(axis=1))
    return make_tree(middles, radii)


class EmitterTree:
    """One tracer's tree over triangles that emit: its own bounds, which follow what moves."""

    def __init__(self, emitters: Emitters, surfaces: Surfaces, both_sides: NDArray[np.bool_], origin: Float64) -> None:
        """`emitters` with a tree; `both_sides` (n,) of each instance; `origin` (3,) of the tree, world."""
        tree = emitters.tree
        assert tree is not None
        self._tree = tree._replace(nodes=tree.nodes.copy(), offset=np.zeros(3, np.float32))
        self.emitters = emitters._replace(tree=self._tree)
        self._instances = np.flatnonzero(emitters.first >= 0)
        self._backs = np.where(both_sides, -1.0, 1.0).astype(np.float32)
        self._meshes = surfaces.meshes.mesh_table, surfaces.meshes.triangles, surfaces.vertices
        self._origin, self._changed = origin, np.zeros(len(tree.nodes), np.bool_)
        self._seen: Float64 | None = None  # as last placed: the moment's own array, and a copy of the emitters' part
        self._placed = np.full((len(self._instances), 4, 4), np.nan)

    def place(self, world_from_object: Float64, eye: Float64) -> None:
        """Fits the tree to where instances (n, 4, 4) are, and to the eye (3,), world."""
        self._tree.offset[:] = eye - self._origin
        if world_from_object is self._seen:
            return
        now = world_from_object[self._instances]
        moved = (now != self._placed).any(axis=(1, 2))
        if moved.any():
            kernels.bound_triangles(
                self._tree,
                self._changed,
                self._instances[moved],
                np.sign(np.linalg.det(now[moved, :3, :3])),
                self.emitters._replace(tree=None),
                self._backs,
                world_from_object,
                self._origin,
                self._meshes,
            )
            kernels.refit(self._tree, self._changed)
        self._seen, self._placed = world_from_object, now


class DeltaLights:
    """One tracer's point lights, or its spots: their rows relative to the eye, and a tree where they are many."""

    def __init__(self, kind: Kind, tree: LightTree | None, origin: Float64) -> None:
        """`tree` over their positions at rest, of `origin` (3,), world; None: they are few, or none."""
        self._kind, self._origin = kind, origin
        self._tree = None if tree is None else tree._replace(nodes=tree.nodes.copy(), offset=np.zeros(3, np.float32))
        self._seen: tuple[Float64, Shading] | None = None  # as last placed
        self._looks = np.zeros((0, 3))  # what follows the position in each row

    def place(self, positions: Float64, shading: Shading, eye: Float64) -> tuple[Float32 | None, ManyLights | None]:
        """Those of a shading at `positions` (m, 3), the eye at (3,), world: one by one, or those of a tree."""
        if not len(positions):
            return None, None
        lights: Sequence[PointLight | SpotLight] = getattr(shading, self._kind)
        if self._seen is None or self._seen[1] is not shading:
            self._looks = np.array([_look(light) for light in lights])
        rows = np.hstack([positions - eye, self._looks]).astype(np.float32)
        tree = self._tree
        if tree is None:
            return rows, None
        tree.offset[:] = eye - self._origin
        if self._seen is None or self._seen[0] is not positions or self._seen[1] is not shading:
            slots = _slots(rows, positions - self._origin, lights)
            nodes = tree.nodes.reshape(len(tree.nodes), -1, WIDTH)
            nodes[tree.first[-1] + (tree.place >> WIDTH_BITS), :, tree.place & (WIDTH - 1)] = slots
            kernels.refit(tree, np.ones(len(tree.nodes), np.bool_))
        self._seen = positions, shading
        return None, ManyLights(rows, tree)


def _look(light: PointLight | SpotLight) -> tuple[float, ...]:
    """What follows the position in a row of Lights.points or .spots."""
    if isinstance(light, SpotLight):
        return (*light.intensity, *light.direction, *light.falloff)
    return light.intensity


def _slots(rows: Float32, places: Float64, lights: Sequence[PointLight | SpotLight]) -> Float32:
    """(m, columns) float32 of lights at `places` (m, 3) from the tree's origin, of one kind."""
    found = np.zeros((kernels.COLUMNS // WIDTH, len(rows)), np.float32)
    center, axis, cosine, back, edge, scale = (
        column // WIDTH
        for column in (kernels.CENTER_X, kernels.AXIS_X, kernels.COSINE, kernels.BACK, kernels.EDGE, kernels.SCALE)
    )
    found[center : center + 3], found[cosine], found[back] = places.T, -1.0, 1.0
    ends = [light.outer_angle for light in lights if isinstance(light, SpotLight)]
    if ends:
        found[axis : axis + 3], found[cosine] = rows[:, 6:9].T, 1.0
        found[edge] = np.clip(np.cos(np.radians(ends)) - LOOSE_EDGE, 0.0, WIDEST_EDGE)
    found[scale] = rows[:, 3:6] @ LUMINANCE / (1.0 - found[edge])
    return found.T
