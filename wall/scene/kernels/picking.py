"""Meets one ray with the triangles, spheres or curves of a mesh, one by one: no tree is needed for a click."""

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


@kernel
def first_segment(spheres, segments, origin, direction, after):
    """As `first_sphere`, for curves: segments (s,) uint32 between two of the spheres, with a cone that touches both.

    A point at a + h b of the axis, b from centre to centre, lies on the cone with the radius that shrinks along it:
    with d the radii's difference, (p - a) . b - h |b|^2 = d r at the normal's foot, a quadratic equation for the ray.
    """
    dx, dy, dz = direction[0], direction[1], direction[2]
    nearest = first_sphere(spheres, origin, direction, after)
    for s in range(segments.shape[0]):
        i = segments[s]
        x, y, z = float(spheres[i, 0]), float(spheres[i, 1]), float(spheres[i, 2])
        bx, by, bz = spheres[i + 1, 0] - x, spheres[i + 1, 1] - y, spheres[i + 1, 2] - z
        ox, oy, oz = origin[0] - x, origin[1] - y, origin[2] - z
        ra, fall = float(spheres[i, 3]), float(spheres[i, 3]) - float(spheres[i + 1, 3])
        bb = bx * bx + by * by + bz * bz
        slant = bb - fall * fall  # square of the cone's length
        if slant <= 0.0:
            continue  # one sphere is in the other
        bd, bo = bx * dx + by * dy + bz * dz, bx * ox + by * oy + bz * oz
        dd, do = dx * dx + dy * dy + dz * dz, dx * ox + dy * oy + dz * oz
        oo = ox * ox + oy * oy + oz * oz
        # y = p . b along the ray; the surface is where slant |p|^2 = y^2 - 2 fall ra y + ra^2 bb
        a = slant * dd - bd * bd
        b = slant * do - bo * bd + fall * ra * bd
        c = slant * oo - bo * bo + 2.0 * fall * ra * bo - ra * ra * bb
        root = b * b - a * c
        if root < 0.0 or a == 0.0:
            continue
        for sign in (-1.0, 1.0):
            away = (-b + sign * math.sqrt(root)) / a
            along = bo + away * bd - ra * fall
            if 0.0 <= along <= slant and after < away < nearest:
                nearest = away
    return nearest
