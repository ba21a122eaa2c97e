"""What stands first along one ray: for a click, in a process that has the scene's meshes and no trees of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.bounds import local_box
from wall.scene.build import Scene
from wall.scene.cuts import piece_left, planes_of
from wall.scene.kernels.picking import first_segment, first_sphere, first_triangle
from wall.scene.model import Material, Mesh, Moment, Texture

MOSTLY_THERE = 0.5  # alpha from which on a blended surface is what is seen
NEXT = 1e-9  # beyond a surface that is not there, of its distance


class Picking:
    """`first` surface along a ray; all triangles whose boxes the ray meets are tried."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        corners = [local_box(mesh) for mesh in scene.meshes]
        self._boxes = np.array(corners, np.float64)[[instance.mesh for instance in scene.instances]]  # (n, 2, 3)

    def distance(self, moment: Moment, origin: Float64, direction: Float64) -> float:
        """How far the first surface stands, see `first`."""
        return self.first(moment, origin, direction)[0]

    def first(self, moment: Moment, origin: Float64, direction: Float64) -> tuple[float, int]:
        """The first surface: how many lengths of `direction` (3,) from `origin` (3,), world; index of its instance.

        Infinity and -1: there is none. Where alpha makes a mask, what is cut out is passed; blended surfaces are, where
        less than half is there; cuts leave a piece of the ray.
        """
        begin, end = piece_left(planes_of(moment.shading.cuts, origin), direction)
        known = np.abs(np.linalg.det(moment.world_from_object[:, :3, :3])) > 0.0
        inverse = np.zeros_like(moment.world_from_object)
        inverse[known] = np.linalg.inv(moment.world_from_object[known])
        origins = inverse[:, :3, :3] @ origin + inverse[:, :3, 3]
        directions = inverse[:, :3, :3] @ direction
        boxes, steps = self._boxes, self._steps(moment)
        if steps:
            boxes = boxes.copy()
            boxes[list(steps)] = [local_box(mesh) for mesh in steps.values()]
        entries = np.where(known, entered(boxes, origins, directions), np.inf)
        nearest, instance = end, -1
        for k in np.argsort(entries):
            if entries[k] >= nearest:
                break
            mesh = steps.get(int(k)) or self._scene.meshes[self._scene.instances[k].mesh]
            if (found := self._first(mesh, origins[k], directions[k], begin)) < nearest:
                nearest, instance = found, int(k)
        return (nearest, instance) if instance >= 0 else (math.inf, instance)

    def _steps(self, moment: Moment) -> dict[int, Mesh]:
        """By their instances, the meshes of the steps of series that are shown, but for first steps."""
        shown = zip(self._scene.series, moment.steps, strict=True)
        return {series.first + step: series.meshes.mesh(step) for series, step in shown if step > 0}

    def _first(self, mesh: Mesh, origin: Float64, direction: Float64, after: float) -> float:
        if mesh.spheres is not None:
            material = self._scene.materials[mesh.material]
            there = material.alpha_mode == "opaque" or material.alpha >= _least(material)
            if not there:
                return math.inf
            if mesh.segments is not None:
                return float(first_segment(mesh.spheres, mesh.segments, origin, direction, after))
            return float(first_sphere(mesh.spheres, origin, direction, after))
        found = np.zeros(3)
        while (number := first_triangle(mesh.vertices, mesh.triangles, origin, direction, after, found)) >= 0:
            if self._is_there(mesh, number, found):
                return float(found[0])
            after = found[0] * (1.0 + NEXT)
        return math.inf

    def _is_there(self, mesh: Mesh, number: int, found: Float64) -> bool:
        material = self._scene.materials[mesh.material]
        if material.alpha_mode == "opaque":
            return True
        slot, alpha = material.textures.base_color, material.alpha
        texture = None if slot is None else self._scene.textures[slot]
        if texture is not None and (uvs := mesh.uvs_of(texture)) is not None:
            a, b, c = uvs[mesh.triangles[number]].astype(np.float64)
            alpha *= alpha_of(texture, a + found[1] * (b - a) + found[2] * (c - a))
        return alpha >= _least(material)


def _least(material: Material) -> float:
    """The alpha from which on a surface that is not opaque is seen."""
    return material.alpha_cutoff if material.alpha_mode == "mask" else MOSTLY_THERE


def entered(boxes: Float64, origins: Float64, directions: Float64) -> Float64:
    """(n,) where rays (n, 3) enter boxes (n, 2, 3), in lengths of their directions, 0 from inside; inf: they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (boxes - origins[:, None]) / directions[:, None]
    low, high = np.fmin(ends[:, 0], ends[:, 1]), np.fmax(ends[:, 0], ends[:, 1])  # NaN: along a face, on it
    first, last = np.maximum(np.fmax.reduce(low, axis=1), 0.0), np.fmin.reduce(high, axis=1)
    near: Float64 = np.where(first <= last * (1.0 + NEXT) + NEXT, first, np.inf)
    return near


def alpha_of(texture: Texture, uv: Float64) -> float:
    """The alpha of the texel at `uv` (2,), v up, 0..1."""
    if texture.alpha is None:
        return 1.0
    places: list[float] = [_wrapped(float(x), way) for x, way in zip(uv, texture.wrap, strict=True)]
    height, width = texture.alpha.shape
    texels: NDArray[np.uint8] = texture.alpha
    row, column = int((1.0 - places[1]) * height), int(places[0] * width)
    return float(texels[min(row, height - 1), min(column, width - 1)]) / 255.0


def _wrapped(x: float, way: str) -> float:
    """A texture coordinate brought to 0..1."""
    if way == "clamp":
        return min(max(x, 0.0), 1.0)
    if way == "mirror":
        x = x % 2.0
        return 2.0 - x if x > 1.0 else x
    return x % 1.0
