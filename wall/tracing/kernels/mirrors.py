"""Mirrors under direct light: a ray that goes on waits until there are 16 of them, whatever packets they come from.

Rays that a sampler chose lie apart, so that most packets have a mirrored lane or two: followed packet by packet, they
would leave all other lanes idle.
"""

from __future__ import annotations

import math

from wall.core.jit import inline_kernel, lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.bsdf import mirrored, start_off_surface
from wall.tracing.kernels.camera import open_rays
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.surface import material_of
from wall.tracing.kernels.texture_filter import widen_footprints
from wall.tracing.kernels.values import INF, MIRROR_ROOM, ONE, THIRD, ZERO

MAX_BOUNCES = 4  # mirror chains are cut here; what is behind the last mirror is dropped
RAY_ORIGIN, RAY_DIRECTION, RAY_THROUGHPUT, RAY_WIDTH, RAY_SPREAD = (MIRROR_ROOM * row for row in (0, 3, 6, 7, 8))


@inline_kernel
def reflect(mirrors, texels, table, work):
    """Parts what the packet's rays show by themselves from what mirrors show, and turns rays that hit one.

    The rows RADIANCE become what goes into samples, THROUGHPUT the share that is still to come: 0 where no mirror was
    hit. Where there are texels (Textures.texels, else None) cones are widened by the way.
    mirrors = None does nothing; table : (k,) MATERIAL
    """
    if mirrors is not None:
        widen_footprints(texels, work)
        p = work.packet
        for lane in range(16):
            share = ZERO
            if p[rows.HIT + lane] != ZERO:
                share = material_of(table, lane, work)["mirror"]
            own = p[rows.THROUGHPUT + lane] * (ONE - share)
            p[rows.THROUGHPUT + lane] *= share
            r, g, b = xyz(p, rows.RADIANCE_R, lane)
            set_xyz(p, rows.RADIANCE_R, lane, own * r, own * g, own * b)
            if share > ZERO:
                dx, dy, dz = mirrored(p, lane)
                set_xyz(p, embree.DIRECTION_X, lane, dx, dy, dz)
                start_off_surface(p, embree.ORIGIN_X, lane)


@inline_kernel
def start_throughputs(mirrors, work):
    """Sets the row THROUGHPUT of primary rays; mirrors = None does nothing."""
    if mirrors is not None:
        for lane in range(16):
            work.packet[rows.THROUGHPUT + lane] = ONE


@inline_kernel
def begin_mirrors(mirrors, first, count, waiting, texels, work):
    """Has the mirrored lanes of a reflected packet of primary rays wait; returns how many do. None does nothing."""
    if mirrors is not None:
        for lane in range(count):
            waiting += wait(first + lane, 0, lane, waiting, texels, work)
    return waiting


@lane_kernel
def wait(sample, bounce, lane, waiting, texels, work):
    """Writes a lane's ray as number `waiting` of those that wait, and returns 1; 0 where it does not go on."""
    p, rays = work.packet, work.waiting.rays
    through = p[rows.THROUGHPUT + lane]
    if through <= ZERO:
        return 0
    for axis in range(3):
        rays[RAY_ORIGIN + MIRROR_ROOM * axis + waiting] = p[embree.ORIGIN_X + 16 * axis + lane]
        rays[RAY_DIRECTION + MIRROR_ROOM * axis + waiting] = p[embree.DIRECTION_X + 16 * axis + lane]
    rays[RAY_THROUGHPUT + waiting] = through
    if texels is not None:
        rays[RAY_WIDTH + waiting] = p[rows.CONE_WIDTH + lane]
        rays[RAY_SPREAD + waiting] = p[rows.CONE_SPREAD + lane]
    work.waiting.sample[waiting], work.waiting.bounce[waiting] = sample, bounce
    return 1


@inline_kernel
def load_mirrored(mirrors, first, count, texels, work):
    """Fills the packet with `count` rays that wait, from number `first` on; the lanes behind repeat the last one."""
    if mirrors is not None:
        p, rays = work.packet, work.waiting.rays
        for lane in range(16):
            k = first + min(lane, count - 1)
            for axis in range(3):
                p[embree.ORIGIN_X + 16 * axis + lane] = rays[RAY_ORIGIN + MIRROR_ROOM * axis + k]
                p[embree.DIRECTION_X + 16 * axis + lane] = rays[RAY_DIRECTION + MIRROR_ROOM * axis + k]
            p[rows.THROUGHPUT + lane] = rays[RAY_THROUGHPUT + k]
            if texels is not None:
                p[rows.CONE_WIDTH + lane] = rays[RAY_WIDTH + k]
                p[rows.CONE_SPREAD + lane] = rays[RAY_SPREAD + k]
        open_rays(count, False, work)


@inline_kernel
def add_mirrored(mirrors, first, count, samples, texels, work):
    """Adds a reflected packet of rays that waited, from number `first` on, to their samples, and has those that go on
    wait again, from that number on. Returns how many wait then, and whether some sample is not finite.

    What a mirror shows has no colour to divide out: its irradiance is the mean of the channels.
    """
    waiting, bad = first, False
    if mirrors is not None:
        p = work.packet
        for lane in range(count):
            k, bounce = work.waiting.sample[first + lane], work.waiting.bounce[first + lane] + 1
            radiance = samples[k]["radiance"]
            r, g, b = xyz(p, rows.RADIANCE_R, lane)
            r, g, b = radiance[0] + r, radiance[1] + g, radiance[2] + b
            radiance[0], radiance[1], radiance[2] = r, g, b
            samples[k]["sqrt_irradiance"] = math.sqrt(max((r + g + b) * THIRD, ZERO))
            bad |= not abs(r) + abs(g) + abs(b) < INF
            if bounce < MAX_BOUNCES:
                waiting += wait(k, bounce, lane, waiting, texels, work)
    return waiting, bad
