"""Files of nodes: refused at their node before anything runs, warmed up, and used from end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.plan import Layout, check_files, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [24, 18], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: framed}
graph:
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: p, op: reconstruct, input: s}
    - {id: m, op: mask, input: p, file: mask.png}
    - {id: out, op: sink, kind: png, input: m}
"""
WHOLE = TEXT.replace("    - {id: m, op: mask, input: p, file: mask.png}\n", "").replace("input: m}", "input: p}")


def layout_of(folder: Path, text: str, mask: NDArray[np.uint8]) -> Layout:
    Image.fromarray(mask).save(folder / "mask.png")
    (folder / "a.yaml").write_text(text)
    return make_layout(load(folder / "a.yaml"))


def test_a_mask_of_another_size_is_refused_at_its_node(tmp_path: Path) -> None:
    layout = layout_of(tmp_path, TEXT, np.zeros((6, 8), np.uint8))
    with pytest.raises(ConfigError, match=r"a\.yaml:10:7: .*mask\.png is 8 x 6 pixels, wanted 24 x 18"):
        check_files(layout)


def test_a_mask_from_a_file_takes_its_part_of_a_run_s_image(tmp_path: Path, compiled_only: None) -> None:
    mask = np.zeros((18, 24), np.uint8)
    mask[:, 9:] = 255
    shown = {}
    for name, text in (("masked", TEXT), ("whole", WHOLE)):
        layout = layout_of(tmp_path, text, mask)
        check_files(layout)
        plan = make_plan(layout)
        tracer_scene = make_tracer_scene(plan.scene)
        warm_up(plan, tracer_scene, lambda line: None)
        shown[name] = SingleProcess(plan, tracer_scene).until_complete()[0].rgb

    assert shown["whole"][:, :9].any()
    assert not shown["masked"][:, :9].any()
    np.testing.assert_array_equal(shown["masked"][:, 9:], shown["whole"][:, 9:])
