"""Raw triangles from a file, made fit to trace: what can be repaired is, and said; nothing is merged or moved.

Triangles are dropped that name a vertex that is not there, touch a coordinate that is not finite (or beyond
FARTHEST), or have no area. What remains is stored about its own middle and, where its size would leave float32's
comfortable range, in its own unit; the instance's float64 matrix puts it back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.scene.model import Mesh
from wall.scene.normals import crease_normals, same_position

FARTHEST = 1e100  # products of three coordinates still fit float64
THINNEST = 1e-7  # height over length of a triangle; less is below what float32 vertices can tell apart
SMALLEST_EXTENT, LARGEST_EXTENT = 1e-4, 1e6  # squares and cubes of lengths stay normal float32 numbers
REMOTE = 1e4  # distance from the origin over size, from which on it is worth a word


@dataclass(frozen=True, slots=True, kw_only=True)
class RawMesh:
    """One mesh as a file has it, or code makes it."""

    name: str = ""
    vertices: Float64  # (v, 3) object space
    triangles: NDArray[np.integer]  # (t, 3)
    normals: Float64 | None = None  # (v, 3)
    uvs: Float64 | None = None  # (v, 2 n), n sets of u and v, v up
    colors: Float32 | None = None  # (v, 3) linear RGB

    def taken(self, rows: NDArray[np.integer], triangles: NDArray[np.integer]) -> RawMesh:
        """The mesh of some of its vertices, which `triangles` count by their positions in `rows`."""
        values = {name: getattr(self, name) for name in ("vertices", "normals", "uvs", "colors")}
        taken: dict[str, Any] = {name: value[rows] for name, value in values.items() if value is not None}
        return replace(self, triangles=triangles, **taken)

    def shaded(self, material: int, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
        """As a scene's mesh, with its own normals, or else smooth ones by the crease rule."""
        raw = self
        if raw.normals is None:
            if raw.uvs is None and raw.colors is None:  # equal positions once: an STL repeats each about six times
                positions = same_position(raw.vertices)
                raw = raw.taken(np.unique(positions, return_index=True)[1], positions[raw.triangles])
            smoothed = crease_normals(raw.vertices, raw.triangles)
            if smoothed is not None:
                raw = replace(raw.taken(smoothed.source, smoothed.triangles), normals=smoothed.normals)
        normals, uvs, colors = (None if a is None else a.astype(np.float32) for a in (raw.normals, raw.uvs, raw.colors))
        return Mesh(
            name=raw.name,
            vertices=raw.vertices.astype(np.float32),
            triangles=raw.triangles.astype(np.uint32),
            material=material,
            origin=origin,
            normals=normals,
            uvs=uvs,
            colors=colors,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Repaired:
    """A mesh fit to trace, the unit that its vertices are in, and what was done."""

    mesh: Mesh
    unit: float  # object units; placements are multiplied by it
    notes: tuple[str, ...]


def unit_of(extent: float) -> float:
    """The unit, in object units, that vertices so far apart are stored in."""
    return 1.0 if extent == 0.0 or SMALLEST_EXTENT <= extent <= LARGEST_EXTENT else extent


def repair(raw: RawMesh, material: int) -> Repaired | tuple[str, ...]:
    """A traceable mesh, or only the notes that say why nothing of it is left."""
    triangles, notes = _usable(raw)
    if len(triangles) == 0:
        return (*notes, f"mesh {raw.name!r} has no triangle that could be drawn, and is left out")
    used, flat = np.unique(triangles, return_inverse=True)
    vertices = raw.vertices[used]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    origin, extent = low / 2.0 + high / 2.0, float((high - low).max())
    unit = unit_of(extent)
    if np.linalg.norm(origin) > REMOTE * extent:
        notes.append(
            f"mesh {raw.name!r} lies {np.linalg.norm(origin):.3g} from the origin and is {extent:.3g} large: "
            "kept about its own middle, as exactly as its file gives it"
        )
    kept = RawMesh(
        name=raw.name,
        vertices=(vertices - origin) / unit,
        triangles=flat.reshape(-1, 3),
        normals=_given_normals(raw, used, notes),
        uvs=_given_uvs(raw, used, notes),
        colors=None if raw.colors is None else np.nan_to_num(raw.colors[used], nan=1.0, posinf=1.0, neginf=0.0),
    )
    kept = _without_slivers(kept, notes)
    if len(kept.triangles) == 0:
        return (*notes, f"mesh {raw.name!r} has no area, and is left out")
    x, y, z = (origin / unit).tolist()
    return Repaired(mesh=kept.shaded(material, (x, y, z)), unit=unit, notes=tuple(notes))


def _usable(raw: RawMesh) -> tuple[NDArray[np.integer], list[str]]:
    """Triangles whose corners exist and are finite."""
    notes = []
    there = np.all((raw.triangles >= 0) & (raw.triangles < len(raw.vertices)), axis=1)
    if not there.all():
        notes.append(
            f"mesh {raw.name!r}: {np.count_nonzero(~there)} triangles name a vertex that is not there "
            f"(it has {len(raw.vertices)}), dropped"
        )
    triangles = raw.triangles[there]
    with np.errstate(invalid="ignore"):
        finite = np.atleast_1d(np.all(np.abs(raw.vertices) <= FARTHEST, axis=1))
    touched = ~finite[triangles].all(axis=1)
    if touched.any():
        notes.append(
            f"mesh {raw.name!r}: {np.count_nonzero(~finite)} vertices are NaN, infinite or beyond {FARTHEST:g}; "
            f"{np.count_nonzero(touched)} triangles that touch them dropped"
        )
    return triangles[~touched], notes


def _without_slivers(raw: RawMesh, notes: list[str]) -> RawMesh:
    """The mesh without triangles that have no area once their corners are float32."""
    corners = raw.vertices.astype(np.float32).astype(np.float64)[raw.triangles]
    edges = np.roll(corners, -1, axis=1) - corners
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = (edges**2).sum(axis=2).max(axis=1)
    solid = area > THINNEST * longest
    if solid.all():
        return raw
    thin = ~solid & ((edges**2).sum(axis=2).min(axis=1) > 0.0)  # else two corners are one, as at a sphere's poles
    if thin.any():
        notes.append(f"mesh {raw.name!r}: {np.count_nonzero(thin)} triangles without area dropped")
    used, flat = np.unique(raw.triangles[solid], return_inverse=True)
    return raw.taken(used, flat.reshape(-1, 3))


def _given_normals(raw: RawMesh, used: NDArray[np.integer], notes: list[str]) -> Float64 | None:
    """The file's normals at unit length; None, said, where some are no directions."""
    if raw.normals is None or len(raw.normals) != len(raw.vertices):
        return None
    normals = raw.normals[used]
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        good = np.isfinite(length) & (length > 1e-12)
    if not good.all():
        bad = np.count_nonzero(~good)
        notes.append(f"mesh {raw.name!r}: {bad} of its normals are no directions; all computed anew")
        return None
    return np.asarray(normals / length, np.float64)


def _given_uvs(raw: RawMesh, used: NDArray[np.integer], notes: list[str]) -> Float64 | None:
    if raw.uvs is None or len(raw.uvs) != len(raw.vertices):
        return None
    uvs = raw.uvs[used]
    good = np.atleast_1d(np.isfinite(uvs).all(axis=1))
    if not good.all():
        notes.append(f"mesh {raw.name!r}: {np.count_nonzero(~good)} texture coordinates are not finite, taken as 0")
    return np.where(good[:, None], uvs, 0.0)
