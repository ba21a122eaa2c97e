"""A scene traced for the albedo and the normal of the first surface alone, under whatever integrator it is shown."""

from __future__ import annotations

from dataclasses import replace

from wall.scene.model import AmbientOcclusion
from wall.scene.of_views import Way, shown_by
from wall.tracing.tracer_scene import TracerScene

SHORTEST_SHARE = 1e-6  # of the scene's radius, as far as shadow rays go: nobody asks for their answers


def surface_scene(tracer_scene: TracerScene) -> TracerScene:
    """The same meshes for samples that bring albedos and normals; mirrors count as surfaces of their own.

    It shares Embree's trees. Its samples are of ambient occlusion, the cheapest that bring both; their light is unused.
    """
    scene = tracer_scene.scene
    distance = max(SHORTEST_SHARE * scene.radius, SHORTEST_SHARE)
    under = tracer_scene.under(shown_by(scene, Way(1, AmbientOcclusion(distance=distance, colors=True), scene.lens)))
    rows = under.materials.rows.copy()
    rows["mirror"] = 0.0
    materials = tuple(replace(material, mirror=0.0) for material in under.scene.materials)
    return replace(
        under, scene=replace(under.scene, materials=materials), materials=under.materials._replace(rows=rows)
    )
