"""Rays aimed at edges and vertices of closed meshes, shadow rays past them, and seams between instances."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64, Samples
from wall.geometry.frusta import project, ray_frame
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Instance, Material, PointLight
from wall.study.accuracy.case import Case, Found, Picture, picture
from wall.study.accuracy.scenes import (
    TracedImage,
    View,
    instance,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    turned,
    view,
    with_every_feature,
)
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

ROUNDING = 2.0**-24
NEAR_ROUNDINGS, FAR_ROUNDINGS = 2, 8  # of a position on the panel, either way
SIX_WAYS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
SEGMENTS = 48
BATCH = 1 << 18
SEED = 15


def escapes_at_edges(rays: int) -> Found:
    """Rays from inside a closed sphere, aimed at random points of its edges, that meet nothing."""
    mesh = sphere_mesh(segments=SEGMENTS, smooth=False)
    random = np.random.default_rng(SEED)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    edge, share = random.integers(0, 3, rays), random.random((rays, 1))
    face = random.integers(0, len(corners), rays)
    points = corners[face, edge] * share + corners[face, (edge + 1) % 3] * (1.0 - share)
    found = _escapes(points, random)
    return Found(figure=len(found.beside), note=f"of {found.aimed:,}", pictures=(_from_inside(),))


def escapes_at_vertices(rays: int) -> Found:
    """How far from a vertex of the same sphere a ray passes that escapes, in roundings of its distance."""
    vertices = np.unique(sphere_mesh(segments=SEGMENTS, smooth=False).vertices, axis=0).astype(np.float64)
    random = np.random.default_rng(SEED)
    points = vertices[random.integers(0, len(vertices), rays)]
    near, far = (_escapes(points, random, roundings=steps) for steps in (NEAR_ROUNDINGS, FAR_ROUNDINGS))
    farthest = float(np.concatenate([near.beside, far.beside]).max(initial=0.0))
    note = f"{len(near.beside)} of {near.aimed:,} rays within {NEAR_ROUNDINGS} roundings on the panel escape"
    return Found(figure=farthest, note=f"{note}, {len(far.beside)} within {FAR_ROUNDINGS}", pictures=(_from_inside(),))


class Escapes(NamedTuple):
    """What came of rays aimed at points."""

    aimed: int
    beside: Float64  # (k,) of those that escaped: how far they pass from the nearest point, roundings of its distance


def _escapes(points: Float64, random: np.random.Generator, *, roundings: int = NEAR_ROUNDINGS) -> Escapes:
    """Of rays from six cameras at the sphere's middle, and from six beside it, to points (n, 3)."""
    scene = make_tracer_scene(with_every_feature(scene_of([sphere_mesh(segments=SEGMENTS, smooth=False)])))
    aimed, beside = 0, []
    for place in ((0.0, 0.0, 0.0), (0.31, -0.17, 0.23)):
        for way in SIX_WAYS:
            x, y, z = np.add(place, way).tolist()
            seen = view(place, (x, y, z), pixels=(64, 64), fov=90.0, up=(0.36, 0.48, 0.8))
            samples = samples_near(scene, seen, points, random, roundings=roundings)
            aimed += len(samples)
            frame, away = ray_frame(seen.panel, seen.eye, seen.event.camera), points - place
            for xy in samples["xy"][samples["object_id"] == 0].astype(np.float64):
                ray = frame[0] + (xy + seen.panel.screen) @ frame[1:]
                ahead = away[away @ ray > 0.0]
                sines = np.linalg.norm(np.cross(ahead, ray), axis=1) / np.linalg.norm(ahead, axis=1)
                beside.append(float(sines.min() / np.linalg.norm(ray)) / ROUNDING)
    return Escapes(aimed, np.array(beside, np.float64))


def _from_inside() -> Picture:
    lamp = PointLight(position=(0.4, 0.3, 0.2), intensity=(1.0, 1.0, 1.0))
    ball = scene_of([sphere_mesh(segments=SEGMENTS, smooth=False)], lights=[lamp])
    shown = traced_image(with_every_feature(ball), view((0.3, -0.2, 0.2), (0.0, 0.0, 1.0), pixels=(128, 128), fov=90))
    return picture("from inside", shown.radiance)


def light_through_edges(rays: int) -> Found:
    """Shadow rays from a floor to a lamp in a closed sphere, through its edges and vertices, that reach the lamp."""
    mesh = sphere_mesh(segments=SEGMENTS, smooth=False)
    random = np.random.default_rng(SEED)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    face, share = random.integers(0, len(corners), rays), random.random((rays, 1))
    share[::2] = 1.0  # vertices
    points = corners[face, 0] * share + corners[face, 1] * (1.0 - share)
    lamp, floor = np.array([0.11, 0.07, -0.13]), -3.0
    away = points - lamp
    below = away[:, 2] < -0.3
    on_floor = lamp + away[below] * ((floor - lamp[2]) / away[below, 2:])
    light = PointLight(position=(0.11, 0.07, -0.13), intensity=(9.0, 9.0, 9.0))
    scene = scene_of([quad(80.0, 80.0), mesh], [instance(0, at=(0.0, 0.0, floor)), instance(1)], lights=[light])
    tracer_scene = make_tracer_scene(with_every_feature(scene))
    seen = view((0.0, 0.0, -1.6), (0.0, 0.0, -3.0), pixels=(256, 256), fov=150.0)
    samples = samples_near(tracer_scene, seen, on_floor, random)
    on = samples["object_id"] == 1
    aimed, lit = int(on.sum()), int((samples["radiance"][on] > 0.0).any(axis=1).sum())
    return Found(figure=lit, note=f"of {aimed:,}")


def gap_between_instances(rays: int) -> Found:
    """How far from the seam of two instances that share an edge a ray still slips through, in roundings of distance."""
    random = np.random.default_rng(SEED)
    widest, escaped, aimed = 0.0, 0, 0
    for seed in range(8):
        scene, seen, edge = _seam(seed)
        share = random.random((rays // 8, 1))
        points = edge[0] * share + edge[1] * (1.0 - share)
        samples = samples_near(scene, seen, points, random, roundings=64)
        through = samples["object_id"] == 0
        aimed, escaped = aimed + len(samples), escaped + int(through.sum())
        if through.any():
            widest = max(widest, float(_off_seam(seen, samples["xy"][through].astype(np.float64), edge).max()))
    return Found(figure=widest / ROUNDING, note=f"{escaped:,} of {aimed:,} rays within 64 roundings slip through")


def _seam(seed: int) -> tuple[TracerScene, View, Float64]:
    """Two squares turned at random together, the second scaled and turned by half a turn more; their edge (2, 3)."""
    random = np.random.default_rng(seed)
    matrix = np.eye(4)
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    matrix[:3, :3] = q * np.sign(np.linalg.det(q))
    matrix[:3, 3] = random.uniform(-1.0, 1.0, 3)
    beside = matrix @ np.array(
        [[-0.5, 0.0, 0.0, 1.0], [0.0, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    placed = [
        Instance(name="a", mesh=0, world_from_object=matrix), Instance(name="b", mesh=1, world_from_object=beside)
    ]  # fmt: skip
    scene = make_tracer_scene(with_every_feature(scene_of([quad(1.0, 1.0), quad(2.0, 2.0)], placed)))
    edge = np.array([[0.5, -0.45, 0.0], [0.5, 0.45, 0.0]]) @ matrix[:3, :3].T + matrix[:3, 3]
    middle, normal = edge.mean(axis=0), matrix[:3, 2]
    position = middle + 2.0 * normal + 0.3 * matrix[:3, 0]
    up = matrix[:3, 1]
    x, y, z = position.tolist()
    return scene, view((x, y, z), tuple(middle.tolist()), pixels=(8, 8), fov=30.0, up=tuple(up.tolist())), edge


def _off_seam(seen: View, xy: Float64, edge: Float64) -> Float64:
    """(n,) distances of positions on the panel from the edge's image, in units of the distance to the panel."""
    ends, _ = project(seen.panel, seen.eye, seen.event.camera, edge)
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    off = np.abs((xy - ends[0]) @ np.array([-along[1], along[0]]))
    height = 2.0 * math.tan(math.radians(15.0)) / seen.panel.pixels[1]  # of a pixel, in such units
    return np.asarray(off * height, np.float64)


def samples_near(
    scene: TracerScene, seen: View, points: Float64, random: np.random.Generator, *, roundings: int = NEAR_ROUNDINGS
) -> Samples:
    """Samples where points (n, 3) are seen on the panel, as far as they are, each some roundings beside it."""
    tracer = Tracer(scene, seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy, _ = project(seen.panel, seen.eye, seen.event.camera, points)
    width, height = seen.panel.pixels
    with np.errstate(invalid="ignore"):
        inside = ((xy > 0.0) & (xy < (width, height))).all(axis=1)
    aim = beside(xy[inside].astype(np.float32), random, roundings)
    found = [tracer.trace(part)[0].copy() for part in np.array_split(aim, max(1, math.ceil(len(aim) / BATCH)))]
    return np.concatenate(found)


def beside(values: Float32, random: np.random.Generator, roundings: int) -> Float32:
    """Positive float32 numbers, each up to so many steps away."""
    steps = random.integers(-roundings, roundings + 1, values.shape).astype(np.int32)
    moved: NDArray[np.int32] = np.ascontiguousarray(values).view(np.int32) + steps
    return np.maximum(moved, 0).view(np.float32)


def coplanar_light(width: int) -> Found:
    """Pixels of two equal squares in one place, under a directional light, whose light differs from eye to eye."""
    light = DirectionalLight(direction=(0.3, 0.1, 1.0), irradiance=(math.pi,) * 3)
    scene = with_every_feature(scene_of([quad(4.0, 4.0)] * 2, lights=[light]))
    first = _shown(scene, width, 0.0)
    changed = np.zeros(first.objects.shape, bool)
    for step in range(1, 8):
        apart = np.abs(_shown(scene, width, 1e-3 * step).radiance - first.radiance)
        changed |= (apart > 1e-5 * first.radiance).any(axis=2)
    return Found(
        figure=int(changed.sum()), note=f"of {changed.size:,} pixels",
        pictures=(picture("their light", first.radiance), picture("which of the two is seen", first.objects == 2)),
    )  # fmt: skip


def coplanar_objects(width: int) -> Found:
    """Pixels of a square that show another object in its plane: from eight eyes, in packets of others too."""
    sun = DirectionalLight(direction=(0.3, 0.1, 1.0), irradiance=(math.pi,) * 3)
    colours = [Material(name="red", base_color=(0.8, 0.1, 0.1)), Material(name="blue", base_color=(0.1, 0.1, 0.8))]
    changed = seen = 0
    pictures = []
    for turn, size in ((0.0, 4.0), (0.0, 5.0), (31.0, 4.0), (31.0, 5.0), (80.0, 5.0)):
        placed = [instance(k, at=(0.1, 0.2, 0.0), turn=("x", -turn)) for k in range(2)]
        meshes = [quad(4.0, 4.0), quad(size, 0.8 * size, material=1)]
        alone, both = (
            make_tracer_scene(with_every_feature(scene_of(meshes[:n], placed[:n], materials=colours, lights=[sun])))
            for n in (1, 2)
        )
        for step in range(8):
            own = _shown(alone, width, 1e-3 * step).objects == 1
            for coherent in (True, False):
                shown = _shown(both, width, 1e-3 * step, coherent=coherent)
                changed, seen = changed + int((shown.objects[own] != 1).sum()), seen + int(own.sum())
        pictures.append(picture(f"turned by {turn:g} degrees, beside {size:g} x {0.8 * size:g}", shown.radiance))
    return Found(figure=changed, note=f"of {seen:,}", pictures=tuple(pictures))


def _shown(scene: Scene | TracerScene, width: int, slide: float, *, coherent: bool = True) -> TracedImage:
    seen = view((0.3 + slide, 0.2, 3.0), (slide, 0.0, 0.0), pixels=(width, width), fov=60.0)
    return traced_image(scene, seen, coherent=coherent)


def needles(width: int) -> Found:
    """Pixels of a sphere stretched 1 : 1,000 (needles of triangles) that show what is behind it."""
    placed = instance(0, scale=(1000.0, 1.0, 1.0))
    matrix = placed.world_from_object.copy()
    matrix[:3, :3] = turned("z", 30.0) @ matrix[:3, :3]
    ball = scene_of([sphere_mesh(segments=SEGMENTS, smooth=False)], [replace(placed, world_from_object=matrix)])
    missed = total = 0
    for way in SIX_WAYS:
        seen = view((0.1, -0.2, 0.3), tuple(np.add((0.1, -0.2, 0.3), way)), pixels=(width, width), fov=90.0,
                    up=(0.36, 0.48, 0.8))  # fmt: skip
        objects = traced_image(with_every_feature(ball), seen, coherent=False).objects
        missed, total = missed + int((objects == 0).sum()), total + objects.size
    return Found(figure=missed, note=f"of {total:,} rays from inside")


def along_an_axis(width: int) -> Found:
    """Pixels of a closed sphere's inside that show what is behind it, in packets of neighbours."""
    scene = make_tracer_scene(with_every_feature(scene_of([sphere_mesh(segments=SEGMENTS, smooth=False)])))
    missed = total = 0
    worst, most = np.zeros((width, width), bool), -1
    for way in SIX_WAYS:
        seen = view((0.0, 0.0, 0.0), way, pixels=(width, width), fov=90.0, up=(0.36, 0.48, 0.8))
        missing = traced_image(scene, seen, coherent=True).objects == 0
        missed, total = missed + int(missing.sum()), total + missing.size
        if int(missing.sum()) > most:
            worst, most = missing, int(missing.sum())
    middle = slice(width // 2 - 16, width // 2 + 16)
    return Found(
        figure=missed, note=f"of {total:,} pixels",
        pictures=(picture("the middle of the worst image, what shows the background in white", worst[middle, middle]),),
    )  # fmt: skip


_CLOSED = (
    "Embree's robust traversal decides on which side of an edge a ray passes by the same numbers for both triangles, "
    "so none may pass between them"
)
CASES = (
    Case(
        name="edges", family="Watertight", unit="rays", bound=0.0, reason=_CLOSED,
        scene="Rays from inside a closed sphere to random points of its edges, within two roundings",
        measure=escapes_at_edges, size=400_000, small=5_000, long=10_000_000,
    ),
    Case(
        name="vertices", family="Watertight", unit="roundings of the distance", bound=13.0,
        reason="a ray escapes where the numbers of all edges of a vertex have one sign, and a wrong sign is within 7 "
        "roundings of its edge: two differences, a cross product, a dot product; where edges are up to 90 degrees "
        "apart that is within 10 of the vertex, and 3 more are the direction's and the eye's",
        scene="Rays from inside a closed sphere to its vertices, within two and eight roundings; how far from a "
        "vertex one passes that escapes",
        measure=escapes_at_vertices, size=400_000, small=20_000, long=10_000_000,
    ),
    Case(
        name="shadow_rays", family="Watertight", unit="rays", bound=0.0, reason=_CLOSED,
        scene="Shadow rays to a lamp in a closed sphere, through its edges and vertices",
        measure=light_through_edges, size=2_000_000, small=5_000, long=10_000_000,
    ),
    Case(
        name="instance_seams", family="Watertight", unit="roundings of the distance", bound=20.0,
        reason="each instance brings the ray to its own space: a hit is known to 20 roundings of float32 there (see "
        "the ray offset), so a gap may be as wide, and no wider",
        scene="Two squares that share an edge, instances of other meshes, scales and turns; rays beside the seam",
        measure=gap_between_instances, size=800_000, small=8_000,
    ),
    Case(
        name="coplanar", family="Watertight", unit="pixels", bound=0.0,
        reason="which of two equal surfaces is nearer is a matter of rounding; the light of both is the same",
        scene="Two equal squares in one place, from eight eyes 1e-3 apart; light that differs by more than 1e-5",
        measure=coplanar_light, size=256, small=32,
    ),
    Case(
        name="coplanar_objects", family="Watertight", unit="pixels", bound=0.0,
        reason="the later of two objects in one plane is placed 16 roundings of the distance behind the first, more "
        "than a hit is off",
        scene="A red square and a blue rectangle in its plane, turned by 0 to 80 degrees, from eight eyes 1e-3 apart, "
        "in packets of neighbours and ray by ray; pixels of the first that show the second",
        measure=coplanar_objects, size=256, small=24,
    ),
    Case(
        name="along_an_axis", family="Watertight", unit="pixels", bound=0.0, reason=_CLOSED,
        scene="The inside of a closed sphere from its middle, along each axis of the world, the camera rolled, traced "
        "as frames are: in packets of 4 x 4 neighbours",
        measure=along_an_axis, size=512, small=128,
    ),
    Case(
        name="needles", family="Watertight", unit="rays", bound=0.0, reason=_CLOSED,
        scene="The inside of a closed sphere stretched 1,000 : 1",
        measure=needles, size=512, small=48,
    ),
)  # fmt: skip
