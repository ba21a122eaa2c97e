"""Trace batches of samples: rays from pixels, 16-wide Embree queries, direct light, sample records out.

Everything is relative to the eye: rays start at 0, instances and lights are placed by float64 differences to the
eye and only then rounded to float32. Optional scene features come as None where the scene lacks them; numba drops
those branches when it compiles, so that a scene without textures runs a kernel without textures.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.tracing.embree import (
    DIRECTION_X,
    DIRECTION_Y,
    DIRECTION_Z,
    FORMAT_FLOAT3X4_ROW_MAJOR,
    GEOMETRY,
    INSTANCE,
    MASK,
    ORIGIN_X,
    ORIGIN_Y,
    ORIGIN_Z,
    T_FAR,
    commit_geometry,
    commit_scene,
    intersect16,
    occluded16,
    set_transform,
)
from wall.tracing.kernels.packet import (
    AB,
    AG,
    ALL,
    ALL_LIGHTS,
    AR,
    BAD,
    COS,
    DEPTH,
    GX,
    GY,
    GZ,
    HITS,
    INF,
    INV_PI,
    LB,
    LG,
    LIFT,
    LIFT_SLOPE,
    LIGHT,
    LIGHT_VISIBILITY,
    LR,
    MAX_BOUNCES,
    MIRROR,
    MISS,
    NO_NORMAL,
    NORMAL_CODE,
    NX,
    NY,
    NZ,
    OBJECT,
    ONE,
    PRIMARY,
    PX,
    PY,
    PZ,
    SAMPLE_VISIBILITY,
    SECONDARY,
    SEES,
    SHADE,
    SHADOW,
    TB,
    TG,
    TR,
    ZERO,
)
from wall.tracing.kernels.surface import (
    add_ambient,
    add_emission,
    colour_surfaces,
    finish_surfaces,
    gather_surfaces,
    see_sky,
)

DARKEST = np.float32(1e-3)  # of three channels' reflectance: below it a colour cannot be divided out
TINY = np.float32(1e-30)
ALL_OBJECTS = np.uint32(ALL)  # mask of rays that any object stops
THIRD = np.float32(1.0 / 3.0)


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
        bits[MASK + lane] = bits[SEES + lane]
        bits[GEOMETRY + lane] = MISS
        bits[INSTANCE + lane] = MISS
        valid[lane] = -1 if lane < count else 0


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
def add_light(light, number, scene, work):
    """Trace the shadow rays that were aimed, and add the light to every lane that sees it. Returns rays traced.

    number : int, the light's bit in row LIGHT_VISIBILITY
    """
    p, bits, lit = work.packet, work.bits, work.lit
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
        hidden = np.uint32(0) if seen or lit[lane] == 0 else np.uint32(1)
        bits[LIGHT_VISIBILITY + lane] ^= hidden << np.uint32(number)
        p[LR + lane] += p[AR + lane] * red * weight
        p[LG + lane] += p[AG + lane] * green * weight
        p[LB + lane] += p[AB + lane] * blue * weight
    return rays


@inline_kernel
def light_packet(scene, surfaces, normals, colors, uvs, texels, textures, to_linear, points, suns, emission, work):
    """Radiance along each ray of a traced packet, without mirrors, into rows LR, LG, LB. Returns shadow rays."""
    bits = work.bits
    see_sky(surfaces, work)
    if gather_surfaces(surfaces, normals, work) == 0:
        return 0
    finish_surfaces(work)
    if colors is not None or texels is not None:
        colour_surfaces(surfaces, colors, uvs, texels, textures, to_linear, work)
    add_ambient(surfaces, work)
    rays = 0
    for lane in range(16):
        bits[LIGHT_VISIBILITY + lane] = ALL_LIGHTS
    if suns is not None or points is not None:
        start_shadow_rays(work)
    if suns is not None:
        for k in range(suns.shape[0]):
            aim_directional(suns[k], work)
            rays += add_light(suns[k], k, scene, work)
    if points is not None:
        for k in range(points.shape[0]):
            aim_point(points[k], work)
            rays += add_light(points[k], k if suns is None else k + suns.shape[0], scene, work)
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
            share = surfaces.materials[surfaces.mesh_table[bits[INSTANCE + lane], 2], 3]
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
        bits[MASK + lane] = ALL_OBJECTS
        bits[GEOMETRY + lane] = MISS
        bits[INSTANCE + lane] = MISS
    return going


@inline_kernel
def divide_out_colour(work):
    """The lighting alone, into row LIGHT: radiance over base colour, channels summed; the sky's radiance as it is."""
    p = work.packet
    for lane in range(16):
        light = p[LR + lane] + p[LG + lane] + p[LB + lane]
        colour = p[AR + lane] + p[AG + lane] + p[AB + lane]
        coloured = p[HITS + lane] > ZERO and colour > DARKEST
        p[LIGHT + lane] = light / colour if coloured else light * THIRD


@inline_kernel
def note_surfaces(relit, surfaces, work):
    """Fill the rows NORMAL_CODE and SAMPLE_VISIBILITY: normals in the frames of their objects, and visible lights.

    A code is octahedral, 2 x 8 bits. Mirrors get none: their radiance is not their surface's.
    """
    p, bits = work.packet, work.bits
    for lane in range(16):
        if p[HITS + lane] == ZERO or surfaces.materials[surfaces.mesh_table[bits[INSTANCE + lane], 2], 3] > ZERO:
            bits[NORMAL_CODE + lane], bits[SAMPLE_VISIBILITY + lane] = NO_NORMAL, ALL_LIGHTS
            continue
        m = relit[bits[INSTANCE + lane]]
        a, b, c = p[NX + lane], p[NY + lane], p[NZ + lane]
        x, y, z = m[0] * a + m[4] * b + m[8] * c, m[1] * a + m[5] * b + m[9] * c, m[2] * a + m[6] * b + m[10] * c
        size = np.float32(127.0) / max(abs(x) + abs(y) + abs(z), TINY)
        u, v = x * size, y * size
        if z < ZERO:
            u, v = (
                (np.float32(127.0) - abs(v)) * (ONE if u >= ZERO else -ONE),
                (np.float32(127.0) - abs(u)) * (ONE if v >= ZERO else -ONE),
            )
        low, high = np.uint32(round(u) + 128), np.uint32(round(v) + 128)
        bits[NORMAL_CODE + lane] = low | (high << np.uint32(8))
        bits[SAMPLE_VISIBILITY + lane] = bits[LIGHT_VISIBILITY + lane]


@inline_kernel
def write_samples(xy, first, count, samples, kept, relit, work):
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
        sample["object_id"] = np.uint32(p[OBJECT + lane])
        sample["lighting"] = math.sqrt(max(p[LIGHT + lane], ZERO))
        sample["change"] = ZERO
        if relit is not None:
            code = work.bits[NORMAL_CODE + lane]
            sample["normal"][0] = np.int8(np.int32(code & np.uint32(255)) - 128)
            sample["normal"][1] = np.int8(np.int32(code >> np.uint32(8)) - 128)
            sample["light_visibility"] = work.bits[SAMPLE_VISIBILITY + lane]
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
    relit,
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
    relit : (n, 12) float32, rows of eye_from_object, | None; None leaves normals and lamps out of the records
    work : Workspace; its counts are added to (rays by kind, and samples whose radiance was not finite)

    Returns
    -------
    kept : int, samples written; records 0..kept-1 are filled, those with NaN or infinite radiance are left out
    """
    p, bits, counts = work.packet, work.bits, work.counts
    packet, valid, arguments = p.ctypes.data, work.valid.ctypes.data, work.arguments.ctypes.data
    valid_row = work.valid
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
        divide_out_colour(work)
        if relit is not None:
            note_surfaces(relit, surfaces, work)
        if mirrors is not None:
            for lane in range(16):
                p[TR + lane] = p[TG + lane] = p[TB + lane] = ZERO
                p[MIRROR + lane] = ONE
            for _bounce in range(MAX_BOUNCES):
                going = reflect(surfaces, work)
                if going == 0:
                    break
                counts[SECONDARY] += going
                for lane in range(16):  # what a mirror shows has no colour to divide out
                    p[LIGHT + lane] = -ONE if valid_row[lane] != 0 else p[LIGHT + lane]
                intersect16(valid, scene, packet, arguments)
                counts[SHADOW] += light_packet(
                    scene, surfaces, normals, colors, uvs, texels, textures, to_linear, points, suns, emission, work
                )
            reflect(surfaces, work)
            for lane in range(16):
                r, g, b = p[TR + lane], p[TG + lane], p[TB + lane]
                p[LIGHT + lane] = (r + g + b) * THIRD if p[LIGHT + lane] < ZERO else p[LIGHT + lane]
                p[LR + lane], p[LG + lane], p[LB + lane] = r, g, b
        kept = write_samples(xy, first, count, samples, kept, relit, work)
    return kept
