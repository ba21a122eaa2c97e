"""The measuring scene: textured objects on a checkered floor under one point light. Y is up, a unit is a metre.

What makes images hard to keep up with is all there, and nothing else: fine texture, hard shadows across it, smooth
and sharp silhouettes, thin rods, and, in `gallery_mirrors`, four mirrors.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_codes
from wall.scene.animation import Vector
from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.shapes import box, join, lathe, moved, placed, sphere, torus, torus_knot
from wall.scene.model import PointLight, Sky, Source
from wall.scene.repair import RawMesh

HALF_FLOOR = 6.0
POINT_LIGHT = PointLight(position=(2.5, 5.0, 1.5), intensity=(62.0, 58.0, 50.0))
DUSK = Sky(zenith=(0.10, 0.17, 0.36), horizon=(0.32, 0.38, 0.46), ground=(0.09, 0.08, 0.07))
SILVER: Vector = (0.9, 0.9, 0.9)
VASE = [(0.26, 0.0), (0.22, 0.06), (0.33, 0.25), (0.3, 0.42), (0.13, 0.72), (0.2, 0.9), (0.16, 0.92), (0.0, 0.9)]
COLUMN = [(0.36, 0.0), (0.36, 0.1), (0.24, 0.2), (0.2, 2.15), (0.32, 2.25), (0.32, 2.38), (0.2, 2.4), (0.0, 2.4)]


def gallery() -> Source:
    """Six textured or coloured objects, four columns and a railing."""
    return _gallery(mirrors=False)


def gallery_mirrors() -> Source:
    """The same with four of its objects turned into mirrors."""
    return _gallery(mirrors=True)


def _gallery(*, mirrors: bool) -> Source:
    parts = Assembly()
    _floor(parts)
    _fixtures(parts)
    stripes = parts.textured("stripes", _stripes(256))
    dots = parts.textured("dots", _dots(256))
    bricks = parts.textured("bricks", _bricks(256))
    red, blue = parts.material("red", (0.62, 0.12, 0.08)), parts.material("blue", (0.08, 0.16, 0.5))
    silver = parts.material("silver", SILVER, mirror=0.85) if mirrors else red
    ball, vase = sphere(0.7, segments=64), lathe(VASE, 64)
    knot = torus_knot(2, 3, radius=0.5, thickness=0.16)
    parts.put("globe", sphere(0.5, segments=64), dots, (-1.35, 0.5, 0.65))
    parts.put("ball", ball, silver if mirrors else stripes, (2.0, 0.7, 1.95))
    parts.put("knot", knot, silver if mirrors else blue, (0.0, 1.15, 0.0))
    parts.put("vase", vase, silver if mirrors else bricks, (-0.6, 0.0, 2.4))
    parts.put("crate", box(0.9, 0.9, 0.9), bricks, (2.4, 0.0, -1.2))
    parts.put("ring", torus(0.6, 0.17), silver if mirrors else red, (-2.55, 0.85, -1.45))
    return parts.source((POINT_LIGHT,), DUSK)


def _floor(parts: Assembly) -> None:
    material = parts.textured("tiles", _tiles(1024))
    a = HALF_FLOOR
    corners = np.array([[-a, 0.0, a], [a, 0.0, a], [a, 0.0, -a], [-a, 0.0, -a]])
    uvs = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    quad = RawMesh(vertices=corners, triangles=np.array([[0, 1, 2], [0, 2, 3]], np.uint32), uvs=uvs)
    parts.put("floor", quad, material)


def _fixtures(parts: Assembly) -> None:
    """Four columns and, behind them, a railing of thin rods."""
    stone = parts.material("stone", (0.66, 0.62, 0.55))
    mesh = parts.mesh("column", lathe(COLUMN, 32), stone)
    for k, (x, z) in enumerate([(-3.4, -3.2), (-1.2, -3.6), (1.2, -3.6), (3.4, -3.2)]):
        parts.place(f"column {k}", mesh, placed(x, 0.0, z))
    iron = parts.material("iron", (0.06, 0.06, 0.07))
    rods = [moved(box(0.03, 1.0, 0.03), placed(x, 0.0, 0.0)) for x in np.linspace(-4.5, 4.5, 31)]
    rails = [moved(box(9.06, 0.05, 0.06), placed(0.0, y, 0.0)) for y in (0.12, 1.0)]
    parts.put("railing", join([*rods, *rails]), iron, (0.0, 0.0, -4.8))


def _grid(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    y, x = np.mgrid[0:size, 0:size] / size
    return x, y


def _tiles(size: int) -> NDArray[np.uint8]:
    """24 by 24 tiles in two tones that vary from tile to tile, with grey joints."""
    x, y = _grid(size)
    i, j = np.floor(24 * x).astype(int), np.floor(24 * y).astype(int)
    tone = np.random.default_rng(3).uniform(0.75, 1.15, (24, 24))[j, i][..., None]
    colour = np.where(((i + j) % 2 == 0)[..., None], [0.55, 0.50, 0.42], [0.16, 0.22, 0.24]) * tone
    joint = (np.minimum(24 * x % 1, 24 * y % 1) < 0.05)[..., None]
    return srgb_codes(np.where(joint, [0.3, 0.29, 0.27], colour))


def _stripes(size: int) -> NDArray[np.uint8]:
    x, y = _grid(size)
    wave = (0.5 + 0.5 * np.sin(2 * math.pi * (12 * x + 4 * y)))[..., None]
    return srgb_codes(np.array([0.75, 0.42, 0.05]) * wave + np.array([0.08, 0.28, 0.3]) * (1 - wave))


def _dots(size: int) -> NDArray[np.uint8]:
    x, y = _grid(size)
    dot = (np.hypot(16 * x % 1 - 0.5, 8 * y % 1 - 0.5) < 0.3)[..., None]
    return srgb_codes(np.where(dot, [0.8, 0.78, 0.7], [0.12, 0.3, 0.14]))


def _bricks(size: int) -> NDArray[np.uint8]:
    x, y = _grid(size)
    row = np.floor(8 * y)
    along = 6 * x + 0.5 * (row % 2)
    joint = (np.minimum(along % 1, 8 * y % 1) < 0.1)[..., None]
    tone = np.random.default_rng(5).uniform(0.7, 1.2, (8, 8))[row.astype(int), np.floor(along).astype(int)][..., None]
    return srgb_codes(np.where(joint, [0.5, 0.48, 0.44], np.array([0.5, 0.2, 0.12]) * tone))
