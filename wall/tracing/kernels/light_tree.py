"""A tree over many lights: one is chosen by what it may bring to a point, and the chance of any is known.

Each node has WIDTH slots, which bound the lights below them by a sphere, their power and a cone of their normals.
Lights stand in an order of their own, WIDTH after WIDTH in the nodes of the last level, those likewise in the level
above: a light's place says its way from the root. After A. Conty Estevez and C. Kulla, "Importance Sampling of Many
Lights with Adaptive Tree Splitting", 2018, without the splitting, and with many slots a node, which compute in vectors.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.values import FIRST_TRIANGLE, FIRST_VERTEX, ONE, ZERO

WIDTH, WIDTH_BITS = 16, 4  # slots of a node
(
    CENTER_X, CENTER_Y, CENTER_Z, RADIUS,  # middle of the power, from the tree's origin, and a sphere about it
    SPREAD,  # root mean square distance of power from there
    AXIS_X, AXIS_Y, AXIS_Z, COSINE, SINE,  # of the cone that holds all normals; cosine -1: any direction
    BACK,  # -1: something shines to both sides; 1: to the front alone
    EDGE,  # cosine to its normal at which a light ends: 0 of surfaces, above of spots
    SCALE,  # power / (1 - EDGE); 0: an empty slot
) = range(0, 13 * WIDTH, WIDTH)  # fmt: skip
COLUMNS = 13 * WIDTH  # of a node: WIDTH values each of the above
CLOSEST = np.float32(1e-12)  # to a light that is counted as so close
BELOW_ONE = np.float32(1.0 - 2.0**-24)
LOOSE = 1.0 + 1e-5  # spheres and cones, by which float32 cannot leave anything out
LEAST_AXIS = 1e-3  # of the mean of a node's axes, below which they count as any direction


@inline_kernel
def weigh(tree, node, point, normal, p):
    """Writes the importance of each slot of a node for a point and its normal to row IMPORTANCE; returns their sum.

    Power times the greatest cosines that any light of the sphere may have to its normal and to the point's, over the
    square of the distance to its centre, or of its spread where that is more. It is 0 only where no light can come
    from, and has no steps: rays find it where they start, a little off the point.

    point : relative to the tree's origin, as normal three float32
    """
    nodes = tree.nodes[node]
    x, y, z = point
    for k in range(WIDTH):
        dx, dy, dz = nodes[k + CENTER_X] - x, nodes[k + CENTER_Y] - y, nodes[k + CENTER_Z] - z
        radius, cosine, edge = nodes[k + RADIUS], nodes[k + COSINE], nodes[k + EDGE]
        square = dx * dx + dy * dy + dz * dz
        distance = math.sqrt(square)
        ahead = -(nodes[k + AXIS_X] * dx + nodes[k + AXIS_Y] * dy + nodes[k + AXIS_Z] * dz)
        ahead = max(ahead, nodes[k + BACK] * ahead)
        turned = ahead * cosine + math.sqrt(max(square - ahead * ahead, ZERO)) * nodes[k + SINE]
        nearest = distance if ahead >= distance * cosine else turned  # distance times cosine to the nearest normal
        reach = max(distance, nodes[k + SPREAD], CLOSEST)
        shines = max(min(reach * (ONE - edge), nearest - distance * edge + radius * (ONE + edge)), ZERO)
        lit = max(min(reach, normal[0] * dx + normal[1] * dy + normal[2] * dz + radius), ZERO)
        share = ONE / reach
        p[rows.IMPORTANCE + k] = (nodes[k + SCALE] * share * share) * (shines * share) * (lit * share)
    total = ZERO
    for k in range(rows.IMPORTANCE, rows.IMPORTANCE + 4):
        total += (p[k] + p[k + 4]) + (p[k + 8] + p[k + 12])
    return total


@inline_kernel
def choose_light(tree, number, point, normal, p):
    """The row of a light chosen by importance with one random number, and its chance; chance 0: none shines here.

    point : relative to the eye, as normal three float32
    """
    offset, node, chance = tree.offset, np.int64(0), ONE
    here = point[0] + offset[0], point[1] + offset[1], point[2] + offset[2]
    for level in range(tree.first.shape[0]):
        total = weigh(tree, tree.first[level] + node, here, normal, p)
        if not total > ZERO:
            return np.int64(0), ZERO
        number, slot, importance = number * total, 0, ONE
        for k in range(WIDTH):
            own = p[rows.IMPORTANCE + k]
            if own > ZERO:
                slot, importance = k, own
                if number < own:
                    break
                number -= own
        number = min(number / importance, BELOW_ONE)
        chance *= importance / total
        node = node * WIDTH + slot
    return tree.order[node], chance


@inline_kernel
def chance_of_light(tree, row, point, normal, p):
    """The chance with which choose_light finds a row; parameters as there."""
    offset, place, chance = tree.offset, tree.place[row], ONE
    here = point[0] + offset[0], point[1] + offset[1], point[2] + offset[2]
    shift = WIDTH_BITS * tree.first.shape[0]
    for level in range(tree.first.shape[0]):
        total = weigh(tree, tree.first[level] + (place >> shift), here, normal, p)
        shift -= WIDTH_BITS
        if not total > ZERO:
            return ZERO
        chance *= p[rows.IMPORTANCE + ((place >> shift) & (WIDTH - 1))] / total
    return chance


@kernel
def bound_triangles(tree, changed, moved, turns, emitters, backs, world_from_object, origin, meshes):
    """Writes the slots of all triangles of instances that moved, and marks their nodes.

    changed : (nodes,) bool, written; moved : (k,) int64, instances; turns : (k,) float64, -1 where it is mirrored, or 1
    backs : (n,) float32 of each instance: BACK; world_from_object : (n, 4, 4) float64
    origin : (3,) float64 of the tree, world; meshes : Surfaces.mesh_table, triangles and vertices
    """
    mesh_table, triangles, vertices = meshes
    last, corners = tree.first[-1], np.zeros((3, 3))
    for number, instance in enumerate(moved):
        m, start = world_from_object[instance], emitters.first[instance]
        first, vertex = np.int64(mesh_table[instance, FIRST_TRIANGLE]), np.int64(mesh_table[instance, FIRST_VERTEX])
        row = start
        while row < emitters.instance.shape[0] and emitters.instance[row] == instance:
            for corner in range(3):
                v = vertices[vertex + triangles[first + row - start, corner]]
                for i in range(3):
                    corners[corner, i] = m[i, 0] * v[0] + m[i, 1] * v[1] + m[i, 2] * v[2] + (m[i, 3] - origin[i])
            place = tree.place[row]
            node, k = last + (place >> WIDTH_BITS), place & (WIDTH - 1)
            _bound(tree.nodes[node], k, corners, turns[number])
            tree.nodes[node, BACK + k] = backs[instance]
            tree.nodes[node, SCALE + k] = emitters.chance[row]
            changed[node] = True
            row += 1


@inline_kernel
def _bound(node, k, corners, turn):
    """Writes sphere and normal of a triangle (3, 3) to slot k of a node."""
    a, b, c = corners[0], corners[1], corners[2]
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    fx, fy, fz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = turn / length if length > 0.0 else 0.0
    node[AXIS_X + k], node[AXIS_Y + k], node[AXIS_Z + k] = nx * scale, ny * scale, nz * scale
    node[COSINE + k], node[SINE + k], node[EDGE + k] = 1.0, 0.0, 0.0
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    square = total = 0.0
    for corner in range(3):
        dx, dy, dz = corners[corner, 0] - x, corners[corner, 1] - y, corners[corner, 2] - z
        own = dx * dx + dy * dy + dz * dz
        square, total = max(square, own), total + own
    node[CENTER_X + k], node[CENTER_Y + k], node[CENTER_Z + k], node[RADIUS + k] = x, y, z, math.sqrt(square) * LOOSE
    node[SPREAD + k] = math.sqrt(total / 12.0)  # of a triangle's points


@kernel
def refit(tree, changed):
    """Writes the slots above the nodes that are marked in `changed` (nodes,) bool, up to the root; clears the marks."""
    for level in range(tree.first.shape[0] - 1, 0, -1):
        first, above = tree.first[level], tree.first[level - 1]
        end = tree.nodes.shape[0] if level == tree.first.shape[0] - 1 else tree.first[level + 1]
        for node in range(first, end):
            if changed[node]:
                parent = above + ((node - first) >> WIDTH_BITS)
                _unite(tree.nodes[node], tree.nodes[parent], (node - first) & (WIDTH - 1))
                changed[node], changed[parent] = False, True
    changed[0] = False


@inline_kernel
def _unite(node, parent, slot):
    """Writes what bounds all slots of a node to a slot of its parent; empty slots do not count."""
    power, edge, back = 0.0, 1.0, 1.0
    x = y = z = ax = ay = az = 0.0
    for k in range(WIDTH):
        if node[SCALE + k] > ZERO:
            own = float(node[SCALE + k]) * (1.0 - node[EDGE + k])
            power, edge, back = power + own, min(edge, float(node[EDGE + k])), min(back, float(node[BACK + k]))
            x, y, z = x + own * node[CENTER_X + k], y + own * node[CENTER_Y + k], z + own * node[CENTER_Z + k]
            ax, ay, az = ax + own * node[AXIS_X + k], ay + own * node[AXIS_Y + k], az + own * node[AXIS_Z + k]
    if power == 0.0:
        parent[SCALE + slot] = ZERO
        return
    x, y, z, spread = x / power, y / power, z / power, 0.0
    length = math.sqrt(ax * ax + ay * ay + az * az)
    radius, angle = 0.0, 0.0 if length > LEAST_AXIS * power else math.pi
    scale = 1.0 / length if length > LEAST_AXIS * power else 0.0
    for k in range(WIDTH):
        if node[SCALE + k] > ZERO:
            dx, dy, dz = node[CENTER_X + k] - x, node[CENTER_Y + k] - y, node[CENTER_Z + k] - z
            square = dx * dx + dy * dy + dz * dz
            radius = max(radius, math.sqrt(square) + node[RADIUS + k])
            spread += float(node[SCALE + k]) * (1.0 - node[EDGE + k]) * (square + float(node[SPREAD + k]) ** 2)
            cosine = (ax * node[AXIS_X + k] + ay * node[AXIS_Y + k] + az * node[AXIS_Z + k]) * scale
            own = math.acos(max(min(float(node[COSINE + k]), 1.0), -1.0))
            angle = max(angle, math.acos(max(min(cosine, 1.0), -1.0)) + own)
    parent[CENTER_X + slot], parent[CENTER_Y + slot], parent[CENTER_Z + slot], parent[RADIUS + slot] = (
        x,
        y,
        z,
        radius * LOOSE,
    )
    parent[AXIS_X + slot], parent[AXIS_Y + slot], parent[AXIS_Z + slot] = ax * scale, ay * scale, az * scale
    angle = min(angle * LOOSE + 1e-4, math.pi)
    parent[COSINE + slot], parent[SINE + slot] = math.cos(angle), math.sin(angle)
    parent[BACK + slot], parent[EDGE + slot], parent[SCALE + slot] = back, edge, power / (1.0 - edge)
