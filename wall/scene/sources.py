"""What a configuration puts in a scene's world: built-in scenes and models, joined into one source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wall.config.loading import nearest
from wall.config.scene import SceneConfig, Up
from wall.core.errors import SceneError
from wall.scene.animation import Moving
from wall.scene.builtin.arcade import arcade
from wall.scene.builtin.cornell import cornell
from wall.scene.builtin.courtyard import courtyard
from wall.scene.builtin.forest import forest
from wall.scene.builtin.gallery import gallery, gallery_mirrors
from wall.scene.builtin.museum import museum
from wall.scene.builtin.spheres import spheres
from wall.scene.loader_process import load_models
from wall.scene.model import Instance, Material, Mesh, Source, Texture, TextureSet
from wall.scene.series import Series

BUILT_IN = {
    "arcade": arcade,
    "cornell": cornell,
    "courtyard": courtyard,
    "forest": forest,
    "gallery": gallery,
    "gallery_mirrors": gallery_mirrors,
    "museum": museum,
    "spheres": spheres,
}


def is_built_in(what: str | Path) -> bool:
    """Whether a built-in scene is meant; a file comes before one of the same name."""
    return str(what) in BUILT_IN and not Path(what).is_file()


def sources_of(scene_config: SceneConfig) -> tuple[str, ...]:
    """The names of the built-in scenes and models that are put in the scene's world."""
    source = scene_config.source
    return () if source is None else source if isinstance(source, tuple) else (source,)


def make_sources(
    names: Sequence[str], base_folder: Path, up: Up = "auto", *, textures_given: bool = False
) -> list[Source]:
    """Built-in scenes by their names, and model files; `up`, `textures_given`: see loading.load. Raises SceneError."""
    for name in names:
        if name not in BUILT_IN and not Path(name).suffix:
            near = nearest(name, BUILT_IN) or ";"
            raise SceneError(f"{name}: no built-in scene, and no model file{near} built in are {', '.join(BUILT_IN)}")
    files = [base_folder / name for name in names if name not in BUILT_IN]
    models = iter(load_models(files, up, textures_given=textures_given))
    return [_built_in(name, up) if name in BUILT_IN else next(models) for name in names]


def _built_in(name: str, up: Up) -> Source:
    said = () if up == "auto" else (f"{name}: a built-in scene has y up; scene.up or --up changes nothing here",)
    return replace(BUILT_IN[name](), notes=said)


def joined(sources: Sequence[Source]) -> Source:
    """Several sources in one world; lights and sky are those of the first that has any."""
    if len(sources) == 1:
        return sources[0]
    meshes: list[Mesh] = []
    materials: list[Material] = []
    textures: list[Texture] = []
    instances: list[Instance] = []
    motions: list[Moving] = []
    series: list[Series] = []
    for source in sources:
        motions += [replace(moving, body=moving.body + len(instances)) for moving in source.motions]
        series += [replace(each, first=each.first + len(instances)) for each in source.series]
        instances += [replace(i, mesh=i.mesh + len(meshes)) for i in source.instances]
        meshes += [replace(m, material=m.material + len(materials)) for m in source.meshes]
        materials += [_with_textures_from(len(textures), material) for material in source.materials]
        textures += source.textures
    return Source(
        meshes=tuple(meshes),
        materials=tuple(materials),
        textures=tuple(textures),
        instances=tuple(instances),
        lights=next((source.lights for source in sources if source.lights is not None), None),
        sky=next((source.sky for source in sources if source.sky is not None), None),
        animation=tuple(track for source in sources for track in source.animation),
        motions=tuple(motions),
        series=tuple(series),
        path_depth=max((source.path_depth for source in sources if source.path_depth is not None), default=None),
        cameras=tuple(camera for source in sources for camera in source.cameras),
        of_paths=tuple(name for source in sources for name in source.of_paths),
        notes=tuple(note for source in sources for note in source.notes),
    )


def _with_textures_from(first: int, material: Material) -> Material:
    """A material whose textures stand `first` rows further on."""
    return replace(material, textures=TextureSet(*(k if k is None else k + first for k in material.textures)))
