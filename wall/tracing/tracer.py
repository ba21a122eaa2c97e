"""Trace batches of positions under an event, by the instances that a Tracer has placed relative to the eye.

A thread that chooses rays owns a Tracer: its own instance tree, packets and scratch. So those threads never wait for
each other, and a new event is taken up between two batches, never inside one. Within a batch threads may share the
rays: nothing is placed then, and each has packets and scratch of its own.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Event, Float32, Float64, Samples
from wall.core.threads import Threads
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import Panel
from wall.scene.model import AmbientOcclusion, Moment, Shading
from wall.scene.sky import sky_irradiance
from wall.tracing import embree
from wall.tracing.instance_trees import InstanceTrees
from wall.tracing.kernels import rows
from wall.tracing.kernels import trace as kernels
from wall.tracing.kernels.ambient import trace_ambient
from wall.tracing.kernels.path import count_samples, trace_paths
from wall.tracing.kernels.values import (
    COUNTS,
    EMITTER_COLUMNS,
    EVERY_OBJECT,
    MIRROR_ROOM,
    MIRROR_ROWS,
    RAY_ROWS,
    SEEN,
    UNSEEN,
    Emitters,
    Lights,
    Materials,
    Occlusion,
    Paths,
    RayFrame,
    Surfaces,
    Trees,
    WaitingRays,
    Workspace,
)
from wall.tracing.light_trees import DeltaLights, EmitterTree
from wall.tracing.steps import LaidSteps
from wall.tracing.tracer_scene import TracerScene, sky_rows

RAYS_A_THREAD = 256  # of a batch; waking a thread takes as long as tracing 50 to 100
MOST_SURFACES = 1 << 16  # of a path: no limit
NUMBERS = 0xFFFFFFFF  # of samples, where they begin again


class Arguments(NamedTuple):
    """Everything that kernels.trace wants, in its order."""

    scene: Trees
    camera: RayFrame
    xy: Float32
    samples: Samples
    surfaces: Surfaces
    materials: Materials
    lights: Lights
    work: Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class Traced:
    """Counts of a traced batch: rays by kind, and samples dropped because their radiance was not finite."""

    primary: int
    shadow: int
    secondary: int
    bad: int


def workspace(*, coherent: bool, primary_mask: int = EVERY_OBJECT) -> Workspace:
    """A fresh packet for one thread; the fields that no kernel changes are set here, once.

    primary_mask : Embree mask of primary rays
    """
    packet = embree.aligned((rows.PACKET_FLOATS,), np.float32)
    bits = packet.view(np.uint32)
    for rays in (0, rows.SHADOW_PACKET):
        bits[rays + embree.MASK : rays + embree.MASK + embree.PACKET] = EVERY_OBJECT
        bits[rays + embree.RAY_ID : rays + embree.RAY_ID + embree.PACKET] = np.arange(embree.PACKET)
    bits[rows.PRIMARY_MASK : rows.PRIMARY_MASK + embree.PACKET] = primary_mask
    return Workspace(
        packet=packet,
        bits=bits,
        valid=embree.aligned((embree.PACKET,), np.int32),
        shadow_valid=embree.aligned((embree.PACKET,), np.int32),
        arguments=embree.query_arguments(coherent=coherent),
        hit_before=np.zeros(embree.PACKET, np.uint32),
        counts=np.zeros(COUNTS, np.int64),
        waiting=WaitingRays(np.zeros(MIRROR_ROWS * MIRROR_ROOM, np.float32), *np.zeros((2, MIRROR_ROOM), np.int64)),
    )


def path_room(count: int, *, normals: bool = False) -> Paths:
    """Room for so many paths; `normals`: a tree chooses among surfaces that emit."""
    return Paths(
        rays=np.zeros(RAY_ROWS * (count + embree.PACKET), np.float32),
        sample=np.zeros(count + embree.PACKET, np.int64),
        key=np.zeros(count + embree.PACKET, np.uint32),
        radiance=np.zeros((count, 3), np.float32),
        normals=np.zeros((count, 3), np.float32) if normals else None,
        depth=0,
        number=np.zeros(count, np.uint32),
        seed=np.uint32(0),
    )


class Tracer:
    """Traces rays. `set_event(event)` moves to a new event; `trace(xy)` gives samples under it."""

    def __init__(
        self,
        tracer_scene: TracerScene,
        panel: Panel,
        eye: Float64,
        *,
        coherent: bool,
        seen: NDArray[np.bool_] | None = None,
        threads: int = 1,
    ) -> None:
        """`eye` is (3,) float64 in the wall's frame, metres; `coherent` says that packets are small screen tiles.

        seen : (n,) bool, instances that primary rays may hit; the others only cast shadows and show in mirrors. None:
            all
        threads : that share a batch, the caller's among them; each has packets and scratch of its own
        """
        n = len(tracer_scene.meshes)
        masks = np.full(n, SEEN, np.uint32) if seen is None else np.where(seen, SEEN, UNSEEN).astype(np.uint32)
        self._tracer_scene, self._panel, self._eye = tracer_scene, panel, eye
        self.instances = InstanceTrees(tracer_scene, masks)
        placements, transforms = self.instances.placements, self.instances.transforms
        meshes = tracer_scene.surfaces.meshes._replace(placements=placements, eye_from_object=transforms)
        self._surfaces = tracer_scene.surfaces._replace(meshes=meshes)
        self._lights = Lights(
            directional=None,
            points=None,
            spots=None,
            many_points=None,
            many_spots=None,
            suns=None,
            emitters=_emitters_of_one(tracer_scene.emitters),
            environment=tracer_scene.environment,
            sky=tracer_scene.sky,
            sky_irradiance=tracer_scene.sky_irradiance,
        )
        center, emitters = tracer_scene.scene.center, tracer_scene.emitters
        self._points = DeltaLights("point_lights", tracer_scene.point_tree, center)
        self._spots = DeltaLights("spot_lights", tracer_scene.spot_tree, center)
        self._emitter_tree: EmitterTree | None = None
        if emitters is not None and emitters.tree is not None:
            self._emitter_tree = EmitterTree(emitters, self._surfaces, tracer_scene.both_sides, center)
            self._lights = self._lights._replace(emitters=self._emitter_tree.emitters)
        self._materials = tracer_scene.materials
        self._steps = (0,) * len(tracer_scene.scene.series)  # of series, that are shown
        self._laid: LaidSteps | None = None  # kept while they are
        self._shading: Shading | None = None  # as last placed
        self._depth = tracer_scene.scene.path_depth
        primary_mask = EVERY_OBJECT if seen is None else SEEN
        self._threads = Threads(threads)
        self.cpu_beside_s = 0.0  # CPU seconds of the threads beside the caller's so far
        self.works = [workspace(coherent=coherent, primary_mask=primary_mask) for _ in range(threads)]
        self._ray_frame = RayFrame(np.zeros((3, 3)), np.array(panel.screen, np.float64), 1.0, None)
        self._occlusion = _occlusion(tracer_scene.scene.occlusion)
        self._path_rooms = [path_room(0, normals=self._emitter_tree is not None) for _ in range(threads)]
        self._counts = np.zeros((0, 0), np.uint32)  # samples of each pixel so far, where they are numbered here
        self.seed = 1  # of paths

    def expect(self, *, coherent: bool) -> None:
        """Trace packets from now on that are small screen tiles, or not."""
        for work in self.works:
            embree.expect(work.arguments, coherent=coherent)

    def set_event(self, event: Event) -> None:
        """Places everything for `event`: its camera, its scene time, its edits."""
        moment = self._tracer_scene.scene.at(event.scene_time, event.edits)
        self.place(event.camera.origin(), moment)
        frame = ray_frame(self._panel, self._eye, event.camera)
        lens = moment.shading.lens
        discs = None if lens is None else lens.rows(event.camera.rotation())
        self._ray_frame = self._ray_frame._replace(frame=frame, lens=discs)

    def look_through(self, panel: Panel, eye: Float64, event: Event) -> None:
        """Trace for another panel from now on, under `event`: as a new Tracer would, without new trees."""
        self._panel, self._eye = panel, eye
        self._ray_frame = self._ray_frame._replace(corner=np.array(panel.screen, np.float64))
        self.set_event(event)

    def place(self, origin: Float64, moment: Moment) -> None:
        """Places instances and lights of a moment relative to the eye at `origin` (3,), world."""
        tracer_scene = self._tracer_scene
        self._shade(moment.shading)
        if tracer_scene.steps is not None and moment.steps != self._steps:
            self._show(tracer_scene.steps.of(tracer_scene, moment.steps), moment.steps)
        self.instances.place(moment, origin)
        if self._emitter_tree is not None:
            self._emitter_tree.place(moment.world_from_object, origin)
        shading = moment.shading
        points, many_points = self._points.place(moment.point_positions, shading, origin)
        spots, many_spots = self._spots.place(moment.spot_positions, shading, origin)
        self._lights = self._lights._replace(points=points, spots=spots, many_points=many_points, many_spots=many_spots)
        if shading.directional_lights:
            directional = _light_rows(moment.directions, [light.irradiance for light in shading.directional_lights])
            self._lights = self._lights._replace(directional=directional)
            if tracer_scene.needs.suns:
                self._part_suns(directional)

    def _show(self, laid: LaidSteps, steps: tuple[int, ...]) -> None:
        """Take over the meshes of the steps of series."""
        arrays, own = laid.arrays, self._surfaces
        meshes = own.meshes._replace(triangles=arrays.meshes.triangles, mesh_table=arrays.meshes.mesh_table)
        self._surfaces = own._replace(
            meshes=meshes, normals=arrays.normals, colors=arrays.colors, point_colors=arrays.point_colors,
            segments=arrays.segments, vertices=arrays.vertices,
        )  # fmt: skip
        self.instances.show(laid)
        self._steps, self._laid = steps, laid

    def _part_suns(self, directional: Float32) -> None:
        """Gives directional lights (n, 6) that are discs to Lights.suns, the others to Lights.directional."""
        diameters = [light.angular_diameter for light in self._tracer_scene.scene.directional_lights]
        caps = 2.0 * np.sin(np.radians(diameters) / 4.0) ** 2  # 1 - cosine of the radius
        discs = caps > 0.0
        suns = np.hstack([directional, caps.astype(np.float32)[:, None]])[discs]
        rest = None if discs.all() else np.ascontiguousarray(directional[~discs])
        self._lights = self._lights._replace(directional=rest, suns=np.ascontiguousarray(suns))

    def _shade(self, shading: Shading) -> None:
        """Take over a shading, but for its lights and its lens; arrays of the same types and shapes."""
        if shading is self._shading:
            return
        if self._shading is None or shading.sky is not self._shading.sky:
            sky = shading.sky
            self._lights = self._lights._replace(sky=sky_rows(sky), sky_irradiance=sky_irradiance(sky))
        if self._shading is None or shading.materials is not self._shading.materials:
            self._materials = self._tracer_scene.materials_of(shading)
        environment = self._tracer_scene.scene.environment
        if environment is not None and self._lights.environment is not None:
            gain = environment.gain(shading.environment_strength)
            self._lights = self._lights._replace(environment=self._lights.environment._replace(strength=gain))
        if self._occlusion is not None:
            self._occlusion = self._occlusion._replace(distance=np.float32(shading.occlusion_distance))
        self._shading, self._depth = shading, shading.path_depth

    def trace(
        self, xy: Float32, footprint: float = 1.0, number: int | None = None, depth: int | None = None
    ) -> tuple[Samples, Traced]:
        """Samples at panel positions `xy` (n, 2) float32 under the newest event, times zero.

        footprint : pixels, edge of the square whose mean of a texture each sample shows; 0: the nearest texels alone
        number : of the samples among those of their pixels, for the random numbers of paths; None: as many as this
            tracer has numbered there
        depth : most surfaces of paths, if fewer than the scene's

        Non-finite radiance is dropped and counted in Traced.bad, so fewer than n samples may come back.
        """
        self._ray_frame = self._ray_frame._replace(footprint=float(footprint))  # of an int, numba compiles all again
        samples, numbers = np.zeros(len(xy), SAMPLE), self._numbers(xy, number)
        free, beside = list(range(self._threads.count)), list[float]()

        def trace(first: int, last: int) -> Samples:
            began = time.thread_time()
            thread, own = free.pop(), samples[first:last]
            arguments = self.arguments(xy[first:last], own, thread)
            if numbers is None:
                kept = kernels.trace(*arguments)
            elif self._occlusion is not None:
                kept = trace_ambient(*arguments, self._paths(thread, numbers[first:last], depth), self._occlusion)
            else:
                kept = trace_paths(*arguments, self._paths(thread, numbers[first:last], depth))
            if first > 0:  # the caller's thread takes the first share
                beside.append(time.thread_time() - began)
            return own[:kept]

        for work in self.works:
            work.counts[:] = 0
        parts = self._threads.share(len(xy), trace, unit=RAYS_A_THREAD)
        self.cpu_beside_s += sum(beside)
        primary, shadow, secondary, bad = (sum(int(work.counts[k]) for work in self.works) for k in range(COUNTS))
        traced = Traced(primary=primary, shadow=shadow, secondary=secondary, bad=bad)
        return samples if bad == 0 else np.concatenate(parts), traced

    def _numbers(self, xy: Float32, number: int | None) -> NDArray[np.uint32] | None:
        """(n,) uint32, see trace; None where light is not followed along paths."""
        if self._depth is None:
            return None
        if number is not None:
            return np.full(len(xy), number & NUMBERS, np.uint32)
        width, height = self._panel.pixels
        if self._counts.shape != (height, width):
            self._counts = np.zeros((height, width), np.uint32)
        numbers = np.empty(len(xy), np.uint32)
        count_samples(xy, self._counts, numbers)
        return numbers

    def _paths(self, thread: int, numbers: NDArray[np.uint32], depth: int | None) -> Paths:
        """Room for paths of these numbers, kept from batch to batch."""
        room = self._path_rooms[thread]
        if len(room.radiance) < len(numbers):
            room = self._path_rooms[thread] = path_room(len(numbers), normals=self._emitter_tree is not None)
        room.number[: len(numbers)] = numbers  # there is one, if an old one, for lanes that no ray has
        depth = min(self._depth or 0, depth or MOST_SURFACES)
        return room._replace(seed=np.uint32(self.seed & NUMBERS), depth=depth)

    def arguments(self, xy: Float32, samples: Samples, thread: int = 0) -> Arguments:
        """The arguments of kernels.trace for one of the threads; for trace() and for measuring the kernel alone."""
        trees, frame, work = self.instances.trees, self._ray_frame, self.works[thread]
        return Arguments(trees, frame, xy, samples, self._surfaces, self._materials, self._lights, work)


def _occlusion(wanted: AmbientOcclusion | None) -> Occlusion | None:
    """What kernels.ambient takes; None for light that is followed."""
    if wanted is None:
        return None
    return Occlusion(distance=np.float32(wanted.distance), white=None if wanted.colors else True)


def _emitters_of_one(emitters: Emitters | None) -> Emitters | None:
    """Emitters with room for where they are before this tracer's eye."""
    if emitters is None or emitters.tree is not None:
        return emitters
    return emitters._replace(placed=np.zeros((len(emitters.chance), EMITTER_COLUMNS), np.float32))


def _light_rows(directions: Float64, colours: list[tuple[float, float, float]]) -> Float32:
    """(n, 6) float32 rows of Lights: directions or positions (n, 3), then irradiance or intensity."""
    return np.hstack([directions, np.array(colours, np.float64)]).astype(np.float32)
