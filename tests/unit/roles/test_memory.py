"""What ranks need of memory is known before they take it."""

from __future__ import annotations

import gc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.config.scene import SceneConfig
from wall.deepbuffer.kernels.pixel_buffer import PIXEL
from wall.reconstruction.memory import reconstruction_bytes
from wall.roles.layer import PanelCompositor
from wall.roles.memory import ARRIVED, FORKED, kept_by, memory_of, memory_on_host
from wall.roles.plan import Plan, make_layout, make_plan, on_one_machine
from wall.run.usage import give_memory_back, memory
from wall.scene.build import Scene, build
from wall.tracing.memory import OF_A_TRIANGLE, scene_bytes, tree_bytes
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {{source: cornell}}
wall: {{grid: {{columns: {columns}, rows: 1, pixels: [{width}, {height}], size: [0.3, 0.2]}}}}
views: [{{camera: auto}}]
sampling: {{method: {method}}}
reconstruction: cpu
"""
MEASURED = 0.3  # how far an estimate may be off: allocators round, and what is freed before is used again


def plan_of(columns: int = 1, width: int = 96, height: int = 64, method: str = "adaptive") -> Plan:
    text = TEXT.format(columns=columns, width=width, height=height, method=method)
    return make_plan(make_layout(loads(text, path=Path("w.yaml"))))


@pytest.mark.parametrize("size", [(96, 64), (80, 50)])
def test_the_arrays_of_a_layer_have_the_bytes_that_were_worked_out(compiled_only: None, size: tuple[int, int]) -> None:
    plan = on_one_machine(plan_of(1, *size))
    panel, kept = PanelCompositor(plan, 0), kept_by(plan, 0)
    made = panel.reprojected.shared().bytes
    assert made == pytest.approx(reconstruction_bytes(*size, kept, room=True), rel=0.03)  # tiles at borders are whole
    newest = panel.newest.buffer.records.nbytes + panel.reprojected.arrivals.times.nbytes
    assert newest == (PIXEL.itemsize + ARRIVED) * size[0] * size[1]
    assert memory_of(plan, 1).images == reconstruction_bytes(*size, kept) + newest


def test_where_samples_travel_both_the_renderer_and_the_compositor_keep_them() -> None:
    apart, together = plan_of(), on_one_machine(plan_of())
    pixels = 96 * 64
    assert [memory_of(together, 0).images, memory_of(together, 1).shared] == [0, 2 * (1 << 17)]
    whole = reconstruction_bytes(96, 64, kept_by(apart, 0))
    assert memory_of(apart, 1).images == whole
    assert memory_of(apart, 0).images == whole + (PIXEL.itemsize + ARRIVED) * pixels
    assert memory_of(plan_of(method="frameless"), 1).images == 0


def test_a_machine_holds_a_scene_once_for_ranks_that_are_forked_and_otherwise_once_for_each() -> None:
    plan = on_one_machine(plan_of(3))
    forked, apart = (memory_on_host(plan, range(4), forked=forked) for forked in (True, False))
    assert (apart.scene, forked.scene) == (4 * scene_bytes(plan.scene), scene_bytes(plan.scene))
    assert apart.ranks == forked.ranks
    more = memory_on_host(plan, range(5)[:3], forked=True)
    assert forked.total - more.total == FORKED + memory_of(plan, 3).own


def grid(edge: int) -> Scene:
    """A bumpy surface of 2 (edge - 1)^2 triangles, as a model has them."""
    scene, at = build(SceneConfig(source="cornell"), Path()), np.linspace(0.0, 1.0, edge, dtype=np.float32)
    x, y = np.meshgrid(at, at)
    bumps = 0.02 * np.random.default_rng(1).random((edge, edge), np.float32)
    i = np.arange(edge * edge).reshape(edge, edge)
    a, b, c, d = (i[r, s].ravel() for r in (slice(-1), slice(1, None)) for s in (slice(-1), slice(1, None)))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.uint32)
    mesh = replace(
        scene.meshes[0], vertices=np.stack([x, y, bumps], 2).reshape(-1, 3), triangles=triangles, normals=None,
        uvs=None, colors=None,
    )  # fmt: skip
    return replace(scene, meshes=(mesh,), instances=(replace(scene.instances[0], mesh=0),), path_depth=None)


def test_a_model_takes_what_was_worked_out_of_it(compiled_only: None) -> None:
    """Resident memory before and after 320,000 triangles are laid out."""
    make_tracer_scene(grid(8))  # Embree's own
    gc.collect()
    give_memory_back()  # what other tests have left
    before = memory()
    scene = grid(400)
    laid = make_tracer_scene(scene)
    give_memory_back()
    took = memory() - before
    assert laid.vertices.nbytes < tree_bytes(scene.meshes[0]) == OF_A_TRIANGLE * 2 * 399**2
    assert scene_bytes(scene) == pytest.approx(took, rel=MEASURED)
