"""Which features a scene uses: what it lacks is not compiled into the tracer."""

from __future__ import annotations

from dataclasses import dataclass

from wall.scene.build import Scene

MOST_RELIT_LIGHTS = 32  # bits of a sample's light visibility mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Needs:
    """One bool for each feature that the tracer can leave out."""

    textures: bool
    metallic_roughness_textures: bool  # on paths
    emission_textures: bool
    normal_textures: bool
    texture_edges: bool  # some texture does not repeat
    uv_sets: bool  # some texture is looked up by other texture coordinates than the first
    alpha: bool  # surfaces that are not there in places
    vertex_colors: bool
    points: bool  # spheres
    curves: bool
    point_colors: bool  # each sphere, or vertex of a curve, has its own
    smooth_normals: bool
    mirrors: bool
    point_lights: bool
    spot_lights: bool
    directional_lights: bool
    suns: bool  # directional lights with an angular diameter, on paths
    environment: bool  # an image in place of the sky
    instancing: bool  # a mesh is placed more than once
    animation: bool
    emission: bool
    change_detection: bool  # a surface may look different from one moment, or one place of the eye, to the next
    paths: bool  # light comes by random ways: samples are noisy
    occlusion: bool  # by one way that nothing near is in; no light is followed
    thin_glass: bool  # on paths
    solid_glass: bool  # on paths; rough or not, which may be edited
    absorption: bool  # inside glass, on paths
    interfaces: bool  # metal, a coat over diffuse light, or thin glass, on paths
    emitters: bool  # triangles that light others, on paths
    cuts: bool  # planes cut the scene open
    relighting: bool  # something moves under what can be relit, and a light visibility mask has a bit for each light


def needs(scene: Scene) -> Needs:
    """Look at what the instances really use: a texture that no placed mesh shows is not needed."""
    meshes = [scene.meshes[k] for k in {instance.mesh for instance in scene.instances}]
    materials = [scene.materials[k] for k in {mesh.material for mesh in meshes}]
    steps = {scene.instances[each.first].mesh for each in scene.series}  # rays that meet them see that they shine
    aimed_at = {k for k in {instance.mesh for instance in scene.instances} - steps if scene.meshes[k].spheres is None}
    mapped = [scene.materials[mesh.material] for mesh in meshes if mesh.uvs is not None]
    slots = [[m.textures[slot] for m in mapped if m.textures[slot] is not None] for slot in range(4)]
    textures = [scene.textures[k] for slot in slots for k in slot if k is not None]
    lit = scene.occlusion is None
    mirrors = lit and any(material.mirror > 0.0 for material in materials)
    emission = lit and any(max(material.emission) > 0.0 for material in materials)
    noisy = scene.path_depth is not None
    paths = lit and noisy
    thin = paths and any(material.thin and material.transmission > 0.0 for material in materials)
    lights = len(scene.point_lights) + len(scene.directional_lights)
    return Needs(
        textures=bool(textures),
        metallic_roughness_textures=paths and bool(slots[1]),
        emission_textures=emission and bool(slots[2]),
        normal_textures=bool(slots[3]),
        texture_edges=any(texture.wrap != ("repeat", "repeat") for texture in textures),
        uv_sets=any(texture.uv_set > 0 for texture in textures),
        alpha=any(material.alpha_mode != "opaque" for material in materials),
        vertex_colors=any(mesh.colors is not None for mesh in meshes if mesh.spheres is None),
        points=any(mesh.spheres is not None and mesh.segments is None for mesh in meshes),
        curves=any(mesh.segments is not None for mesh in meshes),
        point_colors=any(mesh.colors is not None for mesh in meshes if mesh.spheres is not None),
        smooth_normals=any(mesh.normals is not None for mesh in meshes),
        mirrors=mirrors,
        point_lights=bool(scene.point_lights),
        spot_lights=bool(scene.spot_lights),
        directional_lights=bool(scene.directional_lights),
        suns=paths and any(light.angular_diameter > 0.0 for light in scene.directional_lights),
        environment=scene.environment is not None,
        instancing=len(meshes) < len(scene.at_once),
        animation=scene.animated,
        emission=emission,
        change_detection=(scene.animated or mirrors) and not noisy,  # which would take noise for change
        paths=noisy,
        occlusion=not lit,
        thin_glass=thin,
        solid_glass=paths and any(not material.thin and material.transmission > 0.0 for material in materials),
        absorption=paths and any(max(material.absorption) > 0.0 for material in materials),
        interfaces=thin or (paths and any(max(material.metallic, material.specular) > 0.0 for material in materials)),
        emitters=paths and any(max(scene.materials[scene.meshes[k].material].emission) > 0.0 for k in aimed_at),
        cuts=bool(scene.cuts),
        relighting=scene.animated
        and 0 < lights <= MOST_RELIT_LIGHTS
        and not noisy
        and not scene.spot_lights  # objects know where lights are and which way is up, not how they are turned
        and scene.environment is None,
    )
