"""Layers of which the graph needs more than display bytes: `reconstruction: gpu` shows what `cpu` shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import Camera
from wall.geometry.cameras import look_at
from wall.reconstruction.gpu.device import Device
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}
views: [{id: main, camera: {position: [3, 2, 4], target: [0, 0.6, 0]}, refresh_hz: 30, prediction: none}]
sampling: {method: adaptive, samples_per_batch: 256}
"""
NODES = """    - {id: far, op: samples, panel: r0c1, range: [0, 0.5]SAMPLES}
    - {id: f, op: reconstruct, input: far, background: transparent, order: 1LAYER}
    - {id: near, op: samples, panel: r0c1, range: [0.5, 1]}
    - {id: n, op: reconstruct, input: near, background: transparent, order: 0}
    - {id: sky, op: sky, panel: r0c1, order: 2}
    - {id: picture, op: OPERATOR, inputs: [n, f, sky]}
    - {id: plain, op: samples, panel: r0c0}
    - {id: p, op: reconstruct, input: plain, order: 3}
    - {id: wall, op: tile, inputs: [p, picture]}
    - {id: files, op: sink, kind: png, input: wall}
"""
REFRESHES, STEPS = 12, 5  # steps of tracing a refresh
STANDS = 8  # the refresh from which the camera stands
DECIDED = 0.008  # pixels in which rounding decides which sample is hidden: docs/guide/accuracy.md. Seen: 0.0005
MEAN_CODES = 0.01  # of all pixels. Seen: 0.001


def nodes(operator: str, *, samples: str = "", layer: str = "") -> str:
    text = NODES.replace("OPERATOR", operator).replace("SAMPLES", samples).replace("LAYER", layer)
    return f"graph:\n  nodes:\n{text}"


GRAPHS = {
    "sort-last": "graph: {preset: sort-last, ranks_per_panel: 2, sinks: [png]}\n",
    "transparent layers by depth": nodes("depth"),
    "transparent layers by order": nodes("over"),
    "newest of two": "".join(
        line.replace(", sky]", "]") for line in nodes("newest").splitlines(keepends=True) if "op: sky" not in line
    ),
    "a layer of fewer pixels": nodes("depth", samples=", scale: 0.5"),
    "a slow layer": nodes("over", layer=", refresh_hz: 7"),
    "a slow layer of fewer pixels": nodes("depth", samples=", scale: 0.5", layer=", refresh_hz: 7"),
    "a transparent sink": """\
graph:
  nodes:
    - {id: s, op: samples, panel: r0c1, range: [0.5, 1]}
    - {id: r, op: reconstruct, input: s, background: transparent}
    - {id: plain, op: samples, panel: r0c0}
    - {id: p, op: reconstruct, input: plain}
    - {id: wall, op: tile, inputs: [p, r]}
    - {id: files, op: sink, kind: png, input: wall}
""",
}


def plan_of(graph: str, wish: str) -> Plan:
    text = TEXT + f"reconstruction: {wish}\n" + graph
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def scene() -> TracerScene:
    return make_tracer_scene(plan_of(GRAPHS["sort-last"], "cpu").scene)


def pan(refresh: int) -> Camera:
    """A camera that slides and turns until it stands."""
    k = min(refresh, STANDS)
    angle = 0.5 + 0.01 * k
    eye = np.array([3.0, 2.0, 4.0 - 0.02 * k])
    return look_at(eye, eye - np.array([5 * math.sin(angle), 1.0, 5 * math.cos(angle)]), np.array([0.0, 1.0, 0.0]))


def film(plan: Plan, scene: TracerScene, wish: str) -> Iterator[NDArray[np.float64]]:
    """What each refresh shows, in codes. Renderers adapt to images of their own, so that all runs trace the same."""
    chain = SingleProcess(plan, scene, at_renderers=False)
    for k in range(REFRESHES):
        chain.clock.advance(k / 30 - chain.clock.now())
        chain.event = replace(chain.event, camera=pan(k), camera_event=min(k, STANDS) + 1, input_time=k / 30)
        for _ in range(STEPS):
            chain.step()
        yield np.stack([image.rgb.astype(float) for image in chain.composition.shown()[0].images()])
    assert {str(layer.reprojected.choice).split()[0] for layer in chain.layers.values()} == {wish}


@pytest.mark.parametrize("graph", GRAPHS.values(), ids=GRAPHS.keys())
def test_a_graph_shows_the_same_whatever_reconstructs_its_layers(
    opengl: Device, compiled_only: None, scene: TracerScene, graph: str
) -> None:
    on_cpu, on_gpu = (np.stack(list(film(plan_of(graph, wish), scene, wish))) for wish in ("cpu", "gpu"))
    assert on_cpu[-1].std() > 10
    assert np.abs(on_cpu[STANDS] - on_cpu[1]).mean() > 3, "the camera moves"
    apart = np.abs(on_cpu - on_gpu).max(axis=-1)
    shares, means = (apart > 1).mean(axis=(1, 2, 3)), apart.mean(axis=(1, 2, 3))
    assert shares.max() <= DECIDED
    assert means.max() <= MEAN_CODES
