"""The Cornell box: a white room with a red and a green wall, two boxes and one lamp, for paths. A unit is 0.1 m.

Sizes as measured at Cornell (C. Goral et al., SIGGRAPH 1984; www.graphics.cornell.edu/online/box/data.html), colours in
linear RGB. The lamp hangs half a millimetre below the ceiling and shines down.
"""

from __future__ import annotations

import numpy as np

from wall.scene.builtin.assembly import Assembly
from wall.scene.model import Sky, Source
from wall.scene.repair import RawMesh

WHITE, RED, GREEN = (0.886, 0.699, 0.666), (0.570, 0.043, 0.044), (0.105, 0.378, 0.076)
LAMP = (18.39, 13.99, 6.75)  # W sr^-1 m^-2
HEIGHT, DEPTH = 5.488, 5.592
SMALL = ((1.30, 0.65), (0.82, 2.25), (2.40, 2.72), (2.90, 1.14))  # x, z of the boxes' corners, and their heights
LARGE = ((4.23, 2.47), (2.65, 2.96), (3.14, 4.56), (4.72, 4.06))
SMALL_HEIGHT, LARGE_HEIGHT = 1.65, 3.30
GAP = 0.005  # below the boxes: glass whose base is the floor itself would show either of them by chance
BLACK = (0.0, 0.0, 0.0)
PATH_DEPTH = 6
Corner = tuple[float, float, float]


def cornell() -> Source:
    """The room with its open side towards -z, seen best from (2.78, 2.73, -8) at 39.3 degrees."""
    parts = Assembly()
    white, red, green = parts.material("white", WHITE), parts.material("red", RED), parts.material("green", GREEN)
    lamp = parts.material("lamp", BLACK, emission=LAMP, emits_behind=False)
    parts.put("floor", _quads(((5.528, 0, 0), (0, 0, 0), (0, 0, DEPTH), (5.496, 0, DEPTH))), white)
    parts.put("ceiling", _quads(((5.56, HEIGHT, 0), (5.56, HEIGHT, DEPTH), (0, HEIGHT, DEPTH), (0, HEIGHT, 0))), white)
    parts.put("back wall", _quads(((5.496, 0, DEPTH), (0, 0, DEPTH), (0, HEIGHT, DEPTH), (5.56, HEIGHT, DEPTH))), white)
    parts.put("red wall", _quads(((5.528, 0, 0), (5.496, 0, DEPTH), (5.56, HEIGHT, DEPTH), (5.56, HEIGHT, 0))), red)
    parts.put("green wall", _quads(((0, 0, DEPTH), (0, 0, 0), (0, HEIGHT, 0), (0, HEIGHT, DEPTH))), green)
    parts.put("small box", _box(SMALL, SMALL_HEIGHT), white)
    parts.put("large box", _box(LARGE, LARGE_HEIGHT), white)
    y = HEIGHT - 0.005
    parts.put("lamp", _quads(((3.43, y, 2.27), (3.43, y, 3.32), (2.13, y, 3.32), (2.13, y, 2.27))), lamp)
    return parts.source((), Sky(zenith=BLACK, horizon=BLACK, ground=BLACK), path_depth=PATH_DEPTH)


def _box(corners: tuple[tuple[float, float], ...], height: float) -> RawMesh:
    """Four walls and both ends, outsides counterclockwise."""
    low, high = [(x, GAP, z) for x, z in corners], [(x, height, z) for x, z in corners]
    sides = [(low[k], high[k], high[k - 1], low[k - 1]) for k in range(4)]
    return _quads((high[0], high[1], high[2], high[3]), (low[3], low[2], low[1], low[0]), *sides)


def _quads(*quads: tuple[Corner, Corner, Corner, Corner]) -> RawMesh:
    """Quads with vertices of their own, two triangles each."""
    vertices = np.array(quads, np.float64).reshape(-1, 3)
    first = 4 * np.arange(len(quads))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.uint32)
    return RawMesh(vertices=vertices, triangles=triangles)
