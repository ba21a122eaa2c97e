"""Trace batches of samples: rays from pixels, 16-wide Embree queries, direct light, sample records out.

Everything is relative to the eye: rays start at 0, instances and lights are placed by float64 differences to the
eye and only then rounded to float32. Optional scene features come as None where the scene lacks them; numba drops
those branches when it compiles, so that a scene without textures runs a kernel without textures.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.data import Float32
from wall.jit import inline_kernel, kernel
from wall.tracing.embree import (
    DIRECTION_X,
    DIRECTION_Y,
    DIRECTION_Z,
    FORMAT_FLOAT3X4_ROW_MAJOR,
    GEOMETRY,
    HIT_U,
    HIT_V,
    INSTANCE,
    NO_HIT,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    ORIGIN_X,
    ORIGIN_Y,
    ORIGIN_Z,
    PRIMITIVE,
    RAY_FLOATS,
    RAY_HIT_FLOATS,
    T_FAR,
    commit_geometry,
    commit_scene,
    intersect16,
    occluded16,
    set_transform,
)

INF = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
MISS = np.uint32(NO_HIT)
INV_PI = np.float32(1.0 / math.pi)
MAX_BOUNCES = 4  # mirror chains are cut here; what is behind the last mirror is dropped
IRRADIANCE_STEPS = 256  # of the sky table over the normal's height -1..1

# One flat array holds everything about 16 rays, one row of 16 floats a quantity, so that LLVM sees constant
# distances between rows and turns the loops over lanes into vector code. Rows start at these offsets:
# the ray-hit packet at 0 (see embree.py), the shadow packet, then scratch.
SHADE = RAY_HIT_FLOATS
PX, PY, PZ, NX, NY, NZ, GX, GY, GZ, LIFT = range(SHADE + RAY_FLOATS, SHADE + RAY_FLOATS + 160, 16)
AR, AG, AB, LR, LG, LB, TR, TG, TB, MIRROR, COS, DEPTH, OBJECT, HITS = range(LIFT + 16, LIFT + 240, 16)
LIFT_BASE, LIFT_SLOPE, LIFT_STRETCH = HITS + 16, HITS + 32, HITS + 48
PACKET_FLOATS = LIFT_STRETCH + 16

# counts that a kernel returns
PRIMARY, SHADOW, SECONDARY, BAD = range(4)
COUNTS = 4


class Workspace(NamedTuple):
    """One thread's packet, 64-byte aligned; see workspace() in tracer.py, which sets the rows that never change."""

    packet: Float32  # (PACKET_FLOATS,)
    bits: NDArray[np.uint32]  # the same memory
    valid: NDArray[np.int32]  # (16,) -1 or 0, lanes of the ray-hit packet
    lit: NDArray[np.int32]  # (16,) -1 or 0, lanes of the shadow packet
    arguments: NDArray[np.uint32]  # RTCIntersectArguments
    counts: NDArray[np.int64]  # (4,) rays by kind


class Surfaces(NamedTuple):
    """What every scene has; meshes stand one after another in the vertex and triangle arrays."""

    triangles: NDArray[np.uint32]  # (t, 3) vertex numbers within the mesh
    mesh_table: NDArray[np.uint32]  # (m, 4) first triangle, first vertex, material, flags: 1 normals, 2 colours, 4 uvs
    materials: Float32  # (k, 8) base colour, mirror share, emission, 0
    instance_mesh: NDArray[np.uint32]  # (n,)
    placements: Float32  # (n, 12) normal_from_object (9, row major), lift: base, slope, stretched slope
    sky: Float32  # (3, 3) radiance of zenith, horizon, ground
    irradiance: Float32  # (257, 3) sky irradiance over pi, by height of the normal


@kernel
def place_instances(world_from_object, eye, scene, geometries, transforms, placements, extents, ulps):
    """Place every instance relative to the eye and commit the scene.

    Parameters
    ----------
    world_from_object : (n, 4, 4) float64
    eye : (3,) float64, world
    scene, geometries : Embree handles, int and (n,) intp
    transforms : (n, 12) float32, row major 3x4 eye_from_object, written
    placements : (n, 12) float32, written; see Surfaces
    extents : (n,) float64, mesh radius in object space
    ulps : float, how many float32 roundings a secondary ray's start is lifted by; see `lift` in trace()

    Returns
    -------
    singular : int, instances whose matrix has no inverse (their normals are left unrotated)
    """
    singular = 0
    for k in range(world_from_object.shape[0]):
        m = world_from_object[k]
        a, b, c = m[0, 0], m[0, 1], m[0, 2]
        d, e, f = m[1, 0], m[1, 1], m[1, 2]
        g, h, i = m[2, 0], m[2, 1], m[2, 2]
        x, y, z = m[0, 3] - eye[0], m[1, 3] - eye[1], m[2, 3] - eye[2]
        for row in range(3):
            for column in range(3):
                transforms[k, 4 * row + column] = m[row, column]
        transforms[k, 3] = x
        transforms[k, 7] = y
        transforms[k, 11] = z
        # the cofactor matrix is the inverse transpose times the determinant; the sign keeps mirrored instances right
        c0, c1, c2 = e * i - f * h, f * g - d * i, d * h - e * g
        determinant = a * c0 + b * c1 + c * c2
        size = math.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i)
        if determinant == 0.0:
            singular += 1
            scale = 1.0
            placements[k, 0:9] = 0.0
            placements[k, 0] = placements[k, 4] = placements[k, 8] = 1.0
        else:
            scale = 1.0 / determinant * size
            placements[k, 0], placements[k, 1], placements[k, 2] = c0 * scale, c1 * scale, c2 * scale
            placements[k, 3], placements[k, 4], placements[k, 5] = (
                (c * h - b * i) * scale,
                (a * i - c * g) * scale,
                (b * g - a * h) * scale,
            )
            placements[k, 6], placements[k, 7], placements[k, 8] = (
                (b * f - c * e) * scale,
                (c * d - a * f) * scale,
                (a * e - b * d) * scale,
            )
        norm = 0.0
        for q in range(9):
            norm += float(placements[k, q]) ** 2
        # condition number of the 3x3 part in the Frobenius norm over 3: 1 for rotation and uniform scale
        condition = max(1.0, math.sqrt(norm) / 3.0)
        root = math.sqrt(3.0)
        placements[k, 9] = root * ulps * 2.0**-24 * (condition * (abs(x) + abs(y) + abs(z)) + extents[k] * size)
        placements[k, 10] = ulps * 2.0**-24
        placements[k, 11] = root * ulps * 2.0**-24 * condition
        set_transform(geometries[k], np.uint32(0), np.int32(FORMAT_FLOAT3X4_ROW_MAJOR), transforms.ctypes.data + 48 * k)
        commit_geometry(geometries[k])
    commit_scene(scene)
    return singular


@inline_kernel
def make_rays(frame, corner, xy, first, count, work):
    """Fill the packet with primary rays from the eye through `count` positions from `first` on.

    Directions are computed in float64, so that a panel's rays are those of the whole wall, then made unit in float32.
    """
    p, bits, valid = work.packet, work.bits, work.valid
    x0, y0 = corner[0], corner[1]
    ax, ay, az = frame[0, 0], frame[0, 1], frame[0, 2]
    bx, by, bz = frame[1, 0], frame[1, 1], frame[1, 2]
    cx, cy, cz = frame[2, 0], frame[2, 1], frame[2, 2]
    for lane in range(16):
        k = first + min(lane, count - 1)
        x = x0 + xy[k, 0]
        y = y0 + xy[k, 1]
        p[DIRECTION_X + lane] = ax + x * bx + y * cx
        p[DIRECTION_Y + lane] = ay + x * by + y * cy
        p[DIRECTION_Z + lane] = az + x * bz + y * cz
    for lane in range(16):
        dx, dy, dz = p[DIRECTION_X + lane], p[DIRECTION_Y + lane], p[DIRECTION_Z + lane]
        scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz)
        p[DIRECTION_X + lane] = dx * scale
        p[DIRECTION_Y + lane] = dy * scale
        p[DIRECTION_Z + lane] = dz * scale
        p[ORIGIN_X + lane] = ZERO
        p[ORIGIN_Y + lane] = ZERO
        p[ORIGIN_Z + lane] = ZERO
        p[T_FAR + lane] = INF
    for lane in range(16):
        bits[GEOMETRY + lane] = MISS
        bits[INSTANCE + lane] = MISS
        valid[lane] = -1 if lane < count else 0


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
        m = surfaces.instance_mesh[instance]
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
        m = surfaces.instance_mesh[bits[INSTANCE + lane]]
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
            x = (p[NY + lane] + ONE) * np.float32(IRRADIANCE_STEPS / 2)
            i = np.uint32(min(max(int(x), 0), IRRADIANCE_STEPS - 1))
            j = i + np.uint32(1)
            f = x - np.float32(i)
            p[LR + lane] = p[AR + lane] * (table[i, 0] + f * (table[j, 0] - table[i, 0]))
            p[LG + lane] = p[AG + lane] * (table[i, 1] + f * (table[j, 1] - table[i, 1]))
            p[LB + lane] = p[AB + lane] * (table[i, 2] + f * (table[j, 2] - table[i, 2]))


@inline_kernel
def start_shadow_rays(work):
    """Secondary rays start at the hit, lifted off the surface."""
    p = work.packet
    for lane in range(16):
        lift = p[LIFT + lane]
        p[SHADE + ORIGIN_X + lane] = p[PX + lane] + lift * p[GX + lane]
        p[SHADE + ORIGIN_Y + lane] = p[PY + lane] + lift * p[GY + lane]
        p[SHADE + ORIGIN_Z + lane] = p[PZ + lane] + lift * p[GZ + lane]


@inline_kernel
def aim_directional(light, work):
    """Aim shadow rays at a directional light; COS becomes the weight of its irradiance, 0 where it is not faced."""
    p = work.packet
    lx, ly, lz = light[0], light[1], light[2]
    for lane in range(16):
        cosine = p[NX + lane] * lx + p[NY + lane] * ly + p[NZ + lane] * lz
        side = p[GX + lane] * lx + p[GY + lane] * ly + p[GZ + lane] * lz
        p[COS + lane] = cosine * INV_PI if min(cosine, side) > ZERO else ZERO
        p[SHADE + DIRECTION_X + lane] = lx
        p[SHADE + DIRECTION_Y + lane] = ly
        p[SHADE + DIRECTION_Z + lane] = lz
        p[SHADE + T_FAR + lane] = INF


@inline_kernel
def aim_point(light, work):
    """Aim shadow rays at a point light (position relative to the eye); COS becomes the weight of its intensity.

    Rays end a lift before the light, so that a lamp in a surface is not shaded by it. Weights are those of the hit
    itself: the lifted start would brighten what lies close to a lamp.
    """
    p = work.packet
    x, y, z = light[0], light[1], light[2]
    reach = abs(x) + abs(y) + abs(z)
    for lane in range(16):
        px, py, pz = p[PX + lane], p[PY + lane], p[PZ + lane]
        lx, ly, lz = x - px, y - py, z - pz
        square = lx * lx + ly * ly + lz * lz
        scale = ONE / math.sqrt(square)
        cosine = p[NX + lane] * lx + p[NY + lane] * ly + p[NZ + lane] * lz
        side = p[GX + lane] * lx + p[GY + lane] * ly + p[GZ + lane] * lz
        p[COS + lane] = cosine * scale * INV_PI / square if min(cosine, side) > ZERO else ZERO
        p[SHADE + DIRECTION_X + lane] = x - p[SHADE + ORIGIN_X + lane]
        p[SHADE + DIRECTION_Y + lane] = y - p[SHADE + ORIGIN_Y + lane]
        p[SHADE + DIRECTION_Z + lane] = z - p[SHADE + ORIGIN_Z + lane]
        gap = p[LIFT + lane] + p[LIFT_SLOPE + lane] * reach
        p[SHADE + T_FAR + lane] = max(ONE - gap * scale, ZERO)


@inline_kernel
def add_light(light, scene, work):
    """Trace the shadow rays that were aimed, and add the light to every lane that sees it. Returns rays traced."""
    p, lit = work.packet, work.lit
    rays = 0
    for lane in range(16):
        facing = p[COS + lane] * p[HITS + lane] > ZERO
        lit[lane] = -1 if facing else 0
        rays += 1 if facing else 0
    if rays == 0:
        return 0
    occluded16(lit.ctypes.data, scene, p.ctypes.data + 4 * SHADE, work.arguments.ctypes.data)
    red, green, blue = light[3], light[4], light[5]
    for lane in range(16):
        seen = p[SHADE + T_FAR + lane] >= ZERO  # Embree sets it to -inf where something is in the way
        weight = p[COS + lane] if seen and p[HITS + lane] > ZERO else ZERO
        p[LR + lane] += p[AR + lane] * red * weight
        p[LG + lane] += p[AG + lane] * green * weight
        p[LB + lane] += p[AB + lane] * blue * weight
    return rays


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
            material = surfaces.materials[surfaces.mesh_table[surfaces.instance_mesh[bits[INSTANCE + lane]], 2]]
            p[LR + lane] += material[4]
            p[LG + lane] += material[5]
            p[LB + lane] += material[6]


@inline_kernel
def light_packet(scene, surfaces, normals, colors, uvs, texels, textures, to_linear, points, suns, emission, work):
    """Radiance along each ray of a traced packet, without mirrors, into rows LR, LG, LB. Returns shadow rays."""
    see_sky(surfaces, work)
    if gather_surfaces(surfaces, normals, work) == 0:
        return 0
    finish_surfaces(work)
    if colors is not None or texels is not None:
        colour_surfaces(surfaces, colors, uvs, texels, textures, to_linear, work)
    add_ambient(surfaces, work)
    rays = 0
    if suns is not None or points is not None:
        start_shadow_rays(work)
    if suns is not None:
        for k in range(suns.shape[0]):
            aim_directional(suns[k], work)
            rays += add_light(suns[k], scene, work)
    if points is not None:
        for k in range(points.shape[0]):
            aim_point(points[k], work)
            rays += add_light(points[k], scene, work)
    if emission is not None:
        add_emission(surfaces, work)
    return rays


@inline_kernel
def reflect(surfaces, work):
    """Keep the mirrors' lanes going: weigh what they showed, turn their rays. Returns how many go on."""
    p, bits, valid = work.packet, work.bits, work.valid
    going = 0
    for lane in range(16):
        if valid[lane] == 0:
            continue
        share = ZERO
        if p[HITS + lane] != ZERO:
            share = surfaces.materials[surfaces.mesh_table[surfaces.instance_mesh[bits[INSTANCE + lane]], 2], 3]
        through = p[MIRROR + lane]
        p[TR + lane] += through * (ONE - share) * p[LR + lane]
        p[TG + lane] += through * (ONE - share) * p[LG + lane]
        p[TB + lane] += through * (ONE - share) * p[LB + lane]
        p[MIRROR + lane] = through * share
        if share <= ZERO:
            valid[lane] = 0
            continue
        going += 1
        lift = p[LIFT + lane]
        gx, gy, gz = p[GX + lane], p[GY + lane], p[GZ + lane]
        nx, ny, nz = p[NX + lane], p[NY + lane], p[NZ + lane]
        dx, dy, dz = p[DIRECTION_X + lane], p[DIRECTION_Y + lane], p[DIRECTION_Z + lane]
        turn = np.float32(2.0) * (nx * dx + ny * dy + nz * dz)
        if (dx - turn * nx) * gx + (dy - turn * ny) * gy + (dz - turn * nz) * gz <= ZERO:
            nx, ny, nz = gx, gy, gz  # the shading normal would send it inside
            turn = np.float32(2.0) * (nx * dx + ny * dy + nz * dz)
        p[DIRECTION_X + lane], p[DIRECTION_Y + lane], p[DIRECTION_Z + lane] = (
            dx - turn * nx,
            dy - turn * ny,
            dz - turn * nz,
        )
        p[ORIGIN_X + lane] = p[PX + lane] + lift * gx
        p[ORIGIN_Y + lane] = p[PY + lane] + lift * gy
        p[ORIGIN_Z + lane] = p[PZ + lane] + lift * gz
        p[T_FAR + lane] = INF
        bits[GEOMETRY + lane] = MISS
        bits[INSTANCE + lane] = MISS
    return going


@inline_kernel
def write_samples(xy, first, count, samples, kept, work):
    """Write the packet's records from `kept` on, leaving out radiance that is not finite. Returns the new `kept`."""
    p = work.packet
    for lane in range(count):
        r, g, b = p[LR + lane], p[LG + lane], p[LB + lane]
        if not abs(r) + abs(g) + abs(b) < INF:
            work.counts[BAD] += 1
            continue
        sample = samples[kept]
        sample["xy"][0] = xy[first + lane, 0]
        sample["xy"][1] = xy[first + lane, 1]
        sample["radiance"][0] = r
        sample["radiance"][1] = g
        sample["radiance"][2] = b
        sample["depth"] = p[DEPTH + lane]
        sample["object"] = np.uint32(p[OBJECT + lane])
        kept += 1
    return kept


@kernel
def trace(
    scene,
    frame,
    corner,
    xy,
    samples,
    surfaces,
    normals,
    colors,
    uvs,
    texels,
    textures,
    to_linear,
    points,
    suns,
    emission,
    mirrors,
    work,
):
    """Trace one sample for each position and write its record.

    Parameters
    ----------
    scene : int, committed Embree scene whose instances are placed relative to the eye
    frame : (3, 3) float64, rows A, B, C: direction A + X B + Y C of virtual-screen position (X, Y)
    corner : (2,) float64, the panel's top left corner on the virtual screen, pixels
    xy : (n, 2) float32, positions, panel pixels; 16 in a row make a packet
    samples : (n,) SAMPLE, written, except time
    surfaces : Surfaces
    normals : (v, 3) float32 | None; colors : (v, 3) float32 | None; uvs : (v, 2) float32 | None
    texels : (p, 3) uint8 sRGB | None; textures : (materials, 3) int32 first texel, width, height | None
    to_linear : (256,) float32, linear light of an sRGB byte
    points, suns : (k, 6) float32 | None, position relative to the eye or direction, then intensity or irradiance
    emission, mirrors : any array | None; None leaves the feature out
    work : Workspace; its counts are added to (rays by kind, and samples whose radiance was not finite)

    Returns
    -------
    kept : int, samples written; records 0..kept-1 are filled, those with NaN or infinite radiance are left out
    """
    p, bits, counts = work.packet, work.bits, work.counts
    packet, valid, arguments = p.ctypes.data, work.valid.ctypes.data, work.arguments.ctypes.data
    kept = 0
    for first in range(0, xy.shape[0], 16):
        count = min(16, xy.shape[0] - first)
        make_rays(frame, corner, xy, first, count, work)
        intersect16(valid, scene, packet, arguments)
        counts[PRIMARY] += count
        for lane in range(16):
            p[DEPTH + lane] = p[T_FAR + lane]  # stays infinite on a miss
            missed = bits[GEOMETRY + lane] == MISS
            p[OBJECT + lane] = ZERO if missed else np.float32(bits[INSTANCE + lane]) + ONE
        counts[SHADOW] += light_packet(
            scene, surfaces, normals, colors, uvs, texels, textures, to_linear, points, suns, emission, work
        )
        if mirrors is not None:
            for lane in range(16):
                p[TR + lane] = p[TG + lane] = p[TB + lane] = ZERO
                p[MIRROR + lane] = ONE
            for _bounce in range(MAX_BOUNCES):
                going = reflect(surfaces, work)
                if going == 0:
                    break
                counts[SECONDARY] += going
                intersect16(valid, scene, packet, arguments)
                counts[SHADOW] += light_packet(
                    scene, surfaces, normals, colors, uvs, texels, textures, to_linear, points, suns, emission, work
                )
            reflect(surfaces, work)
            for lane in range(16):
                p[LR + lane], p[LG + lane], p[LB + lane] = p[TR + lane], p[TG + lane], p[TB + lane]
        kept = write_samples(xy, first, count, samples, kept, work)
    return kept
