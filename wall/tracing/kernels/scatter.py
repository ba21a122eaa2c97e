"""How a path goes on from what it hit: which material model holds, in the frame of the shading normal.

A material is glass by the share `transmission`, a perfect mirror by the share `mirror`, and opaque for the rest; a path
takes one of the three. Glass and mirrors are only found by rays that scatter there: nothing is aimed at through them.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import lane_kernel
from wall.core.kernels.hashing import hash_uint32
from wall.tracing import embree
from wall.tracing.kernels import glass, opaque, rows, thin_glass
from wall.tracing.kernels.bsdf import mirrored
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS, by_cosine, frame_of, in_world
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.surface import material_of, seen_from_inside
from wall.tracing.kernels.terminator import facing
from wall.tracing.kernels.textures import roughness_of
from wall.tracing.kernels.values import INV_PI, ONE, ZERO

TWO = np.float32(2.0)
FLATTEST = np.float32(1e-3)  # smallest cosine of a ray to a shading normal; below, the geometric normal is taken


@lane_kernel
def look_at(lane, work):
    """Tangents and normal of a lane's hit, and the direction back along its ray in their frame, z > 0."""
    p = work.packet
    dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
    nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
    cosine = -(dx * nx + dy * ny + dz * nz)
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    flat = cosine < FLATTEST
    nx, ny, nz = gx if flat else nx, gy if flat else ny, gz if flat else nz
    cosine = max(-(dx * nx + dy * ny + dz * nz), FLATTEST) if flat else cosine
    s, t = frame_of(nx, ny, nz)
    out = -(dx * s[0] + dy * s[1] + dz * s[2]), -(dx * t[0] + dy * t[1] + dz * t[2]), cosine
    return s, t, (nx, ny, nz), out


@lane_kernel
def lit_by(x, y, z, lane, table, scattering, work):
    """BSDF times cosine at a lane's hit for light from unit direction (x, y, z), RGB, and its density in scatter.

    table : (k,) MATERIAL; scattering : Scattering
    """
    p = work.packet
    material = material_of(table, lane, work)
    share = share_of_opaque(scattering.parts, material)
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    s, t, n, out = look_at(lane, work)
    to = x * s[0] + y * s[1] + z * s[2], x * t[0] + y * t[1] + z * t[2], x * n[0] + y * n[1] + z * n[2]
    side = facing(scattering.rounded, to[2], gx * x + gy * y + gz * z, lane, p)
    lit = (p[rows.HIT + lane] != ZERO) & (share > ZERO) & (side > ZERO)
    if leave_out(scattering.interface, lit):
        return ZERO, ZERO, ZERO, ZERO
    metal, rough = roughness_of(scattering.metallic_roughness_textures, material, lane, work)
    look = opaque.look_of(material, metal, rough, xyz(p, rows.ALBEDO_R, lane), out[2], scattering.interface)
    r, g, b, density = opaque.evaluate(look, out, to)
    r, g, b = share * r if lit else ZERO, share * g if lit else ZERO, share * b if lit else ZERO
    return r, g, b, share * density if lit else ZERO


@lane_kernel
def leave_out(interface, lit):
    """Whether an unlit lane is left out: where all surfaces are diffuse none is, since branches keep LLVM from making
    a loop over lanes one of vectors. interface : of Scattering
    """
    if interface is None:
        return False
    return not lit


@lane_kernel
def share_of_opaque(parts, material):
    """The share of a surface that is neither glass nor a mirror; parts : Scattering.parts."""
    if parts is None:
        return ONE
    return (ONE - material["transmission"]) * (ONE - material["mirror"])


@lane_kernel
def scatter_lanes(parts, interface, placements, table, scattering, work):
    """Sends the path of each lane that hit something on: rows NEXT_X to NEXT_DENSITY.

    parts, interface : of Scattering, without which all surfaces are diffuse; placements : see Meshes
    """
    if parts is None:  # noqa: SIM102  (numba leaves a branch out only for a bare test for None)
        if interface is None:
            scatter_diffuse(scattering.rounded, work)
            return
    p = work.packet
    for lane in range(16):
        if p[rows.HIT + lane] != ZERO:
            (x, y, z), (r, g, b), density = scatter(lane, placements, table, scattering, work)
            set_xyz(p, rows.NEXT_X, lane, x, y, z)
            set_xyz(p, rows.NEXT_R, lane, r, g, b)
            p[rows.NEXT_DENSITY + lane] = density


@lane_kernel
def scatter_diffuse(rounded, work):
    """As `scatter` where all surfaces are diffuse, all lanes at once; rounded : Scattering.rounded."""
    p = work.packet
    for lane in range(16):
        s, t, n, _ = look_at(lane, work)
        to = by_cosine(p[rows.DIRECTION_U + lane], p[rows.DIRECTION_V + lane])
        x, y, z = in_world(to, s, t, n)
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        allowed = facing(rounded, to[2], x * gx + y * gy + z * gz, lane, p) > ZERO
        r, g, b = xyz(p, rows.ALBEDO_R, lane)
        set_xyz(p, rows.NEXT_X, lane, x, y, z)
        set_xyz(p, rows.NEXT_R, lane, r if allowed else ZERO, g if allowed else ZERO, b if allowed else ZERO)
        p[rows.NEXT_DENSITY + lane] = to[2] * INV_PI


@lane_kernel
def scatter(lane, placements, table, scattering, work):
    """A unit direction in which a lane's path goes on, its weight, RGB, and its density; -1 where it is mirrored.

    placements : see Meshes; table : (k,) MATERIAL; scattering : Scattering
    """
    p = work.packet
    choice, u, v = p[rows.CHOICE_NUMBER + lane], p[rows.DIRECTION_U + lane], p[rows.DIRECTION_V + lane]
    material = material_of(table, lane, work)
    albedo = xyz(p, rows.ALBEDO_R, lane)
    metal, rough = roughness_of(scattering.metallic_roughness_textures, material, lane, work)
    s, t, n, out = look_at(lane, work)
    through, mirror = material["transmission"], (ONE - material["transmission"]) * material["mirror"]
    if through <= choice < through + mirror:
        return mirrored(p, lane), (ONE, ONE, ONE), -ONE
    if choice < through:
        numbers = choice / through, u, v
        to, weight = through_glass(
            scattering.thin_glass, scattering.solid_glass, scattering.interface, rough, out, numbers, lane, placements,
            material, work,
        )  # fmt: skip
        density = -ONE
    else:
        rest = ONE - through - mirror
        look = opaque.look_of(material, metal, rough, albedo, out[2], scattering.interface)
        to, weight, density = opaque.sample(look, out, (choice - through - mirror) / rest, u, v)
        density = density * rest if density > ZERO else density
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    x, y, z = in_world(to, s, t, n)
    side = x * gx + y * gy + z * gz
    if (side > ZERO) != (to[2] > ZERO):  # the shading normal sends it to the wrong side
        if density < ZERO and rough >= FLATTEST_ROUGHNESS:  # of rough glass, which would lose it at every bounce
            return (x - TWO * side * gx, y - TWO * side * gy, z - TWO * side * gz), weight, density
        allowed = density > ZERO and facing(scattering.rounded, to[2], side, lane, p) > ZERO
        weight = weight if allowed else (ZERO, ZERO, ZERO)
    return (x, y, z), weight, density


@lane_kernel
def through_glass(thin, solid, interface, rough, out, numbers, lane, placements, material, work):
    """A direction in which a path goes on from glass of a MATERIAL and its weight, RGB.

    thin, solid, interface : see Scattering; numbers : three in [0, 1); placements : see Meshes
    """
    albedo, bits = xyz(work.packet, rows.ALBEDO_R, lane), work.bits
    if thin is not None:  # noqa: SIM102  (numba leaves a branch out only for a bare test for None)
        if material["thin"] > ZERO:
            choice, u, v = numbers
            return thin_glass.sample(albedo, material["ior"], rough, interface, out, choice, u, v)
    if solid is not None:
        eta = ONE / material["ior"] if seen_from_inside(placements, lane, work) else material["ior"]
        seed = hash_uint32(hash_uint32(bits[rows.KEY + lane], bits[rows.NUMBER + lane]), bits[rows.DIRECTION_U + lane])
        return glass.sample(albedo, eta, rough, out, numbers, seed)
    return out, (ZERO, ZERO, ZERO)
