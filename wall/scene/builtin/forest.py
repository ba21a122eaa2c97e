"""The project's large scene: a round of autumn forest with a lake, more than two million triangles by instancing.

Y is up, sixty units wide. Seven tree and bush meshes of some 1,500 triangles stand about 1,450 times on hills;
three balloons drift over them. Only some 60,000 triangles are stored.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wall.core.data import Float64
from wall.scene.animation import Vector
from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.shapes import join, lathe, moved, painted, placed, sheet, sphere
from wall.scene.lights import directional_light
from wall.scene.model import Sky, Source
from wall.scene.repair import RawMesh

REACH = 30.0  # radius of the round
LAKE_LEVEL = -0.9
LAKE: tuple[float, float, float] = (5.0, 6.0, 7.5)  # x, z, radius of its hollow
SPACING = 0.97  # of the jittered grid that trees are drawn from
SEED = 20

MORNING = Sky(zenith=(0.10, 0.22, 0.50), horizon=(0.36, 0.47, 0.60), ground=(0.07, 0.09, 0.14))
SUN_DIRECTION: Vector = (-0.62, 0.50, 0.45)
SUN_SHARE: Vector = (1.10, 0.88, 0.60)  # irradiance / pi

WHITE: Vector = (1.0, 1.0, 1.0)
BARK = np.array([0.16, 0.10, 0.06])
BIRCH_BARK = np.array([0.62, 0.58, 0.50])


def forest() -> Source:
    """Build the scene; the same every time."""
    parts = Assembly()
    paint = parts.material("paint", WHITE)
    parts.put("ground", _ground(), paint)
    water = parts.material("water", (0.02, 0.07, 0.09), mirror=0.6)
    x, z, radius = LAKE
    lake = moved(lathe([(radius * 1.35, 0.0), (0.0, 0.0)], 64), placed(x, LAKE_LEVEL, z))
    parts.put("lake", lake, water)
    _plant(parts, paint)
    _balloons(parts, paint)
    return parts.source((directional_light(SUN_DIRECTION, SUN_SHARE),), MORNING)


def height(x: Float64, z: Float64) -> Float64:
    """Ground height: long hills, a rise to the rim behind, a hollow for the lake; any shape, world units."""
    hills = 1.1 * np.sin(0.21 * x + 0.7) * np.cos(0.17 * z - 0.4) + 0.5 * np.sin(0.43 * x - 0.31 * z)
    ridge = 4.2 * np.exp(-((x + 11.0) ** 2 + (z + 13.0) ** 2) / 90.0)
    ridge += 2.6 * np.exp(-((x - 14.0) ** 2 + (z + 12.0) ** 2) / 60.0)
    lake_x, lake_z, radius = LAKE
    hollow = 2.6 * np.exp(-((((x - lake_x) ** 2 + (z - lake_z) ** 2) / radius**2) ** 2))
    return np.asarray(hills + ridge - hollow + 0.05 * np.sin(2.3 * x) * np.sin(1.9 * z), np.float64)


def _ground() -> RawMesh:
    """Rings of ground out to REACH, then a skirt of earth; coloured by height, slope and wetness."""
    rings, sides = 110, 200
    out = np.concatenate([np.sqrt(np.linspace(0.0, 1.0, rings)) * REACH, [REACH, REACH * 0.93, REACH * 0.5, 0.0]])
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    angle[-1] = 0.0
    x, z = out[:, None] * np.sin(angle), out[:, None] * np.cos(angle)
    y = height(x, z)
    y[rings:] = np.array([-2.2, -4.5, -8.5, -10.0])[:, None]
    y[rings:-1] += 0.5 * np.sin(7.0 * angle) + 0.3 * np.sin(17.0 * angle)
    shape = sheet(np.stack([x, y, z], -1)[::-1])
    chance = np.random.default_rng(SEED)
    grass, straw = np.array([0.17, 0.22, 0.06]), np.array([0.36, 0.27, 0.10])
    sand, earth = np.array([0.48, 0.38, 0.24]), np.array([0.22, 0.13, 0.08])
    mix = np.clip(0.5 + 0.35 * np.sin(0.6 * x + 0.4 * z) + 0.3 * chance.standard_normal(x.shape), 0.0, 1.0)[..., None]
    color = grass * (1.0 - mix) + straw * mix
    by_the_lake = np.hypot(x - LAKE[0], z - LAKE[1]) < 1.5 * LAKE[2]
    shore = (np.clip((LAKE_LEVEL + 0.45 - y) / 0.3, 0.0, 1.0) * by_the_lake)[..., None]
    color = color * (1.0 - shore) + sand * shore
    color[rings - 1 :] = earth
    color[:, -1] = color[:, 0]
    return painted(shape, color[::-1].reshape(-1, 3))


def _plant(parts: Assembly, paint: int) -> None:
    """Draw places from a jittered grid; kinds grow in patches, conifers up the hills, nothing in the lake."""
    chance = np.random.default_rng(SEED + 1)
    kinds = [
        parts.mesh("fir", _conifer(1.0, np.array([0.035, 0.11, 0.05]), 31), paint),
        parts.mesh("pine", _conifer(0.8, np.array([0.07, 0.16, 0.05]), 32), paint),
        parts.mesh("maple", _leafy(np.array([0.62, 0.10, 0.03]), BARK, 33), paint),
        parts.mesh("beech", _leafy(np.array([0.70, 0.30, 0.03]), BARK, 34), paint),
        parts.mesh("birch", _leafy(np.array([0.80, 0.55, 0.07]), BIRCH_BARK, 35), paint),
        parts.mesh("oak", _leafy(np.array([0.20, 0.27, 0.05]), BARK, 36), paint),
        parts.mesh("shrub", _shrub(np.array([0.42, 0.14, 0.06]), 37), paint),
    ]
    x, z = _positions(chance)
    y = height(x, z)
    patch = np.sin(0.33 * x + 1.0) + np.sin(0.29 * z - 0.5) + 0.9 * chance.standard_normal(len(x))
    broadleaf = 2 + np.digitize(patch, [-0.9, 0.1, 1.0])  # maple, beech, birch, oak
    kind = np.where(y + 0.8 * chance.standard_normal(len(x)) > 1.1, chance.integers(0, 2, len(x)), broadleaf)
    kind = np.where(chance.random(len(x)) < 0.08, 6, kind)
    size, turn = chance.uniform(0.7, 1.25, len(x)), chance.uniform(0.0, 360.0, len(x))
    names = ("fir", "pine", "maple", "beech", "birch", "oak", "shrub")
    for k in range(len(x)):
        matrix = placed(x[k], y[k] - 0.05, z[k], turn_degrees=turn[k], scale=size[k])
        parts.place(f"{names[kind[k]]} {k}", kinds[kind[k]], matrix)


def _positions(chance: np.random.Generator) -> tuple[Float64, Float64]:
    """(n,) x and z of the trees."""
    grid = np.arange(-REACH, REACH, SPACING)
    x, z = (part.reshape(-1) for part in np.meshgrid(grid, grid))
    x = x + chance.uniform(-0.45, 0.45, len(x)) * SPACING
    z = z + chance.uniform(-0.45, 0.45, len(z)) * SPACING
    dense = 0.58 + 0.42 * np.sin(0.23 * x - 0.9) * np.sin(0.26 * z + 0.3)
    dry = (height(x, z) > LAKE_LEVEL + 0.35) | (np.hypot(x - LAKE[0], z - LAKE[1]) > 1.5 * LAKE[2])
    kept = (np.hypot(x, z) < REACH - 0.8) & dry & (chance.random(len(x)) < dense)
    return x[kept], z[kept]


def _conifer(width: float, needles: Float64, seed: int) -> RawMesh:
    """A trunk and nine skirts with ragged hems, lighter at the hem; about 2.6 high."""
    chance = np.random.default_rng(seed)
    trunk = painted(lathe([(0.09, 0.0), (0.05, 0.8)], 8), BARK)
    tiers, sides = [], 30
    for k in range(9):
        low, reach = 0.35 + 0.24 * k, width * (0.72 - 0.072 * k)
        profile = [(0.15 * reach, low + 0.10), (reach, low - 0.06), (0.62 * reach, low + 0.10), (0.0, low + 0.52)]
        tier = lathe(profile, sides)
        ragged = chance.uniform(0.72, 1.12, sides + 1)
        ragged[-1] = ragged[0]
        vertices = tier.vertices.reshape(4, sides + 1, 3).copy()
        vertices[1] *= np.stack([ragged, np.ones(sides + 1), ragged], 1)
        vertices[1, :, 1] -= 0.10 * (ragged - 0.9)
        color = np.repeat(needles[None] * np.array([[0.5], [1.5], [1.05], [0.8]]), sides + 1, axis=0)
        tiers.append(painted(replace(tier, vertices=vertices.reshape(-1, 3)), color))
    return join([trunk, *tiers])


def _leafy(leaves: Float64, bark: Float64, seed: int) -> RawMesh:
    """A trunk under a crown of nine rough balls, darker inside and below; about 2.3 high."""
    chance = np.random.default_rng(seed)
    trunk = painted(lathe([(0.10, 0.0), (0.07, 0.5), (0.05, 1.3)], 8), bark)
    balls = []
    for k in range(9):
        turn, out = 2.4 * k, 0.42 * math.sqrt((k + 0.5) / 9.0)
        up = 1.45 + 0.62 * chance.random() - 0.71 * out
        middle = np.array([out * math.sin(turn), up, out * math.cos(turn)])
        balls.append(_rough_ball(middle, chance.uniform(0.32, 0.46), chance, leaves))
    return join([trunk, *balls])


def _shrub(leaves: Float64, seed: int) -> RawMesh:
    chance = np.random.default_rng(seed)
    spots = [(0.0, 0.22, 0.0), (0.24, 0.16, 0.08), (-0.18, 0.15, 0.18), (-0.05, 0.16, -0.24)]
    return join([_rough_ball(np.array(spot), chance.uniform(0.22, 0.30), chance, leaves) for spot in spots])


def _rough_ball(middle: Float64, radius: float, chance: np.random.Generator, color: Float64) -> RawMesh:
    segments = 14
    ball = sphere(1.0, segments=segments)
    rough = chance.uniform(0.78, 1.12, (segments // 2 + 1, segments + 1))
    rough[:, -1], rough[0], rough[-1] = rough[:, 0], 0.95, 0.95
    vertices = ball.vertices * rough.reshape(-1, 1) * radius + middle
    shade = 0.72 + 0.36 * ball.vertices[:, 1] + chance.uniform(-0.12, 0.12, len(vertices))
    shade = shade.reshape(rough.shape)
    shade[:, -1] = shade[:, 0]
    colors = np.clip(color * np.clip(shade, 0.25, 1.3).reshape(-1, 1), 0.0, 1.0)
    return painted(replace(ball, vertices=vertices), colors)


def _balloons(parts: Assembly, paint: int) -> None:
    """Three striped balloons that drift round the middle."""
    stripes = (
        ((0.78, 0.10, 0.07), (0.90, 0.82, 0.66)),
        ((0.04, 0.26, 0.42), (0.90, 0.66, 0.16)),
        ((0.40, 0.06, 0.28), (0.85, 0.45, 0.30)),
    )
    flights = ((9.0, 7.5, 0.02, 90.0), (15.0, 9.5, 0.38, 140.0), (19.0, 6.5, 0.72, -180.0))
    for k, ((one, other), (radius, up, turn, period)) in enumerate(zip(stripes, flights, strict=True)):
        mesh = parts.mesh(f"balloon {k}", _balloon(np.array(one), np.array(other)), paint)
        angle = 2.0 * math.pi * turn
        parts.place(f"balloon {k}", mesh, placed(radius * math.sin(angle), up, radius * math.cos(angle)))
        parts.spin(f"balloon {k}", period, (0.0, 0.0, 0.0))


def _balloon(one: Float64, other: Float64) -> RawMesh:
    angle = np.linspace(-0.42 * np.pi, 0.5 * np.pi, 22)
    across = np.cos(angle) * np.where(angle < 0.0, 1.0 - 0.25 * (angle / angle[0]) ** 2, 1.0)
    across[-1] = 0.0
    sides = 48
    skin = lathe(list(zip((1.3 * across).tolist(), (1.45 * np.sin(angle) + 2.2).tolist(), strict=True)), sides)
    gore = (np.arange(sides + 1) // 4 % 2 == 0)[None, :, None]
    color = np.broadcast_to(np.where(gore, one, other), (len(angle), sides + 1, 3)).reshape(-1, 3)
    basket = painted(lathe([(0.0, 0.0), (0.2, 0.0), (0.24, 0.32)], 16), np.array([0.30, 0.18, 0.08]))
    ropes = painted(lathe([(0.24, 0.30), (0.30, 0.80)], 8), np.array([0.25, 0.18, 0.12]))
    return join([painted(skin, color), basket, ropes])
