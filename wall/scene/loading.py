"""Models from files, through trimesh: glTF/GLB, OBJ, PLY and STL, with node transforms and instancing kept.

A mesh of the file is one Mesh however often the file places it. Nothing is merged or centred. glTF says that y is up;
the other formats do not say, and are turned so that y is. A file that cannot be used raises SceneError; what
could be repaired is in the notes.
"""

from __future__ import annotations

import io
import logging
import struct
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.core.errors import SceneError
from wall.core.files import read_file
from wall.scene.animation import Moving
from wall.scene.appearance import Palette
from wall.scene.bounds import framing_sphere, world_boxes
from wall.scene.gltf import (
    IDENTITY,
    KEPT,
    MALFORMED,
    MOST_BYTES,
    NORMALIZED,
    UvSet,
    cameras_of,
    check_read,
    lights_of,
    renamed,
    unread,
)
from wall.scene.gltf_animation import motions_of
from wall.scene.gltf_instancing import instance_poses
from wall.scene.lights import scaled
from wall.scene.loader_process import MODEL_SUFFIXES
from wall.scene.model import Instance, Mesh, Source
from wall.scene.mtl import Maps, options_of
from wall.scene.repair import RawMesh, Repaired, repair
from wall.scene.unreadable import as_utf8, check_ply, text_of, why_unreadable
from wall.scene.up import Y_FROM

if TYPE_CHECKING:
    from wall.config.scene import Up

FLATTEST = 1e-7  # smallest over largest stretch of a placement that can still be inverted
SMALLEST_RADIUS, LARGEST_RADIUS = 1e-4, 1e7  # of a whole model, world units; others are scaled to radius 1
NOTEWORTHY = ("fail", "unable", "unsupported", "skipping", "not loaded", "didn't decode")


def load(path: Path, up: Up = "auto", *, textures_given: bool = False) -> Source:
    """Read a model file; `up`: what is up in it, see SceneConfig; `textures_given`: meshes without textures keep their
    texture coordinates, as a configuration has some for them.

    Raises SceneError: missing, unknown format, unreadable, or nothing left to draw.
    """
    loaded, notes, header = _read(path)
    gltf = path.suffix.lower() in (".glb", ".gltf")
    turn = np.eye(4)
    if not gltf:
        chosen = up if up != "auto" else "z" if path.suffix.lower() == ".stl" else "y"
        turn[:3, :3] = Y_FROM[chosen]
        guess = f"{path.name}: the format does not say which way is up; {chosen} is taken to be; scene.up or --up says"
        notes += [guess] if up == "auto" else []
    elif up != "auto":
        notes.append(f"{path.name}: glTF says that y is up; scene.up or --up changes nothing here")
    maps = Maps(_Beside(str(path)).get)
    palette = Palette(linear_vertex_colors=gltf, textures_given=textures_given, header=header, maps=maps)
    meshes: list[Mesh] = []
    numbers: dict[str, tuple[int, float]] = {}
    for name, geometry in loaded.geometry.items():
        repaired = _mesh(name, geometry, palette)
        notes += repaired.notes if isinstance(repaired, Repaired) else repaired
        if isinstance(repaired, Repaired):
            numbers[name] = (len(meshes), repaired.unit)
            meshes.append(repaired.mesh)
    try:
        lights, said = lights_of(header)
        cameras, more = cameras_of(header)
        poses = instance_poses(path, header)
        said += [*more, *unread(header)]
    except (*MALFORMED, OSError, struct.error) as error:
        raise SceneError(f"{path}: cannot be read as glTF, {type(error).__name__}: {error}") from error
    placed = list(_instances(loaded, numbers, poses, notes))
    instances = [replace(i, world_from_object=turn @ i.world_from_object) for _, i in placed]
    notes += palette.said()
    if not instances:
        raise SceneError(
            f"{path}: holds nothing that can be drawn, wanted at least one triangle with area"
            + "".join(f"\n  {note}" for note in [why_unreadable(path), *notes] if note)
        )
    notes += [f"{path.name}: {what}" for what in said]
    source = Source(
        meshes=tuple(meshes),
        materials=tuple(palette.materials),
        textures=tuple(palette.images.textures),
        instances=tuple(instances),
        lights=lights or None,
        cameras=cameras,
        of_paths=tuple(palette.of_paths),
    )
    source = replace(source, motions=_motions(path, header, source, [frame for frame, _ in placed], notes))
    return _comfortable(source, notes)


def _motions(
    path: Path, header: dict[str, Any], source: Source, frames: list[str], notes: list[str]
) -> tuple[Moving, ...]:
    """How a glTF file moves its objects; what cannot be read is noted, and nothing moves then."""
    boxes = world_boxes(source.meshes, source.instances)
    try:
        motions, said = motions_of(path, header, frames, source.instances, boxes.mean(axis=1))
    except (*MALFORMED, OSError, struct.error) as error:
        notes.append(f"{path.name}: its animation cannot be read ({type(error).__name__}: {error})")
        return ()
    notes += [f"{path.name}: {what}" for what in said]
    return motions


def _read(path: Path) -> tuple[Any, list[str], dict[str, Any]]:
    """trimesh's scene of a file, what trimesh only whispers to its log, and a glTF's JSON, {} for other formats."""
    known = ", ".join(MODEL_SUFFIXES)
    if path.suffix.lower() not in MODEL_SUFFIXES:
        raise SceneError(f"{path}: no built-in scene and no known kind of model, known are {known}")
    if not path.is_file():
        raise SceneError(f"{path}: is a folder" if path.is_dir() else f"{path}: there is no such file")
    with _overheard(path.name) as notes:
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # numpy's, about numbers that trimesh's parsers stumble on
                loaded, header = _parsed(path)
                return loaded, notes, header
        except MemoryError:
            raise
        except Exception as error:  # parsers of broken files raise anything
            reason = why_unreadable(path) or f"{type(error).__name__}: {error}"
            raise SceneError(f"{path}: cannot be read as {path.suffix.lower()[1:]}, {reason}") from error


def _parsed(path: Path) -> tuple[Any, dict[str, Any]]:
    """trimesh's scene, and a glTF's JSON. An OBJ keeps its objects apart, and may have any bytes in its comments."""
    kind = path.suffix.lower()[1:]
    beside = _Beside(str(path))
    if kind in ("glb", "gltf"):
        data, header = renamed(path)
        check_read(header)
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=beside, process=False), header
    data = read_file(path, MOST_BYTES)
    if kind == "ply":
        check_ply(data)
    if kind != "obj":  # of a whole path trimesh takes the kind and the object's name
        file = io.BytesIO(as_utf8(data, kind))
        return trimesh.load_scene(file, file_type=str(path), resolver=beside, process=False), {}
    text = io.StringIO(text_of(data))
    return trimesh.load_scene(text, file_type="obj", resolver=beside, process=False, split_objects=True), {}


class _Beside(trimesh.resolvers.FilePathResolver):
    """Reads files beside a model; not pipes and devices, which may never end."""

    def get(self, name: str) -> bytes:
        """The bytes of a file that a model names. Raises OSError, and ValueError for one that is not beside it."""
        name = options_of(name.split())[1] if name.strip().startswith("-") else name.strip()  # of a map_Kd
        inside = [self.absolute(each) for each in (name, name.lstrip("/"), Path(name).name) if self._is_inside(each)]
        found = next((path for path in inside if path.exists()), self.absolute(name))
        return as_utf8(read_file(found, MOST_BYTES), found.suffix.lower()[1:])

    def _is_inside(self, name: str) -> bool:
        parent = Path(self.parent).resolve()
        return (parent / name).resolve().is_relative_to(parent)


@contextmanager
def _overheard(where: str) -> Iterator[list[str]]:
    """Collect trimesh's complaints of a load as notes; its logger is put back as it was."""
    notes: list[str] = []
    logger = logging.getLogger("trimesh")
    before = logger.level, logger.propagate
    ear = MemoryHandler(capacity=1 << 20, flushLevel=logging.CRITICAL + 1)
    logger.addHandler(ear)
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    try:
        yield notes
    finally:
        logger.setLevel(before[0])
        logger.propagate = before[1]
        logger.removeHandler(ear)
        for record in ear.buffer:
            text = record.getMessage()
            cause = record.exc_info[1] if record.exc_info else None
            if any(word in text.lower() for word in NOTEWORTHY):
                notes.append(f"{where}: {text} ({type(cause).__name__}: {cause})" if cause else f"{where}: {text}")


def _mesh(name: str, geometry: Any, palette: Palette) -> Repaired | tuple[str, ...]:
    """One of the file's geometries, repaired; or why there is nothing to draw in it."""
    triangles = _triangles(geometry)
    vertices = _attribute("POSITION", geometry, np.asarray(geometry.vertices, np.float64))
    if triangles is None or vertices.ndim != 2 or vertices.shape[1] != 3:
        what = f"{type(geometry).__name__} of {len(vertices)} points"
        points = "; points are shown by scene.data, type: points" if "Point" in what else ""
        return (f"{name!r} is no triangle mesh ({what}), and is left out{points}",)
    if len(triangles) == 0:
        return (f"mesh {name!r} is empty, and is left out",)
    visual: Any = getattr(geometry, "visual", None)
    given = np.asarray(geometry.vertex_normals, np.float64) if "vertex_normals" in geometry._cache else None
    normals = _attribute("NORMAL", geometry, given)
    if getattr(visual, "kind", None) == "face" and triangles.min() >= 0 and triangles.max() < len(vertices):
        colors = palette.linear(np.repeat(np.asarray(visual.face_colors), 3, axis=0))
        corners = triangles.reshape(-1)
        own = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
        return repair(RawMesh(name=name, vertices=vertices[corners], triangles=own, colors=colors), palette.plain())
    colors_or_none = palette.vertex_colors(visual, len(vertices))
    material = palette.material(visual) if colors_or_none is None or hasattr(visual, "material") else palette.plain()
    palette.see_alpha(visual, material)
    textured = palette.textures_given or any(k is not None for k in palette.materials[material].textures)
    uvs, notes = _uvs(name, geometry, palette.uv_sets.get(material, (UvSet(),))) if textured else (None, ())
    raw = RawMesh(
        name=name,
        vertices=vertices,
        triangles=triangles,
        normals=normals,
        uvs=uvs,
        colors=colors_or_none,
    )
    palette.notes += notes
    return repair(raw, material)


def _attribute(name: str, geometry: Any, otherwise: Float64 | None) -> Any:
    """(v, width) float64 of an attribute that a glTF's mesh has kept; its normalized integers are what they stand for.

    otherwise : what it is where the mesh has kept none. glTF 2.0 specification, 3.6.2.
    """
    attributes = getattr(geometry, "vertex_attributes", {})
    whole = attributes.get(f"{KEPT}{name}{NORMALIZED}")
    if whole is not None and np.issubdtype(whole.dtype, np.integer):
        return np.maximum(whole / np.iinfo(whole.dtype).max, -1.0)
    plain = attributes.get(f"{KEPT}{name}") if whole is None else whole
    return otherwise if plain is None else np.asarray(plain, np.float64)


def _uvs(name: str, geometry: Any, wanted: tuple[UvSet, ...]) -> tuple[Float64 | None, tuple[str, ...]]:
    """(v, 2 n) texture coordinates, v up, of a mesh that shows n sets, and notes of those that it lacks; None: it has
    none at all.
    """
    found = {0: getattr(geometry.visual, "uv", None)}
    for number in {0} | {uv_set.number for uv_set in wanted}:
        down = _attribute(f"TEXCOORD_{number}", geometry, None)
        if down is not None and down.ndim == 2 and down.shape[1] == 2:
            found[number] = np.stack([down[:, 0], 1.0 - down[:, 1]], 1)
    sets = {number: np.asarray(uvs, np.float64)[:, :2] for number, uvs in found.items() if uvs is not None}
    sets = {number: uvs for number, uvs in sets.items() if len(uvs) == len(geometry.vertices)}
    if not sets:
        return None, ()
    missing = sorted({uv_set.number for uv_set in wanted} - sets.keys())
    notes = (f"mesh {name!r} has no texture coordinates of set {k}; those of another set are used" for k in missing)
    spare = next(iter(sets.values()))
    columns = [transformed(sets.get(uv_set.number, spare), uv_set.transform) for uv_set in wanted]
    return np.concatenate(columns, axis=1), tuple(notes)


def transformed(uvs: Float64, transform: tuple[float, ...]) -> Float64:
    """Texture coordinates (v, 2), v up, changed as UvSet says."""
    if transform == IDENTITY:
        return uvs
    u, v = uvs[:, 0], 1.0 - uvs[:, 1]
    moved = np.stack([u, v, np.ones_like(u)], 1) @ np.reshape(transform, (2, 3)).T
    return np.stack([moved[:, 0], 1.0 - moved[:, 1]], 1)


def _triangles(geometry: Any) -> NDArray[np.int64] | None:
    """(t, 3) of a mesh; also of a PLY that keeps its surface as strips, which trimesh takes for points."""
    if isinstance(geometry, trimesh.Trimesh):
        return np.asarray(geometry.faces, np.int64).reshape(-1, 3)
    strips = geometry.metadata.get("_ply_raw", {}).get("tristrips", {}).get("data")
    if strips is None:
        return None
    rows = strips.values() if isinstance(strips, dict) else [strips[name]["f1"] for name in strips.dtype.names]
    found = [strip_triangles(np.ravel(row).astype(np.int64)) for lists in rows for row in np.atleast_2d(lists)]
    return np.concatenate(found)


def strip_triangles(strip: NDArray[np.int64]) -> NDArray[np.int64]:
    """(t, 3) triangles of a strip in which -1 begins a new one; every second triangle is turned round."""
    if len(strip) < 3:
        return np.empty((0, 3), np.int64)
    windows = np.stack([strip[:-2], strip[1:-1], strip[2:]], 1)
    breaks = np.where(strip == -1, np.arange(len(strip)), -1)
    start = np.maximum.accumulate(breaks)[:-2] + 1
    odd = (np.arange(len(windows)) - start) % 2 == 1
    windows[odd] = windows[odd][:, [1, 0, 2]]
    return windows[(windows >= 0).all(axis=1)]


def _instances(
    loaded: Any, numbers: dict[str, tuple[int, float]], poses: dict[str, Float64], notes: list[str]
) -> Iterator[tuple[str, Instance]]:
    """Every placement in the file's graph of a mesh that is left, and the frame of the file's node that makes it.

    numbers : of meshes, with their units; poses : (n, 4, 4) by frames that place their meshes many times
    """
    parents, names = loaded.graph.transforms.parents, dict[str, str]()  # names: by frames, the file's or a first mesh's
    placed = []
    for node in loaded.graph.nodes_geometry:
        matrix, geometry = loaded.graph[node]
        if geometry not in numbers:
            continue
        number, unit = numbers[geometry]
        part = loaded.geometry[geometry].metadata.get("from_gltf_primitive")  # one of a node's several meshes
        frame = str(parents[node] if part else node)
        name = names.setdefault(frame, str(geometry) if frame.isdigit() else frame)  # all parts are one object
        placements = np.array(matrix, np.float64) @ poses.get(frame, np.eye(4)[None])
        good = [bool(np.isfinite(each).all()) and not _flat(each[:3, :3]) for each in placements]
        if not all(good):
            notes.append(f"object {name!r}: its placement squashes it flat or is not finite; left out")
        placements[:, :3, :3] *= unit
        placements[:, 3] = 0.0, 0.0, 0.0, 1.0
        placed += [(frame, name, number, placement) for placement in placements[good]]
    for frame, name, number, placement in placed:
        above = {names[other] for other in _above(parents, frame) if other in names} - {name}
        yield frame, Instance(name=name, mesh=number, world_from_object=placement, parents=tuple(sorted(above)))


def _above(parents: Mapping[str, str], frame: str) -> Iterator[str]:
    """The frames that one is below of."""
    while (above := parents.get(frame)) is not None:
        frame = str(above)
        yield frame


def _flat(matrix: Float64) -> bool:
    stretch = np.linalg.svd(matrix, compute_uv=False)
    return bool(stretch[-1] <= FLATTEST * stretch[0])


def _comfortable(source: Source, notes: list[str]) -> Source:
    """The source with its notes; a model of extreme size is scaled about the world's origin to radius 1."""
    _, radius = framing_sphere(source.meshes, source.instances)
    if not SMALLEST_RADIUS <= radius <= LARGEST_RADIUS:
        scale = np.diag([1.0 / radius, 1.0 / radius, 1.0 / radius, 1.0])
        placed = (replace(i, world_from_object=scale @ i.world_from_object) for i in source.instances)
        nearer = np.ones((4, 4))
        nearer[:3, 3] = 1.0 / radius  # a camera stays as large as it is
        cameras = (replace(c, world_from_camera=nearer * c.world_from_camera) for c in source.cameras)
        motions = (moving.scaled(1.0 / radius) for moving in source.motions)
        lights = None if source.lights is None else tuple(scaled(light, 1.0 / radius) for light in source.lights)
        materials = (replace(m, attenuation_distance=m.attenuation_distance / radius) for m in source.materials)
        source = replace(
            source,
            instances=tuple(placed), motions=tuple(motions), cameras=tuple(cameras), lights=lights,
            materials=tuple(materials),
        )  # fmt: skip
        notes = [*notes, f"the model's radius is {radius:.3g}; everything is scaled by {1.0 / radius:.3g} to radius 1"]
    return replace(source, notes=tuple(notes))
