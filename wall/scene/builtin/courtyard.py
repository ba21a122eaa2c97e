"""The project's small scene: a round terrace in the evening, a fountain with a golden knot, turning toys.

Y is up, a unit is a metre; the terrace is ten wide. About 60,000 triangles; twenty objects and two lanterns move.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wall.config.scene import OrbitConfig
from wall.core.data import Float64
from wall.scene.animation import Vector
from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.shapes import join, lathe, moved, painted, placed, sheet, sphere, torus, torus_knot
from wall.scene.lights import directional_light
from wall.scene.model import PointLight, Sky, Source
from wall.scene.repair import RawMesh

ON_AXIS: Vector = (0.0, 0.0, 0.0)

LIMESTONE: Vector = (0.72, 0.62, 0.48)
IVORY: Vector = (0.84, 0.77, 0.64)
TERRACOTTA: Vector = (0.60, 0.21, 0.10)
TEAL: Vector = (0.03, 0.30, 0.31)
INDIGO: Vector = (0.05, 0.09, 0.30)
SAFFRON: Vector = (0.86, 0.48, 0.06)
CORAL: Vector = (0.82, 0.20, 0.14)
SAGE: Vector = (0.22, 0.34, 0.13)
PLUM: Vector = (0.28, 0.06, 0.22)
GOLD: Vector = (0.88, 0.44, 0.06)

SUN_DIRECTION: Vector = (0.62, 0.52, 0.59)
SUN_SHARE: Vector = (1.10, 0.84, 0.52)  # irradiance / pi, low evening sun
EVENING = Sky(zenith=(0.04, 0.13, 0.42), horizon=(0.24, 0.40, 0.60), ground=(0.05, 0.06, 0.14))

COLUMNS, GONDOLAS, FLAGS = 9, 8, 10
QUARTER_TURN = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # about x: a ring stands


def courtyard() -> Source:
    """Build the scene; the same every time."""
    parts = Assembly()
    _terrace(parts)
    _colonnade(parts)
    _bunting(parts)
    _fountain(parts)
    _carousel(parts)
    _garden(parts)
    lights = _lanterns(parts)
    return parts.source((*lights, directional_light(SUN_DIRECTION, SUN_SHARE)), EVENING)


def _terrace(parts: Assembly) -> None:
    """A floating disc of stone with steps at its rim, rock below, a mosaic on top."""
    floor = parts.textured("mosaic", _mosaic(1024))
    stone = parts.material("limestone", LIMESTONE)
    rock = parts.material("rock", (0.25, 0.19, 0.17))
    disc = lathe([(4.9, 0.0), (2.5, 0.0), (0.0, 0.0)], 96)
    flat = disc.vertices[:, [0, 2]] / 9.8 + 0.5
    parts.put("floor", replace(disc, uvs=flat * [1, -1] + [0, 1]), floor)
    rim = [(5.6, -0.62), (5.6, -0.36), (5.55, -0.34), (5.25, -0.34), (5.25, -0.02), (5.2, 0.0), (4.9, 0.0)]
    parts.put("rim", lathe(rim, 96), stone)
    parts.put("rock", _rock(), rock)


def _rock() -> RawMesh:
    """The underside: a cone of cragged rings that hangs in the air."""
    chance = np.random.default_rng(7)
    rings, sides = 12, 40
    depth = np.linspace(0.0, 1.0, rings)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    angle[-1] = 0.0
    crag = np.cumsum(chance.uniform(-0.05, 0.05, (rings, sides + 1)), axis=0)
    fall = chance.uniform(0.75, 1.25, sides + 1)
    crag[:, -1], fall[-1] = crag[:, 0], fall[0]
    across = 5.55 * (1.0 - depth**1.5) * (1.0 + crag)
    down = np.broadcast_to(-0.62 - 2.5 * depth * np.where(depth < 1.0, fall, 1.0), across.shape)
    points = np.stack([across * np.sin(angle), down, across * np.cos(angle)], -1)
    return sheet(points[::-1])


def _mosaic(size: int) -> NDArray[np.uint8]:
    """A round pavement: rings of trapezoid stones around a star, each stone its own shade; (size, size, 3) sRGB."""
    centres = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    rows = np.array_split(centres[:, None], max(1, size // 16))  # so few that temporary arrays stay in the cache
    shades = _stone_colours()
    return np.concatenate([_stones(centres, some, shades) for some in rows])


def _stone_colours() -> Float64:
    """(10, 96, 3) sRGB, 0 to 255: of the stones of each ring."""
    palette = np.array(
        [
            [203, 174, 134],
            [178, 96, 62],
            [226, 208, 174],
            [203, 176, 138],
            [34, 108, 110],
            [216, 192, 154],
            [196, 166, 126],
            [182, 102, 66],
            [222, 200, 164],
            [210, 188, 150],
        ],
        float,
    )
    colours = palette[:, None] * np.random.default_rng(3).uniform(0.86, 1.08, (len(palette), 96))[..., None]
    for ring in (0, 1, 4, 6, 7):  # checkered
        colours[ring, ::2] = colours[ring, ::2] * [0.80, 0.78, 0.76] + [14, 10, 8]
    return colours


def _stones(x: Float64, y: Float64, colours: Float64) -> NDArray[np.uint8]:
    """The pavement at x (w,), y (h, 1), from -1 to 1; (h, w, 3) sRGB."""
    radius, angle = np.hypot(x, y), np.arctan2(y, x) / (2.0 * np.pi) + 0.5
    edges = np.array([0.0, 0.16, 0.30, 0.37, 0.50, 0.57, 0.70, 0.83, 0.90, 1.01, 2.0])
    ring = np.searchsorted(edges, radius, side="right") - 1
    stones = np.array([12, 24, 48, 36, 72, 48, 60, 96, 72, 72])[ring]
    along = angle * stones + 0.5 * (ring % 2)
    stone = np.floor(along).astype(int) % stones
    across = np.minimum(radius - edges[ring], edges[ring + 1] - radius)
    sideways = np.minimum(along % 1.0, 1.0 - along % 1.0) * 2.0 * np.pi * radius / stones
    joint = np.clip(np.minimum(across, sideways) / 0.0035, 0.0, 1.0)[..., None]
    return np.asarray(np.clip(colours[ring, stone] * (0.62 + 0.38 * joint), 0, 255), np.uint8)


def _colonnade(parts: Assembly) -> None:
    """Fluted columns on the rim, each with a jewel on its capital, low walls between some of them."""
    ivory = parts.material("ivory", IVORY)
    profile = [(0.30, 0.0), (0.30, 0.10), (0.26, 0.12), (0.24, 0.20), (0.20, 0.24)]
    shaft = [(0.19, 0.26), (0.188, 0.9), (0.175, 1.6), (0.155, 2.2)]
    capital = [(0.18, 2.22), (0.20, 2.28), (0.24, 2.34), (0.28, 2.36), (0.28, 2.46), (0.0, 2.46)]
    stones = [lathe(profile, 40), lathe(shaft, 120, flutes=15, depth=0.10), lathe(capital, 40)]
    column = parts.mesh("column", join(stones), ivory)
    polish = (("coral", CORAL, 0.06), ("teal", TEAL, 0.10), ("saffron", SAFFRON, 0.06), ("indigo", INDIGO, 0.12))
    jewels = [
        parts.mesh(f"jewel {name}", sphere(0.23, segments=40), parts.material(name, color, mirror))
        for name, color, mirror in polish
    ]
    for k in range(COLUMNS):
        matrix = _on_circle(4.55, k / COLUMNS)
        parts.place(f"column {k}", column, matrix)
        parts.place(f"jewel {k}", jewels[k % 4], matrix @ placed(0.0, 2.46 + 0.20, 0.0))


def _bunting(parts: Assembly) -> None:
    """Strings of little flags from column to column, each flag its own colour at its corners."""
    cloth = parts.material("cloth", (1.0, 1.0, 1.0))
    colors = np.array([CORAL, IVORY, TEAL, SAFFRON, INDIGO])
    flags: list[RawMesh] = []
    hang = np.linspace(0.0, 1.0, FLAGS + 1)
    for k in range(COLUMNS):
        start, end = (_on_circle(4.55, (k + side) / COLUMNS, 2.36)[:3, 3] for side in (0, 1))
        rope = start + hang[:, None] * (end - start) - [0.0, 0.5, 0.0] * (4.0 * hang * (1.0 - hang))[:, None]
        for number, (left, right) in enumerate(itertools.pairwise(rope)):
            tip = (left + right) / 2.0 - [0.0, 0.24, 0.0]
            corners = np.stack([0.92 * left + 0.08 * right, 0.08 * left + 0.92 * right, tip])
            one = RawMesh(vertices=corners, triangles=np.array([[0, 2, 1]], np.uint32))
            flags.append(painted(one, colors[(k * 2 + number) % len(colors)] * np.array([[0.85], [0.85], [1.1]])))
    parts.put("bunting", join(flags), cloth)


def _on_circle(radius: float, turn: float, height: float = 0.0) -> Float64:
    """(4, 4) placement on a circle about the y axis, facing outward."""
    angle = 2.0 * math.pi * turn
    return placed(radius * math.sin(angle), height, radius * math.cos(angle), turn_degrees=math.degrees(angle))


def _fountain(parts: Assembly) -> None:
    """Two basins of water, a golden knot above, three moons around it."""
    stone, water = parts.material("basin", IVORY), parts.material("water", (0.03, 0.16, 0.18), 0.45)
    low = [(1.55, 0.0), (1.55, 0.10), (1.45, 0.14), (1.42, 0.40), (1.50, 0.44), (1.50, 0.50)]
    low += [(1.36, 0.50), (1.34, 0.36)]
    stem = [(0.34, 0.30), (0.30, 0.44), (0.16, 0.60), (0.15, 0.80), (0.24, 0.92), (0.62, 1.06)]
    stem += [(0.72, 1.16), (0.72, 1.20), (0.64, 1.20), (0.60, 1.12)]
    parts.put("basin", join([lathe(low, 72), lathe(stem, 56)]), stone)
    parts.put("water", join([lathe([(1.36, 0.42), (0.0, 0.42)], 72), lathe([(0.63, 1.16), (0.0, 1.16)], 48)]), water)
    knot = torus_knot(2, 3, radius=0.74, thickness=0.17, steps=360, sides=24)
    parts.place("knot", parts.mesh("knot", knot, parts.material("gold", GOLD, 0.12)), placed(0.0, 2.25, 0.0))
    parts.spin("knot", 9.0)
    moon = sphere(0.13, segments=36)
    for k, (color, period) in enumerate(((CORAL, 5.0), (TEAL, 7.0), (IVORY, 11.0))):
        mesh = parts.mesh(f"moon {k}", moon, parts.material(f"moon {k}", color, 0.05))
        parts.place(f"moon {k}", mesh, _on_circle(1.5 + 0.12 * k, k / 3.0, 2.25))
        axis = (0.35 - 0.3 * k, 1.0, 0.2 * k)
        orbit = OrbitConfig(type="orbit", object=f"moon {k}", center=(0.0, 2.25, 0.0), axis=axis, period_s=period)
        parts.tracks.append(orbit)


def _carousel(parts: Assembly) -> None:
    """Eight toys on little poles that circle the fountain; each also turns on its own pole."""
    pole = parts.material("pole", (0.55, 0.36, 0.14), 0.15)
    colors = (CORAL, TEAL, SAFFRON, PLUM)
    paints = [parts.material(f"paint {k}", color) for k, color in enumerate(colors)]
    toys = [
        moved(torus(0.27, 0.11), QUARTER_TURN),
        lathe([(0.0, -0.40), (0.34, 0.0), (0.0, 0.40)], 6),
        sphere(0.31, segments=40),
        torus_knot(2, 5, radius=0.27, thickness=0.065, steps=240, sides=12),
    ]
    rod = parts.mesh("rod", lathe([(0.16, 0.0), (0.16, 0.04), (0.03, 0.07), (0.025, 0.66), (0.0, 0.66)], 20), pole)
    for k in range(GONDOLAS):
        mesh = parts.mesh(f"toy {k}", toys[k % 4], paints[(k + k // 4) % 4])
        parts.place(f"rod {k}", rod, _on_circle(2.75, k / GONDOLAS))
        parts.place(f"toy {k}", mesh, _on_circle(2.75, k / GONDOLAS, 1.05))
        parts.spin(f"toy {k}", 3.0 + 0.5 * k)
    parts.spin("rod *", 24.0, ON_AXIS)
    parts.spin("toy *", 24.0, ON_AXIS)


def _garden(parts: Assembly) -> None:
    """Cypresses and round bushes in terracotta pots, between the columns."""
    clay, leaf = parts.material("clay", TERRACOTTA), parts.material("sage", SAGE)
    dark = parts.material("cypress", (0.07, 0.17, 0.08))
    pot_profile = [(0.16, 0.0), (0.25, 0.34), (0.29, 0.36), (0.29, 0.44), (0.24, 0.44), (0.23, 0.38), (0.0, 0.38)]
    pot = parts.mesh("pot", lathe(pot_profile, 36), clay)
    slim = [(0.05, 0.36), (0.22, 0.5), (0.27, 0.85), (0.22, 1.4), (0.12, 1.9), (0.0, 2.2)]
    round_ = [(0.0, 0.34), (0.24, 0.42), (0.34, 0.66), (0.32, 0.86), (0.18, 1.04), (0.0, 1.1)]
    cypress = parts.mesh("cypress", _leaves(slim, 1), dark)
    bush = parts.mesh("bush", _leaves(round_, 2), leaf)
    for k in range(COLUMNS):
        if k % 3 == 2:
            continue
        matrix = _on_circle(4.4, (k + 0.5) / COLUMNS)
        parts.place(f"pot {k}", pot, matrix)
        parts.place(f"plant {k}", cypress if k % 3 == 0 else bush, matrix)


def _leaves(profile: list[tuple[float, float]], seed: int) -> RawMesh:
    """A turned profile, roughened so that it reads as foliage."""
    radius, height = np.array(profile).T
    fine = np.linspace(height[0], height[-1], 26)
    dense = list(zip(np.interp(fine, height, radius).tolist(), fine.tolist(), strict=True))
    shape = lathe(dense, 36)
    chance = np.random.default_rng(seed).uniform(0.80, 1.12, (26, 37))
    chance[:, -1] = chance[:, 0]
    rough = shape.vertices.copy()
    rough[:, [0, 2]] *= chance.reshape(-1, 1)
    return replace(shape, vertices=rough)


LANTERN_RADIUS = 0.11
BELOW_LANTERN = 0.14  # clear of the ball


def _lanterns(parts: Assembly) -> tuple[PointLight, ...]:
    """Two glowing balls that wander around the court, and the light they give.

    A point light inside its ball would light nothing: it hangs under it, where the flame of a lantern shines out.
    """
    lights = []
    glows = (
        ((1.0, 0.55, 0.20), 0.35, 1.25, 14.0, (0.0, 1.0, 0.0)),
        ((0.30, 0.65, 1.0), 0.85, 0.75, 19.0, (0.0, -1.0, 0.0)),
    )
    for k, (color, turn, height, period, axis) in enumerate(glows):
        glow = parts.material(f"glow {k}", (0.0, 0.0, 0.0), emission=color)
        mesh = parts.mesh(f"lantern {k}", sphere(LANTERN_RADIUS, segments=24), glow)
        matrix = _on_circle(3.6, turn, height)
        parts.place(f"lantern {k}", mesh, matrix)
        x, y, z = matrix[:3, 3].tolist()
        r, g, b = (2.4 * part for part in color)
        lights.append(PointLight(position=(x, y - BELOW_LANTERN, z), intensity=(r, g, b)))
        for target in ({"object": f"lantern {k}"}, {"light": k}):
            orbit = {"type": "orbit", "center": (0.0, height, 0.0), "axis": axis, "period_s": period}
            parts.tracks.append(OrbitConfig.model_validate({**orbit, **target}))
    return tuple(lights)
