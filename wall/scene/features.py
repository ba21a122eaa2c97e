"""What a scene may have, what it has and why, what that takes, and the scene without it.

`needs` says what is compiled into the tracer; here each of its features has words for a reader.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.scene.animation import Tracks
from wall.scene.build import Scene
from wall.scene.model import NO_TEXTURES, Material, Mesh, Texture
from wall.scene.needs import needs
from wall.scene.parameter_tracks import ParameterTrack

MIP_SHARE = 4.0 / 3.0  # of a texture's texels with all of its mip levels
BASE, ROUGHNESS, EMISSION, NORMAL = range(4)  # slots of TextureSet


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """One feature, in a reader's words."""

    name: str
    used: bool
    why: str  # what of the scene asks for it; where it is not used, what would
    bytes: int = 0  # memory of a rank that it takes; below 0: that it saves
    fields: tuple[str, ...] = ()  # of adaptive samples that packets carry for it
    without: Callable[[], Scene] | None = None  # the scene without it; None: it goes with another one


def features(scene: Scene) -> tuple[Feature, ...]:
    """Every feature of a scene as a view shows it: how light is followed, surfaces, lights, objects, cuts and lens."""
    return (
        *_of_light(scene), *_of_surfaces(scene), *_of_lights(scene), *_of_objects(scene), *_of_views(scene),
    )  # fmt: skip


def added_one_by_one(scene: Scene) -> list[tuple[str, Scene]]:
    """The scene without any feature that can be left out, then with one more in each row; the last is the scene."""
    rows = []
    for name in reversed([feature.name for feature in features(scene)]):
        feature = next(each for each in features(scene) if each.name == name)
        if feature.used and feature.without is not None:
            rows.append((name, scene))
            scene = feature.without()
    return [("triangles under a sky", scene), *reversed(rows)]


def _of_surfaces(scene: Scene) -> Iterator[Feature]:
    wanted, meshes, materials = needs(scene), _shown(scene), _materials(scene)
    mapped = [scene.materials[mesh.material] for mesh in meshes if mesh.uvs is not None]
    sets = [material.textures for material in {id(material): material for material in mapped}.values()]
    used = [sorted({each[slot] for each in sets if each[slot] is not None}) for slot in range(4)]  # type: ignore[type-var]

    def images(slot: int) -> str:
        return f"{len(used[slot])} images of {sum(each[slot] is not None for each in sets)} materials"

    def size(slots: Sequence[int]) -> int:
        numbers = {k for slot in slots for k in used[slot] if k is not None}
        return sum(_texture_bytes(scene.textures[k]) for k in numbers)

    def of_materials(holds: Callable[[Material], bool]) -> str:
        return f"{sum(map(holds, materials))} of {len(materials)} materials"

    uvs = sum(mesh.uvs.nbytes for mesh in meshes if mesh.uvs is not None) if wanted.textures else 0
    yield Feature(
        name="textures", used=wanted.textures, why=images(BASE) + " for base colour" * wanted.textures,
        bytes=size((BASE,)) + uvs, without=lambda: _changed(scene, textures=NO_TEXTURES),
    )  # fmt: skip
    yield Feature(
        name="normal maps", used=wanted.normal_textures, why=images(NORMAL), bytes=size((NORMAL,)),
        without=lambda: _without_slot(scene, NORMAL),
    )  # fmt: skip
    yield Feature(
        name="roughness textures", used=wanted.metallic_roughness_textures, why=images(ROUGHNESS) + ", on paths",
        bytes=size((ROUGHNESS,)), without=lambda: _without_slot(scene, ROUGHNESS),
    )  # fmt: skip
    yield Feature(
        name="emission textures", used=wanted.emission_textures, why=images(EMISSION), bytes=size((EMISSION,)),
        without=lambda: _without_slot(scene, EMISSION),
    )  # fmt: skip
    yield Feature(
        name="texture edges", used=wanted.texture_edges, why="textures that do not repeat",
        without=lambda: replace(scene, textures=tuple(replace(t, wrap=("repeat", "repeat")) for t in scene.textures)),
    )  # fmt: skip
    yield Feature(
        name="several texture coordinates", used=wanted.uv_sets, why="textures of other than the first ones",
        without=lambda: replace(scene, textures=tuple(replace(t, uv_set=0) for t in scene.textures)),
    )  # fmt: skip
    yield Feature(
        name="alpha", used=wanted.alpha, why=of_materials(lambda m: m.alpha_mode != "opaque"),
        without=lambda: _changed(scene, alpha_mode="opaque"),
    )  # fmt: skip
    round_ones = [mesh for mesh in meshes if mesh.spheres is not None]
    spheres = [mesh for mesh in round_ones if mesh.segments is None]
    curves = [mesh for mesh in round_ones if mesh.segments is not None]
    triangles = [mesh for mesh in meshes if mesh.spheres is None]
    yield Feature(
        name="points", used=wanted.points, why=f"{len(spheres)} of {len(meshes)} meshes are spheres",
        bytes=sum(mesh.spheres.nbytes for mesh in spheres if mesh.spheres is not None),
        without=(lambda: _without(scene, spheres)) if len(spheres) < len(meshes) else None,
    )  # fmt: skip
    yield Feature(
        name="curves", used=wanted.curves, why=f"{len(curves)} of {len(meshes)} meshes are curves",
        bytes=sum(mesh.spheres.nbytes for mesh in curves if mesh.spheres is not None),
        without=(lambda: _without(scene, curves)) if len(curves) < len(meshes) else None,
    )  # fmt: skip
    yield _attribute(scene, round_ones, "colours of points and curves", "colors", wanted.point_colors)
    yield _attribute(scene, triangles, "vertex colours", "colors", wanted.vertex_colors)
    yield _attribute(scene, meshes, "smooth normals", "normals", wanted.smooth_normals)
    yield Feature(
        name="mirrors", used=wanted.mirrors, why=of_materials(lambda m: m.mirror > 0.0),
        without=lambda: _changed(scene, mirror=0.0),
    )  # fmt: skip
    yield Feature(
        name="glass", used=wanted.paths and any(m.transmission > 0.0 for m in materials),
        why=of_materials(lambda m: m.transmission > 0.0) + ", on paths",
        without=lambda: _changed(scene, transmission=0.0, thin=False),
    )  # fmt: skip
    yield Feature(
        name="metals and coats", used=wanted.interfaces,
        why=of_materials(lambda m: max(m.metallic, m.specular) > 0.0) + ", on paths",
        without=lambda: _changed(scene, metallic=0.0, specular=0.0, thin=False),
    )  # fmt: skip
    yield Feature(
        name="surfaces that shine", used=wanted.emission, why=of_materials(lambda m: max(m.emission) > 0.0),
        without=lambda: _changed(scene, emission=(0.0, 0.0, 0.0)),
    )  # fmt: skip


def _of_lights(scene: Scene) -> Iterator[Feature]:
    wanted = needs(scene)
    for name in ("point", "spot", "directional"):
        count = len(getattr(scene, f"{name}_lights"))
        yield Feature(
            name=f"{name} lights", used=count > 0, why=f"{count} of the scene",
            without=lambda name=name: _without_lights(scene, name),  # type: ignore[misc]
        )  # fmt: skip
    yield Feature(
        name="sun discs", used=wanted.suns, why="directional lights with an angular diameter, on paths",
        without=lambda: replace(
            scene, directional_lights=tuple(replace(each, angular_diameter=0.0) for each in scene.directional_lights)
        ),
    )  # fmt: skip
    environment = scene.environment
    yield Feature(
        name="sky", used=environment is None, why="every scene without an environment has one"
    )  # fmt: skip
    yield Feature(
        name="environment", used=wanted.environment, why="an image in place of the sky",
        bytes=0 if environment is None else environment.texels.nbytes,
        without=lambda: replace(scene, environment=None, parameter_tracks=_other_tracks(scene, "environment.")),
    )  # fmt: skip


def _of_objects(scene: Scene) -> Iterator[Feature]:
    wanted, count, there = needs(scene), len(scene.instances), scene.at_once
    placed = [scene.meshes[instance.mesh] for instance in there]
    once = {instance.mesh for instance in scene.instances}
    spared = sum(map(_mesh_bytes, placed)) - sum(_mesh_bytes(scene.meshes[k]) for k in once)
    yield Feature(
        name="instancing", used=wanted.instancing, why=f"{len(there)} objects of {len(once)} meshes", bytes=-spared
    )
    still, moving = wanted.animation and not wanted.relighting, len(scene.animated_objects)
    lights = int((scene.tracks.bodies >= count).sum())
    yield Feature(
        name="motion", used=wanted.animation,
        why=f"{moving} objects, {lights} lights and {len(scene.parameter_tracks)} parameters move",
        without=lambda: _still(scene),
    )  # fmt: skip
    yield Feature(
        name="relighting", used=wanted.relighting,
        why="with motion" if not still else "not on paths, with spots, an environment or above 32 lights",
        fields=("normal", "light visibility") if wanted.relighting else (),
    )  # fmt: skip
    yield Feature(
        name="change detection", used=wanted.change_detection, why="with motion and mirrors, not on paths",
        fields=("change",) if wanted.change_detection else (),
    )  # fmt: skip


def _of_light(scene: Scene) -> Iterator[Feature]:
    wanted, depth = needs(scene), scene.path_depth
    paths = wanted.paths and not wanted.occlusion
    yield Feature(
        name="paths", used=paths, why=f"of {depth} surfaces at most" if paths else "integrator: {method: path}",
        fields=("normal", "albedo") if wanted.paths else (), without=lambda: _direct(scene),
    )  # fmt: skip
    yield Feature(
        name="ambient occlusion", used=wanted.occlusion, why="integrator: {method: ambient_occlusion}",
        without=lambda: _direct(scene),
    )  # fmt: skip


def _of_views(scene: Scene) -> Iterator[Feature]:
    yield Feature(
        name="cuts", used=bool(scene.cuts), why=f"{len(scene.cuts)} planes",
        without=lambda: replace(scene, cuts=(), parameter_tracks=_other_tracks(scene, "cuts.")),
    )  # fmt: skip
    yield Feature(
        name="lens", used=scene.lens is not None, why="a view with a lens, on paths",
        without=lambda: replace(scene, lens=None, parameter_tracks=_other_tracks(scene, "lens.")),
    )  # fmt: skip


def _shown(scene: Scene) -> list[Mesh]:
    return [scene.meshes[k] for k in sorted({instance.mesh for instance in scene.instances})]


def _materials(scene: Scene) -> list[Material]:
    return [scene.materials[k] for k in sorted({mesh.material for mesh in _shown(scene)})]


def _texture_bytes(texture: Texture) -> int:
    return round(MIP_SHARE * texture.texels.nbytes) + (0 if texture.alpha is None else texture.alpha.nbytes)


def _mesh_bytes(mesh: Mesh) -> int:
    return mesh.vertices.nbytes + mesh.triangles.nbytes


def _attribute(scene: Scene, meshes: Sequence[Mesh], name: str, attribute: str, used: bool) -> Feature:
    """An attribute of the vertices of some meshes."""
    rows = [getattr(mesh, attribute) for mesh in meshes if getattr(mesh, attribute) is not None]
    none: dict[str, Any] = {attribute: None}
    return Feature(
        name=name, used=used, why=f"{len(rows)} of {len(meshes)} meshes", bytes=sum(each.nbytes for each in rows),
        without=lambda: replace(
            scene,
            meshes=tuple(replace(m, **none) if any(m is each for each in meshes) else m for m in scene.meshes),
        ),
    )  # fmt: skip


def _changed(scene: Scene, **properties: Any) -> Scene:
    """The scene with these properties of all materials."""
    return replace(scene, materials=tuple(replace(each, **properties) for each in scene.materials))


def _without_slot(scene: Scene, slot: int) -> Scene:
    """The scene without the textures of one slot."""
    name = NO_TEXTURES._fields[slot]
    of_each = (each.textures._replace(**{name: None}) for each in scene.materials)
    return replace(
        scene, materials=tuple(replace(m, textures=t) for m, t in zip(scene.materials, of_each, strict=True))
    )


def _other_tracks(scene: Scene, *prefixes: str) -> tuple[ParameterTrack, ...]:
    return tuple(track for track in scene.parameter_tracks if not track.name.startswith(prefixes))


def _direct(scene: Scene) -> Scene:
    tracks = _other_tracks(scene, "lens.", "integrator.")
    return replace(scene, path_depth=None, occlusion=None, lens=None, parameter_tracks=tracks)


def _without(scene: Scene, meshes: Sequence[Mesh]) -> Scene:
    """The scene without objects of some meshes; lights keep their rows behind those of objects."""
    gone = {id(mesh) for mesh in meshes}
    placed = np.array([id(scene.meshes[each.mesh]) not in gone for each in scene.instances], np.bool_)
    rows = np.cumsum(placed) - 1
    series = [replace(each, first=int(rows[each.first])) for each in scene.series if placed[each.first]]
    return replace(_with_instances(scene, placed), series=tuple(series))


def _still(scene: Scene) -> Scene:
    """The scene without motion; of series, the first steps."""
    placed = np.ones(len(scene.instances), np.bool_)
    for each in scene.series:
        placed[each.rows.start + 1 : each.rows.stop] = False
    still = replace(scene, tracks=Tracks(), parameter_tracks=(), series=())
    return still if placed.all() else _with_instances(still, placed)


def _with_instances(scene: Scene, placed: NDArray[np.bool_]) -> Scene:
    """The scene with some of its instances alone; its series are left as they were."""
    kept = np.concatenate([placed, np.ones(len(scene.rest) - len(placed), np.bool_)])
    instances = tuple(each for each, stays in zip(scene.instances, placed, strict=True) if stays)
    return replace(_with_bodies(scene, kept), instances=instances)


def _without_lights(scene: Scene, kind: str) -> Scene:
    """The scene without its point, spot or directional lights, and without what moves them."""
    counts = [len(scene.instances), len(scene.point_lights), len(scene.spot_lights), len(scene.directional_lights)]
    starts = np.cumsum([0, *counts])
    k = ("point", "spot", "directional").index(kind) + 1
    kept = np.ones(starts[-1], np.bool_)
    kept[starts[k] : starts[k + 1]] = False
    rows = np.cumsum(kept) - 1
    order = tuple(
        row if row < 0 else int(rows[counts[0] + row]) - counts[0]
        for row in scene.light_order
        if row < 0 or kept[counts[0] + row]
    )
    none: dict[str, Any] = {f"{kind}_lights": ()}
    tracks = _other_tracks(scene, "lights.")
    return replace(_with_bodies(scene, kept), **none, light_order=order, parameter_tracks=tracks)


def _with_bodies(scene: Scene, kept: NDArray[np.bool_]) -> Scene:
    """The scene with the places and motions of those bodies alone that are kept, under their new rows."""
    layers, tracks, rows = [], scene.tracks, np.cumsum(kept) - 1
    for layer in tracks.layers:
        own = kept[layer.rows]
        columns: dict[str, Any] = {each.name: getattr(layer, each.name)[own] for each in fields(layer)}
        columns["rows"] = rows[layer.rows[own]]
        if own.any():
            layers.append(replace(layer, **columns))
    tracks = Tracks(layers=tuple(layers), bodies=rows[tracks.bodies[kept[tracks.bodies]]])
    return replace(scene, rest=scene.rest[kept], tracks=tracks)
