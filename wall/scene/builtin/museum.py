"""A gallery in the afternoon, for paths: sun through tall windows, paintings, a golden knot, glass on a laid table.

Y is up, a unit is a metre; the windows are in the wall at -x, the large painting hangs at -z. Light 0 is the sun.
Noise decides what lights the room. The windows have no panes: nothing is aimed at through glass, so behind panes the
sun would be lost. Shade is lit by a laylight, which is aimed at, more than by the sky, which is only found by chance.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wall.core.data import Float64
from wall.scene.animation import Vector
from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.museum_images import Texels, discs, fields, hills, parquet, weave
from wall.scene.builtin.shapes import box, join, lathe, moved, placed, sheet, sphere, torus_knot
from wall.scene.model import DirectionalLight, Sky, Source, SpotLight
from wall.scene.repair import RawMesh

PATH_DEPTH = 6
LEFT, RIGHT, BACK, FRONT, CEILING = -3.6, 3.6, -5.6, 5.8, 4.4  # the room's inner faces
WALL = 0.45  # thickness of its walls: the depth of the windows' reveals
SILL, HEAD, HALF_WINDOW = 0.5, 3.7, 0.8
WINDOWS_Z = (-3.6, -0.9)  # their middles
CURTAIN, FOLDS = 0.50, 6.0  # width of one, and its folds

SUN_DIRECTION: Vector = (-0.83, 0.41, -0.33)  # towards the sun: 25 degrees high
SUN: Vector = (15.0, 11.8, 7.8)  # W m^-2
SUN_DEGREES = 0.53
AFTERNOON = Sky(zenith=(0.40, 0.72, 1.50), horizon=(0.74, 0.85, 1.00), ground=(0.50, 0.48, 0.36))
LAYLIGHT: Vector = (0.80, 0.86, 0.95)  # W sr^-1 m^-2, of the glass in the ceiling
LAMP: Vector = (1.15, 0.80, 0.46)  # W sr^-1 m^-2, of the globes

SAGE: Vector = (0.30, 0.37, 0.34)
CHALK: Vector = (0.78, 0.75, 0.69)
OAK: Vector = (0.46, 0.29, 0.155)
GOLD: Vector = (1.0, 0.72, 0.30)
QUARTER_TURN = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # about x: the knot stands
VASE_OUTSIDE = [(0.075, 0.0), (0.085, 0.02), (0.1, 0.1), (0.105, 0.18), (0.085, 0.28), (0.055, 0.36), (0.06, 0.42)]
VASE_INSIDE = [
    (0.082, 0.46),
    (0.078, 0.46),
    (0.054, 0.42),
    (0.047, 0.36),
    (0.075, 0.28),
    (0.093, 0.18),
    (0.085, 0.1),
    (0.06, 0.06),
]
UNIT_BOX = box(1.0, 1.0, 1.0)


def museum() -> Source:
    """Build the scene; the same every time. Seen best from (1.1, 1.55, 5.0) towards (-0.3, 1.4, -1)."""
    parts = Assembly()
    _room(parts)
    for k, z in enumerate(WINDOWS_Z):
        _window(parts, f"window {k}", z)
    _curtains(parts)
    _paintings(parts)
    _sculpture(parts)
    _table(parts)
    _bench(parts)
    _lamps(parts)
    x, y, z = np.array(SUN_DIRECTION) / np.linalg.norm(SUN_DIRECTION)
    sun = DirectionalLight(direction=(float(x), float(y), float(z)), irradiance=SUN, angular_diameter=SUN_DEGREES)
    return parts.source((sun, *_spots()), AFTERNOON, path_depth=PATH_DEPTH)


def _block(low: Vector, high: Vector) -> RawMesh:
    """A box between two corners."""
    return replace(UNIT_BOX, vertices=np.where(UNIT_BOX.vertices > [0.0, 0.5, 0.0], high, low))


def _number(parts: Assembly, name: str) -> int:
    """The number of a material that another part of the room has brought."""
    return next(k for k, material in enumerate(parts.materials) if material.name == name)


def _coated(parts: Assembly, name: str, texels: Texels | Vector, *, roughness: float, specular: float = 1.0) -> int:
    """A coated material, of a texture or a colour."""
    number = parts.textured(name, texels) if isinstance(texels, np.ndarray) else parts.material(name, texels)
    parts.materials[number] = replace(parts.materials[number], specular=specular, roughness=roughness)
    return number


def _room(parts: Assembly) -> None:
    """Floor, ceiling, four walls, of which the left one is what the windows leave; skirting and cornice."""
    plaster, chalk = parts.material("plaster", SAGE), parts.material("chalk", CHALK)
    floor = sheet(np.array([[[LEFT, 0, FRONT], [RIGHT, 0, FRONT]], [[LEFT, 0, BACK], [RIGHT, 0, BACK]]]))
    x, z = floor.vertices[:, 0], floor.vertices[:, 2]
    uvs = np.stack([x + z, x - z], 1) / math.sqrt(2.0) / 4.0  # planks at 45 degrees, 0.1 m wide
    parts.put(
        "floor", replace(floor, uvs=uvs), _coated(parts, "parquet", parquet(24, OAK), roughness=0.45, specular=0.5)
    )
    out = LEFT - WALL
    _ceiling(parts, chalk)
    parts.put("base", _block((out, -WALL, BACK - WALL), (RIGHT + WALL, -0.01, FRONT + WALL)), chalk)
    parts.put("back wall", _block((out, -0.01, BACK - WALL), (RIGHT + WALL, CEILING, BACK)), plaster)
    parts.put("front wall", _block((out, -0.01, FRONT), (RIGHT + WALL, CEILING, FRONT + WALL)), plaster)
    parts.put("right wall", _block((RIGHT, -0.01, BACK), (RIGHT + WALL, CEILING, FRONT)), plaster)
    sides = (BACK, *(z + s * HALF_WINDOW for z in WINDOWS_Z for s in (-1, 1)), FRONT)
    piers = [_block((out, SILL, a), (LEFT, HEAD, b)) for a, b in zip(sides[::2], sides[1::2], strict=True)]
    bands = [_block((out, low, BACK), (LEFT, high, FRONT)) for low, high in ((-0.01, SILL), (HEAD, CEILING))]
    parts.put("window wall", join([*piers, *bands]), plaster)
    trims = []
    for y, height, depth in (
        (0.0, 0.16, 0.025),
        (0.92, 0.05, 0.03),
        (CEILING - 0.10, 0.10, 0.14),
        (CEILING - 0.17, 0.07, 0.07),
    ):
        trims.append(_block((LEFT, y, BACK), (RIGHT, y + height, BACK + depth)))
        trims.append(_block((RIGHT - depth, y, BACK + depth), (RIGHT, y + height, FRONT)))
        if not SILL < y < HEAD:
            trims.append(_block((LEFT, y, BACK + depth), (LEFT + depth, y + height, FRONT)))
    parts.put("trims", join(trims), chalk)
    parts.put("panels", join([_border(x) for x in (-2.7, -1.35, 0.0, 1.35, 2.7)]), chalk)


def _ceiling(parts: Assembly, chalk: int) -> None:
    """A ceiling with a laylight: a shallow pit whose top is a sheet of frosted glass between bars, and shines."""
    glow = parts.material("laylight", (0.7, 0.7, 0.7), emission=LAYLIGHT, emits_behind=False)
    x, z0, z1, y, top = 1.4, -4.4, 4.4, CEILING + 0.22, CEILING + WALL
    left, right, back, front = LEFT - WALL, RIGHT + WALL, BACK - WALL, FRONT + WALL
    bands = [_block((left, CEILING, a), (right, top, b)) for a, b in ((back, z0), (z1, front))]
    bands += [_block((a, CEILING, z0), (b, top, z1)) for a, b in ((left, -x), (x, right))]
    parts.put("ceiling", join([*bands, _block((-x, y + 0.01, z0), (x, top, z1))]), chalk)
    parts.put("laylight", sheet(np.array([[[-x, y, z0], [x, y, z0]], [[-x, y, z1], [x, y, z1]]])), glow)
    bars = [_block((-x, y - 0.05, z - 0.02), (x, y - 0.001, z + 0.02)) for z in np.linspace(z0, z1, 8)[1:-1].tolist()]
    bars += [_block((a - 0.02, y - 0.04, z0), (a + 0.02, y - 0.001, z1)) for a in (-x / 3, x / 3)]
    parts.put("laylight bars", join(bars), chalk)


def _border(x: float) -> RawMesh:
    """A thin moulding in a rectangle below the rail of the back wall."""
    y, w, h, t, front = 0.54, 0.62, 0.26, 0.03, BACK + 0.018
    return join(
        [
            _block((x - w, y - h, BACK), (x + w, y - h + t, front)),
            _block((x - w, y + h - t, BACK), (x + w, y + h, front)),
            _block((x - w, y - h + t, BACK), (x - w + t, y + h - t, front)),
            _block((x + w - t, y - h + t, BACK), (x + w, y + h - t, front)),
        ]
    )


def _window(parts: Assembly, name: str, z: float) -> None:
    """A frame with mullions and a sill in an opening of the left wall; no panes."""
    near, far = LEFT - 0.30, LEFT - 0.36  # within the wall
    a, b = z - HALF_WINDOW, z + HALF_WINDOW
    bars = [_block((far, SILL, a), (near, HEAD, a + 0.06)), _block((far, SILL, b - 0.06), (near, HEAD, b))]
    bars += [_block((far, y, a + 0.06), (near, y + 0.06, b - 0.06)) for y in (SILL, HEAD - 0.06)]
    bars.append(_block((far, SILL + 0.06, z - 0.035), (near, HEAD - 0.06, z + 0.035)))
    for y in np.linspace(SILL, HEAD, 6)[1:-1].tolist():
        for low, high in ((a + 0.06, z - 0.035), (z + 0.035, b - 0.06)):
            bars.append(_block((far + 0.01, y - 0.015, low), (near - 0.01, y + 0.015, high)))
    bars.append(_block((far, SILL, a + 0.001), (LEFT + 0.07, SILL + 0.035, b - 0.001)))
    parts.put(name, join(bars), _number(parts, "chalk"))


def _curtains(parts: Assembly) -> None:
    """Heavy curtains beside each window, on brass rods."""
    cloth = parts.textured("curtain", weave(128, (0.50, 0.085, 0.05), (0.38, 0.045, 0.04), 32))
    brass = parts.material("brass", (0.90, 0.66, 0.32), metallic=1.0, roughness=0.35)
    for k, z in enumerate(WINDOWS_Z):
        for side in (-1, 1):
            middle = z + side * (HALF_WINDOW + 0.18)
            parts.put(f"curtain {k} {'left' if side < 0 else 'right'}", _curtain(middle, 7 * k + side), cloth)
        rod = moved(lathe([(0.0, -1.35), (0.018, -1.35), (0.018, 1.35), (0.0, 1.35)], 16), QUARTER_TURN)
        knobs = [moved(sphere(0.04, segments=20), placed(0.0, 0.0, end)) for end in (-1.37, 1.37)]
        parts.put(f"rod {k}", join([rod, *knobs]), brass, (LEFT + 0.13, HEAD + 0.17, z))


def _curtain(z: float, seed: int) -> RawMesh:
    """A sheet that hangs in folds from the rod: even at the top, deeper and looser at the hem."""
    chance = np.random.default_rng(100 + seed)
    down, across = np.linspace(0.0, 1.0, 40)[:, None], np.linspace(0.0, 1.0, 145)
    uneven = np.sin(2.0 * np.pi * across * 1.5 + chance.uniform(0, 6)) * (0.4 + down)
    phase = 2.0 * np.pi * FOLDS * across + 0.5 * uneven
    depth = 0.035 + 0.035 * down + 0.012 * np.sin(2.0 * np.pi * (across * 2.0 + 0.4 * down) + chance.uniform(0, 6))
    out = depth * np.sin(phase) + 0.010 * down * np.sin(2.0 * phase + 3.0 * down)
    spread = CURTAIN * (0.86 + 0.14 * down) * (across - 0.5) + 0.25 * depth * np.cos(phase)
    spread += 0.02 * down * np.sin(5.0 * down)
    top, hem = HEAD + 0.16, 0.02
    points = np.stack([LEFT + 0.14 + out, np.broadcast_to(top + (hem - top) * down, out.shape), z + spread], -1)
    shape = sheet(points[::-1])
    assert shape.uvs is not None
    return replace(shape, uvs=shape.uvs * [CURTAIN * 2.0 * 12.0, (top - hem) * 12.0])


def _painting(parts: Assembly, name: str, texels: Texels, *, height: float, world: Float64) -> None:
    """A canvas in a gilded frame, about the origin and facing +z, placed by `world` (4, 4)."""
    h, w = height / 2, height * texels.shape[1] / texels.shape[0] / 2
    canvas = sheet(np.array([[[-w, -h, 0.03], [w, -h, 0.03]], [[-w, h, 0.03], [w, h, 0.03]]]))
    number = parts.textured(name, texels)
    parts.place(name, parts.mesh(name, canvas, number), world)
    gilt = _number(parts, "gilt")
    pieces = []
    for inner, outer, depth in ((0.0, 0.025, 0.045), (0.025, 0.085, 0.065), (0.085, 0.11, 0.05)):
        a, b, c, d = w + inner, w + outer, h + inner, h + outer
        pieces += [_block((-b, low, 0.0), (b, high, depth)) for low, high in ((-d, -c), (c, d))]
        pieces += [_block((low, -c, 0.0), (high, c, depth)) for low, high in ((-b, -a), (a, b))]
    parts.place(f"{name} frame", parts.mesh(f"{name} frame", join(pieces), gilt), world)


def _paintings(parts: Assembly) -> None:
    """Hills and a sea on the back wall, discs and fields of colour on the right one."""
    parts.material("gilt", (0.86, 0.62, 0.28), metallic=1.0, roughness=0.38)
    dawn = fields(320, 400, (0.30, 0.03, 0.02), ((0.07, 0.50, (0.80, 0.30, 0.03)), (0.55, 0.93, (0.10, 0.02, 0.04))))
    sea = fields(320, 400, (0.04, 0.09, 0.16), ((0.08, 0.36, (0.75, 0.66, 0.48)), (0.42, 0.92, (0.02, 0.16, 0.24))))
    back = BACK + 0.001
    _painting(parts, "hills", hills(720, 448), height=1.5, world=placed(-1.68, 2.15, back))
    _painting(parts, "sea", sea, height=1.0, world=placed(2.4, 2.15, back))
    right = RIGHT - 0.001
    _painting(parts, "discs", discs(512), height=1.3, world=placed(right, 2.1, -3.2, turn_degrees=-90.0))
    _painting(parts, "dawn", dawn, height=1.3, world=placed(right, 2.1, 0.6, turn_degrees=-90.0))


def _sculpture(parts: Assembly) -> None:
    """A polished golden knot on a plinth, between two beams of the sun: caustics in its light would be noise."""
    stone = parts.material("stone", (0.66, 0.62, 0.55))
    gold = parts.material("gold", GOLD, metallic=1.0, roughness=0.14)
    x, z = 0.85, -0.6
    parts.put(
        "plinth",
        join([box(0.50, 0.76, 0.50), moved(box(0.56, 0.06, 0.56), placed(0.0, 0.76, 0.0))]),
        stone,
        (x, 0.0, z),
    )
    knot = moved(torus_knot(2, 3, radius=0.27, thickness=0.078, steps=480, sides=32), QUARTER_TURN)
    parts.place("knot", parts.mesh("knot", knot, gold), placed(x, 1.32, z, turn_degrees=-20.0))
    parts.put(
        "stem",
        lathe([(0.0, 0.82), (0.13, 0.82), (0.13, 0.84), (0.03, 0.86), (0.025, 1.0), (0.0, 1.0)], 32),
        gold,
        (x, 0.0, z),
    )


def _table(parts: Assembly) -> None:
    """A round table under a linen cloth, with a vase and a ball of clear glass."""
    linen = parts.textured("linen", weave(128, (0.92, 0.88, 0.79), (0.84, 0.79, 0.70), 32))
    glass = parts.material("glass", (1.0, 1.0, 1.0), transmission=1.0, roughness=0.0)
    x, z = 2.1, 0.1
    parts.put("tablecloth", _tablecloth(0.52, 0.76), linen, (x, 0.0, z))
    vase = lathe(_rounded([(0.0, 0.0), *VASE_OUTSIDE, *VASE_INSIDE, (0.0, 0.05)]), 96)
    parts.place("vase", parts.mesh("vase", vase, glass), placed(x - 0.16, 0.762, z - 0.12, scale=1.25))
    parts.put("glass ball", sphere(0.16, segments=96), glass, (x + 0.15, 0.923, z + 0.18))


def _rounded(profile: list[tuple[float, float]], per: int = 4) -> list[tuple[float, float]]:
    """A profile with its corners rounded: a cubic through its points (Catmull-Rom)."""
    points = np.array([profile[0], *profile, profile[-1]])
    t = (np.arange(per) / per)[:, None]
    found = []
    for a, b, c, d in zip(points, points[1:], points[2:], points[3:], strict=False):
        found.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    curve = np.concatenate([*found, points[-1:]])
    curve[:, 0] = np.maximum(curve[:, 0], 0.0)
    return [(float(r), float(y)) for r, y in curve]


def _tablecloth(radius: float, height: float) -> RawMesh:
    """A round cloth over a round table: flat on it, folds that grow towards the hem."""
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    angle[-1] = 0.0
    hang = np.linspace(1.0, 0.0, 28)[:, None] ** 1.2
    wave = np.cos(11.0 * angle + 0.9 * np.sin(3.0 * angle) + 0.5 * np.sin(2.0 * angle + 1.0))
    reach = radius + hang * (0.035 + 0.060 * wave) + 0.012 * np.minimum(1.0, 8.0 * hang)
    fall = 0.02 + (height - 0.02) * (1.0 - hang) + np.zeros_like(angle)
    top = np.linspace(1.0, 0.0, 12)[1:, None]
    radii = np.concatenate([reach, radius * top * np.ones_like(angle)])
    heights = np.concatenate([fall, np.full((len(top), len(angle)), height)])
    points = np.stack([radii * np.sin(angle), heights, radii * np.cos(angle)], -1)
    shape = sheet(points)
    assert shape.uvs is not None
    return replace(shape, uvs=shape.uvs * [2.0 * np.pi * radius * 14.0, (radius + height) * 14.0])


def _bench(parts: Assembly) -> None:
    """Leather cushions on a frame of dark wood, before the large painting."""
    leather = _coated(parts, "leather", (0.30, 0.115, 0.045), roughness=0.42)
    walnut = parts.material("walnut", (0.10, 0.06, 0.04))
    x, z, cushion, depth = -0.85, 0.75, 0.60, 0.56
    pads = [moved(_cushion(cushion, 0.12, depth), placed((k - 1) * cushion, 0.40, 0.0)) for k in range(3)]
    parts.put("cushions", join(pads), leather, (x, 0.0, z))
    w, d = 1.5 * cushion - 0.10, depth / 2 - 0.05
    legs = [moved(box(0.035, 0.31, 0.035), placed(a * w, 0.0, b * d)) for a in (-1, 1) for b in (-1, 1)]
    rails = [moved(box(2 * w - 0.035, 0.03, 0.035), placed(0.0, 0.28, b * d)) for b in (-1, 1)]
    ends = [moved(box(0.035, 0.03, 2 * d - 0.035), placed(a * w, 0.28, 0.0)) for a in (-1, 1)]
    deck = moved(box(3 * cushion, 0.03, depth), placed(0.0, 0.311, 0.0))
    parts.put("bench frame", join([*legs, *rails, *ends, deck]), walnut, (x, 0.0, z))


def _cushion(width: float, height: float, depth: float) -> RawMesh:
    """A box with soft edges: a sphere whose coordinates are drawn towards its faces."""
    ball = sphere(1.0, segments=64)
    soft = np.sign(ball.vertices) * np.abs(ball.vertices) ** [0.26, 0.45, 0.26]
    return replace(ball, vertices=soft * [width / 2, height / 2, depth / 2])


def _lamps(parts: Assembly) -> None:
    """Three glowing globes of opal glass that hang over the table."""
    opal = parts.material("opal", (0.8, 0.76, 0.68), emission=LAMP, emits_behind=False)
    brass = _number(parts, "brass")
    for k, (x, y, z, radius) in enumerate(
        ((1.9, 2.35, -0.15, 0.15), (2.3, 2.75, 0.15, 0.12), (2.5, 2.15, -0.35, 0.10))
    ):
        parts.put(f"globe {k}", sphere(radius, segments=32), opal, (x, y, z))
        cord = lathe(
            [
                (0.0, 0.97 * radius),
                (0.035, 0.97 * radius),
                (0.035, radius + 0.05),
                (0.004, radius + 0.06),
                (0.004, CEILING - y),
                (0.0, CEILING - y),
            ],
            16,
        )
        parts.put(f"cord {k}", cord, brass, (x, y, z))


def _spots() -> tuple[SpotLight, ...]:
    """Warm light from the ceiling on the large painting and the pictures on the right."""
    aims: tuple[tuple[Vector, Vector, Vector, float], ...] = (
        ((-1.68, 4.3, -3.4), (-1.68, 2.1, -5.6), (13.0, 9.4, 5.6), 26.0),
        ((1.9, 4.3, -2.4), (3.6, 2.0, -2.6), (9.0, 6.4, 3.7), 30.0),
    )
    return tuple(_spot(place, target, intensity, angle) for place, target, intensity, angle in aims)


def _spot(place: Vector, target: Vector, intensity: Vector, angle: float) -> SpotLight:
    way = np.subtract(target, place)
    x, y, z = (way / np.linalg.norm(way)).tolist()
    return SpotLight(
        position=place, direction=(x, y, z), intensity=intensity, inner_angle=0.5 * angle, outer_angle=angle
    )
