"""What tracing kernels read and write, as named values: camera, surfaces, materials, lights, workspace.

None stands for a feature that the scene lacks: numba leaves out a branch that tests an argument for None, so that a
scene without textures runs a kernel without textures. Kernels see the constants here as such.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64, Samples
from wall.tracing.embree import NO_HIT

INF = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
MISS = np.uint32(NO_HIT)
INV_PI, THIRD = np.float32(1.0 / math.pi), np.float32(1.0 / 3.0)

# Embree ray masks
EVERY_OBJECT = 0xFFFFFFFF  # hit by rays that any object stops
EVERY_OBJECT_MASK = np.uint32(EVERY_OBJECT)
SEEN, UNSEEN = 1, 2  # objects that primary rays may hit, and those that only shadow rays and mirrors know

ALL_LIGHTS = np.uint32(0xFFFFFFFF)  # light visibility mask where nothing is hidden
NO_NORMAL = np.uint32(0x8080)  # code of the normal (0, 0): of the sky and of mirrors

# counts of a workspace
PRIMARY_RAYS, SHADOW_RAYS, SECONDARY_RAYS, BAD_SAMPLES = range(4)
COUNTS = 4

RAY_ROWS = 12  # of Paths.rays
MIRROR_ROOM, MIRROR_ROWS = 32, 9  # of WaitingRays: 15 that wait for a full packet, and those of the packet that comes

# columns of Surfaces.mesh_table, and the flags in the last of them
FIRST_TRIANGLE, FIRST_VERTEX, MATERIAL_ROW, MESH_FLAGS = range(4)
FIRST_SPHERE = FIRST_VERTEX  # of spheres: their first row of Surfaces.point_colors
FIRST_SEGMENT = FIRST_TRIANGLE  # of curves: their first row of Surfaces.segments
HAS_NORMALS, HAS_COLORS, HAS_UVS, HAS_POINT_COLORS, HAS_SEGMENTS = 1, 2, 4, 8, 16
# columns of Surfaces.placements behind the nine of normal_from_object
PLACEMENT_BASE, PLACEMENT_SLOPE, PLACEMENT_STRETCH = 9, 10, 11
PLACEMENT_COLUMNS = 12
EMITTER_COLUMNS = 14  # of Emitters.placed

# a material's textures, in the order of scene.model.TEXTURE_FIELDS, and what is beyond their edges
BASE_COLOR, METALLIC_ROUGHNESS, EMISSION, NORMAL = range(4)
REPEAT, CLAMP, MIRROR = range(3)

# One material. To add a property of surfaces (roughness, metalness, ...): a field here, filled by tracer_scene.py from
# scene.model.Material; scatter.py and what it calls read it.
MATERIAL = np.dtype(
    [
        ("base_color", np.float32, (3,)),  # linear RGB reflectance
        ("mirror", np.float32),  # share of the ray that is mirrored, 0..1
        ("emission", np.float32, (3,)),  # W sr^-1 m^-2
        ("emits_behind", np.float32),  # 1: both sides emit; 0: the front alone, whose corners go counterclockwise
        ("metallic", np.float32),  # 0..1, this and the following for paths alone; see scene.model.Material
        ("roughness", np.float32),
        ("specular", np.float32),
        ("ior", np.float32),
        ("transmission", np.float32),
        ("thin", np.float32),  # 1: glass is a sheet
        ("absorption", np.float32, (3,)),  # 1 / world units
        ("normal_scale", np.float32),
        # textures, by the numbers BASE_COLOR ... NORMAL
        ("first_texel", np.int32, (4,)),  # row of Materials.texels, of the finest level; coarser ones follow it
        ("texture_width", np.int32, (4,)),  # texels, of the finest level; 0 = no texture
        ("texture_height", np.int32, (4,)),
        ("wrap_u", np.int32, (4,)),  # REPEAT, CLAMP or MIRROR
        ("wrap_v", np.int32, (4,)),
        ("uv_set", np.int32, (4,)),  # see scene.model.Texture
    ]
)


class Recording(NamedTuple):
    """What Embree was asked, in order, with room for n packets of rays: for measuring alone."""

    packets: NDArray[np.uint32]  # (n, RAY_HIT_FLOATS) bits, 64-byte aligned
    valid: NDArray[np.int32]  # (n, 16) -1 or 0, likewise aligned
    shadow: NDArray[np.bool_]  # (n,) asked for anything in the way, not for the nearest hit
    flags: NDArray[np.uint32]  # (n,) of the query
    asked: NDArray[np.int64]  # (1,) queries so far, also beyond the room


class Trees(NamedTuple):
    """What rays may meet: Embree's trees over the instances, and planes that cut the scene open; for one thread.

    What only some runs have is here and not in Workspace, which all kernels take: these are compiled once for all runs.
    """

    at_rest: int  # handle of the tree whose instances have their own numbers
    moving: int  # handle of a tree over those that move, where rebuilding the other would take long; 0: there is none
    objects: NDArray[np.uint32]  # (m,) numbers of the instances in `moving`
    cuts: Float32 | None  # (k, 4) planes, unit normal and distance from the eye, see scene.cuts; None: there are none
    recording: Recording | None = None  # of queries; None: nobody measures


class RayFrame(NamedTuple):
    """Primary rays of a panel: direction A + X B + Y C at virtual-screen position (X, Y), from the eye at 0."""

    frame: Float64  # (3, 3) rows A, B, C
    corner: Float64  # (2,) the panel's top left corner on the virtual screen, pixels
    footprint: float  # pixels, edge of the square whose mean of a texture a sample shows
    lens: Float32 | None  # (3, 3) right and up times its radius, ahead over the distance in focus; None: a pinhole


class Meshes(NamedTuple):
    """Meshes of all instances; they stand one after another in the vertex and triangle arrays."""

    triangles: NDArray[np.uint32]  # (t, 3) vertex numbers within the mesh
    mesh_table: NDArray[np.uint32]  # (n, 4) of each instance, columns FIRST_TRIANGLE ... MESH_FLAGS
    placements: Float32  # (n, 12) normal_from_object (9, row major), then PLACEMENT_BASE, _SLOPE, _STRETCH
    eye_from_object: Float32  # (n, 12) row major 3x4


class Surfaces(NamedTuple):
    """Meshes, and what not every scene's have."""

    meshes: Meshes
    normals: Float32 | None  # (v, 3) shading normals
    colors: Float32 | None  # (v, 3) linear RGB
    point_colors: Float32 | None  # (s, 3) linear RGB of the spheres, or vertices of curves, that have such colours
    segments: NDArray[np.uint32] | None  # (c,) of curves: the first of two vertices; None: none have colours
    uvs: Float32 | None  # (v, 2 n), n sets
    vertices: Float32 | None  # (v, 3) within the mesh, object space; None without textures, emitters and normals
    relit: bool | None  # None leaves normals and visible lights out of samples


class Textures(NamedTuple):
    """What textures are looked up in."""

    texels: NDArray[np.uint8] | None  # (p, 3) of all textures and their mip levels, as scene.model.Texture has them
    linear_of_srgb: Float32  # (256,) linear light of an sRGB byte
    value_of_byte: Float32  # (256,) 0..1
    edges: bool | None  # None: all textures repeat
    uv_sets: bool | None  # None: all textures are looked up by set 0


class Scattering(NamedTuple):
    """What light and paths meet, besides what every material has."""

    metallic_roughness_textures: bool | None  # None: there are none, or no path needs them
    thin_glass: bool | None  # None: there is none, or no path meets it
    solid_glass: bool | None  # the same
    interface: Float32 | None  # (r, c, 2), see interface.py; None: no path meets an interface
    parts: bool | None  # None: nothing is glass or a mirror, or in part, so all surfaces are opaque
    rounded: bool | None  # None: no mesh has normals at its vertices, so no ray starts above its triangle


class Materials(NamedTuple):
    """What surfaces look like."""

    rows: Samples  # (k,) MATERIAL
    textures: Textures
    emission_textures: bool | None
    normal_textures: bool | None
    emits: bool | None  # None: nothing emits
    mirrors: bool | None  # None: nothing mirrors
    absorbs: bool | None  # None: no glass absorbs, or no path goes through it
    scattering: Scattering


class LightTree(NamedTuple):
    """A tree over m lights, see kernels.light_tree; its nodes level by level, the root first."""

    nodes: Float32  # (nodes, COLUMNS)
    first: NDArray[np.int64]  # (levels,) first node of each
    order: NDArray[np.int64]  # (m,) row of the light at each place
    place: NDArray[np.int64]  # (m,) of each row
    offset: Float32  # (3,) the eye, from the tree's origin


class ManyLights(NamedTuple):
    """Lights of which a tree chooses one for each surface of a path."""

    rows: Float32  # (p, 6) or (q, 11), as Lights.points or .spots
    tree: LightTree


class Emitters(NamedTuple):
    """Triangles that emit, instance by instance in the order of their meshes' triangles; m in all."""

    first: NDArray[np.int64]  # (n,) of each instance: the row of its triangle 0; -1: it emits nothing
    instance: NDArray[np.uint32]  # (m,)
    chance: Float32  # (m,) probability of being chosen, sums to 1
    cumulated: Float64  # (m,) sums of chance up to and with this row
    tree: LightTree | None  # chooses in place of chance; None: there are few
    placed: Float32 | None  # (m, EMITTER_COLUMNS) rows LAMP_X to LAMP_CHANCE, of the newest batch; None: tree chooses


class Paths(NamedTuple):
    """A batch of paths, with room for n."""

    rays: Float32  # RAY_ROWS rows of 16 for each 16 rays: origin, direction, throughput, density, cone width and spread
    sample: NDArray[np.int64]  # (n + 16,) which of the batch's samples a ray belongs to
    key: NDArray[np.uint32]  # (n + 16,) of its pixel, for random numbers
    radiance: Float32  # (n, 3) of each sample
    normals: Float32 | None  # (n, 3) of the surfaces that rays start from, to their side; None: no tree of emitters
    depth: int  # most surfaces that scatter one path
    number: NDArray[np.uint32]  # (n,) of each sample among those of its pixel
    seed: np.uint32


class Occlusion(NamedTuple):
    """What ambient occlusion looks for."""

    distance: np.float32  # world units, as far as surfaces hide light
    white: bool | None  # None: surfaces have their colours


class Environment(NamedTuple):
    """A lat-long image (h, 2 h) in place of the sky; what the integrator does not read has no entries."""

    texels: Float32  # (h, w, 3) radiance
    middle: np.float32  # u of the direction -z
    row_sums: Float32  # (h + 1,) chance of all rows before each: 0 to 1
    column_sums: Float32  # (h, w + 1) of each row: chance of all its texels before each
    irradiance: Float32  # (n, n, 3) over pi, by the normal on an unfolded octahedron
    strength: np.float32  # factor of all of its light, 1 as configured


class Lights(NamedTuple):
    """What shines: lights by number, directional ones, then points, then spots; surfaces; and the sky."""

    directional: Float32 | None  # (s, 6) unit direction towards the light, irradiance
    points: Float32 | None  # (p, 6) position relative to the eye, intensity
    spots: Float32 | None  # (q, 11) as points, then unit direction of its light, and a, b of SpotLight.falloff
    many_points: ManyLights | None  # in place of points
    many_spots: ManyLights | None
    suns: Float32 | None  # (r, 7) directional lights that are discs: direction, irradiance, 1 - cosine of the radius
    emitters: Emitters | None  # None: light sources are not aimed at
    environment: Environment | None  # in place of the sky
    sky: Float32  # (3, 3) radiance of zenith, horizon, ground
    sky_irradiance: Float32  # (SKY_STEPS + 1, 3) over pi, by the normal's height


class WaitingRays(NamedTuple):
    """Rays that mirrors send on, until a packet of them is full, see mirrors.py."""

    rays: Float32  # (MIRROR_ROWS * MIRROR_ROOM,): origins, directions, throughputs, widths and spreads of their cones
    sample: NDArray[np.int64]  # (MIRROR_ROOM,) record that they belong to
    bounce: NDArray[np.int64]  # (MIRROR_ROOM,) 0 where the first mirror sent them


class Workspace(NamedTuple):
    """One thread's packet, 64-byte aligned; see workspace() in tracer.py, which sets the rows that never change."""

    packet: Float32  # (rows.PACKET_FLOATS,)
    bits: NDArray[np.uint32]  # the same memory
    valid: NDArray[np.int32]  # (16,) -1 or 0, lanes of the ray-hit packet
    shadow_valid: NDArray[np.int32]  # (16,) -1 or 0, lanes of the shadow packet
    arguments: NDArray[np.uint32]  # RTCIntersectArguments
    hit_before: NDArray[np.uint32]  # (16,) scratch of trees.closest_hits
    counts: NDArray[np.int64]  # (4,) PRIMARY_RAYS ... BAD_SAMPLES
    waiting: WaitingRays
