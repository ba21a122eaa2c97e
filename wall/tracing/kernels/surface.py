"""What a packet's rays hit, and the light that needs no further rays: surfaces, colours, sky, emission."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.scene.sky import SKY_STEPS
from wall.tracing.embree import (
    DIRECTION_X,
    DIRECTION_Y,
    DIRECTION_Z,
    GEOMETRY,
    HIT_U,
    HIT_V,
    INSTANCE,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    ORIGIN_X,
    ORIGIN_Y,
    ORIGIN_Z,
    PRIMITIVE,
    T_FAR,
)
from wall.tracing.kernels.packet import (
    AB,
    AG,
    AR,
    GX,
    GY,
    GZ,
    HITS,
    LB,
    LG,
    LIFT,
    LIFT_BASE,
    LIFT_SLOPE,
    LIFT_STRETCH,
    LR,
    MISS,
    NX,
    NY,
    NZ,
    ONE,
    PX,
    PY,
    PZ,
    ZERO,
)


@inline_kernel
def gather_surfaces(surfaces, normals, work):
    """Look up what was hit, lane by lane: normals turned towards the world (any length), base colour, lift."""
    p, bits = work.packet, work.bits
    hits = 0
    for lane in range(16):
        if work.valid[lane] == 0 or bits[GEOMETRY + lane] == MISS:
            p[HITS + lane] = ZERO
            p[GX + lane] = p[GY + lane] = p[GZ + lane] = ONE
            p[NX + lane] = p[NY + lane] = p[NZ + lane] = ONE
            continue
        hits += 1
        p[HITS + lane] = ONE
        instance = bits[INSTANCE + lane]
        m = instance
        place = surfaces.placements[instance]
        a, b, c, d, e, f, g, h, i = (
            place[0],
            place[1],
            place[2],
            place[3],
            place[4],
            place[5],
            place[6],
            place[7],
            place[8],
        )
        x, y, z = p[NORMAL_X + lane], p[NORMAL_Y + lane], p[NORMAL_Z + lane]
        size = ONE / max(abs(x), abs(y), abs(z))  # Embree's normal is twice the area: its square would leave float32
        x, y, z = x * size, y * size, z * size
        p[NORMAL_X + lane], p[NORMAL_Y + lane], p[NORMAL_Z + lane] = x, y, z
        p[GX + lane], p[GY + lane], p[GZ + lane] = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
        if normals is not None:  # noqa: SIM102  (numba leaves a branch out only for a bare test for None)
            if surfaces.mesh_table[m, 3] & np.uint32(1):
                t = surfaces.mesh_table[m, 0] + bits[PRIMITIVE + lane]
                vertex = surfaces.mesh_table[m, 1]
                i0, i1, i2 = (
                    vertex + surfaces.triangles[t, 0],
                    vertex + surfaces.triangles[t, 1],
                    vertex + surfaces.triangles[t, 2],
                )
                u, v = p[HIT_U + lane], p[HIT_V + lane]
                w = ONE - u - v
                x = w * normals[i0, 0] + u * normals[i1, 0] + v * normals[i2, 0]
                y = w * normals[i0, 1] + u * normals[i1, 1] + v * normals[i2, 1]
                z = w * normals[i0, 2] + u * normals[i1, 2] + v * normals[i2, 2]
        p[NX + lane], p[NY + lane], p[NZ + lane] = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
        p[LIFT_BASE + lane], p[LIFT_SLOPE + lane], p[LIFT_STRETCH + lane] = place[9], place[10], place[11]
        material = surfaces.mesh_table[m, 2]
        p[AR + lane] = surfaces.materials[material, 0]
        p[AG + lane] = surfaces.materials[material, 1]
        p[AB + lane] = surfaces.materials[material, 2]
    return hits


@inline_kernel
def finish_surfaces(work):
    """Positions, unit normals turned towards the ray, and the lift of secondary rays, for all lanes at once.

    The lift moves the start of a secondary ray along the geometric normal by more than the float32 error of the hit
    in that direction: u (W + q (R |M| + c (W + |T|))), with u = ulps * 2^-24, W = |O| + t |d| the ray's way to the hit
    O + t d (O is 0 but behind a mirror), M and T the instance's matrix and place, R its mesh's radius, c the condition
    of M. q is |N| / |M^-T N| / |M| for the object's normal N: 1 for rotations and uniform scales, small across the thin
    side of a flattened object, whose error is only as large as the object is thin.
    """
    p = work.packet
    for lane in range(16):
        t = p[T_FAR + lane]
        dx, dy, dz = p[DIRECTION_X + lane], p[DIRECTION_Y + lane], p[DIRECTION_Z + lane]
        ox, oy, oz = p[ORIGIN_X + lane], p[ORIGIN_Y + lane], p[ORIGIN_Z + lane]
        p[PX + lane], p[PY + lane], p[PZ + lane] = ox + t * dx, oy + t * dy, oz + t * dz
        way = abs(ox) + abs(oy) + abs(oz) + t * (abs(dx) + abs(dy) + abs(dz))
        gx, gy, gz = p[GX + lane], p[GY + lane], p[GZ + lane]
        side = ONE / math.sqrt(gx * gx + gy * gy + gz * gz)
        ux, uy, uz = p[NORMAL_X + lane], p[NORMAL_Y + lane], p[NORMAL_Z + lane]
        shrink = math.sqrt(ux * ux + uy * uy + uz * uz) * side
        stretched = p[LIFT_BASE + lane] + p[LIFT_STRETCH + lane] * way
        p[LIFT + lane] = p[LIFT_SLOPE + lane] * way + shrink * stretched
        side = -side if gx * dx + gy * dy + gz * dz > ZERO else side
        gx, gy, gz = gx * side, gy * side, gz * side
        p[GX + lane], p[GY + lane], p[GZ + lane] = gx, gy, gz
        nx, ny, nz = p[NX + lane], p[NY + lane], p[NZ + lane]
        square = nx * nx + ny * ny + nz * nz
        side = ONE / math.sqrt(square)
        side = -side if nx * gx + ny * gy + nz * gz < ZERO else side
        smooth = square > ZERO  # opposite vertex normals may cancel
        p[NX + lane] = nx * side if smooth else gx
        p[NY + lane] = ny * side if smooth else gy
        p[NZ + lane] = nz * side if smooth else gz


@inline_kernel
def colour_surfaces(surfaces, colors, uvs, texels, textures, to_linear, work):
    """Multiply base colours by vertex colours and textures (bilinear, repeating)."""
    p, bits = work.packet, work.bits
    for lane in range(16):
        if p[HITS + lane] == ZERO:
            continue
        m = bits[INSTANCE + lane]
        flags = surfaces.mesh_table[m, 3]
        if flags & np.uint32(6) == np.uint32(0):
            continue
        t, vertex = surfaces.mesh_table[m, 0] + bits[PRIMITIVE + lane], surfaces.mesh_table[m, 1]
        i0, i1, i2 = (
            vertex + surfaces.triangles[t, 0],
            vertex + surfaces.triangles[t, 1],
            vertex + surfaces.triangles[t, 2],
        )
        u, v = p[HIT_U + lane], p[HIT_V + lane]
        w = ONE - u - v
        if colors is not None:  # noqa: SIM102
            if flags & np.uint32(2):
                p[AR + lane] *= w * colors[i0, 0] + u * colors[i1, 0] + v * colors[i2, 0]
                p[AG + lane] *= w * colors[i0, 1] + u * colors[i1, 1] + v * colors[i2, 1]
                p[AB + lane] *= w * colors[i0, 2] + u * colors[i1, 2] + v * colors[i2, 2]
        if texels is not None:
            texture = textures[surfaces.mesh_table[m, 2]]
            if texture[1] > 0 and flags & np.uint32(4):
                x = w * uvs[i0, 0] + u * uvs[i1, 0] + v * uvs[i2, 0]
                y = w * uvs[i0, 1] + u * uvs[i1, 1] + v * uvs[i2, 1]
                r, g, b = texel_at(texels, texture, to_linear, x, y)
                p[AR + lane] *= r
                p[AG + lane] *= g
                p[AB + lane] *= b


@inline_kernel
def texel_at(texels, texture, to_linear, u, v):
    """Bilinear lookup in linear light; texture = (first texel, width, height), v up, wrapped."""
    first, width, height = texture[0], texture[1], texture[2]
    x = (u - np.floor(u)) * width - np.float32(0.5)
    y = (ONE - (v - np.floor(v))) * height - np.float32(0.5)
    if not (x > -ONE and y > -ONE):  # NaN coordinates read texel 0
        x, y = ZERO, ZERO
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = np.float32(x - x0), np.float32(y - y0)
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    x0, y0 = x0 % width, y0 % height
    a, b = texels[first + y0 * width + x0], texels[first + y0 * width + x1]
    c, d = texels[first + y1 * width + x0], texels[first + y1 * width + x1]
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    red = wa * to_linear[a[0]] + wb * to_linear[b[0]] + wc * to_linear[c[0]] + wd * to_linear[d[0]]
    green = wa * to_linear[a[1]] + wb * to_linear[b[1]] + wc * to_linear[c[1]] + wd * to_linear[d[1]]
    blue = wa * to_linear[a[2]] + wb * to_linear[b[2]] + wc * to_linear[c[2]] + wd * to_linear[d[2]]
    return red, green, blue


@inline_kernel
def add_ambient(surfaces, work):
    """Light from the whole sky, unoccluded: base colour * E(normal) / pi, from a table over the normal's height."""
    p, table = work.packet, surfaces.irradiance
    for lane in range(16):
        if p[HITS + lane] != ZERO:
            x = (p[NY + lane] + ONE) * np.float32(SKY_STEPS / 2)
            i = np.uint32(min(max(int(x), 0), SKY_STEPS - 1))
            j = i + np.uint32(1)
            f = x - np.float32(i)
            p[LR + lane] = p[AR + lane] * (table[i, 0] + f * (table[j, 0] - table[i, 0]))
            p[LG + lane] = p[AG + lane] * (table[i, 1] + f * (table[j, 1] - table[i, 1]))
            p[LB + lane] = p[AB + lane] * (table[i, 2] + f * (table[j, 2] - table[i, 2]))


@inline_kernel
def see_sky(surfaces, work):
    """Rays that left the scene see the sky: ground to horizon to zenith, linear in the direction's height."""
    p, sky = work.packet, surfaces.sky
    zr, zg, zb = sky[0, 0] - sky[1, 0], sky[0, 1] - sky[1, 1], sky[0, 2] - sky[1, 2]
    gr, gg, gb = sky[2, 0] - sky[1, 0], sky[2, 1] - sky[1, 1], sky[2, 2] - sky[1, 2]
    hr, hg, hb = sky[1, 0], sky[1, 1], sky[1, 2]
    for lane in range(16):
        up, down = max(p[DIRECTION_Y + lane], ZERO), max(-p[DIRECTION_Y + lane], ZERO)
        p[LR + lane] = hr + up * zr + down * gr
        p[LG + lane] = hg + up * zg + down * gg
        p[LB + lane] = hb + up * zb + down * gb


@inline_kernel
def add_emission(surfaces, work):
    p, bits = work.packet, work.bits
    for lane in range(16):
        if p[HITS + lane] != ZERO:
            material = surfaces.materials[surfaces.mesh_table[bits[INSTANCE + lane], 2]]
            p[LR + lane] += material[4]
            p[LG + lane] += material[5]
            p[LB + lane] += material[6]
