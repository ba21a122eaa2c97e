"""Which tiles of an image moving objects can reach: by being seen there, or by their shadows."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import NEAREST_DEPTH, NEAREST_OBJECT
from wall.deepbuffer.kernels.pixel_buffer import TILE

ZERO = np.float32(0.0)
NEAR, FAR = 0, 1  # columns of depths
RADIUS = 3  # column of movers
AT_POINT = 3  # column of lights: 1 for a place, 0 for a direction towards the light
POINTS_APART = 2.0  # pixels between the point of a pixel that is tested, and others of its surface


@kernel
def note_depths(nearest, mirrors, depths, mirrored):
    """Widen the range of depths that each pixel's nearest samples have had.

    Parameters
    ----------
    nearest : (h, w, 4) float32, see PixelHistory
    mirrors : (n + 1,) bool, objects that show others
    depths : (h, w, 2) float32, NEAR and FAR; (inf, 0): nothing but sky yet
    mirrored : (h, w) bool, set where a mirror is seen
    """
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            object_id = int(nearest[i, j, NEAREST_OBJECT])
            if object_id > 0:
                depth = nearest[i, j, NEAREST_DEPTH]
                depths[i, j, NEAR] = min(depths[i, j, NEAR], depth)
                depths[i, j, FAR] = max(depths[i, j, FAR], depth)
                if mirrors[object_id]:
                    mirrored[i, j] = True


@kernel
def forget_depths(tiles, depths, mirrored):
    """Forget what was noted in some tiles (rows, columns) bool; the others: see note_depths."""
    for i in range(depths.shape[0]):
        for j in range(depths.shape[1]):
            if tiles[i // TILE, j // TILE]:
                depths[i, j, NEAR], depths[i, j, FAR], mirrored[i, j] = np.float32(np.inf), ZERO, False


@kernel
def mark_reached(depths, frame, left, top, movers, lights, first, last, reached):
    """Set the tiles in which a mover may be seen, or on whose surfaces its shadow may fall.

    Parameters
    ----------
    depths : (h, w, 2) float32, see note_depths
    frame : (3, 3) float64, see geometry.frusta.ray_frame; left, top : float64, virtual-screen pixels of the image
    movers : (m, 4) float64, spheres about objects, relative to the eye
    lights : (l, 4) float64, places relative to the eye, or directions towards them
    first, last : int, rows of tiles
    reached : (rows, columns) bool, updated from row `first` to the one before `last`
    """
    centre, middle, point = np.empty(3), np.empty(3), np.empty(3)
    for row in range(first, last):
        for column in range(reached.shape[1]):
            if reached[row, column]:
                continue
            i, j = row * TILE, column * TILE
            bottom, right = min(i + TILE, depths.shape[0]), min(j + TILE, depths.shape[1])
            tile = depths[i:bottom, j:right]
            near, far = depth_range(tile)
            angle = view_cone(frame, left + j, top + i, left + right, top + bottom, middle, point)
            about = 0.0
            if far > ZERO:
                about = sphere_about(frame, (left + j, top + i, left + right, top + bottom), near, far, centre, point)
            for m in range(movers.shape[0]):
                mover = movers[m]
                found = is_seen(mover, middle, angle)
                for k in range(lights.shape[0]):
                    if not found and far > ZERO and shades(mover, lights[k], centre, about):
                        found = shades_pixels(mover, lights[k], tile, frame, left + j, top + i, point)
                if found:
                    reached[row, column] = True
                    break


@inline_kernel
def depth_range(tile):
    """The range of the depths (h, w, 2) of a tile; far is 0 where only sky is seen."""
    near, far = np.float32(np.inf), ZERO
    for i in range(tile.shape[0]):
        for j in range(tile.shape[1]):
            near, far = min(near, tile[i, j, NEAR]), max(far, tile[i, j, FAR])
    return near, far


@inline_kernel
def ray_through(frame, x, y, out):
    """Write the point at depth 1 that is seen at virtual-screen position (x, y), relative to the eye."""
    for c in range(3):
        out[c] = frame[0, c] + x * frame[1, c] + y * frame[2, c]


@inline_kernel
def length_of(v):
    """Of a vector (3,)."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inline_kernel
def view_cone(frame, left, top, right, bottom, middle, corner):
    """Write the unit direction to the middle of a rectangle; returns the angle to its farthest corner, radians."""
    widest = 0.0
    ray_through(frame, 0.5 * (left + right), 0.5 * (top + bottom), middle)
    size = length_of(middle)
    for c in range(3):
        middle[c] /= size
    for k in range(4):
        ray_through(frame, right if k & 1 else left, bottom if k & 2 else top, corner)
        cosine = (corner[0] * middle[0] + corner[1] * middle[1] + corner[2] * middle[2]) / length_of(corner)
        widest = max(widest, math.acos(min(max(cosine, -1.0), 1.0)))
    return widest


@inline_kernel
def sphere_about(frame, edges, near, far, centre, corner):
    """Write the centre of a sphere about what a rectangle shows at depths from near to far. Returns its radius."""
    left, top, right, bottom = edges
    ray_through(frame, 0.5 * (left + right), 0.5 * (top + bottom), centre)
    for c in range(3):
        centre[c] *= 0.5 * (near + far)
    radius = 0.0
    for k in range(8):
        ray_through(frame, right if k & 1 else left, bottom if k & 2 else top, corner)
        depth = far if k & 4 else near
        for c in range(3):
            corner[c] = corner[c] * depth - centre[c]
        radius = max(radius, length_of(corner))
    return radius


@inline_kernel
def is_seen(mover, middle, angle):
    """Whether a sphere may be seen within `angle` of a direction."""
    distance = math.sqrt(mover[0] * mover[0] + mover[1] * mover[1] + mover[2] * mover[2])
    if distance <= mover[RADIUS]:
        return True
    cosine = (mover[0] * middle[0] + mover[1] * middle[1] + mover[2] * middle[2]) / distance
    return math.acos(min(max(cosine, -1.0), 1.0)) <= angle + math.asin(mover[RADIUS] / distance)


@inline_kernel
def shades(mover, light, point, about):
    """Whether a sphere may come between a light and what lies within `about` of a point (3,)."""
    x, y, z = mover[0] - point[0], mover[1] - point[1], mover[2] - point[2]
    a, b, c = light[0], light[1], light[2]
    along = 1.0
    if light[AT_POINT] > 0.0:
        a, b, c = a - point[0], b - point[1], c - point[2]
        along = max(a * a + b * b + c * c, 1e-300)
    t = max((x * a + y * b + z * c) / along, 0.0)
    if light[AT_POINT] > 0.0:
        t = min(t, 1.0)
    x, y, z, reach = x - t * a, y - t * b, z - t * c, mover[RADIUS] + about
    return x * x + y * y + z * z <= reach * reach


@inline_kernel
def shades_pixels(mover, light, tile, frame, left, top, point):
    """`shades` for any pixel of a tile, whose depths are (h, w, 2) and whose corner is (left, top)."""
    apart = POINTS_APART * max(length_of(frame[1]), length_of(frame[2]))
    for i in range(tile.shape[0]):
        for j in range(tile.shape[1]):
            for side in range(2):
                depth = float(tile[i, j, side])
                if tile[i, j, FAR] == ZERO or (side == FAR and tile[i, j, FAR] == tile[i, j, NEAR]):
                    continue
                ray_through(frame, left + j + 0.5, top + i + 0.5, point)
                for c in range(3):
                    point[c] *= depth
                if shades(mover, light, point, apart * depth):
                    return True
    return False


@kernel
def settle(still, mirrored, settled):
    """Write (h, w) bool `settled`: pixels of `still` (rows, columns) tiles that are not `mirrored` (h, w)."""
    for i in range(settled.shape[0]):
        for j in range(settled.shape[1]):
            settled[i, j] = still[i // TILE, j // TILE] & ~mirrored[i, j]
