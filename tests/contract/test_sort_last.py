"""Sort-last gives the image of sort-first: parts of the objects traced apart, put together by depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import panels, summary, wall

from wall.config.loading import loads
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3], bezel: 0.01}}
views: [{id: main, camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 30}]
transport: {heartbeat_s: 0.2, lost_after_s: 10.0}
"""
FRAMED = "sampling: {method: framed, samples_per_batch: 256}\n"
SORT_FIRST = "graph: {preset: sort-first, sinks: [png]}\n"
SORT_LAST = "graph: {preset: sort-last, ranks_per_panel: 3, sinks: [png]}\n"
ADAPTIVE_CODES = 1.5  # mean of the differences, 8-bit; measured 0.5 and 0.7: filters see but their own objects' samples


def tree(*, compositors: int = 1) -> str:
    """Four parts of the objects a panel, compared two by two, then those, then the sky behind."""
    nodes = []
    for k, panel in enumerate(("r0c0", "r0c1")):
        for r in range(4):
            nodes.append(f"{{id: s{k}{r}, op: samples, panel: {panel}, range: [{r / 4}, {(r + 1) / 4}]}}")
            on = f", on: compositor {r // 2 % compositors}"
            nodes.append(f"{{id: f{k}{r}, op: reconstruct, input: s{k}{r}, background: transparent{on}}}")
        nodes += [
            f"{{id: sky{k}, op: sky, panel: {panel}}}",
            f"{{id: a{k}, op: depth, inputs: [f{k}0, f{k}1]}}",
            f"{{id: b{k}, op: depth, inputs: [f{k}2, f{k}3], on: compositor {compositors - 1}}}",
            f"{{id: p{k}, op: depth, inputs: [a{k}, b{k}, sky{k}], on: head}}",
        ]
    nodes += ["{id: w, op: tile, inputs: [p0, p1], on: head}", "{id: png, op: sink, kind: png, input: w}"]
    return f"graph:\n  compositors: {compositors}\n  SYNC\n  nodes:\n" + "".join(f"    - {node}\n" for node in nodes)


def in_lock_step(graph: str) -> str:
    return graph.replace("SYNC", "sync: frame").replace("preset:", "sync: frame, preset:")


def still(text: str) -> NDArray[np.uint8]:
    """What a still view ends in, in one process: (panels, h, w, 3)."""
    plan = make_plan(make_layout(loads(text.replace("  SYNC\n", ""), path=Path("wall.yaml"))))
    images = SingleProcess(plan, make_tracer_scene(plan.scene)).until_complete()
    return np.stack([image.rgb for image in sorted(images, key=lambda image: image.id)])


@pytest.fixture(scope="module")
def truth() -> NDArray[np.uint8]:
    found = still(TEXT + FRAMED + SORT_FIRST)
    assert found.std() > 10, "the truth itself shows nothing"
    return found


@pytest.mark.parametrize("graph", [SORT_LAST, tree()], ids=["direct-send", "tree"])
def test_whole_frames_put_together_by_depth_are_the_sort_first_image(graph: str, truth: NDArray[np.uint8]) -> None:
    """Every pixel's ray is the same and hits the same object: only the sky is computed at another place."""
    found = still(TEXT + FRAMED + in_lock_step(graph))
    assert np.abs(found.astype(int) - truth).max() <= 1


def test_a_part_alone_is_not_the_image(truth: NDArray[np.uint8]) -> None:
    """That the parts differ is what makes the test above say something."""
    graph = (
        in_lock_step(tree())
        .replace("inputs: [a0, b0, sky0]", "inputs: [a0, sky0]")
        .replace("[a1, b1, sky1]", "[a1, sky1]")
    )
    lines = [line for line in graph.splitlines() if not any(f"{{id: {name}," in line for name in UNUSED)]
    found = still(TEXT + FRAMED + "\n".join(lines) + "\n")
    assert (np.abs(found.astype(int) - truth).max(axis=-1) > 8).mean() > 0.02


UNUSED = [f"{kind}{k}{r}" for kind in "sf" for k in range(2) for r in (2, 3)] + ["b0", "b1"]


def test_adaptive_samples_at_rest_put_together_are_the_sort_first_image_within_the_filters() -> None:
    text = TEXT.replace("[64, 48]", "[24, 18]") + "sampling: {method: adaptive, samples_per_batch: 1024}\n"
    first, last = (still(text + graph) for graph in (SORT_FIRST, tree()))
    assert np.abs(first.astype(int) - last).mean() <= ADAPTIVE_CODES


@pytest.mark.parametrize("graph", [SORT_LAST, tree(compositors=2)], ids=["direct-send", "tree on two compositors"])
def test_processes_over_zeromq_give_the_single_process_image(tmp_path: Path, graph: str) -> None:
    text = TEXT + FRAMED + in_lock_step(graph)
    config = tmp_path / "wall.yaml"
    config.write_text(text.replace("  SYNC\n", ""), encoding="utf-8")
    done = wall("run", config, "--until-complete", "--seconds", 30, "--headless", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    found = np.stack(panels(tmp_path / "out"))
    assert np.array_equal(found, still(text))
    assert summary(tmp_path / "out")["ended"] == "complete"
