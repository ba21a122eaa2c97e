"""Views with integrators of their own: each looks as on a wall that has this integrator alone, over the same trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import Edits
from wall.core.errors import ConfigError
from wall.roles.editing import Editor
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.embree import Device
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {{source: courtyard{scene}}}
wall: {{grid: {{columns: 3, rows: 1, pixels: [32, 24], size: [0.32, 0.24]}}}}
views:
{views}
sampling: {{method: {method}, samples_per_batch: 256}}
"""
SEEN = "eye: [0, 0, 0.8], camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}"
PATH, SHAPE = "{method: path, depth: 2}", "{method: ambient_occlusion, distance: 3}"
OWN = (
    f"id: main, {SEEN}",
    f"id: light, panels: [r0c1], {SEEN}, integrator: {PATH}",
    f"id: shape, panels: [r0c2], {SEEN}, integrator: {SHAPE}",
)
INSET = f"id: corner, viewport: {{left: 0.02, top: 0.45, width: 0.2, height: 0.5}}, {SEEN}"
Picture = NDArray[np.uint8]


def plan_of(*views: str, scene: str = "", method: str = "framed") -> Plan:
    listed = "\n".join(f"  - {{{view}}}" for view in views)
    text = TEXT.format(scene=scene and f", integrator: {scene}", views=listed, method=method)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def laid() -> TracerScene:
    return make_tracer_scene(plan_of(*OWN).scene)


def pictures(running: SingleProcess, steps: int | None = None) -> list[Picture]:
    """What the panels show in the end, or after so many steps."""
    if steps is None:
        return [image.rgb.copy() for image in running.until_complete()]
    for _ in range(steps):
        running.step()
    return [image.rgb.copy() for image in running.composition.shown()[0].images()]


@pytest.mark.parametrize(("method", "steps"), [("framed", None), ("adaptive", 12)])
def test_a_view_has_the_bits_that_it_has_alone(
    laid: TracerScene, compiled_only: None, method: str, steps: int | None
) -> None:
    together = pictures(SingleProcess(plan_of(*OWN, method=method), laid), steps)
    assert len({picture.tobytes() for picture in together}) == 3
    for panel, integrator in enumerate(("", PATH, SHAPE)):
        alone = plan_of(f"id: main, {SEEN}", scene=integrator, method=method)
        wanted = pictures(SingleProcess(alone, make_tracer_scene(alone.scene)), steps)
        assert len(np.unique(wanted[panel])) > 20
        np.testing.assert_array_equal(together[panel], wanted[panel])


def test_an_inset_over_the_same_panels_has_its_own_integrator(laid: TracerScene, compiled_only: None) -> None:
    """As between views that all have it; around it nothing changes."""
    inside = np.s_[11:23, 2:21]
    (direct, *_) = pictures(SingleProcess(plan_of(f"id: main, {SEEN}"), laid))
    (mixed, *_) = pictures(SingleProcess(plan_of(f"id: main, {SEEN}", f"{INSET}, integrator: {SHAPE}"), laid))
    both = plan_of(f"id: main, {SEEN}", INSET, scene=SHAPE)
    (shape, *_) = pictures(SingleProcess(both, make_tracer_scene(both.scene)))
    np.testing.assert_array_equal(mixed[inside], shape[inside])
    assert (mixed[inside] != direct[inside]).any(axis=-1).mean() > 0.3, "all but the sky"
    direct[inside] = mixed[inside]
    np.testing.assert_array_equal(mixed, direct)


def test_integrators_share_trees_and_arrays(laid: TracerScene, monkeypatch: pytest.MonkeyPatch) -> None:
    plan, built = plan_of(*OWN), list[int]()
    own = Device.mesh
    monkeypatch.setattr(Device, "mesh", lambda *given: (built.append(1), own(*given))[1])
    others = [laid.under(scene) for scene in plan.scenes]
    assert others[0] is laid
    assert built == []
    assert [other.needs.paths for other in others] == [False, True, True]
    assert [other.needs.occlusion for other in others] == [False, False, True]
    for other, scene in zip(others[1:], plan.scenes[1:], strict=True):
        assert other is laid.under(scene), "made once"
        assert other.meshes is laid.meshes
        assert other.surfaces.meshes.triangles is laid.surfaces.meshes.triangles
        assert other.materials.rows is laid.materials.rows
        assert (other.scene.path_depth, other.scene.occlusion) == (scene.path_depth, scene.occlusion)


def begun_with(values: Mapping[str, tuple[float, ...]], laid: TracerScene) -> list[Picture]:
    """What each panel shows of a wall that begins with an edit: the random numbers are the same ones."""
    running = SingleProcess(plan_of(*OWN), laid)
    edits = Edits(1, tuple(sorted(values.items())))
    events = (running.event, *running.other_events)
    running.event, *running.other_events = (replace(event, scene_event=1, edits=edits) for event in events)
    return pictures(running)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ({"integrator.depth": (1.0,)}, [False, True, False]),
        ({"integrator.distance": (0.3,)}, [False, False, True]),
        ({"lights.2.irradiance": (0.0, 0.0, 4.0)}, [True, True, False]),
        ({"materials.mosaic.color": (1.0, 0.2, 0.2)}, [True, True, True]),
    ],
)
def test_an_edit_reaches_every_view_that_has_its_parameter(
    laid: TracerScene, compiled_only: None, values: dict[str, tuple[float, ...]], wanted: list[bool]
) -> None:
    editor = Editor(plan_of(*OWN))
    editor.set(list(values.items()))
    assert dict(editor.edits.values) == values
    pairs = zip(begun_with(values, laid), begun_with({}, laid), strict=True)
    assert [bool((new != old).any()) for new, old in pairs] == wanted


@pytest.mark.parametrize(
    ("views", "expected"),
    [
        (
            (f"id: main, {SEEN}, lens: {{aperture: 0.1, focus: 3}}", OWN[1]),
            "views[0].lens: direct light has no lens; accepted: scene.integrator: {method: path}, or no lens",
        ),
        (
            (OWN[0], f"{OWN[1]}, lens: {{aperture: 0.1, focus: 3}}".replace(PATH, "{method: direct}")),
            "views[1].lens: direct light has no lens; accepted: integrator: {method: path}, or no lens",
        ),
        (
            (OWN[0], f"{OWN[1]}, reconstruction: gpu"),
            "views[1].reconstruction = 'gpu': view light has paths, whose noise is filtered on the CPU alone; "
            "accepted: auto, cpu, or integrator: {method: direct}",
        ),
        (
            (OWN[0], f"{OWN[1]}, reconstruction: fast"),
            "views[1].reconstruction = 'fast'",
        ),
        ((f"id: main, {SEEN}, integrator: {{method: photons}}",), "views[0].integrator"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_place(views: tuple[str, ...], expected: str) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_of(*views, method="adaptive")
    assert expected in str(refused.value)


def test_a_gpu_is_refused_for_paths_of_layers_that_are_compared_whatever_samples_them() -> None:
    """Values of one pixel are compared at one moment: such samples are reprojected, and their noise is filtered."""
    graph = """\
graph:
  nodes:
    - {id: s, op: samples, panel: r0c0, range: [0, 0.5]}
    - {id: f, op: reconstruct, input: s, background: transparent}
    - {id: t, op: samples, panel: r0c0, range: [0.5, 1]}
    - {id: g, op: reconstruct, input: t, background: transparent}
    - {id: both, op: depth, inputs: [f, g]}
    - {id: files, op: sink, kind: png, input: both}
"""
    text = f"""\
version: 1
scene: {{source: courtyard, integrator: {PATH}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [8, 6], size: [0.4, 0.3]}}}}
views: [{{id: main}}]
sampling: {{method: framed}}
reconstruction: gpu
{graph}"""
    with pytest.raises(ConfigError, match="has paths, whose noise is filtered on the CPU alone"):
        make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


def test_a_view_after_the_first_may_have_a_lens(compiled_only: None) -> None:
    """It blurs what that view shows, and nothing else."""
    sharp = plan_of(*OWN[:2])
    blurred = plan_of(OWN[0], f"{OWN[1]}, lens: {{aperture: 2, focus: 3}}")
    (first, before), (same, after) = (
        pictures(SingleProcess(plan, make_tracer_scene(plan.scene)))[:2] for plan in (sharp, blurred)
    )
    np.testing.assert_array_equal(first, same)
    assert (before != after).any(axis=-1).mean() > 0.5
    assert "lens.focus" in Editor(blurred).parameters
    assert "lens.focus" not in Editor(sharp).parameters
