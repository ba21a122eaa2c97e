"""The Shading Cache: light at the vertices of the scene's own meshes, subdivided where rays show that it pays.

Tole, Pellacini, Walter and Greenberg, "Interactive global illumination in dynamic scenes" (2002). The paper's text was
not at hand; what follows was rebuilt from its abstract, what later papers say of it, and memory. As there: a hierarchy
of patches over every object, in object space, whose vertices keep light that moves with the object; the image is drawn
by hardware from the meshes, with the cache interpolated and textures applied; samples are chosen in image space, where
interpolation differs most, where nothing is known, and where light is old; they update patches or subdivide them; what
a changed light or a moved occluder contradicts ages, so that its surroundings are sampled again.

Primary rays stand for the hardware: four a pixel find triangle and texture of each refresh. They see no light, so they
cost CPU time but do not count against the rate. The sky is a background, drawn like textures. So, unlike every other
method, the display needs the scene itself, its textures and the poses of its objects: `bytes` counts samples alone.

Changed: triangles are halved, not quads quartered; a sample lies where a pixel sees a patch, not at a vertex, which may
be hidden, and moves the corners by their weights; it is one ray, which updates and may split. Mirrors and glass keep
what they show in place of their light, as it was seen from wherever it was sampled.

Limits: no patch is split below Tuning.smallest; with 16 patches and 8 vertices a pixel all splits are given up, and it
starts over from the scene's own vertices.

`shading_cache_untextured` keeps textures in the cache, as part of the light: what the cache is worth by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from wall.core.data import SAMPLE, Event, Float32, Samples
from wall.core.errors import RunError
from wall.scene.build import Scene
from wall.study.quality.baseline import AVERAGED_FOOTPRINT, FramelessMethod, Maps, fill_holes
from wall.study.quality.kernels import shading_cache as kernels
from wall.study.quality.kernels import shading_cache_image as image_kernels
from wall.study.quality.method import Method, Setup
from wall.study.quality.pixel_plan import PixelPlan

PATCHES_A_PIXEL, VERTICES_A_PIXEL = 16, 8  # room beside the scene's own
FULL = 0.9  # of the room: then all splits are given up


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What was chosen by hindsight, of those tried on the four scenes at 100k and 400k rays a second."""

    smallest: float = 1.0  # pixels, of a patch that is split
    step: float = 0.7  # towards a sample
    error: float = 0.04  # of sqrt radiance, that splits
    doubt: float = 4.0  # turns that vertices age around a contradiction
    age: float = 0.05  # of a pixel's priority, for each turn
    contrast: float = 1.0
    least: float = 0.02
    unknown: float = 1.0


BEST = Tuning()


class ShadingCache:
    """A Renderer: light at the vertices of a scene's subdivided meshes."""

    coherent = False  # pixels of a batch lie anywhere

    def __init__(self, setup: Setup, *, textured: bool = True, tuning: Tuning = BEST) -> None:
        """`textured`: textures are drawn with the meshes, else they are part of the light that is kept."""
        width, height = setup.size
        self._textured = textured
        self._maps = Maps(setup, follow_objects=True)
        own = tuning
        self._patches = patches_of(setup.plan.scene, width * height)
        self._tracer = setup.tracer(coherent=True)
        self._placed: Event | None = None
        step = np.arange(image_kernels.SUBPIXELS)
        y, x, v, u = np.meshgrid(np.arange(height), np.arange(width), step, step, indexing="ij")
        places = np.stack([x + (u + 0.5) / len(step), y + (v + 0.5) / len(step)], axis=-1)
        self._places = places.reshape(-1, 2).astype(np.float32)
        self._points = points_of(len(self._places))
        self._priority = np.ones((height, width), np.float32)
        self._image = np.zeros((height, width, 4), np.float32)
        self._seen = np.full((height, width, 3), -1, np.int32)
        self._steps = np.array([own.smallest, own.step, own.error, own.doubt], np.float32)
        self._values = np.array([own.age, own.contrast, own.least, own.unknown], np.float32)
        self._plan = PixelPlan(self._priority, setup.seed)
        self._since = 0
        self._wanted = setup.rate / setup.refresh_hz
        self._random = np.random.default_rng(setup.seed)

    def choose(self, count: int, event: Event, now: float) -> Float32:
        """See Renderer."""
        pixels = self._plan.take(count, self._wanted)
        xy: Float32 = (pixels + self._random.uniform(0.01, 0.99, pixels.shape)).astype(np.float32)
        return xy

    def take(self, samples: Samples, event: Event, now: float) -> None:
        """See Renderer."""
        self._since += len(samples) if now > 0.0 else 0  # the free image says nothing of the rate
        points = points_of(len(samples))
        self._look(np.ascontiguousarray(samples["xy"]), event, points)
        table = self._maps.of(event).panel_from_object
        kernels.take(samples, points, self._patches, table, self._steps, self._seen)

    def image(self, event: Event, now: float) -> Float32:
        """See Renderer."""
        patches = self._patches
        kernels.grow_old(patches, np.float32(self._since / self._priority.size))
        if patches.counts[0] > FULL * len(patches.child) or patches.counts[1] > FULL * len(patches.age):
            kernels.forget(patches)
        self._look(self._places, event, self._points)
        image_kernels.shade(self._points, patches, self._values, self._image, self._priority, self._seen)
        if not self._image[:, :, 3].all():
            fill_holes(self._image)
        self._wanted, self._since = self._since or self._wanted, 0
        self._plan.make(self._wanted)
        return self._image[:, :, :3]

    def _look(self, xy: Float32, event: Event, points: kernels.Points) -> None:
        """Find what is seen at positions under an event."""
        if self._placed is not event:
            self._tracer.set_event(event)
            self._placed = event
        given = self._tracer.arguments(xy, np.empty(0, SAMPLE))
        camera = given.camera._replace(footprint=AVERAGED_FOOTPRINT)
        image_kernels.look(given.scene, camera, xy, given.surfaces, given.materials, given.lights, given.work, points)
        if not self._textured:
            points.albedo[points.seen[:, 0] > 0] = 1.0


def points_of(count: int) -> kernels.Points:
    """Room for what is seen at so many points."""
    return kernels.Points(
        seen=np.zeros((count, 2), np.int32),
        weights=np.zeros((count, 2), np.float32),
        albedo=np.zeros((count, 3), np.float32),
    )


def patches_of(scene: Scene, pixels: int) -> kernels.Patches:
    """The triangles of every object as patches without light, and room for those of an image of so many pixels."""
    meshes = [scene.meshes[instance.mesh] for instance in scene.instances]
    if any(mesh.spheres is not None for mesh in meshes):
        raise RunError("the shading cache keeps light at corners of triangles; the scene has points, wanted none")
    triangles, vertices = (sum(len(getattr(m, name)) for m in meshes) for name in ("triangles", "vertices"))
    n, v = triangles + PATCHES_A_PIXEL * pixels, vertices + VERTICES_A_PIXEL * pixels
    corners, position = np.full((n, 4), -1, np.int32), np.zeros((v, 3), np.float32)
    first = np.zeros(len(meshes) + 1, np.int32)
    row = vertex = 0
    for k, mesh in enumerate(meshes, start=1):
        first[k] = row
        corners[row : row + len(mesh.triangles), :3] = mesh.triangles.astype(np.int32) + vertex
        position[vertex : vertex + len(mesh.vertices)] = mesh.vertices
        row, vertex = row + len(mesh.triangles), vertex + len(mesh.vertices)
    patches = kernels.Patches(
        corners=corners, child=np.full(n, -1, np.int32), turn=np.zeros(triangles, np.uint8), first=first,
        position=position, light=np.zeros((v, 3), np.float32), age=np.full(v, -1.0, np.float32),
        middles=np.full((1 << (2 * v - 1).bit_length(), 3), -1, np.int32),
        counts=np.array([triangles, vertices], np.int64),
    )  # fmt: skip
    kernels.turn_roots(patches)
    return patches


def shading_cache(textured: bool, setup: Setup) -> FramelessMethod:
    """Returns the Shading Cache as a frameless method."""
    return FramelessMethod(setup, ShadingCache(setup, textured=textured))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "shading_cache": partial(shading_cache, True),
    "shading_cache_untextured": partial(shading_cache, False),
}
