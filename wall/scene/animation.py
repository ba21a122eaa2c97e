"""Rigid motion as a pure function of time: spin, orbit and keyframes, vectorised over everything that moves.

A *body* is anything with a pose: an instance, a point light (a body at its position), a directional light (a body
that far from the origin in its direction). A motion gives a rigid matrix M(t) in the world that is applied on top
of the body's pose at rest; several motions on one body chain, the first listed innermost.

A turn by angle a about axis k (unit, cross-product matrix K) is I + sin a K + (1 - cos a) K^2 (Rodrigues), so all
turns of a layer are two weighted sums of matrices that were laid out once. Rotations between keyframes follow the
shorter great arc (Shoemake 1985, slerp); positions between keyframes are linear.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64

Vector: TypeAlias = tuple[float, float, float]

NEARLY_PARALLEL = 1e-9  # rad between two quaternions; less is drawn as this much


def _rotation_of_products() -> Float64:
    """(16, 9): every entry of a rotation is a quadratic form of its quaternion, so one product gives all of them."""
    table = np.zeros((4, 4, 9))
    w, x, y, z = range(4)
    for entry, signs in ((0, (1, 1, -1, -1)), (4, (1, -1, 1, -1)), (8, (1, -1, -1, 1))):
        table[range(4), range(4), entry] = signs
    for entry, a, b, c in ((1, x, y, z), (5, y, z, x), (6, z, x, y)):  # 2 (ab - wc), mirrored 2 (ab + wc)
        mirrored = 3 * (entry % 3) + entry // 3
        table[a, b, [entry, mirrored]] = 2.0
        table[w, c, [entry, mirrored]] = -2.0, 2.0
    return table.reshape(16, 9)


ROTATION_OF_PRODUCTS = _rotation_of_products()


@dataclass(frozen=True, slots=True, kw_only=True)
class Spin:
    """Turn about an axis through `center`; one turn takes `period_s` (negative: the other way round)."""

    axis: Vector
    period_s: float
    center: Vector | None = None  # world; None = the body's own centre


@dataclass(frozen=True, slots=True, kw_only=True)
class Orbit:
    """Travel on a circle about an axis through `center`, keeping the orientation; `period_s` a round."""

    center: Vector
    axis: Vector
    period_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyframes:
    """Poses at times: the body's own centre goes to each position, turned there by each rotation."""

    times: tuple[float, ...]  # seconds, strictly increasing
    positions: tuple[Vector, ...]  # world
    rotations: tuple[tuple[float, float, float, float], ...]  # unit quaternions (w, x, y, z) against rest
    loop: bool = True  # last to first without a pause; else the ends hold


Motion: TypeAlias = Spin | Orbit | Keyframes


@dataclass(frozen=True, slots=True, kw_only=True)
class Moving:
    """One motion of one body."""

    body: int  # row of the poses
    motion: Motion
    center: Vector  # the body's own centre at rest, world


@dataclass(frozen=True, slots=True, kw_only=True)
class Turns:
    """Spins and orbits of one layer: M(t) = I + sin(a) sine + (1 - cos(a)) versine, a = 2 pi t / period."""

    rows: NDArray[np.intp]  # (n,) bodies
    periods: Float64  # (n,) seconds
    sine: Float64  # (n, 4, 4)
    versine: Float64  # (n, 4, 4)

    def at(self, time: float) -> Float64:
        """(n, 4, 4) rigid matrices at a time in seconds. Whole turns are taken off first, so any time is exact."""
        angle = 2.0 * np.pi * np.fmod(time, self.periods) / self.periods
        weighted = np.sin(angle)[:, None, None] * self.sine
        weighted += (1.0 - np.cos(angle))[:, None, None] * self.versine
        weighted[:, (0, 1, 2, 3), (0, 1, 2, 3)] += 1.0
        return weighted


@dataclass(frozen=True, slots=True, kw_only=True)
class Paths:
    """Keyframed bodies of one layer; rows with fewer keys than the longest repeat their last one."""

    rows: NDArray[np.intp]  # (n,) bodies
    times: Float64  # (n, k) seconds; padded with inf
    positions: Float64  # (n, k, 3) world
    rotations: Float64  # (n, k, 4) unit quaternions, neighbours in one half space
    first: Float64  # (n,) seconds
    length: Float64  # (n,) seconds from the first to the last key
    loop: NDArray[np.bool_]  # (n,)
    center: Float64  # (n, 3) own centre at rest, world

    def at(self, time: float) -> Float64:
        """(n, 4, 4) rigid matrices at a time in seconds."""
        after = time - self.first
        since = np.where(self.loop, np.mod(after, self.length), np.minimum(np.maximum(after, 0.0), self.length))
        local = self.first + since
        each = np.arange(len(self.rows))
        passed = (self.times <= local[:, None]).sum(axis=1)
        right = np.minimum(np.maximum(passed, 1), self.times.shape[1] - 1)
        left = right - 1
        start, end = self.times[each, left], self.times[each, right]
        held = ~np.isfinite(end)  # past a short row's last key
        share = np.where(held, 0.0, (local - start) / np.where(held, 1.0, end - start))[:, None]
        rotation = slerp(self.rotations[each, left], self.rotations[each, right], share)
        position = (1.0 - share) * self.positions[each, left] + share * self.positions[each, right]
        return _placed(quaternion_matrices(rotation), self.center, position)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """Every motion of a scene, in layers: the k-th motions of all bodies are applied together, after the k-1-th."""

    layers: tuple[Turns | Paths, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.layers)

    def apply(self, poses: Float64, time: float) -> None:
        """Move `poses` ((bodies, 4, 4) world_from_body at rest, changed in place) to a time in seconds."""
        for layer in self.layers:
            poses[layer.rows] = layer.at(time) @ poses[layer.rows]


def compile_tracks(motions: Sequence[Moving]) -> Tracks:
    """Lay out motions for evaluation. A body may occur several times: its first motion is the innermost."""
    depth: Counter[int] = Counter()
    turns: defaultdict[int, list[tuple[Moving, Spin | Orbit]]] = defaultdict(list)
    paths: defaultdict[int, list[tuple[Moving, Keyframes]]] = defaultdict(list)
    for moving in motions:
        level, motion = depth[moving.body], moving.motion
        depth[moving.body] += 1
        if isinstance(motion, Keyframes):
            paths[level].append((moving, motion))
        else:
            turns[level].append((moving, motion))
    layers: list[Turns | Paths] = []
    for level in range(max(depth.values(), default=0)):
        layers += [_turns(turns[level])] if turns[level] else []
        layers += [_paths(paths[level])] if paths[level] else []
    return Tracks(layers=tuple(layers))


def slerp(start: Float64, end: Float64, share: Float64) -> Float64:
    """Unit quaternions (n, 4) between two in one half space; share (n, 1) in 0..1. After Shoemake 1985."""
    angle = np.arccos(np.minimum((start * end).sum(axis=1, keepdims=True), 1.0))
    angle = np.maximum(angle, NEARLY_PARALLEL)  # sin(x) / x is 1 there to the last digit: a straight blend
    return np.asarray((np.sin((1.0 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle), np.float64)


def quaternion(axis: Vector, degrees: float) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a turn about an axis (any length but zero), right-handed."""
    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    half = np.radians(degrees) / 2.0
    x, y, z = (np.sin(half) * unit).tolist()
    return (float(np.cos(half)), x, y, z)


def quaternion_matrices(quaternions: Float64) -> Float64:
    """(n, 3, 3) rotations of (n, 4) unit quaternions (w, x, y, z)."""
    products = quaternions[:, :, None] * quaternions[:, None, :]
    return (products.reshape(-1, 16) @ ROTATION_OF_PRODUCTS).reshape(-1, 3, 3)


def _placed(rotation: Float64, center: Float64, position: Float64) -> Float64:
    """(n, 4, 4) matrices that turn about `center` and carry it to `position`; both (n, 3)."""
    matrices = np.zeros((len(rotation), 4, 4))
    matrices[:, :3, :3] = rotation
    matrices[:, :3, 3] = position - (rotation @ center[:, :, None])[:, :, 0]
    matrices[:, 3, 3] = 1.0
    return matrices


def _turns(motions: list[tuple[Moving, Spin | Orbit]]) -> Turns:
    rows = np.array([moving.body for moving, _ in motions], np.intp)
    sine, versine = np.zeros((2, len(rows), 4, 4))
    for row, (moving, motion) in enumerate(motions):
        x, y, z = np.asarray(motion.axis, np.float64) / np.linalg.norm(motion.axis)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        own = np.asarray(moving.center, np.float64)
        about = own if motion.center is None else np.asarray(motion.center, np.float64)
        for matrix, part in ((sine[row], cross), (versine[row], cross @ cross)):
            if isinstance(motion, Orbit):
                matrix[:3, 3] = part @ (own - about)
            else:
                matrix[:3, :3] = part
                matrix[:3, 3] = -part @ about
    return Turns(rows=rows, periods=np.array([motion.period_s for _, motion in motions]), sine=sine, versine=versine)


def _paths(motions: list[tuple[Moving, Keyframes]]) -> Paths:
    rows = np.array([moving.body for moving, _ in motions], np.intp)
    keys = max(2, *(len(motion.times) for _, motion in motions))
    times = np.full((len(rows), keys), np.inf)
    positions, rotations = np.zeros((len(rows), keys, 3)), np.zeros((len(rows), keys, 4))
    for row, (_, motion) in enumerate(motions):
        count = len(motion.times)
        times[row, :count] = motion.times
        positions[row, :count], positions[row, count:] = motion.positions, motion.positions[-1]
        rotations[row, :count], rotations[row, count:] = motion.rotations, motion.rotations[-1]
        for key in range(1, keys):  # q and -q are one rotation: take the nearer
            if rotations[row, key] @ rotations[row, key - 1] < 0.0:
                rotations[row, key] *= -1.0
    first = times[:, 0].copy()
    length = np.array([motion.times[-1] - motion.times[0] for _, motion in motions])
    loop = np.array([motion.loop for _, motion in motions]) & (length > 0.0)
    return Paths(
        rows=rows,
        times=times,
        positions=positions,
        rotations=rotations,
        first=first,
        length=np.where(length > 0.0, length, 1.0),  # a single key: never divided by
        loop=loop,
        center=np.array([moving.center for moving, _ in motions], np.float64),
    )
