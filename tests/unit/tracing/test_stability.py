"""Numerical stability: scenes far away, huge, tiny, stretched; no acne, no leaks; nothing degenerate is fatal.

Where rounding has the last word a test says which share of pixels may differ, and the share is what was measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import (
    TracedImage,
    Triple,
    View,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
    with_every_feature,
)

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Instance, PointLight, Sky
from wall.tracing import instance_trees

HARDEST = 4.0  # OFFSET_ULPS / 4: where the hard cases below must be free of acne already


def directional(direction: Float64, strength: float = math.pi) -> DirectionalLight:
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    return DirectionalLight(direction=(x, y, z), irradiance=(strength, strength, strength))


def test_a_scene_scaled_by_a_power_of_two_gives_the_same_bits(tiny_scene: Scene, tiny_view: View) -> None:
    """Float32 has no scale of its own: 2^-13 (a courtyard in a matchbox) and 2^13 change exponents only."""
    here = traced_image(
        replace(tiny_scene, point_lights=(), light_order=(0,), rest=tiny_scene.rest[[0, 1, 2, 4]]), tiny_view
    )
    for power in (-13, 13):
        matrices = [np.diag([2.0**power] * 3 + [1.0]) @ i.world_from_object for i in tiny_scene.instances]
        placed = [
            Instance(name="i", mesh=i.mesh, world_from_object=m)
            for i, m in zip(tiny_scene.instances, matrices, strict=True)
        ]
        scene = scene_of(
            tiny_scene.meshes, placed, materials=tiny_scene.materials, lights=tiny_scene.directional_lights
        )
        x, y, z = (2.0**power * np.array(tiny_view.event.camera.position)).tolist()
        camera = replace(tiny_view.event.camera, position=(x, y, z))
        there = traced_image(scene, replace(tiny_view, event=replace(tiny_view.event, camera=camera)))
        np.testing.assert_array_equal(here.radiance, there.radiance)


def plane_case(size: float, distance: float, elevation: float, seed: int) -> tuple[Scene, View]:
    """A turned plane, seen at 37 degrees from `distance`, under a directional light `elevation` radians above it."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    rotation = q * np.sign(np.linalg.det(q))
    x, n = rotation[:, 0], rotation[:, 2]
    centre = -distance * (0.6 * n + 0.8 * x)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = centre + 0.17 * size * x
    light = directional(math.sin(elevation) * n + math.cos(elevation) * x)
    scene = scene_of([quad(size, size)], [Instance(name="p", mesh=0, world_from_object=matrix)], lights=[light])
    fov = min(60.0, math.degrees(0.4 * size / distance))
    return scene, view((0.0, 0.0, 0.0), tuple(centre.tolist()), pixels=(40, 40), fov=fov)


def ball_case(
    scale: float | Triple, distance: float, fov: float, seed: int, *, height: float = 0.1
) -> tuple[Scene, View]:
    """A sphere of 6,240 triangles, scaled and turned, under light across the line of sight, `height` to the viewer."""
    random = np.random.default_rng(seed)
    axis, side = random.normal(size=3), random.normal(size=3)
    light = directional(
        np.cross(axis, side) / np.linalg.norm(np.cross(axis, side)) + height * axis / np.linalg.norm(axis)
    )
    centre = -distance * axis / np.linalg.norm(axis)
    placed = instance(0, at=tuple(centre.tolist()), turn=("x", float(random.uniform(0, 360))), scale=scale)
    scene = scene_of([sphere_mesh(segments=80, smooth=False)], [placed], lights=[light])
    return scene, view((0.0, 0.0, 0.0), tuple(centre.tolist()), pixels=(40, 40), fov=fov)


def hard_cases() -> Iterator[tuple[str, Scene, View]]:
    for size, distance, elevation in [
        (1e5, 1.0, 1e-2),
        (1e5, 1e3, 1e-3),
        (1e5, 1e4, 0.5),
        (1e5, 1e-3, 1e-2),
        (10.0, 1e4, 0.1),
        (1e-4, 1e-3, 0.1),
        (1.0, 3.0, 0.3),
    ]:
        for seed in (1, 2):
            yield f"plane {size:g} from {distance:g} seed {seed}", *plane_case(size, distance, elevation, seed)
    for scale, distance in [(1.0, 3.0), (1e5, 3e5), (1e-4, 3e-4), (1.0, 300.0), (1.0, 1e4)]:
        for seed in (3, 4):
            fov = 2 * math.degrees(math.atan(scale / distance))
            yield f"ball {scale:g} from {distance:g} seed {seed}", *ball_case(scale, distance, fov, seed)
    stretched: list[Triple] = [(1.0, 1e3, 1e3), (1e3, 1.0, 1e3), (1e3, 1e3, 1.0)]
    for scale in stretched:
        for seed in (0, 5, 6):
            yield f"ball 1000:1 {scale} seed {seed}", *ball_case(scale, 4000.0, 30.0, seed, height=1.0)


CASES = {name: (scene, seen) for name, scene, seen in hard_cases()}


def acne(scene: Scene, seen: View, monkeypatch: pytest.MonkeyPatch, *, ulps: float) -> tuple[int, int]:
    """Pixels of a convex object that face the light but are shadowed at a ray offset of `ulps`; pixels that are lit.

    A convex body never shadows what faces the light, so each one is an error. Facing is what an offset of 512 shows.
    Radiance below 2e-3 of the brightest is left out: there the cosine itself is within rounding of nothing.
    """
    monkeypatch.setattr(instance_trees, "OFFSET_ULPS", 512.0)
    lit = traced_image(scene, seen, coherent=False).radiance[..., 0]
    lit_side = lit > 2e-3 * lit.max()
    monkeypatch.setattr(instance_trees, "OFFSET_ULPS", ulps)
    got = traced_image(scene, seen, coherent=False).radiance[..., 0]
    return int((got == 0.0)[lit_side].sum()), int(lit_side.sum())


@pytest.mark.parametrize("name", CASES)
def test_no_shadow_acne_at_a_quarter_of_the_ray_offset(
    name: str, monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    assert instance_trees.OFFSET_ULPS >= 4 * HARDEST
    wrong, lit_side = acne(*CASES[name], monkeypatch, ulps=HARDEST)
    assert wrong == 0
    assert lit_side > 40


def test_without_an_offset_these_cases_do_show_acne(monkeypatch: pytest.MonkeyPatch, compiled_only: None) -> None:
    """The cases are hard ones: at an offset of zero nearly all of them fail."""
    failing = sum(acne(scene, seen, monkeypatch, ulps=0.0)[0] > 0 for scene, seen in CASES.values())
    assert failing > 0.8 * len(CASES)


def contact(gap: float, floor: Instance) -> TracedImage:
    """A floor at the origin, 10 units, and a plate `gap` above its middle, both under light from straight above;
    seen from the side, 1.7 units away, just between the two."""
    plate = instance(1, at=(0.0, 0.0, gap))
    scene = scene_of(
        [quad(10.0, 10.0), quad(1.0, 1.0)], [floor, plate], lights=[directional(np.array([0.0, 0.0, 1.0]))]
    )
    return traced_image(scene, view((0.0, -1.7, 0.5 * gap), (0.0, 0.0, 0.0), pixels=(33, 1), fov=1e-3, up=(0, 0, 1)))


FLOORS = {"quad": instance(0), "flattened": instance(0, scale=(1.0, 1.0, 1e-3))}


@pytest.mark.parametrize("floor", FLOORS.values(), ids=FLOORS.keys())
def test_light_leaks_only_under_what_is_closer_than_the_ray_offset(floor: Instance) -> None:
    """A floor of 10 units, seen from 1.7: W = abs(T) = 1.7, R sqrt(3) = 12.2, offset 16 * 2^-24 * 17.3 = 1.7e-5: a
    plate 2e-5 above it still shades it. Flattening the floor's frame does not make it worse."""
    got = contact(2e-5, floor)
    assert (got.objects == 1).all()
    assert (got.radiance == 0.0).all()


def test_a_mirror_far_away_shows_near_things_without_acne(monkeypatch: pytest.MonkeyPatch, compiled_only: None) -> None:
    """Rays that come back over 2e4 units carry that length's error, not that of the near place where they end."""
    ball, mirror = sphere_mesh(segments=64, smooth=False), quad(50.0, 50.0, material=1)
    scene = scene_of(
        [ball, mirror],
        [instance(0, at=(0.0, 0.0, 3.0)), instance(1, at=(0.0, 0.0, -1e4))],
        materials=[material(0.5, 0.5, 0.5), material(0.0, 0.0, 0.0, mirror=1.0)],
        lights=[directional(np.array([0.4, 0.3, -1.0]))],
    )
    seen = view((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), pixels=(48, 48), fov=math.degrees(2.0 / 2e4))
    wrong, lit_side = acne(with_every_feature(scene), seen, monkeypatch, ulps=instance_trees.OFFSET_ULPS)
    assert lit_side > 500
    assert wrong == 0


def test_a_point_light_in_a_surface_is_not_shaded_by_it() -> None:
    """A point light exactly in a ceiling: a ray that ended at it would be decided by rounding; it ends before."""
    ceiling, floor = instance(0, at=(0.1, 0.2, 1.3), turn=("x", 180.0)), instance(0)
    light = PointLight(position=(0.3, 0.1, 1.3), intensity=(1.0, 1.0, 1.0))
    scene = scene_of([quad(9.0, 9.0)], [floor, ceiling], lights=[light])
    got = traced_image(scene, view((0.0, -2.0, 0.7), (0.0, 0.0, 0.0), pixels=(40, 40)))
    assert (got.radiance[got.objects == 1] > 0.0).all()
    assert (got.objects == 1).sum() > 800


def test_a_point_light_exactly_where_a_ray_ends_gives_numbers() -> None:
    """Straight below the eye the hit is the light: distance zero or rounding. No light, or none that is not finite."""
    for z in (0.0, 1e-12, 1e-30):
        light = PointLight(position=(0.0, 0.0, z), intensity=(1.0, 1.0, 1.0))
        seen = view((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), pixels=(5, 5), fov=1.0)
        got = traced_image(scene_of([quad(4.0, 4.0)], lights=[light]), seen)
        kept = got.radiance[~np.isnan(got.radiance).any(axis=-1)]
        assert np.isfinite(kept).all()
        assert len(kept) == 25 - got.cost.bad
        assert got.cost.bad <= 1


def test_triangles_without_area_are_never_seen_and_break_nothing() -> None:
    mesh = quad(2.0, 2.0)
    broken = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, np.float32([[0, 0, 1], [0, 0, 1], [0.5, 0.5, 1], [1, 1, 1]])]),
        triangles=np.concatenate([mesh.triangles, np.uint32([[4, 5, 6], [4, 6, 7], [4, 4, 4], [0, 4, 0]])]),
    )
    seen, lights = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(33, 33)), [directional(np.array([0.1, 0.2, 1.0]))]
    got = traced_image(scene_of([broken], lights=lights), seen)
    whole = traced_image(scene_of([mesh], lights=lights), seen)
    assert got.cost.bad == 0
    np.testing.assert_array_equal(got.radiance, whole.radiance)


def test_coplanar_surfaces_show_one_of_them_everywhere_and_light_both() -> None:
    """Which of two equal surfaces is nearer is a matter of rounding; that the result is lit like one is not."""
    scene = scene_of([quad(4.0, 4.0), quad(3.0, 3.0)], lights=[directional(np.array([0.3, 0.1, 1.0]))])
    got = traced_image(scene, view((0.3, 0.2, 3.0), (0.0, 0.0, 0.0), pixels=(32, 32), fov=30.0))
    assert set(np.unique(got.objects)) <= {1, 2}
    expected = 0.5 / np.linalg.norm([0.3, 0.1, 1.0])
    np.testing.assert_allclose(got.radiance, expected, rtol=1e-5)


def test_camera_inside_geometry_sees_it_from_inside_in_the_dark() -> None:
    scene = scene_of([sphere_mesh()], lights=[directional(np.array([0.0, 1.0, 0.0]))])
    got = traced_image(scene, view((0.1, 0.0, 0.2), (0.0, 0.0, -1.0), pixels=(16, 16)))
    assert (got.objects == 1).all()
    assert (got.radiance == 0.0).all(), "no light comes through the sphere"


@pytest.mark.parametrize("place", [(0.3, 0.2, 0.0), (-1.0, -1.0, 0.0), (0.0, 0.0, 0.0)], ids=["face", "vertex", "edge"])
def test_camera_exactly_on_a_surface_gives_finite_samples(place: Triple) -> None:
    scene = scene_of([quad(2.0, 2.0), sphere_mesh()], [instance(0), instance(1, at=(0.0, 0.0, -5.0))])
    got = traced_image(scene, view(place, (place[0], place[1], -1.0), pixels=(16, 16)))
    assert got.cost.bad == 0
    assert np.isfinite(got.radiance).all()
    assert (got.depth >= 0.0).all()


@pytest.mark.parametrize("segments", [8, 200])
def test_no_ray_slips_through_the_edges_of_a_closed_mesh(segments: int, compiled_only: None) -> None:
    """Robust traversal: from inside, a sphere covers every pixel, aimed at its vertices and edges as well."""
    ball = scene_of([sphere_mesh(segments=segments)])
    for target in ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)):
        got = traced_image(ball, view((0.0, 0.0, 0.0), target, pixels=(128, 128), fov=90.0, up=(0.0, 0.6, 0.8)))
        assert (got.objects == 1).all()


def test_a_shadow_has_no_holes_along_the_edges_of_its_caster() -> None:
    """A sphere's shadow on a floor, seen from above beside it: no lit pixel more than a pixel inside its outline."""
    scene = scene_of(
        [quad(20.0, 20.0), sphere_mesh(segments=48)],
        [instance(0), instance(1, at=(0.0, 0.0, 3.0))],
        lights=[directional(np.array([1.0, 0.0, 1.0]))],
    )
    seen = view((-3.0, 0.0, 1.0), (-3.0, 0.0, 0.0), pixels=(64, 64), fov=2 * math.degrees(math.atan(0.6)))
    got = traced_image(scene, seen)
    assert (got.objects == 1).all()
    assert (got.radiance == 0.0).all(), "1.2 units about (-3, 0) lie inside the ellipse of half axes sqrt(2) and 1"


def test_sky_and_empty_space_stay_exact_whatever_surrounds_the_eye() -> None:
    """An eye 1e8 units away from a scene of one unit sees sky only, and the sky's own colour."""
    sky = Sky(zenith=(1.0, 1.0, 1.0), horizon=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0))
    got = traced_image(scene_of([sphere_mesh()], sky=sky), view((1e8, 0.0, 0.0), (2e8, 1.0, 0.0), pixels=(4, 4)))
    assert (got.radiance == 1.0).all()


@pytest.mark.parametrize("edge", [1e-12, 1e-9, 1e-4, 1e4, 1e9, 1e12])
def test_meshes_of_any_size_in_their_own_units_are_lit_alike(edge: float) -> None:
    """Embree's normals are as long as twice the area: 1e-24 to 1e24 here, whose squares no float32 holds."""
    direction = np.array([0.0, 0.5, 1.0])
    got = traced_image(
        scene_of([quad(edge, edge)], lights=[directional(direction)]), view((0, 0, edge), (0, 0, 0), pixels=(4, 4))
    )
    np.testing.assert_allclose(got.radiance, 0.5 / np.linalg.norm(direction), rtol=1e-5)
