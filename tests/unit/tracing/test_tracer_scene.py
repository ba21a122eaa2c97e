"""What a scene takes in memory for tracing: what its objects show, counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_scenes import instance, material, quad, sphere_mesh

from wall.scene.build import Scene, assemble
from wall.scene.model import Material, Mesh, Source, Texture, TextureSet
from wall.tracing.tracer_scene import make_tracer_scene

TEXTURED, PLAIN = 0, 1
TEXEL = np.full((1, 1, 3), 200, np.uint8)


def textured(texture: int) -> Material:
    return replace(material(0.5, 0.5, 0.5), textures=TextureSet(base_color=texture))


def ball(number: int) -> Mesh:
    """With texture coordinates, which its material does not look at."""
    mesh = sphere_mesh(number, segments=24)
    return replace(mesh, uvs=np.zeros((len(mesh.vertices), 2), np.float32))


def scene(*meshes: Mesh, placed: tuple[int, ...], textures: int = 1) -> Scene:
    """Materials 0 to `textures` - 1 show a texture each, the next one none."""
    return assemble(
        Source(
            meshes=meshes,
            materials=(*map(textured, range(textures)), material(0.1, 0.2, 0.3)),
            textures=tuple(Texture(name=f"t{k}", texels=np.tile(TEXEL, (8 * k + 1, 1, 1))) for k in range(textures)),
            instances=tuple(instance(k, at=(float(k), 0.0, 0.0)) for k in placed),
        )
    )


def test_one_textured_quad_gives_texture_coordinates_to_its_four_vertices_alone() -> None:
    coloured = quad(1.0, 1.0, material=PLAIN, colors=np.ones((4, 3)))
    made = make_tracer_scene(scene(ball(PLAIN), quad(1.0, 1.0, uvs=True), coloured, placed=(0, 1, 2))).surfaces
    assert len(made.uvs) == 4
    assert len(made.colors) == 8  # it follows the textured one
    assert len(made.normals) == 8 + len(ball(PLAIN).vertices)


def test_meshes_that_are_not_placed_and_their_textures_take_nothing() -> None:
    square, other, unused = quad(1.0, 1.0, uvs=True), quad(1.0, 1.0, material=1, uvs=True), ball(PLAIN + 1)
    made = scene(unused, other, square, placed=(2, 2), textures=2)
    assert made.meshes == (square,)
    assert [texture.name for texture in made.textures] == ["t0"]
    assert [each.textures.base_color for each in made.materials] == [0, None, None]
    assert made.notes == ("of no object that is placed, left out: 2 meshes and 1 texture",)
    traced = make_tracer_scene(made)
    surfaces, textures = traced.surfaces, traced.materials.textures
    assert (len(surfaces.meshes.triangles), len(surfaces.uvs), len(textures.texels)) == (2, 4, 1)
    counted = surfaces.meshes.triangles, surfaces.uvs, textures.texels, textures.linear_of_srgb, textures.value_of_byte
    assert traced.bytes >= sum(array.nbytes for array in counted)


def test_a_texture_is_kept_for_the_one_of_two_meshes_of_its_material_that_is_mapped() -> None:
    made = scene(replace(ball(TEXTURED), uvs=None), quad(1.0, 1.0, uvs=True), placed=(0, 1))
    assert len(made.textures) == 1
    assert made.notes == ()
    assert not scene(replace(ball(TEXTURED), uvs=None), placed=(0,)).textures
