"""Model files, written here byte by byte or by trimesh: what must load, and what must be refused or repaired aloud."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from wall.config.materials import AmbientOcclusionConfig, DiffuseConfig, PathConfig
from wall.config.scene import SceneConfig, Up
from wall.core.errors import SceneError
from wall.scene.build import Scene, build
from wall.scene.loading import load, strip_triangles
from wall.scene.model import Source

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def scene_of(path: Path, **more: Any) -> Scene:
    return build(SceneConfig(source=path.name, **more), path.parent)


def world_triangles(scene: Scene | Source) -> np.ndarray:
    """(t, 3, 3) every placed triangle's corners, world, float64."""
    placed = []
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
        points = mesh.vertices.astype(np.float64) + mesh.origin
        placed.append((points @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles])
    return np.concatenate(placed)


def test_glb_keeps_one_mesh_for_many_nodes(tmp_path: Path) -> None:
    world = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=1)
    places = [trimesh.transformations.translation_matrix([3.0 * k, 0, 0]) for k in range(5)]
    world.add_geometry(ball, node_name="ball 0", geom_name="ball")
    for k, place in enumerate(places[1:], start=1):
        world.graph.update(frame_to=f"ball {k}", geometry="ball", matrix=place)
    world.export(tmp_path / "balls.glb")
    scene = scene_of(tmp_path / "balls.glb")
    assert (len(scene.meshes), len(scene.instances), scene.triangles) == (1, 5, 5 * len(ball.faces))
    assert {i.name for i in scene.instances} == {f"ball {k}" for k in range(5)}
    np.testing.assert_allclose(scene.center, [6.0, 0.0, 0.0], atol=1e-6)
    assert scene.radius == pytest.approx(7.0, abs=1e-5)


def test_glb_transforms_of_nested_nodes_chain(tmp_path: Path) -> None:
    world = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    shift = trimesh.transformations.translation_matrix([10.0, 0, 0])
    world.graph.update(frame_from="world", frame_to="arm", matrix=turn)
    world.add_geometry(trimesh.creation.box(), node_name="hand", parent_node_name="arm", transform=shift)
    world.export(tmp_path / "arm.glb")
    np.testing.assert_allclose(scene_of(tmp_path / "arm.glb").center, [0.0, 0.0, -10.0], atol=1e-6)


def test_glb_base_colour_factor_is_linear_and_texture_is_kept(tmp_path: Path) -> None:
    image = Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]], np.uint8))
    factor = [128, 64, 255, 255]
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=factor, baseColorTexture=image, name="m")
    uv = np.array([[0.0, 0], [1, 0], [0, 1]])
    mesh = trimesh.Trimesh(np.eye(3), [[0, 1, 2]], process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    mesh.export(tmp_path / "painted.glb")
    source = load(tmp_path / "painted.glb")
    (found,) = source.materials
    np.testing.assert_allclose(found.base_color, np.array([128, 64, 255]) / 255, atol=1 / 510)  # bytes in trimesh
    assert found.textures.base_color == 0
    np.testing.assert_array_equal(source.textures[0].texels, np.asarray(image))
    np.testing.assert_allclose(source.meshes[0].uvs, uv, atol=1e-6)


def with_materials(path: Path, *materials: trimesh.visual.material.PBRMaterial) -> Path:
    """A glTF file of one triangle for each material."""
    world = trimesh.Scene()
    for k, material in enumerate(materials):
        mesh = trimesh.Trimesh(np.eye(3) + k, [[0, 1, 2]], process=False)
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.eye(3)[:, :2], material=material)
        world.add_geometry(mesh)
    world.export(path)
    return path


def test_glb_metal_is_noted_once_a_file_under_direct_light_alone(tmp_path: Path) -> None:
    """A metallic factor that is left out is 1, says glTF; a texture's blue channel multiplies it."""
    pbr = trimesh.visual.material.PBRMaterial
    rust, paint = (Image.new("RGB", (2, 2), (0, 128, blue)) for blue in (200, 0))
    source = load(
        car := with_materials(
            tmp_path / "car.glb",
            pbr(name="chrome", metallicFactor=1.0, roughnessFactor=0.1),
            pbr(name="rubber", metallicFactor=0.0),
            pbr(name="rim", baseColorFactor=[200, 200, 200, 255]),
            pbr(name="door", metallicRoughnessTexture=rust),
            pbr(name="hood", metallicRoughnessTexture=paint),
            pbr(name="leaf", metallicFactor=0.0, alphaMode="MASK", alphaCutoff=0.5),
            pbr(name="glass", metallicFactor=0.0, alphaMode="BLEND"),
            pbr(name="floor", metallicFactor=0.0, alphaMode="OPAQUE"),
        )
    )
    assert [note for note in scene_of(car).notes if "metal" in note] == [
        "3 materials are metal, glass or shining (chrome, rim, door): direct light shows metal and glass matt, and "
        "what shines lights nothing; --integrator path, or scene: {integrator: {method: path}}, shows them"
    ]
    for integrator in (PathConfig(method="path"), AmbientOcclusionConfig(method="ambient_occlusion")):
        assert not [note for note in scene_of(car, integrator=integrator).notes if "metal" in note]
    matt = (DiffuseConfig(type="diffuse", material="*"),)
    assert not [note for note in scene_of(car, materials=matt).notes if "metal" in note]
    modes = {material.name: material.alpha_mode for material in source.materials}
    assert (modes["leaf"], modes["glass"], modes["floor"]) == ("mask", "blend", "opaque")


def test_glb_without_metal_has_no_note_of_it(tmp_path: Path) -> None:
    plain = trimesh.visual.material.PBRMaterial(name="plain", metallicFactor=0.0, doubleSided=True)
    assert scene_of(with_materials(tmp_path / "plain.glb", plain)).notes == ()


def test_obj_with_mtl_and_texture(tmp_path: Path) -> None:
    Image.new("RGB", (4, 2), (10, 20, 30)).save(tmp_path / "wood.png")
    written(tmp_path / "m.mtl", "newmtl oak\nKd 0.25 0.5 1.0\nmap_Kd wood.png\n")
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl oak\nf 1/1 2/2 3/3\n"
    source = load(written(tmp_path / "table.obj", text))
    assert source.materials[0].base_color == (0.25, 0.5, 1.0)
    assert source.textures[0].texels.shape == (2, 4, 3)
    np.testing.assert_allclose(source.meshes[0].uvs, [[0, 0], [1, 0], [0, 1]])
    assert source.materials[0].textures.base_color == 0


def test_obj_in_another_encoding_is_read(tmp_path: Path) -> None:
    source = load(written(tmp_path / "e.obj", b"# cr\xe9\xe9 \xe0 la main\n" + TRIANGLE.encode()))
    assert len(source.meshes[0].triangles) == 1


@pytest.mark.parametrize("present", [None, b"no image at all"], ids=["missing", "broken"])
def test_bad_texture_file_is_noted_and_the_plain_colour_used(tmp_path: Path, present: bytes | None) -> None:
    if present:
        written(tmp_path / "wood.png", present)
    written(tmp_path / "m.mtl", "newmtl oak\nKd 0.25 0.5 1.0\nmap_Kd wood.png\n")
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl oak\nf 1/1 2/2 3/3\n"
    source = load(written(tmp_path / "table.obj", text))
    assert source.materials[0].textures.base_color is None
    assert source.materials[0].base_color == (0.25, 0.5, 1.0)
    assert any("image" in note for note in source.notes)


def test_missing_material_file_is_noted(tmp_path: Path) -> None:
    source = load(written(tmp_path / "a.obj", "mtllib gone.mtl\nusemtl oak\n" + TRIANGLE))
    assert any("gone.mtl" in note for note in source.notes)


COW = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


def test_truncated_texture_is_noted(tmp_path: Path) -> None:
    chance = np.random.default_rng(1).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    Image.fromarray(chance).save(tmp_path / "wood.png")
    written(tmp_path / "wood.png", (tmp_path / "wood.png").read_bytes()[:3000])
    written(tmp_path / "m.mtl", "newmtl oak\nmap_Kd wood.png\n")
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl oak\nf 1/1 2/2 3/3\n"
    source = load(written(tmp_path / "table.obj", text))
    assert source.textures == ()
    assert any("cannot be decoded" in note for note in source.notes)


@pytest.mark.parametrize(("alpha", "noted"), [(0, True), (255, False)])
def test_texture_with_alpha_is_opaque_and_noted_where_that_shows(tmp_path: Path, alpha: int, noted: bool) -> None:
    Image.new("RGBA", (2, 2), (10, 20, 30, alpha)).save(tmp_path / "cow_skin.png")
    written(tmp_path / "cow.mtl", "newmtl skin\nmap_Kd cow_skin.png\n")
    source = load(written(tmp_path / "cow.obj", "mtllib cow.mtl\nusemtl skin\n" + COW))
    np.testing.assert_array_equal(source.textures[0].texels[0, 0], [10, 20, 30])
    assert any("alpha" in note for note in source.notes) == noted


def test_an_image_beside_a_model_is_no_texture_unless_the_file_names_it(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (10, 20, 30)).save(tmp_path / "cow.png")  # as `wall render cow.obj -o cow.png` writes it
    source = load(written(tmp_path / "cow.obj", COW))
    assert source.textures == ()
    assert any("names no image" in note for note in source.notes)


def test_obj_objects_stay_apart_and_quads_become_triangles(tmp_path: Path) -> None:
    text = "o door\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no sill\nv 0 0 1\nv 1 0 1\nv 1 1 1\nf 5 6 7\n"
    scene = scene_of(written(tmp_path / "house.obj", text))
    assert sorted(i.name for i in scene.instances) == ["door", "sill"]
    assert scene.triangles == 3


def test_polygons_of_mixed_sizes_are_triangulated(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nv 0 0 1\nf 1 2 3 4 5\nf 1 2 6\n"
    triangles = world_triangles(load(written(tmp_path / "fan.obj", text)))
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(5.0 + 1.0)


def test_ply_vertex_colours_become_linear(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    body = "0 0 0 255 0 188\n1 0 0 255 0 188\n0 1 0 255 0 188\n3 0 1 2\n"
    source = load(written(tmp_path / "c.ply", header + body))
    assert source.meshes[0].colors is not None
    expected = ((188 / 255 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
    np.testing.assert_allclose(source.meshes[0].colors, [[1.0, 0.0, expected]] * 3, atol=1e-6)


def test_ply_face_colours_colour_whole_triangles(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 2\nproperty list uchar int vertex_indices\n"
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n"
    source = load(written(tmp_path / "f.ply", header + body))
    (mesh,) = source.meshes
    assert mesh.colors is not None
    np.testing.assert_array_equal(mesh.colors[mesh.triangles], [[[1, 0, 0]] * 3, [[0, 1, 0]] * 3])


def test_ply_that_stores_strips(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    source = load(written(tmp_path / "s.ply", header + "0 0 0\n1 0 0\n0 1 0\n1 1 0\n5 5 0\n8 0 1 2 3 -1 2 3 4\n"))
    triangles = world_triangles(source)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert len(triangles) == 3
    assert (normals[:2, 2] > 0).all()


def test_strips_turn_every_second_triangle_and_begin_again_after_a_break() -> None:
    strip = np.array([0, 1, 2, 3, -1, 4, 5, 6, 7])
    np.testing.assert_array_equal(strip_triangles(strip), [[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]])
    assert strip_triangles(np.array([1, 2])).shape == (0, 3)


@pytest.mark.parametrize(("up", "top"), [("x", 0), ("y", 1), ("z", 2), ("-x", 3), ("-y", 4), ("-z", 5)])
def test_models_are_turned_so_that_what_is_up_in_them_is_y(tmp_path: Path, up: Up, top: int) -> None:
    corners = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    text += "".join(f"f {k} {k % 6 + 1} {(k + 1) % 6 + 1}\n" for k in range(1, 7))
    (instance,) = load(written(tmp_path / "cross.obj", text), up).instances
    turn = instance.world_from_object[:3, :3]
    np.testing.assert_array_equal(turn @ corners[top], [0, 1, 0])
    assert np.linalg.det(turn) == 1.0, "it is not mirrored"


def test_an_stl_is_taken_to_have_z_up_and_what_is_taken_is_said_until_it_is_told(tmp_path: Path) -> None:
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.stl")
    guessed, told = load(tmp_path / "box.stl"), load(tmp_path / "box.stl", "y")
    for source, height in ((guessed, 3.0), (told, 2.0)):
        assert np.ptp(world_triangles(source)[..., 1]) == pytest.approx(height)
    assert any("z is taken to be" in note for note in guessed.notes)
    assert not any("taken to be" in note for note in told.notes)
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.glb")
    of_gltf = load(tmp_path / "box.glb", "z")
    assert np.ptp(world_triangles(of_gltf)[..., 1]) == pytest.approx(2.0), "glTF says y"
    assert "box.glb: glTF says that y is up; scene.up or --up changes nothing here" in of_gltf.notes


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_stl_soup_is_welded_and_smoothed(tmp_path: Path, kind: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.export(tmp_path / "ball.stl", file_type=kind)
    (mesh,) = load(tmp_path / "ball.stl").meshes
    assert (len(mesh.vertices), len(mesh.triangles)) == (len(ball.vertices), len(ball.faces))
    assert mesh.normals is not None
    outward = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None]
    assert np.einsum("ij,ij->i", mesh.normals, outward).min() > 0.999


def test_normals_of_the_file_are_kept(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 3 4\nf 1//1 2//1 3//1\n"
    (mesh,) = load(written(tmp_path / "n.obj", text)).meshes
    np.testing.assert_allclose(mesh.normals, [[0, 0.6, 0.8]] * 3, atol=1e-7)


def test_mirroring_transform_is_kept(tmp_path: Path) -> None:
    world = trimesh.Scene()
    shape = trimesh.creation.box().apply_translation([2.0, 0, 0])
    world.add_geometry(shape, node_name="left", transform=np.diag([-1.0, 1, 1, 1]))
    world.export(tmp_path / "mirror.glb")
    scene = scene_of(tmp_path / "mirror.glb")
    assert np.linalg.det(scene.instances[0].world_from_object[:3, :3]) == pytest.approx(-1.0)
    np.testing.assert_allclose(scene.center, [-2.0, 0, 0], atol=1e-6)


def test_flattened_object_is_left_out_with_a_note(tmp_path: Path) -> None:
    world = trimesh.Scene()
    world.add_geometry(trimesh.creation.box(), node_name="good")
    world.add_geometry(trimesh.creation.box(), node_name="squashed", transform=np.diag([1.0, 0, 1, 1]))
    world.export(tmp_path / "two.glb")
    source = load(tmp_path / "two.glb")
    assert [i.name for i in source.instances] == ["good"]
    assert any("squashed" in note for note in source.notes)


def broken_glb(ball: Path, edit: object) -> bytes:
    """A GLB whose JSON was edited; lengths stay right."""
    raw = ball.read_bytes()
    length = int.from_bytes(raw[12:16], "little")
    tree = json.loads(raw[20 : 20 + length])
    edit(tree)  # type: ignore[operator]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunk = len(text).to_bytes(4, "little") + b"JSON" + text
    rest = raw[20 + length :]
    return raw[:8] + (12 + len(chunk) + len(rest)).to_bytes(4, "little") + chunk + rest


def test_glb_indices_out_of_range_are_dropped_or_refused(tmp_path: Path) -> None:
    trimesh.Trimesh(np.eye(3), [[0, 1, 2]], process=False).export(tmp_path / "t.glb")
    raw = (tmp_path / "t.glb").read_bytes()
    old, new = np.array([0, 1, 2], np.uint32).tobytes(), np.array([0, 1, 77], np.uint32).tobytes()
    assert old in raw
    with pytest.raises(SceneError, match="name a vertex that is not there"):
        load(written(tmp_path / "bad.glb", raw.replace(old, new)))


@pytest.mark.parametrize("bad", ["f 1 2 9", "f 1 2 -9"])
def test_obj_indices_out_of_range_are_a_scene_error(tmp_path: Path, bad: str) -> None:
    with pytest.raises(SceneError, match=r"a\.obj"):
        load(written(tmp_path / "a.obj", TRIANGLE.replace("f 1 2 3", bad)))


def test_glb_that_refers_to_a_missing_mesh_is_a_scene_error(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "b.glb")
    bad = broken_glb(tmp_path / "b.glb", lambda tree: tree["nodes"][-1].update(mesh=99))
    with pytest.raises(SceneError, match=r"bad\.glb"):
        load(written(tmp_path / "bad.glb", bad))


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("gone.obj", None, "no such file"),
        ("courtyrad", None, "did you mean courtyard? built in are arcade, cornell"),
        ("scene.blend", b"x", "known are .glb"),
        ("empty.obj", b"", "empty.obj"),
        ("empty.ply", b"", "empty.ply"),
        ("empty.stl", b"", "empty.stl"),
        ("empty.glb", b"", "empty.glb"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "nothing that can be drawn"),
        ("line.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n", "nothing that can be drawn"),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"),
        ("dot.obj", b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "no area"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        ("words.stl", b"solid of words, nothing else", "words.stl"),
        ("words.gltf", b"{not json", "cannot be read as gltf"),
        ("list.gltf", b"[1, 2]", "cannot be read as gltf"),
        ("old.gltf", b'{"asset": {"version": "1.0"}}', "cannot be read as gltf"),
        ("bare.gltf", b'{"asset": {"version": "2.0"}}', "bare.gltf"),
        ("head.ply", b"ply\nformat ascii 1.0\nelement vertex 9999\nproperty float x\nend_header\n", "head.ply"),
    ],
)
def test_unusable_files_are_scene_errors_that_name_the_file(
    tmp_path: Path, name: str, content: bytes | None, told: str
) -> None:
    if content is not None:
        written(tmp_path / name, content)
    with pytest.raises(SceneError) as caught:
        build(SceneConfig(source=name), tmp_path)
    assert name in str(caught.value)
    assert told in str(caught.value)


def test_a_folder_is_no_model(tmp_path: Path) -> None:
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(SceneError, match="is a folder"):
        load(tmp_path / "folder.obj")


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "stl"])
def test_mangled_bytes_give_a_source_or_a_scene_error(tmp_path: Path, kind: str) -> None:
    """Truncations and random byte edits of a valid file; anything else that is raised fails the test."""
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / f"good.{kind}")
    good = np.frombuffer((tmp_path / f"good.{kind}").read_bytes(), np.uint8)
    chance = np.random.default_rng(11)
    outcomes = set()
    for _ in range(60):
        bad = good[: chance.integers(0, len(good))] if chance.random() < 0.4 else good.copy()
        if len(bad) and chance.random() < 0.7:
            bad = bad.copy()
            bad[chance.integers(0, len(bad), chance.integers(1, 12))] = chance.integers(0, 256)
        try:
            source = load(written(tmp_path / f"bad.{kind}", bad.tobytes()))
        except SceneError:
            outcomes.add("refused")
            continue
        outcomes.add("loaded")
        assert all(np.isfinite(mesh.vertices).all() for mesh in source.meshes)
        assert all(mesh.triangles.max() < len(mesh.vertices) for mesh in source.meshes)
    assert outcomes == {"refused", "loaded"}
