"""Trees of lights: what they choose has the chance that they say, every light that shines can be chosen, and paths that
ask them are as bright as closed forms say. Samples have fixed random numbers; bounds are 5 standard errors, 6e-7."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import BLACK, instance, quad, scene_of, view

from wall.core.data import Float32, Float64
from wall.core.jit import kernel
from wall.scene.build import Scene
from wall.scene.model import Material, Mesh, PointLight, SpotLight
from wall.tracing.kernels.light_tree import SCALE, WIDTH, chance_of_light, choose_light, weigh
from wall.tracing.kernels.rows import IMPORTANCE, PACKET_FLOATS
from wall.tracing.kernels.values import LightTree
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import LEAST_EMITTERS, LEAST_POINTS, LEAST_SPOTS, make_tracer_scene

NUMBERS = 4096  # evenly spread, for a tree's chances
EDGE_PIXELS = 48
ALBEDO = 0.5
FLOOR = Material(name="floor", base_color=(ALBEDO,) * 3)
DIM = (1e-9, 1e-9, 1e-9)
DOWN = view((0.0, 0.4, 0.001), (0.0, 0.0, 0.0), pixels=(EDGE_PIXELS, EDGE_PIXELS), fov=0.1)
SIGMAS = 5.0


@kernel
def choose_many(tree, numbers, point, normal, packet, rows, chances):
    for k in range(len(numbers)):
        rows[k], chances[k] = choose_light(
            tree, numbers[k], (point[0], point[1], point[2]), (normal[0], normal[1], normal[2]), packet
        )


@kernel
def chances_of_all(tree, point, normal, packet, chances):
    """Writes the chance of each row; returns that of nodes below which nothing shines, as the bounds above let hope."""
    here, up = (point[0], point[1], point[2]), (normal[0], normal[1], normal[2])
    for row in range(len(chances)):
        chances[row] = chance_of_light(tree, row, here, up, packet)
    here = here[0] + tree.offset[0], here[1] + tree.offset[1], here[2] + tree.offset[2]
    dead, reached = 0.0, np.zeros(len(tree.nodes) * WIDTH + 1)
    reached[0], below = 1.0, 1  # chances of nodes; where those of the next level stand
    for level in range(len(tree.first)):
        below = tree.first[level + 1] if level + 1 < len(tree.first) else len(tree.nodes)
        for node in range(tree.first[level], below):
            total = weigh(tree, node, here, up, packet)
            dead += 0.0 if total > 0.0 else reached[node]
            for k in range(WIDTH):
                if total > 0.0 and level + 1 < len(tree.first) and packet[IMPORTANCE + k] > 0.0:
                    child = below + WIDTH * (node - tree.first[level]) + k
                    reached[child] = reached[node] * packet[IMPORTANCE + k] / total
    return dead


def grid(width: float, cells: int, material: int) -> Mesh:
    """A square like quad(width, width), of cells x cells squares of two triangles."""
    steps = (np.arange(cells + 1) / cells - 0.5) * width
    x, y = np.meshgrid(steps, steps)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    triangles = [corner + np.array([[0], [a], [b]]) for a, b in ((1, cells + 2), (cells + 2, cells + 1))]
    return Mesh(
        name="grid",
        vertices=np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1).astype(np.float32),
        triangles=np.concatenate([t.T for t in triangles]).astype(np.uint32),
        material=material,
    )


def random_lamps(count: int, *, both_sides: bool = False, mirrored: bool = False) -> Scene:
    """Small and large squares, turned at random about a room of ten units, far from the world's origin."""
    rng = np.random.default_rng(4)
    lamp = Material(name="lamp", base_color=BLACK, emission=(3.0, 2.0, 1.0), emits_behind=both_sides)
    placed = []
    for _ in range(count):
        x, y, z = (1000.0 + rng.uniform(-5, 5, 3)).tolist()
        turn = "xyz"[rng.integers(3)], float(rng.uniform(0, 360))
        size = float(rng.choice([0.05, 0.2, 1.5], p=[0.6, 0.3, 0.1]))
        placed.append(instance(0, at=(x, y, z), turn=turn, scale=(-size, size, size) if mirrored else size))
    return replace(scene_of([quad(1.0, 1.0)], placed, materials=[lamp]), path_depth=2)


def tree_of(scene: Scene) -> tuple[Tracer, LightTree]:
    tracer = Tracer(make_tracer_scene(scene), DOWN.panel, DOWN.eye, coherent=False)
    tracer.place(np.array([999.0, 1001.0, 1000.5]), scene.at(0.0))
    emitters = tracer._lights.emitters
    assert emitters is not None
    assert emitters.tree is not None
    return tracer, emitters.tree


def random_points(count: int) -> tuple[Float32, Float32]:
    """Points among the lamps of random_lamps, relative to the eye, and normals."""
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rng.uniform(-6, 6, (count, 3)).astype(np.float32), normals.astype(np.float32)


@pytest.mark.parametrize("count", [LEAST_EMITTERS // 2, 700])
def test_a_tree_chooses_with_the_chances_that_it_says(count: int, compiled_only: None) -> None:
    """Chances, and that of none, sum to 1; a light's own chance is that of its choice; and numbers spread evenly find
    it as often as its chance says: within two of NUMBERS, at the ends of its part."""
    _, tree = tree_of(random_lamps(count))
    packet, numbers = np.zeros(PACKET_FLOATS, np.float32), ((np.arange(NUMBERS) + 0.5) / NUMBERS).astype(np.float32)
    losses: list[float] = []
    for point, normal in zip(*random_points(25), strict=True):
        rows, chosen = np.zeros(NUMBERS, np.int64), np.zeros(NUMBERS, np.float32)
        choose_many(tree, numbers, point, normal, packet, rows, chosen)
        chances = np.zeros(2 * count, np.float32)
        none = chances_of_all(tree, point, normal, packet, chances)
        assert chances.sum(dtype=np.float64) + none == pytest.approx(1.0, abs=1e-5)
        np.testing.assert_array_equal(chosen[chosen > 0.0], chances[rows[chosen > 0.0]])
        found = np.bincount(rows[chosen > 0.0], minlength=len(chances))
        losses.append(none)
        assert np.abs(found - NUMBERS * chances.astype(np.float64)).max() < 2.0
    assert np.mean(losses) < 0.2  # lamps are turned at random, and points too


@pytest.mark.parametrize("both_sides", [False, True])
def test_every_light_that_shines_on_a_point_can_be_chosen(both_sides: bool, compiled_only: None) -> None:
    """A triangle lights a point if its front, or any side, looks at it and a corner lies above the point's surface."""
    scene = random_lamps(150, both_sides=both_sides, mirrored=not both_sides)
    _, tree = tree_of(scene)
    origin, packet = np.array([999.0, 1001.0, 1000.5]), np.zeros(PACKET_FLOATS, np.float32)
    corners = np.array(
        [[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]]
    )
    matrices = scene.rest
    world = np.einsum("nij,tkj->ntki", matrices[:, :3, :3], corners) + matrices[:, None, None, :3, 3] - origin
    world = world.reshape(-1, 3, 3)
    fronts = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]) * (1.0 if both_sides else -1.0)
    dark = 0
    for point, normal in zip(*random_points(40), strict=True):
        chances = np.zeros(len(world), np.float32)
        chances_of_all(tree, point, normal, packet, chances)
        ahead = ((point - world[:, 0]) * fronts).sum(axis=1)
        above = ((world - point) @ normal.astype(np.float64)).max(axis=1)
        shines = ((np.abs(ahead) if both_sides else ahead) > 0.0) & (above > 0.0)
        assert (chances[shines] > 0.0).all()
        dark += int((chances[~shines] == 0.0).sum())
    assert dark > 1000  # and most of the others cannot


def test_a_tree_follows_what_moves_as_if_it_were_made_there() -> None:
    """Bounds after a move are those of a tracer that was never elsewhere; what is empty or still is not written."""
    scene = random_lamps(70)
    tracer, tree = tree_of(scene)
    before = tree.nodes.copy()
    moved = scene.rest.copy()
    moved[3, :3, 3] += (2.0, 0.5, -1.0)
    moved.setflags(write=False)  # as a scene's are
    moment = replace(scene.at(0.0), world_from_object=moved)
    tracer.place(np.array([999.0, 1001.0, 1000.5]), moment)
    other = Tracer(make_tracer_scene(scene), DOWN.panel, DOWN.eye, coherent=False)
    other.place(np.array([1.0, 2.0, 3.0]), moment)
    fresh = other._lights.emitters
    assert fresh is not None
    assert fresh.tree is not None
    np.testing.assert_array_equal(tree.nodes, fresh.tree.nodes)
    assert 0 < (tree.nodes != before).any(axis=1).sum() < len(before)
    np.testing.assert_allclose(tree.nodes[0, SCALE:].sum(), 1.0, rtol=1e-5)  # all power


def test_few_lights_and_direct_light_have_no_tree() -> None:
    few = make_tracer_scene(random_lamps(LEAST_EMITTERS // 2 - 1))
    assert few.emitters is not None
    assert few.emitters.tree is None
    points = [PointLight(position=(float(k), 1.0, 0.0), intensity=(1.0, 1.0, 1.0)) for k in range(LEAST_POINTS)]
    direct = scene_of([quad(1.0, 1.0)], lights=points)
    assert make_tracer_scene(direct).point_tree is None
    assert make_tracer_scene(replace(direct, path_depth=2)).point_tree is not None
    assert make_tracer_scene(replace(direct, path_depth=2), trees=False).point_tree is None
    fewer = replace(scene_of([quad(1.0, 1.0)], lights=points[1:]), path_depth=2)
    assert make_tracer_scene(fewer).point_tree is None


def lit_floor(lamp: Mesh, points: int, spots: int, *, shine: float = 0.0) -> Scene:
    """A floor below a lamp of height 1 that faces it, and below points and spots of that intensity in rows above."""
    lamps = Material(name="lamp", base_color=BLACK, emission=DIM if shine else (3.0, 2.0, 1.0), emits_behind=False)
    rng = np.random.default_rng(6)
    places = rng.uniform((-2, 1, -2), (2, 2, 2), (points + spots, 3))
    lights = [PointLight(position=tuple(at), intensity=(shine,) * 3) for at in places[:points].tolist()]
    down = (0.0, -1.0, 0.0)
    cones = [
        SpotLight(position=tuple(at), direction=down, intensity=(shine,) * 3, inner_angle=20.0, outer_angle=60.0)
        for at in places[points:].tolist()
    ]
    placed = [instance(0, turn=("x", -90.0)), instance(1, at=(0.0, 1.0, 0.0), turn=("x", 90.0))]
    scene = scene_of([quad(100.0, 100.0), lamp], placed, materials=[FLOOR, lamps], lights=[*lights, *cones])
    return replace(scene, path_depth=1)


def mean_and_error(scene: Scene, sweeps: int) -> tuple[Float64, Float64]:
    """Mean radiance, RGB, of the floor below the middle, and its standard error over sweeps."""
    tracer = Tracer(make_tracer_scene(scene), DOWN.panel, DOWN.eye, coherent=False)
    tracer.set_event(DOWN.event)
    xy = np.stack(np.meshgrid(*[np.arange(EDGE_PIXELS) + 0.5] * 2), axis=-1).reshape(-1, 2).astype(np.float32)
    means = np.array([tracer.trace(xy, 0.0, k)[0]["radiance"].mean(axis=0, dtype=np.float64) for k in range(sweeps)])
    return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(sweeps)


@pytest.mark.parametrize("size", [0.2, 2.0, 20.0])
def test_a_lamp_of_many_triangles_gives_the_light_of_its_form_factor(size: float, compiled_only: None) -> None:
    """As test_paths.py derives it for a lamp of two, from 0.2 to 20 times its height."""
    got, _ = mean_and_error(lit_floor(grid(size, 8, 1), LEAST_POINTS, LEAST_SPOTS), 16)
    x = size / 2
    quarter = x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    np.testing.assert_allclose(got, ALBEDO * 4 * quarter * np.array([3.0, 2.0, 1.0]), rtol=0.01)


def test_points_and_spots_that_are_chosen_give_the_light_of_all(compiled_only: None) -> None:
    """The sum over all lights of intensity, falloff (KHR_lights_punctual) and cosine over distance squared."""
    scene = lit_floor(grid(0.1, 8, 1), LEAST_POINTS, LEAST_SPOTS, shine=2.0)
    got, error = mean_and_error(scene, 16)
    want = 0.0
    for light in (*scene.point_lights, *scene.spot_lights):
        square = float(np.square(light.position).sum())
        cosine = light.position[1] / math.sqrt(square)
        a, b = light.falloff if isinstance(light, SpotLight) else (0.0, 1.0)
        want += ALBEDO / math.pi * 2.0 * min(max(a * cosine + b, 0.0), 1.0) ** 2 * cosine / square
    assert (np.abs(got - want) < SIGMAS * error + 1e-5 * want).all(), (got, want, error)
    assert (error < 0.01 * want).all()
