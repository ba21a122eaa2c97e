"""Two spheres on a floor, of rough metal and of paint, for paths: what an environment does to materials."""

from __future__ import annotations

from wall.scene.builtin.assembly import Assembly
from wall.scene.builtin.shapes import box, sphere
from wall.scene.model import Sky, Source

PATH_DEPTH = 6


def spheres() -> Source:
    """Spheres of radius 1 on y = 0, seen best from (0, 2.2, 7.5) towards (0, 0.9, 0)."""
    parts = Assembly()
    floor = parts.material("floor", (0.4, 0.4, 0.4))
    metal = parts.material("metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.15)
    paint = parts.material("paint", (0.7, 0.25, 0.1))
    ball = sphere(segments=96)
    parts.put("floor", box(12.0, 0.1, 12.0), floor, (0.0, -0.1, 0.0))
    parts.put("metal ball", ball, metal, (-1.15, 1.0, 0.0))
    parts.put("painted ball", ball, paint, (1.15, 1.0, 0.3))
    return parts.source((), Sky(), path_depth=PATH_DEPTH)
