"""Rigid motion as a pure function of time: spin, orbit and keyframes, vectorised over everything that moves.

A *body* is anything with a pose: an instance, a point light (a body at its position), a directional light (a body
that far from the origin in its direction). A motion gives a rigid matrix M(t) in the world that is applied on top
of the body's pose at rest; several motions on one body chain, the first listed innermost.

Rotations between keyframes follow the shorter great arc at constant speed (Shoemake 1985, slerp); positions between
keyframes are linear.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.config.scene import KeyframesConfig, MotionConfig, OrbitConfig, SpinConfig
from wall.core.data import Float64
from wall.geometry.rotations import matrices_of, on_the_way, quaternions_of

Vector: TypeAlias = tuple[float, float, float]
AT_REST = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moving:
    """One motion of one body."""

    body: int  # row of the poses
    motion: MotionConfig
    center: Vector  # the body's own centre at rest, world

    def scaled(self, factor: float) -> Moving:
        """A keyframed motion in a world scaled about its origin."""
        assert isinstance(self.motion, KeyframesConfig)
        keys = tuple(key.model_copy(update={"position": times(factor, key.position)}) for key in self.motion.keyframes)
        return replace(
            self, motion=self.motion.model_copy(update={"keyframes": keys}), center=times(factor, self.center)
        )


def times(factor: float, point: Vector) -> Vector:
    """A vector made longer by a factor."""
    x, y, z = point
    return (factor * x, factor * y, factor * z)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turns:
    """Spins and orbits of one layer: turns by 2 pi t / period; a body travels as the tip of its arm does."""

    rows: NDArray[np.intp]  # (n,) bodies
    periods: Float64  # (n,) seconds
    axes: Float64  # (n, 3) unit
    arms: Float64  # (n, 3) from the centre of the turn: of a spin to the origin, of an orbit to the body
    keeps: NDArray[np.bool_]  # (n,) the orientation, as an orbit does

    def at(self, time: float) -> Float64:
        """(n, 4, 4) rigid matrices at a time in seconds. Whole turns are taken off first, so any time is exact."""
        angle = 2.0 * np.pi * np.fmod(time, self.periods) / self.periods
        turn = matrices_of(quaternions_of(angle[:, None] * self.axes))
        moved = (turn @ self.arms[:, :, None])[:, :, 0] - self.arms
        return _rigid(np.where(self.keeps[:, None, None], np.eye(3), turn), moved)


@dataclass(frozen=True, slots=True, kw_only=True)
class Paths:
    """Keyframed bodies of one layer; rows with fewer keys than the longest repeat their last one."""

    rows: NDArray[np.intp]  # (n,) bodies
    times: Float64  # (n, k) seconds; padded with inf
    positions: Float64  # (n, k, 3) world
    rotations: Float64  # (n, k, 4) unit quaternions (w, x, y, z)
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
        rotation = matrices_of(on_the_way(self.rotations[each, left], self.rotations[each, right], share))
        position = (1.0 - share) * self.positions[each, left] + share * self.positions[each, right]
        return _rigid(rotation, position - (rotation @ self.center[:, :, None])[:, :, 0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """Every motion of a scene, in layers: the k-th motions of all bodies are applied together, after the k-1-th."""

    layers: tuple[Turns | Paths, ...] = ()
    bodies: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))  # (m,) that move, in order

    def __bool__(self) -> bool:
        return bool(self.layers)

    def apply(self, poses: Float64, time: float) -> None:
        """Move `poses` ((bodies, 4, 4) world_from_body at rest, changed in place) to a time in seconds."""
        for layer in self.layers:
            poses[layer.rows] = layer.at(time) @ poses[layer.rows]


def compile_tracks(motions: Sequence[Moving]) -> Tracks:
    """Lay out motions for evaluation. A body may occur several times: its first motion is the innermost."""
    depth: Counter[int] = Counter()
    turns: defaultdict[int, list[tuple[Moving, SpinConfig | OrbitConfig]]] = defaultdict(list)
    paths: defaultdict[int, list[tuple[Moving, KeyframesConfig]]] = defaultdict(list)
    for moving in motions:
        level, motion = depth[moving.body], moving.motion
        depth[moving.body] += 1
        if isinstance(motion, KeyframesConfig):
            paths[level].append((moving, motion))
        else:
            turns[level].append((moving, motion))
    layers: list[Turns | Paths] = []
    for level in range(max(depth.values(), default=0)):
        layers += [_turns(turns[level])] if turns[level] else []
        layers += [_paths(paths[level])] if paths[level] else []
    return Tracks(layers=tuple(layers), bodies=np.array(sorted(depth), np.intp))


def quaternion(axis: Vector, degrees: float) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a turn about an axis (any length but zero), right-handed."""
    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    w, x, y, z = quaternions_of(np.radians(degrees) * unit).tolist()
    return (w, x, y, z)


def _rigid(rotation: Float64, moved: Float64) -> Float64:
    """(n, 4, 4) matrices of rotations (n, 3, 3) and translations (n, 3)."""
    matrices = np.zeros((len(rotation), 4, 4))
    matrices[:, :3, :3], matrices[:, :3, 3], matrices[:, 3, 3] = rotation, moved, 1.0
    return matrices


def _turns(motions: list[tuple[Moving, SpinConfig | OrbitConfig]]) -> Turns:
    own = np.array([moving.center for moving, _ in motions])
    about = np.array([moving.center if motion.center is None else motion.center for moving, motion in motions])
    axes = np.array([motion.axis for _, motion in motions])
    keeps = np.array([isinstance(motion, OrbitConfig) for _, motion in motions])
    return Turns(
        rows=np.array([moving.body for moving, _ in motions], np.intp),
        periods=np.array([motion.period_s for _, motion in motions]),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        arms=np.where(keeps[:, None], own - about, -about),
        keeps=keeps,
    )


def _paths(motions: list[tuple[Moving, KeyframesConfig]]) -> Paths:
    rows = np.array([moving.body for moving, _ in motions], np.intp)
    keys = max(2, *(len(motion.keyframes) for _, motion in motions))
    times = np.full((len(rows), keys), np.inf)
    positions, rotations = np.zeros((len(rows), keys, 3)), np.zeros((len(rows), keys, 4))
    for row, (_, motion) in enumerate(motions):
        count = len(motion.keyframes)
        times[row, :count] = [key.time for key in motion.keyframes]
        positions[row, :count] = [key.position for key in motion.keyframes]
        positions[row, count:] = motion.keyframes[-1].position
        turns = [quaternion(turn.axis, turn.degrees) if (turn := key.rotation) else AT_REST for key in motion.keyframes]
        rotations[row, :count], rotations[row, count:] = turns, turns[-1]
    first = times[:, 0].copy()
    length = np.array([motion.keyframes[-1].time - motion.keyframes[0].time for _, motion in motions])
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
