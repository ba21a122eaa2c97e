"""Convert SGCT's projections to flat panels: exact corners where they are planes, a substitute where not.

Field of view and orientation after src/baseviewport.cpp and the project's page on PlanarProjection: yaw turns to
the right, pitch up, roll to the right, applied as Ry(-yaw) Rx(pitch) Rz(-roll); angles in degrees.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.data import Float64
from wall.importers.panels import DISTANCE_M, SMALLEST_M, WIDEST, corners_of, turned
from wall.importers.source import Node, Source

SUBSTITUTE_FOV = 90.0  # degrees
WIDEST_SUBSTITUTE = 120.0  # degrees
PLANES = ("planarprojection", "texturemappedprojection")


def corners_of_projection(source: Source, viewport: Node, pixels: tuple[int, int], eye: Float64) -> Float64:
    """(3, 3) corners of a viewport, metres in the wall's frame.

    A projection by field of view has no position: its plane is DISTANCE_M, or its own distance, before `eye`.
    """
    node = viewport.get("projection")
    kind = (source.text(node.get("type")) or "").lower() if node is not None else ""
    if node is not None and kind == "projectionplane":
        corners = _plane(source, node)
        if corners is not None:
            return corners
        source.drop(node, "its corners span no rectangle: a flat panel of 90 degrees instead")
    elif node is not None and kind in PLANES:
        corners = _by_field_of_view(source, node, eye, kind)
        if corners is not None:
            return corners
        source.drop(node, "has no field of view that can be used: a flat panel of 90 degrees instead")
    return _substitute(source, node, pixels, eye)


def _plane(source: Source, node: Node) -> Float64 | None:
    """(3, 3) corners of a projection plane; None if its points span no rectangle."""
    points = [vector(source, node.get(key)) for key in ("lowerleft", "upperleft", "upperright")]
    if points[0] is None or points[1] is None or points[2] is None:
        return None
    low, high, right = points[0], points[1], points[2]
    corners = corners_of(low, low + (right - high), right)
    if corners is not None:
        source.carry(node.get("type"), "corners")
        for key in ("lowerleft", "upperleft", "upperright"):
            source.carry(node.get(key), "corners")
    return corners


def _by_field_of_view(source: Source, node: Node, eye: Float64, kind: str) -> Float64 | None:
    """(3, 3) corners of a plane given by its field of view; None if that cannot be used."""
    angles = _angles(source, node.get("fov"))
    if angles is None:
        return None
    left, right, down, up = (math.tan(math.radians(angle)) for angle in angles)
    distance = _distance(source, node)
    turn = _orientation(source, node.get("orientation"))
    offset = vector(source, node.get("offset"))
    source.carry(node.get("offset"), "corners")
    flat = distance * np.array([[-left, -down, -1.0], [right, -down, -1.0], [right, up, -1.0]])
    placed = eye + (np.zeros(3) if offset is None else offset) + flat @ turn.T
    corners = corners_of(placed[0], placed[1], placed[2])
    if corners is None:
        return None
    if kind == "texturemappedprojection":
        source.note(node, "the flat picture that the mesh is textured with; the mesh is not carried")
    source.carry(node.get("fov"), "corners")
    source.carry(node.get("type"), "corners")
    source.assume(
        "Projections by field of view have no place: they stand before the user's eye, at their distance, or 1 m."
    )
    return corners


def _angles(source: Source, node: Node | None) -> tuple[float, float, float, float] | None:
    """Degrees from the middle to the left, right, lower and upper edge; None if the file does not say."""
    if node is None:
        return None
    if node.get("hfov") is not None or node.get("vfov") is not None:
        across, high = source.number(node.get("hfov")), source.number(node.get("vfov"))
        if across is None or high is None:
            return None
        found = [across / 2, across / 2, high / 2, high / 2]
    else:
        parts = [source.number(node.get(key)) for key in ("left", "right", "down", "up")]
        found = [part for part in parts if part is not None]
    if len(found) < 4 or found[0] + found[1] <= 0 or found[2] + found[3] <= 0:
        return None
    if max(map(abs, found)) > WIDEST:
        source.note(node, f"a flat picture reaches at most {WIDEST:g} degrees from its middle: it ends there")
    clamped = [max(-WIDEST, min(WIDEST, angle)) for angle in found]
    return clamped[0], clamped[1], clamped[2], clamped[3]


def _distance(source: Source, node: Node) -> float:
    """Metres from the eye to a projection's plane."""
    fov = node.get("fov")
    given = node.get("distance")
    if given is None and fov is not None:
        given = fov.get("distance")
    found = source.number(given)
    if found is None:
        return DISTANCE_M
    if found < SMALLEST_M:
        source.drop(given, f"a plane stands before the eye: {DISTANCE_M:g} m instead")
        return DISTANCE_M
    source.carry(given, "corners")
    return found


def _orientation(source: Source, node: Node | None) -> Float64:
    """(3, 3) rotation of Euler angles in degrees, or of a quaternion x, y, z, w."""
    if node is None:
        return np.eye(3)
    if node.get("w") is not None:
        parts = [source.number(node.get(axis)) for axis in "xyzw"]
        quaternion = np.array([0.0 if part is None else part for part in parts])
        if np.linalg.norm(quaternion) > 1e-9:
            source.carry(node, "corners")
            return _of_quaternion(quaternion / np.linalg.norm(quaternion))
        source.drop(node, "is no rotation")
        return np.eye(3)
    yaw, pitch, roll = (source.number(node.get(key)) or 0.0 for key in ("yaw", "pitch", "roll"))
    source.carry(node, "corners")
    return turned(yaw, pitch, roll)


def _of_quaternion(quaternion: Float64) -> Float64:
    """(3, 3) rotation of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Float64 = np.eye(3) + 2 * w * skew + 2 * skew @ skew
    return turn


def _substitute(source: Source, node: Node | None, pixels: tuple[int, int], eye: Float64) -> Float64:
    """(3, 3) corners of a flat panel with square pixels 1 m before the eye, its longer side as wide as is plausible."""
    wanted = source.number(node.get("fov")) if node is not None and _has_one_fov(node) else None
    fov = SUBSTITUTE_FOV if wanted is None or wanted <= 0 else min(wanted, WIDEST_SUBSTITUTE)
    if node is None:
        source.assume("Viewports without a projection are flat panels of 90 degrees, 1 m before the eye.")
    elif not node.reported:
        label = source.text(node.get("type")) or "this projection"
        source.drop(node, f"{label} is not rendered here: a flat panel of {fov:g} degrees stands in for it")
    half = DISTANCE_M * math.tan(math.radians(fov / 2))
    x, y = half * pixels[0] / max(pixels), half * pixels[1] / max(pixels)
    x, y = max(x, SMALLEST_M), max(y, SMALLEST_M)
    placed: Float64 = eye + np.array([[-x, -y, -DISTANCE_M], [x, -y, -DISTANCE_M], [-x, y, -DISTANCE_M]])
    return placed


def _has_one_fov(node: Node) -> bool:
    """Whether a projection's field of view is one number."""
    fov = node.get("fov")
    return fov is not None and fov.kind == "value"


def vector(source: Source, node: Node | None) -> Float64 | None:
    """(3,) of {x, y, z}, 0 where one is missing; None if there is no node or one is not a number."""
    if node is None or node.kind != "object":
        return None
    parts = [0.0 if node.get(axis) is None else source.number(node.get(axis)) for axis in "xyz"]
    return None if any(part is None for part in parts) else np.array(parts, dtype=np.float64)


def is_unit(source: Source, scene: Node) -> bool:
    """Whether a scene's offset, orientation and scale change nothing."""
    scale = scene.get("scale")
    if scale is not None and source.number(scale) != 1.0:
        return False
    turn = scene.get("orientation")
    offset = scene.get("offset")
    angles = [] if turn is None else [source.number(turn.get(k)) for k in turn.fields if k != "w"]
    parts = [] if offset is None else [source.number(offset.get(k)) for k in offset.fields]
    return set(scene.fields) <= {"offset", "orientation", "scale"} and all(part == 0.0 for part in (*angles, *parts))
