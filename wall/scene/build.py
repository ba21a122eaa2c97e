"""From a configuration to a scene: load or make the source, add its lights, sky and animation, find its bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.config.materials import AmbientOcclusionConfig, IntegratorConfig, PathConfig
from wall.config.scene import MotionConfig, ParameterConfig, SceneConfig
from wall.core.data import NO_EDITS, Edits, Float64
from wall.core.errors import SceneError
from wall.geometry.lens import Lens, NamedCamera
from wall.scene.animation import Moving, Tracks, Vector, compile_tracks
from wall.scene.area_lights import emitting
from wall.scene.bounds import framing_sphere, middle, world_boxes
from wall.scene.cuts import cuts_of
from wall.scene.environment import read_environment
from wall.scene.ground import ground
from wall.scene.lights import STUDIO_SKY, configured_light, default_lights
from wall.scene.materials import described, seen_on_paths, texture_of, with_materials
from wall.scene.model import (
    AmbientOcclusion,
    AreaLight,
    Cut,
    DirectionalLight,
    Environment,
    Instance,
    Light,
    Material,
    Mesh,
    Moment,
    PointLight,
    Shading,
    Sky,
    Source,
    SpotLight,
    Texture,
)
from wall.scene.object_edits import EditedObjects
from wall.scene.parameter_tracks import ParameterTrack, tracks_of
from wall.scene.placed import only_placed
from wall.scene.series import Series, at_once, hide_others
from wall.scene.shading import shaded
from wall.scene.sources import joined, make_sources, sources_of

MOMENTS = 4  # kept: a tracer and its renderer's deep buffer ask for two in turn
SHORTEST = 1e-12  # length of a direction; a shorter one, between opposite keyframes, lights nothing
SHADINGS = 16  # likewise, of states of edits


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Everything that is traced; arrays are read-only. Object k is instances[k]."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...]
    instances: tuple[Instance, ...]
    point_lights: tuple[PointLight, ...]
    spot_lights: tuple[SpotLight, ...]
    directional_lights: tuple[DirectionalLight, ...]
    sky: Sky
    environment: Environment | None  # in place of the sky
    tracks: Tracks
    notes: tuple[str, ...]  # each repair or assumption, for a reader
    cameras: tuple[NamedCamera, ...]  # that the source brings
    center: Float64  # (3,) world, middle of the bounding box at rest
    path_depth: int | None  # most surfaces that scatter a path; None: direct light alone
    occlusion: AmbientOcclusion | None  # paths of one surface, and no light that is followed
    radius: float  # world units, of the smallest sphere about `center`
    rest: Float64  # (bodies, 4, 4): instances, point lights, spot lights, directional lights
    light_order: tuple[int, ...] = ()  # of each light as named: its row in Shading.lights; -1: it has an area
    parameter_tracks: tuple[ParameterTrack, ...] = ()
    lens: Lens | None = None  # of the view that shows it; None: a pinhole
    cuts: tuple[Cut, ...] = ()
    series: tuple[Series, ...] = ()
    _moments: dict[tuple[float, Edits], Moment] = field(init=False, repr=False, compare=False, default_factory=dict)
    _shadings: dict[tuple[float, Edits], Shading] = field(init=False, repr=False, compare=False, default_factory=dict)
    _edited: EditedObjects = field(init=False, repr=False, compare=False, default_factory=EditedObjects)

    @property
    def triangles(self) -> int:
        """Triangles and spheres in the image: each mesh counts once for every instance, a series with its first."""
        return sum(self.meshes[instance.mesh].primitives for instance in self.at_once)

    @property
    def at_once(self) -> list[Instance]:
        """The instances without the further steps of series, one of which is there at a moment."""
        return at_once(self.instances, self.series)

    @property
    def animated(self) -> bool:
        """Whether anything changes with time."""
        return bool(self.tracks or self.parameter_tracks or self.series)

    @property
    def animated_objects(self) -> NDArray[np.intp]:
        """(m,) instances that move by themselves, or take turns as the steps of a series, in order."""
        rows = self.tracks.bodies[self.tracks.bodies < len(self.instances)]
        steps = [np.arange(each.rows.start, each.rows.stop) for each in self.series]
        return np.unique(np.concatenate([rows, *steps])) if steps else rows

    def objects_in(self, share: tuple[float, float]) -> NDArray[np.bool_]:
        """(n,) bool, for sort-last: instances whose middle triangle lies in [from, to) of all, object after object.

        Shares that follow each other hold every object once. An object is never cut, so shares are as equal as
        objects allow.
        """
        sizes = np.array([self.meshes[instance.mesh].primitives for instance in self.instances], np.float64)
        middles = (np.cumsum(sizes) - sizes / 2) / max(sizes.sum(), 1.0)
        found: NDArray[np.bool_] = (share[0] <= middles) & (middles < share[1])
        return found

    @property
    def lights(self) -> tuple[Light | None, ...]:
        """The lights in the order in which they are named; None for those with an area, which are objects."""
        rows = self.unedited.lights
        return tuple(None if row < 0 else rows[row] for row in self.light_order)

    @property
    def unedited(self) -> Shading:
        """The shading as configured."""
        return Shading(
            point_lights=self.point_lights, spot_lights=self.spot_lights, directional_lights=self.directional_lights,
            sky=self.sky, materials=self.materials, path_depth=self.path_depth, lens=self.lens,
            environment_strength=1.0 if self.environment is None else self.environment.strength,
            occlusion_distance=0.0 if self.occlusion is None else self.occlusion.distance, cuts=self.cuts,
        )  # fmt: skip

    def at(self, time: float, edits: Edits = NO_EDITS) -> Moment:
        """Everything that moves or was edited, at a scene time in seconds.

        Read-only, the same object for one of the newest times and states of edits.
        """
        key = (time if self.animated else 0.0, edits)
        if (known := self._moments.get(key)) is not None:
            return known
        if len(self._moments) >= MOMENTS:
            self._moments.clear()
        return self._moments.setdefault(key, self._moment(*key))

    def values(self, time: float, edits: Edits = NO_EDITS) -> dict[str, tuple[float, ...]]:
        """Every parameter that is not as the scene has it, at a scene time in seconds; edits hide keyframes."""
        return {track.name: track.at(time) for track in self.parameter_tracks} | dict(edits.values)

    def shading(self, time: float, edits: Edits = NO_EDITS) -> Shading:
        """How the scene is lit and what surfaces look like: the same object for one of the newest states of edits."""
        key = (time if self.parameter_tracks else 0.0, edits)
        if (known := self._shadings.get(key)) is not None:
            return known
        if len(self._shadings) >= SHADINGS:
            self._shadings.clear()
        return self._shadings.setdefault(key, shaded(self.unedited, self.lights, self.values(*key)))

    def _moment(self, time: float, edits: Edits) -> Moment:
        shading = self.shading(time, edits)
        ends = np.cumsum([len(self.instances), len(self.point_lights), len(self.spot_lights)])
        steps = tuple(each.step_at(time) for each in self.series)
        objects, points, spots, directions = np.split(self._poses(time, shading, steps), ends)
        ways = directions[:, :3, 3]
        return Moment(
            world_from_object=objects,
            steps=steps,
            moved=self._moved(shading),
            point_positions=points[:, :3, 3],
            spot_positions=spots[:, :3, 3],
            directions=ways / np.maximum(np.sqrt((ways**2).sum(axis=1, keepdims=True)), SHORTEST),
            shading=shading,
        )

    def _moved(self, shading: Shading) -> NDArray[np.intp]:
        """Instances that may be elsewhere than at rest."""
        if not shading.objects:
            return self.animated_objects
        return np.union1d(self.animated_objects, self._edited.rows(shading.objects, self.instances))

    def _poses(self, time: float, shading: Shading, steps: tuple[int, ...]) -> Float64:
        """(bodies, 4, 4), read-only, with the lights where `shading` has them at rest."""
        before = self.unedited.lights
        if not self.tracks and shading.lights == before and not shading.objects and not steps:
            return self.rest
        poses = self.rest.copy()
        for row, (light, was) in enumerate(zip(shading.lights, before, strict=True), start=len(self.instances)):
            if light is not was:
                poses[row, :3, 3] = _position(light)
        self.tracks.apply(poses, time)
        self._edited.apply(poses, shading.objects, self.instances, self.meshes)
        hide_others(poses, self.series, steps)
        poses.setflags(write=False)
        return poses


def build(scene_config: SceneConfig, base_folder: Path) -> Scene:
    """The scene that a configuration asks for.

    Paths are relative to `base_folder`. The configuration's lights, sky and animation replace the source's own.
    Raises SceneError where a model or an environment cannot be used, or where the animation names what does not exist.
    """
    given = any(texture_of(each) is not None for each in scene_config.materials)
    sources = make_sources(sources_of(scene_config), base_folder, scene_config.up, textures_given=given)
    if scene_config.data:
        from wall.scene.data.loading import load_data  # brings Matplotlib's colours

        sources += [load_data(data, base_folder, where=f"scene.data[{k}]") for k, data in enumerate(scene_config.data)]
    scene = assemble(_configured(joined(sources), scene_config, base_folder))
    return replace(scene, cuts=cuts_of(scene_config.cuts)) if scene_config.cuts else scene


def _configured(source: Source, config: SceneConfig, base_folder: Path) -> Source:
    """The source with everything that the configuration says; what it leaves out stays the source's."""
    source = with_materials(source, config.materials, base_folder)
    if config.integrator is not None:
        depth, occlusion = integrated(config.integrator)
        source = replace(source, path_depth=depth, occlusion=occlusion)
    if source.path_depth is None:
        source = replace(source, notes=(*source.notes, *seen_on_paths(source)))
    if config.lights is not None:
        source = replace(source, lights=tuple(configured_light(light) for light in config.lights))
    if config.sky is not None:
        sky = config.sky
        source = replace(source, sky=Sky(zenith=sky.zenith, horizon=sky.horizon, ground=sky.ground))
    if config.environment is not None:
        wanted = config.environment
        environment, notes = read_environment(
            base_folder / wanted.file, rotation=wanted.rotation, strength=wanted.strength
        )
        source = replace(source, environment=environment, notes=(*source.notes, *notes))
    source = replace(source, ground=config.ground)
    if config.animation is not None:
        source = replace(source, animation=config.animation, motions=())
    return source


def integrated(config: IntegratorConfig) -> tuple[int | None, AmbientOcclusion | None]:
    """Path depth and occlusion of a Source, or of a Scene."""
    if isinstance(config, AmbientOcclusionConfig):
        return 1, AmbientOcclusion(distance=config.distance, colors=config.colors)
    return config.depth if isinstance(config, PathConfig) else None, None


def assemble(source: Source) -> Scene:
    """Resolve names and defaults, lay out what moves, and leave out what nothing shows."""
    source = only_placed(source)
    lights: tuple[Light, ...] = default_lights() if source.lights is None else source.lights
    points = tuple(light for light in lights if isinstance(light, PointLight))
    spots = tuple(light for light in lights if isinstance(light, SpotLight))
    directional = tuple(light for light in lights if isinstance(light, DirectionalLight))
    bodies: tuple[Light, ...] = (*points, *spots, *directional)
    areas = tuple(light for light in lights if isinstance(light, AreaLight))
    meshes, materials, emitters = emitting(lights, len(source.meshes), len(source.materials))
    there = at_once(source.instances, source.series)
    center, radius = framing_sphere(source.meshes, there)
    instances = tuple(_about_zero(instance, source.meshes[instance.mesh]) for instance in source.instances) + emitters
    if source.ground:
        low = float(world_boxes(source.meshes, there)[:, 0, 1].min())
        counts = {"mesh": len(source.meshes + meshes), "material": len(source.materials + materials)}
        mesh, material, instance = ground(low, center, radius, **counts)
        meshes, materials, instances = (*meshes, mesh), (*materials, material), (*instances, instance)
    return Scene(
        meshes=tuple(replace(mesh, origin=(0.0, 0.0, 0.0)) for mesh in source.meshes) + meshes,
        materials=source.materials + materials,
        textures=source.textures,
        instances=instances,
        point_lights=points,
        spot_lights=spots,
        directional_lights=directional,
        sky=source.sky or STUDIO_SKY,
        environment=source.environment,
        tracks=compile_tracks(_movings(source, (*areas, *bodies), lights)),
        notes=source.notes,
        cameras=source.cameras,
        center=center,
        path_depth=source.path_depth,
        occlusion=source.occlusion,
        radius=radius,
        rest=_rest(instances, bodies),
        light_order=_order(lights, bodies),
        parameter_tracks=tracks_of(source.animation),
        series=source.series,
    )


def _order(lights: Sequence[Light], rows: Sequence[Light]) -> tuple[int, ...]:
    """Of each light in the order in which they are named: its row; -1 for lights with an area, which are objects."""
    numbers = {id(body): row for row, body in reversed(list(enumerate(rows)))}  # the first of two of the same light
    return tuple(numbers.get(id(light), -1) for light in lights)


def _about_zero(instance: Instance, mesh: Mesh) -> Instance:
    """The mesh's origin goes into the float64 matrix, so that nobody downstream has to add it."""
    matrix = instance.world_from_object.copy()
    matrix[:3, 3] += matrix[:3, :3] @ np.asarray(mesh.origin)
    return replace(instance, world_from_object=matrix)


def _rest(instances: Sequence[Instance], lights: Sequence[Light]) -> Float64:
    """(bodies, 4, 4) poses at rest, read-only: lights are frames without rotation at their position or direction."""
    rest = np.tile(np.eye(4), (len(instances) + len(lights), 1, 1))
    if instances:
        rest[: len(instances)] = [instance.world_from_object for instance in instances]
    for row, light in enumerate(lights, start=len(instances)):
        rest[row, :3, 3] = _position(light)
    rest.setflags(write=False)
    return rest


def _position(light: Light) -> Vector:
    return light.direction if isinstance(light, DirectionalLight) else light.position


def _movings(source: Source, bodies: Sequence[Light], lights: Sequence[Light]) -> list[Moving]:
    """Every motion of every body.

    bodies : lights in row order, those with an area first; lights : in the order that they are named by
    """
    movings = list(source.motions)
    boxes = world_boxes(source.meshes, source.instances) if source.animation else np.empty((0, 2, 3))
    for number, track in enumerate(source.animation):
        if isinstance(track, ParameterConfig):
            continue
        where = f"scene.animation[{number}]"
        index = getattr(track, "light", None)
        if index is None:
            movings += _moving_objects(track, source.instances, boxes, where=where)
            continue
        if index >= len(lights):
            raise SceneError(f"{where}.light = {index}: the scene has {len(lights)} lights, counted from 0")
        light = lights[index]
        row = len(source.instances) + next(k for k, body in enumerate(bodies) if body is light)
        movings.append(Moving(body=row, motion=track, center=_position(light)))
    return movings


def _moving_objects(track: MotionConfig, instances: Sequence[Instance], boxes: Float64, *, where: str) -> list[Moving]:
    """Matched instances that stand in one frame are parts of one object, and share its centre."""
    wanted = track.object or ""
    matched = [k for k, instance in enumerate(instances) if fnmatchcase(instance.name, wanted)]
    if not matched:
        raise SceneError(
            f"{where}.object = {wanted!r}: no such object; {described(wanted, [i.name for i in instances])}"
        )
    parts: dict[bytes, list[int]] = {}
    for k in matched:
        parts.setdefault(instances[k].world_from_object.tobytes(), []).append(k)
    movings = []
    for rows in parts.values():
        x, y, z = middle(boxes[rows]).tolist()
        movings += [Moving(body=row, motion=track, center=(x, y, z)) for row in rows]
    return movings
