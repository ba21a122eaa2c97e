"""What a scene takes of memory once it is laid out for tracing, known before that is done."""

from __future__ import annotations

from typing import Any

import numpy as np

from wall.scene.build import Scene
from wall.scene.features import MIP_SHARE
from wall.scene.model import Mesh

# bytes of Embree's trees a primitive, of resident memory before and after they were built: a grid of 1 and 3.9 million
# triangles took 58 and 61, half a million apart from each other 70; 1 million spheres 34, 300,000 segments 33
OF_A_TRIANGLE, OF_A_SPHERE, OF_A_SEGMENT = 65, 34, 33
OF_A_TEXEL = 8  # of an environment: chances, or light by normal


def scene_bytes(scene: Scene) -> int:
    """Bytes of a scene's arrays, of those that kernels read in their place, and of Embree's trees."""
    meshes = sum(_read(mesh) + _laid(mesh) + tree_bytes(mesh) for mesh in scene.meshes)
    texels = sum(texture.texels.nbytes + _nbytes(texture.alpha) for texture in scene.textures)
    mips = MIP_SHARE * sum(texture.texels.nbytes for texture in scene.textures)
    environment = scene.environment
    light = 0 if environment is None else environment.texels.nbytes + OF_A_TEXEL * environment.texels[..., 0].size
    placed = sum(instance.world_from_object.nbytes for instance in scene.instances) + scene.rest.nbytes
    return round(meshes + texels + mips + light + placed)


def tree_bytes(mesh: Mesh) -> int:
    """Bytes of Embree's tree of a mesh."""
    if mesh.segments is not None:
        return OF_A_SEGMENT * mesh.primitives
    return (OF_A_TRIANGLE if mesh.spheres is None else OF_A_SPHERE) * mesh.primitives


def _read(mesh: Mesh) -> int:
    """Of a mesh's own arrays; those of spheres and curves are traced as they are."""
    centres = mesh.spheres is not None and np.shares_memory(mesh.vertices, mesh.spheres)
    own = mesh.triangles, mesh.normals, mesh.uvs, mesh.colors, mesh.spheres, mesh.segments
    return sum(map(_nbytes, own)) + (0 if centres else mesh.vertices.nbytes)


def _laid(mesh: Mesh) -> int:
    """Of the rows of its vertices and triangles among those of all meshes."""
    if mesh.spheres is not None:
        return 0
    return sum(map(_nbytes, (mesh.vertices, mesh.triangles, mesh.normals, mesh.uvs, mesh.colors)))


def _nbytes(array: Any) -> int:
    return 0 if array is None else int(array.nbytes)
