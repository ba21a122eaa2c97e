"""A parameter that was edited gives the picture of a scene that was configured so, without new trees or kernels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from running import write_config

from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Edits
from wall.core.jit import specialisations
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.scene.parameters import parameters_of
from wall.tracing.embree import Device
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

CORNELL = "position: [2.78, 2.73, -8], target: [2.78, 2.73, 0]"
BOX = "white #2"  # the small box has its source's material, and gets one of its own
Values = Mapping[str, tuple[float, ...]]
EDITS: list[Values] = [
    {"lights.2.irradiance": (0.0, 0.0, 4.0)},
    {"lights.2.direction": (-0.6, 0.5, 0.6)},
    {"lights.0.intensity": (20.0, 0.0, 0.0), "lights.0.position": (0.0, 3.0, 0.0)},
    {"sky.strength": (2.0,), "sky.horizon": (0.5, 0.1, 0.1)},
    {"materials.mosaic.color": (1.0, 0.2, 0.2)},
    {"materials.coral.mirror": (0.9,)},
]
PATHS = "{source: cornell, integrator: {method: path, depth: 3}, materials: [{object: small box, type: plastic}]}"


def planned(folder: Path, scene: str = "", **changes: Any) -> Plan:
    """A small wall's plan; `scene` replaces the configuration's whole scene."""
    path = write_config(folder, **changes)
    if scene:
        text = path.read_text().replace("{source: courtyard}", scene)
        if "cornell" in scene:
            text = text.replace("position: [6, 4.5, 10], target: [0, 0.6, 0]", CORNELL)
        path.write_text(text)
    return make_plan(make_layout(load(path)))


def finished(single: SingleProcess, number: int, values: Values, exposure: float = 0.0) -> NDArray[np.uint8]:
    """The final picture under some edits."""
    edits = Edits(number, tuple(sorted(values.items())))
    single.event = replace(single.event, scene_event=number, edits=edits, exposure=exposure)
    return single.until_complete()[0].rgb


@pytest.fixture(scope="module")
def courtyard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, TracerScene]:
    plan = planned(tmp_path_factory.mktemp("courtyard"))
    return plan, make_tracer_scene(plan.scene)


def test_edits_of_a_running_wall_give_the_bits_of_a_wall_that_began_with_them(
    courtyard: tuple[Plan, TracerScene],
) -> None:
    running = SingleProcess(*courtyard)
    before = running.until_complete()[0].rgb
    for number, values in enumerate(EDITS, start=1):
        after = finished(running, number, values)
        assert (after != before).any(-1).mean() > 0.002, f"{values} changed nothing"
        assert_array_equal(after, finished(SingleProcess(*courtyard), 1, values))
    assert_array_equal(finished(running, len(EDITS) + 1, {}), before)
    for worker in running.workers:  # each input was answered once, and the first is none
        assert len(worker.work.answers) == len(EDITS) + 1


def test_edits_build_no_tree_and_compile_no_kernel(
    courtyard: tuple[Plan, TracerScene], monkeypatch: pytest.MonkeyPatch
) -> None:
    running = SingleProcess(*courtyard)
    running.until_complete()
    finished(running, 1, {"sky.strength": (1.5,)})  # a kernel's first call compiles it, whatever called it
    known, built = specialisations(), list[str]()
    for name in ("mesh", "tree", "instance", "commit"):
        own = getattr(Device, name)
        monkeypatch.setattr(Device, name, lambda *a, _own=own, _name=name, **k: (built.append(_name), _own(*a, **k))[1])
    for number, values in enumerate(EDITS, start=2):
        finished(running, number, values, exposure=0.5 * number)
    assert specialisations() == known
    assert built == []


def test_exposure_traces_nothing_and_doubles_light_a_stop(courtyard: tuple[Plan, TracerScene]) -> None:
    running = SingleProcess(*courtyard)
    before = running.until_complete()[0].rgb
    traced = sum(worker.work.samples for worker in running.workers)
    brighter = finished(running, 0, {}, exposure=1.0)
    assert sum(worker.work.samples for worker in running.workers) == traced
    linear = [np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4) for x in (before / 255, brighter / 255)]
    wanted = np.minimum(2.0 * linear[0], 1.0)
    step = 1.5 / 255 * (0.1 + 2.0 * np.maximum(wanted, 0.01))  # of both codes' rounding, as light
    assert (np.abs(linear[1] - wanted) <= 3.0 * step).all()
    assert_array_equal(finished(running, 0, {}), before)


def test_stored_samples_take_a_light_s_edit_at_the_next_refresh_and_converge_to_it(tmp_path: Path) -> None:
    plan = planned(tmp_path, method="adaptive")
    scene = make_tracer_scene(plan.scene)
    values = {"lights.2.irradiance": (0.0, 0.0, 4.0)}
    whole = SingleProcess(planned(tmp_path, method="adaptive", batch=2048), scene)  # at its end after fewer steps
    wanted = finished(whole, 1, values).astype(float)

    def picture(running: SingleProcess, batches: int) -> NDArray[np.float64]:
        for _ in range(batches):  # a ms each
            running.step()
        return running.composition.shown()[0].images()[0].rgb.astype(float)

    def error(image: NDArray[np.float64]) -> float:
        return float(np.sqrt(((image - wanted) ** 2).mean()))

    for at_renderers in (True, False):
        running = SingleProcess(plan, scene, at_renderers=at_renderers)
        before = picture(running, 400)
        running.event = replace(running.event, scene_event=1, edits=Edits(1, tuple(values.items())))
        assert error(picture(running, 70)) < 0.5 * error(before)  # of two refreshes
        assert error(picture(running, 600)) < 0.2 * error(before)


@pytest.mark.parametrize(("method", "at_renderers"), [("adaptive", True), ("adaptive", False), ("frameless", True)])
def test_an_edit_is_shown_at_once_whatever_moment_of_a_refresh_it_comes_in(
    tmp_path: Path, courtyard: tuple[Plan, TracerScene], method: str, at_renderers: bool
) -> None:
    """On a clock on which only batches take time, a ms each: what refreshes wait for counts alone."""
    plan = planned(tmp_path, method=method)
    running = SingleProcess(plan, courtyard[1], at_renderers=at_renderers)
    for number, apart in enumerate((260, 273), start=1):  # at other moments of a period, 33 ms
        for _ in range(apart):
            running.step()
        before = running.composition.shown()[0].images()[0].rgb.mean()
        edits = Edits(number, (("lights.2.irradiance", (0.0, 0.0, 4.0 * (number % 2))),))
        running.event = replace(running.event, scene_event=number, edits=edits)
        for _ in range(6):
            running.step()
        after = running.composition.shown()[0].images()[0].rgb.mean()
        assert abs(after - before) > 0.3  # codes; without an edit at most 0.1


@pytest.mark.parametrize(
    "edit", ["integrator.depth=1", "roughness=0.9", "metallic=1", "emission=5", "color=0.2", "ior=3"]
)
def test_on_paths_an_edit_is_as_bright_as_the_scene_that_began_with_it(tmp_path: Path, edit: str) -> None:
    plan = planned(tmp_path, PATHS)
    scene, running = make_tracer_scene(plan.scene), SingleProcess(plan, make_tracer_scene(plan.scene))
    before = running.until_complete()[0].rgb
    name, value = edit.split("=")
    material = "lamp" if name == "emission" else BOX
    name = name if "." in name else f"materials.{material}.{name}"
    values = {name: (float(value),) * (3 if name.endswith(("color", "emission")) else 1)}
    assert name in parameters_of(plan.scene)
    after, fresh = finished(running, 1, values), finished(SingleProcess(plan, scene), 1, values)
    assert (after != before).any()
    assert abs(after.mean() - fresh.mean()) < 3.0  # codes; 9,000 noisy ones


def keyframed(folder: Path, value: str) -> Plan:
    return planned(
        folder,
        "{source: courtyard, animation: [{type: parameter, name: sky.strength, loop: false, keyframes: "
        f"[{{time: 0, value: {value}}}, {{time: 2, value: 3}}]}}]}}",
    )


def test_keyframes_give_the_picture_of_their_moment_in_render_and_in_a_run(tmp_path: Path) -> None:
    moving, still = keyframed(tmp_path, "1"), keyframed(tmp_path, "3")
    rendered = [render(plan, spp=1, seed=1, at=at) for plan, at in ((moving, 2.0), (still, 0.0), (moving, 0.0))]
    assert_array_equal(rendered[0], rendered[1])
    assert np.abs(rendered[0] - rendered[2]).max() > 0.05
    single = SingleProcess(moving, make_tracer_scene(moving.scene))
    single.event = replace(single.event, scene_event=1, scene_time=2.0)
    other = SingleProcess(still, make_tracer_scene(still.scene))
    assert_array_equal(single.until_complete()[0].rgb, other.until_complete()[0].rgb)
