"""Meets one ray with the triangles or spheres of a mesh, one by one: no tree is needed for a click."""

from __future__ import annotations

import math

from wall.core.jit import kernel

SLACK = 1e-9  # of weights: a ray on an edge meets both of its triangles


@kernel
def first_triangle(vertices, triangles, origin, direction, after, found):
    """The nearest triangle that a ray meets beyond `after` lengths of its direction. Returns its number; -1: none.

    vertices : (v, 3) float32; triangles : (t, 3) uint32; origin, direction : (3,) float64, in the mesh's space
    found : (3,) float64, set to the distance in lengths of the direction, and the weights of corners 1 and 2

    T. Möller and B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
    """
    ox, oy, oz = origin[0], origin[1], origin[2]
    dx, dy, dz = direction[0], direction[1], direction[2]
    nearest, number = math.inf, -1
    for k in range(triangles.shape[0]):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        ax, ay, az = float(vertices[a, 0]), float(vertices[a, 1]), float(vertices[a, 2])
        bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        cx, cy, cz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        px, py, pz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
        volume = bx * px + by * py + bz * pz
        if volume == 0.0:
            continue
        sx, sy, sz = ox - ax, oy - ay, oz - az
        u = (sx * px + sy * py + sz * pz) / volume
        if not -SLACK <= u <= 1.0 + SLACK:
            continue
        qx, qy, qz = sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx
        v = (dx * qx + dy * qy + dz * qz) / volume
        away = (cx * qx + cy * qy + cz * qz) / volume
        if v >= -SLACK and u + v <= 1.0 + SLACK and after < away < nearest:
            nearest, number = away, k
            found[0], found[1], found[2] = away, u, v
    return number


@kernel
def first_sphere(spheres, origin, direction, after):
    """How many lengths of its direction a ray goes to a sphere, its front or back, beyond `after`; infinity: none.

    spheres : (n, 4) float32, centres and radii; origin, direction : (3,) float64, in the spheres' space
    """
    dx, dy, dz = direction[0], direction[1], direction[2]
    square = dx * dx + dy * dy + dz * dz
    nearest = math.inf
    for k in range(spheres.shape[0]):
        x, y, z = spheres[k, 0] - origin[0], spheres[k, 1] - origin[1], spheres[k, 2] - origin[2]
        radius = float(spheres[k, 3])
        way = (x * dx + y * dy + z * dz) / square
        ax, ay, az = x - way * dx, y - way * dy, z - way * dz
        room = radius * radius - (ax * ax + ay * ay + az * az)
        if room < 0.0:
            continue
        half = math.sqrt(room / square)
        away = way - half if way - half > after else way + half
        if after < away < nearest:
            nearest = away
    return nearest
