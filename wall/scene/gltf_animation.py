"""Animation of a glTF file's nodes, as rigid motions of the objects that they place.

Objects are placed again at every key and at least STEPS_PER_SECOND times a second, so that what turns about a point
beside it goes round, not along chords; the first animation plays, over and over. What an animation stretches stays.
glTF 2.0 specification, 3.11 and appendix C.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trimesh.util import unique_name

from wall.config.scene import KeyframeConfig, KeyframesConfig, RotationConfig
from wall.core.data import Float64
from wall.scene.animation import Moving
from wall.scene.gltf import pose_of
from wall.scene.gltf_accessors import Accessors
from wall.scene.model import Instance

STEPS_PER_SECOND = 30
MOST_KEYS = 5000  # of one object
RIGID = 1e-3  # most that a motion may stretch an object by
PATHS = ("translation", "rotation", "scale")
UP_Y = (0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """Keys of one property of a node."""

    times: Float64  # (k,) seconds, growing
    values: Float64  # (k, 3 or 4); by CUBICSPLINE (k, 3, 3 or 4): tangent before, value, tangent behind
    interpolation: str

    def at(self, time: float) -> Float64:
        """(3,) or (4,) at a time in seconds; before the first key and after the last one these stay."""
        values = self.values[:, 1] if self.interpolation == "CUBICSPLINE" else self.values
        if time <= self.times[0]:
            return np.asarray(values[0])
        if time >= self.times[-1]:
            return np.asarray(values[-1])
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        if self.interpolation == "STEP":
            return np.asarray(values[k])
        step = self.times[k + 1] - self.times[k]
        share = (time - self.times[k]) / step
        if self.interpolation == "CUBICSPLINE":
            s2, s3 = share**2, share**3
            found: Float64 = (
                (2 * s3 - 3 * s2 + 1) * values[k] + step * (s3 - 2 * s2 + share) * self.values[k, 2]
                + (3 * s2 - 2 * s3) * values[k + 1] + step * (s3 - s2) * self.values[k + 1, 0]
            )  # fmt: skip
            return found / np.linalg.norm(found) if len(found) == 4 else found
        if values.shape[1] == 4:
            first, second = Rotation.from_quat(values[k]), Rotation.from_quat(values[k + 1])
            turned: Float64 = (first * Rotation.from_rotvec(share * (first.inv() * second).as_rotvec())).as_quat()
            return turned
        return np.asarray((1.0 - share) * values[k] + share * values[k + 1])


def motions_of(
    path: Path, header: dict[str, Any], frames: Sequence[str], instances: Sequence[Instance], centers: Float64
) -> tuple[tuple[Moving, ...], list[str]]:
    """The motions of the file's first animation, and notes. Raises what malformed files raise, see gltf.MALFORMED.

    Parameters
    ----------
    path : the file; header : its JSON
    frames : name of each instance's frame, as trimesh names nodes
    centers : (n, 3) of each instance, world
    """
    animations = header.get("animations", [])
    if not animations:
        return (), []
    notes = [f"it has {len(animations)} animations; the first one plays"] if len(animations) > 1 else []
    curves = _curves(path, header, animations[0])
    numbers, parents = node_numbers(header), _parents(header)
    end = max((float(curve.times[-1]) for curve in curves.values()), default=0.0)
    motions: list[Moving] = []
    stretched: list[str] = []
    for row, (frame, instance) in enumerate(zip(frames, instances, strict=True)):
        chain = _chain(numbers.get(frame), parents)
        own = [curves[node, kind] for node in chain for kind in PATHS if (node, kind) in curves]
        if not own:
            continue
        times = _times(own, end)
        rest = np.linalg.inv(_placed(header, chain, {}, 0.0))
        moves = np.array([_placed(header, chain, curves, time) @ rest for time in times])
        stretch = moves[:, :3, :3].transpose(0, 2, 1) @ moves[:, :3, :3] - np.eye(3)
        if np.abs(stretch).max() > 2 * RIGID:
            stretched.append(instance.name)
            continue
        center = centers[row]
        keys = tuple(_key(float(time), move, center) for time, move in zip(times, moves, strict=True))
        x, y, z = center.tolist()
        motions.append(
            Moving(body=row, motion=KeyframesConfig(type="keyframes", object=instance.name, keyframes=keys),
                   center=(x, y, z))
        )  # fmt: skip
    notes += [f"its animation stretches {name!r}, which stays as it is" for name in sorted(set(stretched))]
    return tuple(motions), notes


def _key(time: float, move: Float64, center: Float64) -> KeyframeConfig:
    x, y, z = (move[:3, :3] @ center + move[:3, 3]).tolist()
    turn = Rotation.from_matrix(move[:3, :3]).as_rotvec(degrees=True)
    degrees = float(np.linalg.norm(turn))
    a, b, c = turn.tolist() if degrees > 0.0 else UP_Y
    return KeyframeConfig(time=time, position=(x, y, z), rotation=RotationConfig(axis=(a, b, c), degrees=degrees))


def _times(curves: Sequence[Curve], end: float) -> Float64:
    """Every key, and even steps between; at most MOST_KEYS."""
    keys = np.unique(np.concatenate([curve.times for curve in curves]))
    steps = np.linspace(0.0, end, min(int(np.ceil(end * STEPS_PER_SECOND)) + 1, MOST_KEYS))
    if len(keys) + len(steps) > MOST_KEYS:
        return steps
    times = np.unique(np.concatenate([keys, steps]))
    kept: Float64 = times[np.append(True, np.diff(times) > 1e-6)]
    return kept


def _placed(header: dict[str, Any], chain: Sequence[int], curves: dict[tuple[int, str], Curve], time: float) -> Float64:
    """(4, 4) of the last node of a chain that begins at a root."""
    pose = np.eye(4)
    for number in chain:
        node = header["nodes"][number]
        moved = {kind: curves[number, kind].at(time).tolist() for kind in PATHS if (number, kind) in curves}
        pose = pose @ pose_of({**node, **moved})
    return pose


def _chain(number: int | None, parents: dict[int, int]) -> list[int]:
    """A node and those above it, the root first; a node that holds itself is met once."""
    chain: list[int] = []
    while number is not None and number not in chain:
        chain.append(number)
        number = parents.get(number)
    return chain[::-1]


def _parents(header: dict[str, Any]) -> dict[int, int]:
    return {child: k for k, node in enumerate(header.get("nodes", [])) for child in node.get("children", [])}


def node_numbers(header: dict[str, Any]) -> dict[str, int]:
    """Numbers of the file's nodes by the names that trimesh gives them."""
    numbers: dict[str, int] = {}
    counts: dict[str | None, int] = {}
    for k, node in enumerate(header.get("nodes", [])):
        numbers[unique_name(node.get("name", str(k)), numbers, counts=counts)] = k
    return numbers


def _curves(path: Path, header: dict[str, Any], animation: dict[str, Any]) -> dict[tuple[int, str], Curve]:
    """Curves by node and property; those of weights and of nodes that the file does not name are left out."""
    curves: dict[tuple[int, str], Curve] = {}
    accessors = Accessors(path, header)
    for channel in animation["channels"]:
        target = channel["target"]
        if target.get("node") is None or target["path"] not in PATHS:
            continue
        sampler = animation["samplers"][channel["sampler"]]
        times = accessors.values(sampler["input"])[:, 0]
        values = accessors.values(sampler["output"])
        how = sampler.get("interpolation", "LINEAR")
        if how == "CUBICSPLINE":
            values = values.reshape(len(times), 3, -1)
        grows = np.isfinite(times).all() and (np.diff(times) > 0).all()
        if not grows or len(times) == 0 or len(values) != len(times) or not np.isfinite(values).all():
            raise ValueError(f"{len(values)} values for {len(times)} times, wanted one each, at times that grow")
        curves[target["node"], target["path"]] = Curve(times=times, values=values, interpolation=how)
    return curves
