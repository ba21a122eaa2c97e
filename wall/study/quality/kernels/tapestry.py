"""Tapestry's image stages: project vertices, remove hidden ones, draw the triangle mesh, weigh triangles, choose rays.

After Simmons and Séquin, "Tapestry: A dynamic mesh-based display representation for interactive rendering" (2000).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.deepbuffer.kernels.reproject import OUTSIDE, pixel_of, position_of
from wall.study.quality.kernels.render_cache import oldest, root

ZERO, ONE, THIRD = np.float32(0.0), np.float32(1.0), np.float32(1.0 / 3.0)
MARGIN = np.float32(6.0)  # pixels around the image whose vertices are kept in the mesh
CELLS = 2  # a pixel's columns and rows of cells; a cell keeps one vertex, the newest
SUBPIXELS = 2  # a pixel's columns and rows of points that are drawn
HIDDEN = np.float32(0.96)  # of the surface's inverse depth: a vertex with less is behind it
BRIDGE = np.float32(0.9)  # ratio of the inverse depths of a triangle's vertices, below which they are of two surfaces
SMALL = np.float32(2.0)  # pixels: a longer bridge shows what is behind the nearer surface
OLD = np.float32(8.0)  # turns: a vertex that was not confirmed for so many times the rays of an image is taken out
LEAST_CHANGE, FULL_CHANGE = np.float32(0.03), np.float32(0.25)  # of sqrt radiance: noise; a different surface
INSIDE = np.float32(-1e-4)  # barycentric coordinate: points on an edge belong to both triangles
FRAME = 8  # the first vertices stand around the image and have no colour: the mesh covers all of it
CORNERS = 3  # of a triangle


class Vertices(NamedTuple):
    """Samples as points, and where they are seen."""

    position: np.ndarray  # (capacity, 4) float32: point, and its row of the tables, -1: free
    radiance: np.ndarray  # (capacity, 3) float32 linear RGB
    age: np.ndarray  # (capacity,) float32: turns; 1 is as many rays as there are pixels
    screen: np.ndarray  # (capacity, 3) float32: pixels x, y, and inverse depth; OUTSIDE: not there
    meshed: np.ndarray  # (capacity,) uint8: 1 if it is a vertex of the mesh, 0 if it came later


class Mesh(NamedTuple):
    """Triangles between vertices."""

    corners: np.ndarray  # (t, 3) int32: numbers of vertices
    bridging: np.ndarray  # (t,) uint8: 1 if the corners lie on different surfaces
    weight: np.ndarray  # (t,) float64: how much a ray in it is wanted


@kernel
def project(vertices, table, width, height):
    """Find the vertices in the image and its margin. table : (rows, 12) float32 panel_from_object. Returns how many."""
    position, screen = vertices.position, vertices.screen
    count = 0
    for k in range(FRAME):
        side = k if k < 4 else k + 1  # of 3 x 3 places, without the middle
        screen[k, 0] = (np.float32(width) + np.float32(2.0) * MARGIN) * np.float32(0.5 * (side % 3)) - MARGIN
        screen[k, 1] = (np.float32(height) + np.float32(2.0) * MARGIN) * np.float32(0.5 * (side // 3)) - MARGIN
        screen[k, 2] = ZERO
    for k in range(FRAME, position.shape[0]):
        screen[k, 2] = OUTSIDE
        row = int(position[k, 3])
        if row < 0:
            continue
        x, y, z = pixel_of(position[k, 0], position[k, 1], position[k, 2], row, table)
        inside = x > -MARGIN and y > -MARGIN and x < np.float32(width) + MARGIN and y < np.float32(height) + MARGIN
        if z > ZERO and inside:
            screen[k, 0], screen[k, 1], screen[k, 2] = x, y, ONE / z
            count += 1
    return count


@inline_kernel
def area_of(screen, a, b, c):
    """Twice the signed area of a triangle, pixels^2."""
    return (screen[b, 0] - screen[a, 0]) * (screen[c, 1] - screen[a, 1]) - (screen[b, 1] - screen[a, 1]) * (
        screen[c, 0] - screen[a, 0]
    )


@inline_kernel
def first_and_end(low, high, scale, count):
    """Points from `low` to `high` pixels, at (k + 1/2) / scale: the first and one past the last of `count`."""
    first = max(math.ceil(low * scale - 0.5 - 1e-3), 0)
    return first, min(math.floor(high * scale - 0.5 + 1e-3) + 1, count)


@kernel
def cover(vertices, mesh, depth):
    """Draw the last mesh as it is seen now, but for what bridges surfaces or has turned its back.

    depth : (h, w) float32, written: the greatest inverse depth at pixel centres, 0 where there is none
    """
    screen, meshed = vertices.screen, vertices.meshed
    height, width = depth.shape
    depth[:] = ZERO
    for t in range(mesh.corners.shape[0]):
        a, b, c = mesh.corners[t, 0], mesh.corners[t, 1], mesh.corners[t, 2]
        known = meshed[a] & meshed[b] & meshed[c]
        if mesh.bridging[t] != 0 or known == 0 or min(screen[a, 2], screen[b, 2], screen[c, 2]) < ZERO:
            continue
        area = area_of(screen, a, b, c)
        if not area > ZERO:
            continue
        scale = ONE / area
        x0, y0 = screen[a, 0], screen[a, 1]
        ux, uy, vx, vy = screen[b, 0] - x0, screen[b, 1] - y0, screen[c, 0] - x0, screen[c, 1] - y0
        left, right = first_and_end(x0 + min(ux, vx, ZERO), x0 + max(ux, vx, ZERO), 1, width)
        top, bottom = first_and_end(y0 + min(uy, vy, ZERO), y0 + max(uy, vy, ZERO), 1, height)
        for i in range(top, bottom):
            for j in range(left, right):
                x, y = np.float32(j + 0.5) - x0, np.float32(i + 0.5) - y0
                p, q = (x * vy - y * vx) * scale, (ux * y - uy * x) * scale
                if p >= INSIDE and q >= INSIDE and ONE - p - q >= INSIDE:
                    z = screen[a, 2] * (ONE - p - q) + screen[b, 2] * p + screen[c, 2] * q
                    depth[i, j] = max(depth[i, j], z)


@kernel
def thin_out(vertices, depth, cells):
    """Take out what is hidden, what is too old, and all but the newest vertex of each cell.

    depth : (h, w) float32 of cover
    cells : (CELLS (h + 2 MARGIN), CELLS (w + 2 MARGIN)) int32, written: the vertex of each, -1: none

    Returns how many vertices are left in the mesh.
    """
    position, age, screen = vertices.position, vertices.age, vertices.screen
    height, width = depth.shape
    cells[:] = -1
    left = FRAME
    for k in range(FRAME, position.shape[0]):
        if position[k, 3] < ZERO:
            continue
        if age[k] > OLD:
            position[k, 3] = -ONE
            continue
        if screen[k, 2] < ZERO:
            continue
        x, y, z = screen[k, 0], screen[k, 1], screen[k, 2]
        if x >= ZERO and y >= ZERO and x < np.float32(width) and y < np.float32(height):
            i, j = int(y), int(x)
            front = depth[i, j]
            for m in range(max(i - 1, 0), min(i + 2, height)):
                for n in range(max(j - 1, 0), min(j + 2, width)):
                    front = min(front, depth[m, n])
            if z < front * HIDDEN:
                position[k, 3], screen[k, 2] = -ONE, OUTSIDE
                continue
        i, j = int((y + MARGIN) * np.float32(CELLS)), int((x + MARGIN) * np.float32(CELLS))
        i, j = min(max(i, 0), cells.shape[0] - 1), min(max(j, 0), cells.shape[1] - 1)
        other = cells[i, j]
        if other >= 0:
            lost = k if age[k] > age[other] else other
            position[lost, 3], screen[lost, 2] = -ONE, OUTSIDE
            if lost == k:
                continue
            left -= 1
        cells[i, j] = k
        left += 1
    return left


@kernel
def list_points(vertices, numbers, points):
    """The vertices of the mesh. numbers : (n,) int32; points : (n, 2) float64, pixels; both written"""
    screen, meshed = vertices.screen, vertices.meshed
    n = 0
    for k in range(screen.shape[0]):
        meshed[k] = 0
        if screen[k, 2] >= ZERO and n < numbers.shape[0]:
            meshed[k], numbers[n] = 1, k
            shift = np.float64(hash_uint32(np.uint32(k), np.uint32(1))) * 2.0**-32  # no four points on one circle
            points[n, 0], points[n, 1] = screen[k, 0] + 2e-3 * shift, screen[k, 1] + 1e-3 * shift
            n += 1
    return n


@kernel
def link(simplices, numbers, vertices, mesh):
    """Triangles of a triangulation, all turned the same way, and whether they bridge two surfaces.

    simplices : (t, 3) int32 rows of numbers : (n,) int32; mesh : Mesh, corners and bridging are written
    """
    screen, position, corners = vertices.screen, vertices.position, mesh.corners
    for t in range(simplices.shape[0]):
        a, b, c = numbers[simplices[t, 0]], numbers[simplices[t, 1]], numbers[simplices[t, 2]]
        if area_of(screen, a, b, c) < ZERO:
            b, c = c, b
        corners[t, 0], corners[t, 1], corners[t, 2] = a, b, c
        near = max(screen[a, 2], screen[b, 2], screen[c, 2])
        far = min(screen[a, 2], screen[b, 2], screen[c, 2])
        same = position[a, 3] == position[b, 3] and position[a, 3] == position[c, 3]
        mesh.bridging[t] = 0 if same and far >= BRIDGE * near else 1


@kernel
def weigh(vertices, mesh, width, height, values, power):
    """How much rays are wanted in each triangle, into mesh.weight; returns their sum.

    values : (4,) float32, what is added for each turn of age, for bridging, for anything, and for contrast
    power : float32, of the area
    """
    screen, colour, age = vertices.screen, vertices.radiance, vertices.age
    total = 0.0
    for t in range(mesh.corners.shape[0]):
        mesh.weight[t] = 0.0
        a, b, c = mesh.corners[t, 0], mesh.corners[t, 1], mesh.corners[t, 2]
        x, y = (
            (screen[a, 0] + screen[b, 0] + screen[c, 0]) * THIRD,
            (screen[a, 1] + screen[b, 1] + screen[c, 1]) * THIRD,
        )
        inside = x >= ZERO and y >= ZERO and x < np.float32(width) and y < np.float32(height)
        if not inside and min(a, b, c) >= FRAME:
            continue
        contrast = ZERO
        for n in range(3):
            p, q, r = root(colour[a, n]), root(colour[b, n]), root(colour[c, n])
            contrast = max(contrast, max(p, q, r) - min(p, q, r))
        turns = (age[a] + age[b] + age[c]) * THIRD
        wanted = values[0] * turns + values[1] * mesh.bridging[t] + values[2] + values[3] * contrast
        mesh.weight[t] = wanted * max(area_of(screen, a, b, c) * 0.5, 0.0) ** power
        total += mesh.weight[t]
    return total


@kernel
def choose(vertices, mesh, step, seed, size, xy, triangle):
    """Positions in triangles, one for each `step` of weight: big or bad triangles get several.

    size : (2,) float32, width and height of the image, outside which there are none
    xy : (n, 2) float32, panel pixels, and triangle : (n,) int32, written in random order. Returns how many there are.
    """
    screen = vertices.screen
    ahead = step * np.float64(hash_uint32(np.uint32(seed), np.uint32(0))) * 2.0**-32
    count = drawn = 0
    for t in range(mesh.corners.shape[0]):
        ahead -= mesh.weight[t]
        while ahead < 0.0 and count < xy.shape[0]:
            ahead += step
            a, b, c = mesh.corners[t, 0], mesh.corners[t, 1], mesh.corners[t, 2]
            p = np.float32(hash_uint32(np.uint32(seed), np.uint32(2 * drawn + 1)) * 2.0**-32)
            q = np.float32(hash_uint32(np.uint32(seed), np.uint32(2 * drawn + 2)) * 2.0**-32)
            if p + q > ONE:
                p, q = ONE - p, ONE - q
            for n in range(2):
                xy[count, n] = screen[a, n] + p * (screen[b, n] - screen[a, n]) + q * (screen[c, n] - screen[a, n])
            triangle[count] = t
            x, y = xy[count, 0], xy[count, 1]
            drawn += 1
            count += 1 if x >= ZERO and y >= ZERO and x < size[0] and y < size[1] else 0
    for i in range(count - 1, 0, -1):
        j = int((np.uint64(hash_uint32(np.uint32(seed + 1), np.uint32(i))) * np.uint64(i + 1)) >> np.uint64(32))
        triangle[i], triangle[j] = triangle[j], triangle[i]
        for n in range(2):
            xy[i, n], xy[j, n] = xy[j, n], xy[i, n]
    return count


@kernel
def draw(vertices, mesh, points):
    """Draw the mesh: colours between vertices; a bridge shows the nearest one's, a long bridge the farthest surface's.

    points : (SUBPIXELS h, SUBPIXELS w, 4) float32, written: linear RGB and 1, or zeros where there is no triangle
    """
    screen, colour = vertices.screen, vertices.radiance
    height, width = points.shape[0], points.shape[1]
    points[:] = ZERO
    for t in range(mesh.corners.shape[0]):
        a, b, c = mesh.corners[t, 0], mesh.corners[t, 1], mesh.corners[t, 2]
        area = area_of(screen, a, b, c)
        if not area > ZERO or min(a, b, c) < FRAME:
            continue
        scale, bridging = ONE / area, mesh.bridging[t] != 0
        x0, y0 = screen[a, 0], screen[a, 1]
        ux, uy, vx, vy = screen[b, 0] - x0, screen[b, 1] - y0, screen[c, 0] - x0, screen[c, 1] - y0
        long = max(abs(ux), abs(uy), abs(vx), abs(vy), abs(ux - vx), abs(uy - vy)) > SMALL
        far = b if screen[b, 2] <= screen[c, 2] else c
        far = a if screen[a, 2] <= screen[far, 2] else far
        left, right = first_and_end(x0 + min(ux, vx, ZERO), x0 + max(ux, vx, ZERO), SUBPIXELS, width)
        top, bottom = first_and_end(y0 + min(uy, vy, ZERO), y0 + max(uy, vy, ZERO), SUBPIXELS, height)
        for i in range(top, bottom):
            for j in range(left, right):
                x, y = np.float32((j + 0.5) / SUBPIXELS) - x0, np.float32((i + 0.5) / SUBPIXELS) - y0
                p, q = (x * vy - y * vx) * scale, (ux * y - uy * x) * scale
                r = ONE - p - q
                if not (p >= INSIDE and q >= INSIDE and r >= INSIDE):
                    continue
                if bridging and long:
                    p, q = ONE if far == b else ZERO, ONE if far == c else ZERO
                    r = ONE - p - q
                elif bridging:
                    most = max(p, q, r)
                    p, q = ONE if p == most else ZERO, ONE if q == most and p != most else ZERO
                    r = ONE - p - q
                for n in range(3):
                    points[i, j, n] = r * colour[a, n] + p * colour[b, n] + q * colour[c, n]
                points[i, j, 3] = ONE


@kernel
def average(points, image):
    """Means of the points of each pixel. points as of draw; image : (h, w, 4) float32, written: linear RGB, coverage"""
    share = ONE / np.float32(SUBPIXELS * SUBPIXELS)
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            image[i, j, :] = ZERO
            for k in range(SUBPIXELS * i, SUBPIXELS * (i + 1)):
                for m in range(SUBPIXELS * j, SUBPIXELS * (j + 1)):
                    for n in range(4):
                        image[i, j, n] += points[k, m, n]
            scale = ONE / max(image[i, j, 3], ONE)
            for n in range(3):
                image[i, j, n] *= scale
            image[i, j, 3] *= share


@kernel
def store(samples, maps, vertices, cursor):
    """Keep new samples as vertices, over old ones where none is free. Returns where to look for an old one next.

    samples : (n,) SAMPLE; maps : PointMaps of their event; vertices : Vertices, updated; cursor : int
    """
    position, colour, age = vertices.position, vertices.radiance, vertices.age
    object_from_eye, corner = maps.object_from_eye, maps.corner
    last = object_from_eye.shape[0] - 1
    for s in range(samples.shape[0]):
        sample = samples[s]
        slot, cursor = oldest(position[FRAME:], age[FRAME:], cursor)
        slot += FRAME
        row = min(int(sample["object_id"]), last)
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = position_of(x, y, sample["depth"], row, maps.frame, object_from_eye)
        position[slot, 0], position[slot, 1], position[slot, 2], position[slot, 3] = a, b, c, np.float32(row)
        light = sample["radiance"]
        colour[slot, 0], colour[slot, 1], colour[slot, 2] = light[0], light[1], light[2]
        age[slot], vertices.meshed[slot] = ZERO, 0
    return cursor


@kernel
def doubt(samples, triangle, image, vertices, mesh, turns):
    """Make the corners of triangles older in which new samples differ from what is shown.

    samples : (n,) SAMPLE, traced in triangle : (n,) int32; image : (h, w, 4) float32, shown
    turns : float32, that corners age where a sample differs by FULL_CHANGE or more. Returns how many were doubted.
    """
    height, width = image.shape[0], image.shape[1]
    doubted = 0
    for s in range(samples.shape[0]):
        xy, light = samples[s]["xy"], samples[s]["radiance"]
        i, j = min(max(int(xy[1]), 0), height - 1), min(max(int(xy[0]), 0), width - 1)
        change = ZERO
        for n in range(3):
            change = max(change, abs(root(light[n]) - root(image[i, j, n])))
        part = min((change - LEAST_CHANGE) / (FULL_CHANGE - LEAST_CHANGE), ONE)
        if part > ZERO and triangle[s] >= 0 and mesh.bridging[triangle[s]] == 0:
            doubted += 1
            for n in range(3):
                k = mesh.corners[triangle[s], n]
                vertices.age[k] += part * turns * np.float32(vertices.meshed[k])
    return doubted
