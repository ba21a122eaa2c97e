"""A measuring scene: thin columns over a finely tiled floor, in low sun. Y is up, a unit is a metre.

What an eye that walks finds hardest to keep: near columns pass before far ones, silhouettes are a few pixels wide,
their shadows too, and from some metres on the floor's tiles are finer than a pixel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_codes
from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.shapes import box, lathe, placed
from wall.scene.lights import directional_light
from wall.scene.model import Sky, Source
from wall.scene.repair import RawMesh

WIDTH, LENGTH = 8.0, 20.0  # of the floor
TILES_A_METRE = 8
TEXTURE_M = 2.0  # the floor's texture repeats after so much
ROWS_X = (-2.6, -1.75, -0.9, 0.9, 1.75, 2.6)
ROW_Z = np.linspace(-9.0, 9.0, 19)
SHAFT = [(0.09, 0.0), (0.09, 0.08), (0.05, 0.12), (0.04, 2.66), (0.09, 2.72), (0.09, 2.8), (0.0, 2.8)]
COLOURS = ((0.50, 0.44, 0.34), (0.08, 0.13, 0.18), (0.42, 0.14, 0.08), (0.10, 0.22, 0.16), (0.60, 0.56, 0.50))
MORNING = Sky(zenith=(0.16, 0.27, 0.52), horizon=(0.52, 0.56, 0.60), ground=(0.12, 0.10, 0.08))


def arcade() -> Source:
    """Six rows of nineteen columns, a beam along each row, a tiled floor."""
    parts = Assembly()
    _floor(parts)
    stone, timber = parts.material("stone", (0.70, 0.64, 0.54)), parts.material("timber", (0.24, 0.13, 0.07))
    column = parts.mesh("column", lathe(SHAFT, 24), stone)
    beam = parts.mesh("beam", box(0.14, 0.2, LENGTH - 1.0), timber)
    for x in ROWS_X:
        parts.place(f"beam {x:g}", beam, placed(x, 2.8, 0.0))
        for z in ROW_Z:
            parts.place(f"column {x:g} {z:g}", column, placed(x, 0.0, float(z)))
    return parts.source((directional_light((0.75, 0.55, 0.35), (1.6, 1.4, 1.1)),), MORNING)


def _floor(parts: Assembly) -> None:
    material = parts.textured("tiles", _tiles(512))
    a, b = WIDTH / 2, LENGTH / 2
    corners = np.array([[-a, 0.0, b], [a, 0.0, b], [a, 0.0, -b], [-a, 0.0, -b]])
    uvs = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, LENGTH], [0.0, LENGTH]]) / TEXTURE_M
    quad = RawMesh(vertices=corners, triangles=np.array([[0, 1, 2], [0, 2, 3]], np.uint32), uvs=uvs)
    parts.put("floor", quad, material)


def _tiles(size: int) -> NDArray[np.uint8]:
    """Tiles of five colours and many tones, with light joints; (size, size, 3) sRGB."""
    count = round(TILES_A_METRE * TEXTURE_M)
    chance = np.random.default_rng(11)
    tiles = np.array(COLOURS)[chance.integers(0, len(COLOURS), (count, count))] * chance.uniform(
        0.8, 1.15, (count, count, 1)
    )
    at = np.arange(size) * count / size
    joint = np.minimum.outer(at % 1, at % 1) < 0.07
    shown = tiles[np.ix_(at.astype(int), at.astype(int))]
    return srgb_codes(np.where(joint[..., None], 0.62, shown))
