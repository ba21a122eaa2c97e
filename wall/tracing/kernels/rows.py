"""Rows of a packet: where each quantity of 16 rays stands in one flat array, and how lanes are read and written.

A packet is one float32 array, one row of 16 floats a quantity, so that LLVM sees constant distances between rows and
turns loops over lanes into vector code. The Embree ray-hit packet comes first (see embree.py), then the Embree packet
of shadow rays, then the rows below. Rows of x, y, z and of red, green, blue follow each other.
"""

from __future__ import annotations

from wall.core.jit import lane_kernel
from wall.tracing.embree import PACKET, RAY_FLOATS, RAY_HIT_FLOATS

SHADOW_PACKET = RAY_HIT_FLOATS  # offset of the shadow rays' packet

(
    POSITION_X, POSITION_Y, POSITION_Z,  # of the hit, relative to the eye
    SHADING_NORMAL_X, SHADING_NORMAL_Y, SHADING_NORMAL_Z,  # unit, towards the ray
    GEOMETRIC_NORMAL_X, GEOMETRIC_NORMAL_Y, GEOMETRIC_NORMAL_Z,  # unit, towards the ray
    RAY_OFFSET,  # how far secondary rays start off the surface, along the geometric normal
    OFFSET_BASE, OFFSET_SLOPE, OFFSET_STRETCH,  # what it follows from, see surface.finish_surfaces
    ALBEDO_R, ALBEDO_G, ALBEDO_B,
    RADIANCE_R, RADIANCE_G, RADIANCE_B,  # along the newest ray, without what its mirror shows
    THROUGHPUT,  # share of the newest ray's radiance that reaches the eye through the mirrors before it
    LIGHT_WEIGHT,  # factor of a light's irradiance or intensity, besides the albedo; 0: the surface is turned away
    IRRADIANCE,  # radiance over albedo of the first surface: irradiance over pi
    THROUGHPUT_R, THROUGHPUT_G, THROUGHPUT_B,  # of a path, up to its newest ray
    LIGHT_R, LIGHT_G, LIGHT_B,  # what the light at the end of the shadow ray adds to a path
    AIMED,  # 1 where there is such a ray, else 0
    GAINED_R, GAINED_G, GAINED_B,  # what a path's newest ray and the lights on its hit add to its sample
    NEXT_X, NEXT_Y, NEXT_Z,  # direction in which a path goes on
    NEXT_R, NEXT_G, NEXT_B, NEXT_DENSITY,  # its weight, and the density with which it was chosen, see scatter.py
    GOES_ON,  # 1 where a path does, else 0
    LAMP_X, LAMP_Y, LAMP_Z,  # the emitting triangle that is aimed at: corner 0 relative to the eye, then its edges,
    LAMP_1_X, LAMP_1_Y, LAMP_1_Z, LAMP_2_X, LAMP_2_Y, LAMP_2_Z,
    LAMP_R, LAMP_G, LAMP_B,  # emission,
    LAMP_SIDE,  # 1 or -1 by how its corners turn where only its front emits, 0 where both sides do,
    LAMP_CHANCE,  # and the probability with which it was chosen
    LAMP_ROW,  # its number, where they are few
    KEY, NUMBER,  # uint32, of a path's pixel and of its sample there
    CHOICE_NUMBER, ROULETTE_NUMBER, DIRECTION_U, DIRECTION_V, POINT_U, POINT_V, LIGHT_NUMBER, SPARE_NUMBER,  # random
    LIGHT_U, LIGHT_V,  # random, of the light that is aimed at next; only where a scene has such lights
    DENSITY,  # with which a path's newest ray was chosen, 1/sr; -1 where it was mirrored
    CONE_WIDTH,  # of the footprint where the newest ray starts; written only where there are textures
    CONE_SPREAD,  # what it grows by in each unit of the way
    TEXTURED,  # 1 where the newest ray hit a texture; the rows behind it are only written there
    EDGE_1_X, EDGE_1_Y, EDGE_1_Z, EDGE_2_X, EDGE_2_Y, EDGE_2_Z,  # of the triangle, from corner 0, relative to the eye
    MAPPING_U0, MAPPING_U1, MAPPING_U2,  # texture coordinate u at the hit, and by how much it grows along both edges
    MAPPING_V0, MAPPING_V1, MAPPING_V2,
    ALONG_U, ALONG_V, ACROSS_U, ACROSS_V,  # axes of the footprint, texture coordinates
    TEXELS_U, TEXELS_V,  # of the texture that is looked up; 0 where there is none
    METALLIC, ROUGHNESS,  # of the hit; written only where textures say them
    EMISSION_R, EMISSION_G, EMISSION_B,  # likewise
    LONG_U, LONG_V,  # longer axis of the footprint, texture coordinates
    LONG_SQUARE, SHORT_SQUARE,  # squares of the footprint's axes in texels
    HIT,  # 1 where the newest ray hit something, else 0
    LIGHT_VISIBILITY,  # uint32 mask of the newest surface, see core.data.SAMPLE
    SAMPLE_VISIBILITY,  # uint32 mask of the first surface
    NORMAL_CODE,  # uint32, octahedral normal of the first surface: two bytes, each offset by 128
    RAISE_X, RAISE_Y, RAISE_Z,  # see terminator.py; only where there are smooth normals
    PRIMARY_MASK,  # uint32, Embree mask of primary rays; set once
    MATERIAL,  # uint32, row of Materials.rows that the newest ray hit; only where it hit something
    IMPORTANCE,  # of the slots of a light tree's node, not of lanes
) = range(SHADOW_PACKET + RAY_FLOATS, SHADOW_PACKET + RAY_FLOATS + 108 * PACKET, PACKET)  # fmt: skip
PACKET_FLOATS = IMPORTANCE + PACKET


@lane_kernel
def xyz(packet, row, lane):
    """Three float32 of a lane: those of `row` and of the two rows behind it."""
    return packet[row + lane], packet[row + 16 + lane], packet[row + 32 + lane]


@lane_kernel
def set_xyz(packet, row, lane, x, y, z):
    """Write three float32 of a lane, to `row` and to the two rows behind it."""
    packet[row + lane] = x
    packet[row + 16 + lane] = y
    packet[row + 32 + lane] = z
