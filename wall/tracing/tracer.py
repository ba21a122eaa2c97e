"""Trace batches of positions under an event: one Tracer a thread, its instances placed relative to the eye.

A thread owns its Tracer: its own instance tree, packets and scratch, so that threads never wait for each other and a
new event is taken up between two batches, never inside one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Event, Float32, Float64, Samples
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import Panel
from wall.scene.model import Moment
from wall.tracing import embree
from wall.tracing.kernels import trace as kernels
from wall.tracing.kernels.packet import ALL, COUNTS, PACKET_FLOATS, SEEN, SEES, SHADE, UNSEEN, Surfaces, Workspace
from wall.tracing.tracer_scene import TracerScene

LIFT_ULPS = 16.0  # float32 roundings from a hit to its secondary ray; eight times the need, docs/guide/accuracy.md


@dataclass(frozen=True, slots=True, kw_only=True)
class Traced:
    """What a batch cost: rays by kind, and samples dropped because their radiance was not finite."""

    primary: int
    shadow: int
    secondary: int
    bad: int


def workspace(*, coherent: bool, sees: int = ALL) -> Workspace:
    """A fresh packet for one thread; the fields that no kernel changes are set here, once.

    sees : mask of primary rays
    """
    packet = embree.aligned((PACKET_FLOATS,), np.float32)
    bits = packet.view(np.uint32)
    for rays in (0, SHADE):
        bits[rays + embree.MASK : rays + embree.MASK + embree.PACKET] = ALL
        bits[rays + embree.RAY_ID : rays + embree.RAY_ID + embree.PACKET] = np.arange(embree.PACKET)
    bits[SEES : SEES + embree.PACKET] = sees
    return Workspace(
        packet=packet,
        bits=bits,
        valid=embree.aligned((embree.PACKET,), np.int32),
        lit=embree.aligned((embree.PACKET,), np.int32),
        arguments=embree.query_arguments(coherent=coherent),
        counts=np.zeros(COUNTS, np.int64),
    )


class Tracer:
    """Traces for one thread. `take(event, ...)` moves to a new event; `trace(xy)` gives samples under it."""

    def __init__(
        self,
        tracer_scene: TracerScene,
        panel: Panel,
        eye: Float64,
        *,
        coherent: bool,
        seen: NDArray[np.bool_] | None = None,
    ) -> None:
        """`eye` is (3,) float64 in the wall's frame, metres; `coherent` says that packets are small screen tiles.

        seen : (n,) bool, instances that primary rays may hit; the others only cast shadows and show in mirrors. None:
            all
        """
        n = len(tracer_scene.mesh_table)
        masks = np.full(n, SEEN, np.uint32) if seen is None else np.where(seen, SEEN, UNSEEN).astype(np.uint32)
        self._tracer_scene, self._panel, self._eye = tracer_scene, panel, eye
        self._scene, self._geometries = tracer_scene.device.instances(list(tracer_scene.meshes), masks)
        self._transforms = embree.aligned((n, 12), np.float32)
        self._surfaces = Surfaces(
            triangles=tracer_scene.triangles,
            mesh_table=tracer_scene.mesh_table,
            materials=tracer_scene.materials,
            placements=np.zeros((n, 12), np.float32),
            sky=tracer_scene.sky,
            irradiance=tracer_scene.irradiance,
        )
        self._work = workspace(coherent=coherent, sees=ALL if seen is None else SEEN)
        self._corner = np.array(panel.screen, np.float64)
        self._frame = np.zeros((3, 3))
        self._points: Float32 | None = None
        self._suns: Float32 | None = None
        self.singular = 0  # instances whose placement cannot be inverted, at the newest event

    def take(self, event: Event) -> None:
        """Place everything for `event`: its camera, and its scene time."""
        self.place(event.camera.origin(), self._tracer_scene.scene.at(event.scene_time))
        self._frame = ray_frame(self._panel, self._eye, event.camera)

    def look_through(self, panel: Panel, eye: Float64, event: Event) -> None:
        """Trace for another panel from now on, under `event`: as a new Tracer would, without new trees."""
        self._panel, self._eye, self._corner = panel, eye, np.array(panel.screen, np.float64)
        self.take(event)

    def place(self, origin: Float64, moment: Moment) -> None:
        tracer_scene = self._tracer_scene
        self.singular = kernels.place_instances(
            moment.world_from_object,
            origin,
            self._scene,
            self._geometries,
            self._transforms,
            self._surfaces.placements,
            tracer_scene.extents,
            LIFT_ULPS,
        )
        scene = tracer_scene.scene
        if scene.point_lights:
            relative = moment.point_positions - origin
            self._points = _light_rows(relative, [light.intensity for light in scene.point_lights])
        if scene.directional_lights:
            self._suns = _light_rows(moment.directions, [light.irradiance for light in scene.directional_lights])

    def trace(self, xy: Float32) -> tuple[Samples, Traced]:
        """Samples at panel positions `xy` (n, 2) float32 under the newest event, times zero.

        Non-finite radiance is dropped and counted in Traced.bad, so fewer than n samples may come back.
        """
        samples = np.zeros(len(xy), SAMPLE)
        work = self._work
        work.counts[:] = 0
        kept = kernels.trace(*self.arguments(xy, samples))
        primary, shadow, secondary, bad = (int(count) for count in work.counts)
        return samples[:kept], Traced(primary=primary, shadow=shadow, secondary=secondary, bad=bad)

    def arguments(self, xy: Float32, samples: Samples) -> tuple[Any, ...]:
        """Everything that kernels.trace wants, in its order; for trace() and for measuring the kernel alone."""
        r = self._tracer_scene
        return (
            self._scene,
            self._frame,
            self._corner,
            xy,
            samples,
            self._surfaces,
            r.normals,
            r.colors,
            r.uvs,
            r.texels,
            r.textures,
            r.to_linear,
            self._points,
            self._suns,
            r.emission,
            r.mirrors,
            self._transforms if r.needs.relighting else None,
            self._work,
        )


def _light_rows(directions: Float64, colours: list[tuple[float, float, float]]) -> Float32:
    return np.hstack([directions, np.array(colours, np.float64)]).astype(np.float32)
