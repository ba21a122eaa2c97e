"""Ambient occlusion against closed forms: free shares of the cosine-weighted hemisphere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scenes import BLACK_SKY, View, instance, quad, scene_of, sphere_mesh, view

from wall.config.loading import loads
from wall.core.data import Edits, Float64, Samples
from wall.roles.plan import Plan, make_layout, make_plan
from wall.scene.build import Scene
from wall.scene.model import AmbientOcclusion, Instance, Material, Mesh
from wall.scene.needs import needs
from wall.scene.parameters import parameters_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

PAINT = (0.5, 0.25, 1.0)
EDGE = 64  # pixels of views whose pixels all show the same place
SWEEPS = 16
FROM_ABOVE = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1)
FROM_THE_SIDE = view((4.0, 0.0, 0.8), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.1)  # below what is at height 1
FOUR_SIGMA = 4 * 0.5 / math.sqrt(EDGE * EDGE * SWEEPS)  # of a share, at most
FLOOR = quad(90.0, 90.0)  # at z = 0, towards +z

pytestmark = pytest.mark.usefixtures("compiled_only")


def occluded(
    meshes: Sequence[Mesh], placed: Sequence[Instance] | None = None, *, distance: float = 1e4, colors: bool = False
) -> Scene:
    found = scene_of(meshes, placed, materials=[Material(name="paint", base_color=PAINT)], sky=BLACK_SKY)
    return replace(found, path_depth=1, occlusion=AmbientOcclusion(distance=distance, colors=colors))


def tracer_of(scene: Scene, seen: View = FROM_ABOVE) -> Tracer:
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    return tracer


def positions() -> np.ndarray:
    xy = np.stack(np.meshgrid(np.arange(EDGE) + 0.5, np.arange(EDGE) + 0.5), axis=-1)
    return xy.reshape(-1, 2).astype(np.float32)


def mean(scene: Scene, seen: View = FROM_ABOVE) -> Float64:
    """Mean radiance, RGB, of SWEEPS samples of every pixel."""
    tracer = tracer_of(scene, seen)
    found = [tracer.trace(positions(), 0.0, number)[0]["radiance"] for number in range(SWEEPS)]
    return np.concatenate(found).astype(np.float64).mean(axis=0)


def disc(radius: float, sides: int = 256) -> Mesh:
    """At z = 0, of the circle's area."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    rim = radius * math.sqrt(2.0 * np.pi / sides / math.sin(2.0 * np.pi / sides))
    vertices = np.vstack([np.zeros(3), rim * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], 1)])
    around = np.arange(sides)
    triangles = np.stack([np.zeros(sides), 1 + around, 1 + (around + 1) % sides], 1)
    return Mesh(name="disc", vertices=vertices.astype(np.float32), triangles=triangles.astype(np.uint32), material=0)


def test_nothing_hides_an_open_plane() -> None:
    np.testing.assert_array_equal(mean(occluded([FLOOR])), 1.0)


def test_surfaces_have_their_colours_or_are_white() -> None:
    np.testing.assert_allclose(mean(occluded([FLOOR], colors=True)), PAINT, rtol=1e-6)


def test_at_the_foot_of_a_wall_half_is_free() -> None:
    """The wall stands at x = 0.004, beside what is seen, and is 4,000 times as high as that is away."""
    wall = instance(1, at=(0.004, 0.0, 0.0), turn=("y", 90.0))
    got = mean(occluded([FLOOR, quad(90.0, 90.0)], [instance(0), wall]))
    np.testing.assert_allclose(got, 0.5, atol=FOUR_SIGMA + 0.0075 / 45.0)


def in_a_ball(distance: float) -> Scene:
    """A ball of radius 10 about the floor."""
    ball = sphere_mesh()
    size = 10.0 / float(np.linalg.norm(ball.vertices, axis=1).max())
    return occluded([FLOOR, ball], [instance(0), instance(1, scale=size)], distance=distance)


@pytest.mark.parametrize(("distance", "free"), [(1e4, 0.0), (25.0, 0.0), (5.0, 1.0)])
def test_inside_a_closed_ball_all_or_nothing_is_free(distance: float, free: float) -> None:
    """Nothing is free as far as 10, all is below that."""
    np.testing.assert_array_equal(mean(in_a_ball(distance)), free)


def test_an_edited_distance_is_what_is_looked_through() -> None:
    tracer = tracer_of(in_a_ball(25.0))
    for distance, free in ((5.0, 1.0), (25.0, 0.0)):
        tracer.set_event(replace(FROM_ABOVE.event, edits=Edits(1, (("integrator.distance", (distance,)),))))
        np.testing.assert_array_equal(tracer.trace(positions(), 0.0, 0)[0]["radiance"], free)


@pytest.mark.parametrize("radius", [0.25, 0.5, 1.0])
def test_a_disc_above_hides_its_form_factor(radius: float) -> None:
    """sin^2 of the angle under which its radius is seen: r^2 / (r^2 + h^2) at height h = 1."""
    got = mean(occluded([FLOOR, disc(radius)], [instance(0), instance(1, at=(0.0, 0.0, 1.0))]), FROM_THE_SIDE)
    np.testing.assert_allclose(got, 1.0 - radius**2 / (radius**2 + 1.0), atol=FOUR_SIGMA + 1e-3)


@pytest.mark.parametrize("distance", [0.9, 1.25, 2.0, 5.0])
def test_what_is_farther_than_the_distance_hides_nothing(distance: float) -> None:
    """A ceiling at height 1 is met within the distance D by directions of cosine above 1 / D: 1 - 1 / D^2 of all."""
    scene = occluded([FLOOR, quad(90.0, 90.0)], [instance(0), instance(1, at=(0.0, 0.0, 1.0))], distance=distance)
    np.testing.assert_allclose(mean(scene, FROM_THE_SIDE), min(1.0, 1.0 / distance**2), atol=FOUR_SIGMA)


def test_a_convex_body_is_white_up_to_its_outline() -> None:
    """Smooth normals lean below the facets near the outline; what they would send inside is mirrored."""
    ball = sphere_mesh()
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=40.0)
    samples, _ = tracer_of(occluded([ball]), seen).trace(positions(), 0.0, 0)
    hit = samples["object_id"] > 0
    assert 100 < hit.sum() < len(samples)
    np.testing.assert_array_equal(samples["radiance"][hit], 1.0)
    np.testing.assert_array_equal(samples["radiance"][~hit], 0.0)  # the sky's


def test_a_sample_is_the_same_whatever_is_traced_beside_it() -> None:
    scene = occluded([FLOOR, disc(0.5)], [instance(0), instance(1, at=(0.0, 0.0, 1.0))])

    def traced(order: np.ndarray) -> Samples:
        return tracer_of(scene, FROM_THE_SIDE).trace(positions()[order], 0.0, 3)[0]

    forwards, some = np.arange(EDGE * EDGE), np.arange(EDGE * EDGE)[::-7]
    np.testing.assert_array_equal(traced(forwards)[some], traced(some))


def test_samples_without_a_number_continue_those_of_their_pixels() -> None:
    """In whatever order and batches they come: so the k-th sample of a pixel is the k-th point of its sequence."""
    scene = occluded([FLOOR, disc(0.5)], [instance(0), instance(1, at=(0.0, 0.0, 1.0))])
    numbered, counting, xy = tracer_of(scene, FROM_THE_SIDE), tracer_of(scene, FROM_THE_SIDE), positions()
    third = np.arange(len(xy)) % 3 == 0
    first = counting.trace(np.concatenate([xy, xy[third]]), 0.0)[0].copy()
    second = counting.trace(xy[::-1], 0.0)[0][::-1].copy()
    wanted = [numbered.trace(xy, 0.0, number)[0].copy() for number in range(3)]
    np.testing.assert_array_equal(first[: len(xy)], wanted[0])
    np.testing.assert_array_equal(first[len(xy) :], wanted[1][third])
    np.testing.assert_array_equal(second, np.where(third, wanted[2], wanted[1]))
    assert not np.array_equal(wanted[0]["radiance"], wanted[1]["radiance"])


def test_a_sample_costs_two_rays_and_brings_albedo_and_normal() -> None:
    samples, cost = tracer_of(occluded([FLOOR], colors=True)).trace(positions(), 0.0, 0)
    assert (cost.primary, cost.shadow, cost.secondary) == (EDGE * EDGE, EDGE * EDGE, 0)
    np.testing.assert_allclose(samples["sqrt_irradiance"], 1.0, atol=1e-6)
    assert len(np.unique(samples["albedo"])) == 1
    assert (samples["normal"] == 0).all()  # octahedral: straight up


def plan_of(integrator: str) -> Plan:
    text = f"""\
version: 1
scene: {{source: courtyard, integrator: {integrator}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [16, 16], size: [0.4, 0.4]}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}}}]
"""
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


def test_a_configured_scene_is_noisy_and_has_no_lights_to_change() -> None:
    scene = plan_of("{method: ambient_occlusion, distance: 3, colors: false}").scene
    assert scene.occlusion == AmbientOcclusion(distance=3.0, colors=False)
    wanted = needs(scene)
    assert (wanted.paths, wanted.occlusion) == (True, True)
    assert not any((wanted.change_detection, wanted.relighting, wanted.mirrors, wanted.emitters, wanted.suns))
    groups = {name.split(".")[0] for name in parameters_of(scene)}
    assert groups == {"exposure", "tone_mapping", "sky", "integrator", "objects"}
    assert parameters_of(scene)["integrator.distance"].default == (3.0,)
    assert "integrator.depth" not in parameters_of(scene)
    coloured = plan_of("{method: ambient_occlusion}").scene
    assert {name.split(".")[-1] for name in parameters_of(coloured) if name.startswith("materials")} == {"color"}
