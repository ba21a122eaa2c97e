"""Rays at edges and vertices of closed meshes, and surfaces in one place: how many rays escape, and what they see.

Embree tests a ray against each triangle in float32 (Pluecker coordinates, robust mode). Two triangles that share an
edge compute the same number for it, but for its sign, so no ray passes between them. A ray within a rounding of a
vertex may get numbers of one sign from all of its edges, so that it is outside every triangle there.
"""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import instance, material, quad, scene_of, sphere_mesh, turned, view, with_every_feature

from wall.core.data import Float32, Float64
from wall.scene.model import Instance, Mesh
from wall.tracing import embree
from wall.tracing.kernels.values import MISS
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

AT_VERTICES = 1e-3  # share of rays within two roundings of a vertex that may escape; 2.5e-4 was seen
FAR = 64  # roundings from a vertex, from where on none was seen to escape


def tracer_in(mesh: Mesh, placed: Instance) -> Tracer:
    """With its eye at the origin of the world."""
    seen = view((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), pixels=(4, 4))
    tracer = Tracer(make_tracer_scene(scene_of([mesh], [placed])), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    return tracer


def escaped(tracer: Tracer, directions: Float32) -> int:
    """How many rays from the eye in `directions` (n, 3) hit nothing; n is a multiple of 16."""
    arguments = tracer.arguments(np.zeros((0, 2), np.float32), np.zeros(0))
    work, escaped = arguments.work, 0
    rays, bits = work.packet[: embree.RAY_HIT_FLOATS].reshape(-1, 16), work.bits.reshape(-1, 16)
    work.valid[:] = -1
    for packet in directions.reshape(-1, 16, 3):
        rays[: embree.TIME // 16] = 0.0
        rays[embree.DIRECTION_X // 16 : embree.TIME // 16] = packet.T
        rays[embree.T_FAR // 16] = np.inf
        bits[embree.GEOMETRY // 16] = MISS
        addresses = work.valid.ctypes.data, arguments.scene.at_rest, work.packet.ctypes.data, work.arguments.ctypes.data
        embree._library.rtcIntersect16(*addresses)
        escaped += int((bits[embree.GEOMETRY // 16] == MISS).sum())
    return escaped


def disturbed(points: Float64, count: int, roundings: int, random: np.random.Generator) -> Float32:
    """`count` directions to points (n, 3) in turn, each component some roundings off; a multiple of 16."""
    units = points / np.linalg.norm(points, axis=1, keepdims=True)
    rays = units[np.arange(count - count % 16) % len(units)].astype(np.float32)
    steps = random.integers(-roundings, roundings + 1, rays.shape)
    return np.asarray(rays + steps * np.spacing(np.abs(rays)), np.float32)


@pytest.mark.parametrize("moved", [False, True], ids=["as it is", "turned, scaled and moved"])
def test_rays_escape_from_a_closed_mesh_at_vertices_alone_and_seldom(compiled_only: None, moved: bool) -> None:
    """From its middle, or from somewhere inside. The same with every kind of Embree tree: its triangle test decides.

    A direction has 2^-24 of roundings: a picture's ray comes so near to one of v vertices with a chance of some
    v * 1e-14, and then escapes with a chance of 1e-3.
    """
    random = np.random.default_rng(1)
    mesh = sphere_mesh(segments=120, smooth=False)
    placed = instance(0, at=(0.2, -0.1, 0.3), turn=("y", 33.0), scale=1.7) if moved else instance(0)
    tracer = tracer_in(mesh, placed)
    matrix = placed.world_from_object
    corners = (mesh.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles]
    shares = random.uniform(0.05, 0.95, (48_000, 1))
    chosen = corners[random.integers(0, len(corners), len(shares))]
    vertices = random.permutation(corners[:, 0])

    at_edges = disturbed(chosen[:, 0] + shares * (chosen[:, 1] - chosen[:, 0]), len(shares), 2, random)
    at_vertices = disturbed(vertices, 64_000, 2, random)
    beside = random.choice([-FAR, FAR], (16_000, 3)).astype(np.float32) * np.float32(2.0**-24)

    share = escaped(tracer, at_vertices) / len(at_vertices)
    print(f"escaped at vertices: {share:.1e}")
    assert escaped(tracer, at_edges) == 0
    assert share < AT_VERTICES
    assert escaped(tracer, disturbed(vertices, 16_000, 1, random) + beside) == 0


def test_needles_let_no_ray_through(compiled_only: None) -> None:
    """A closed box 1 x 1e-4 x 1 round the eye, in the fine and the long direction made of slivers."""
    random = np.random.default_rng(2)
    box = sphere_mesh(segments=40, smooth=False)
    tracer = tracer_in(box, instance(0, scale=(1.0, 1e-4, 1.0)))
    rays = random.normal(size=(32_000, 3))
    rays[::2, 1] *= 1e-4
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert escaped(tracer, rays.astype(np.float32)) == 0


@pytest.mark.parametrize("other", [(3.0, 3.0), (2.0, 5.0)], ids=["duplicates", "others in its plane"])
def test_of_surfaces_in_one_place_the_first_is_seen(compiled_only: None, other: tuple[float, float]) -> None:
    """In packets of any rays, in every thread and refresh."""
    random = np.random.default_rng(3)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turned("x", 31.0) @ turned("y", 17.0), (0.1, 0.2, -4.0)
    placed = [Instance(name=f"object{k}", mesh=k, world_from_object=matrix) for k in range(2)]
    colours = [material(0.9, 0.1, 0.1), material(0.1, 0.1, 0.9)]
    scene = scene_of([quad(3.0, 3.0), quad(*other, material=1)], placed, materials=colours)
    seen, laid = view((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), pixels=(96, 96)), make_tracer_scene(with_every_feature(scene))
    xy = random.uniform(0.0, 96.0, (20_000, 2)).astype(np.float32)
    order = random.permutation(len(xy))
    for coherent in (True, False):
        first = None
        for tracer in (Tracer(laid, seen.panel, seen.eye, coherent=coherent) for _ in range(2)):
            for _refresh in range(2):
                tracer.set_event(seen.event)
                objects = tracer.trace(xy)[0]["object_id"]
                first = objects if first is None else first
                np.testing.assert_array_equal(objects, first)
                objects[order] = tracer.trace(xy[order])[0]["object_id"]
                np.testing.assert_array_equal(objects, first)
        assert first is not None
        assert (first == 1).mean() > 0.3
        assert (first == 2).any() == (other != (3.0, 3.0))
