"""`wall check` reports notes on a wall, and which display shows which panel."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

from wall.commands.check import check, on_the_cpu, reconstructions, tracers
from wall.commands.fields import fields_of_packets
from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout, make_plan

CONFIG = """\
version: 1
scene: {source: courtyard}
wall:
  panels:
    - id: a
      pixels: [40, 30]
      corners: {lower_left: [0, 0, 0], lower_right: [0.4, 0, 0], upper_left: [0, 0.3, 0]}
      overlap: 0.05
      host: node1
      monitor: 2
    - id: b
      pixels: [40, 30]
      corners: {lower_left: [0.35, 0, 0], lower_right: [0.75, 0, 0], upper_left: [0.35, 0.3, 0]}
      overlap: 0.05
      rotation: 90
views: [{id: main}]
"""


def written(folder: Path, text: str) -> Path:
    (folder / "wall.yaml").write_text(text)
    return folder / "wall.yaml"


def test_notes_and_displays_come_before_anything_is_measured(tmp_path: Path) -> None:
    lines, tables = [], []
    for item in check(load(written(tmp_path, CONFIG))):
        (tables if isinstance(item, Table) else lines).append(item)
        if isinstance(item, str) and item.startswith("note: "):
            break
    page = io.StringIO()
    Console(width=100, file=page).print(tables[0])
    text = page.getvalue()

    assert "wall.yaml:11:7: wall.panels[1]: panel b: shares 0.05 x 0.3 m of light with panel a" in lines[-1]
    assert [cell for cell in ("node1", "2", "30", "turned 90") if cell not in text] == []


def test_what_differs_between_views_is_said_of_each(tmp_path: Path) -> None:
    views = """views:
  - {id: main, panels: [a], reconstruction: cpu}
  - {id: copy, viewport: {left: 0, top: 0, width: 0.1, height: 0.1}, reconstruction: cpu}
  - {id: light, panels: [b], integrator: {method: path}}
"""
    both = make_layout(load(written(tmp_path, CONFIG.replace("views: [{id: main}]\n", views))))
    said, lines = list(tracers(make_plan(both))), list(reconstructions(make_plan(both)))
    tables = [each for each in said if isinstance(each, Table)]
    assert [table.title for table in tables] == ["features of main, copy", "features of light"]
    assert [line.split(":")[0] for line in lines] == ["reconstruction of main, copy", "reconstruction of light"]
    assert ["paths" in table.columns[0].cells for table in tables] == [False, True]
    assert ["paths" in line for line in said if isinstance(line, str)] == [True, False]
    one = make_layout(load(written(tmp_path, CONFIG)))
    assert [each.title for each in tracers(make_plan(one)) if isinstance(each, Table)] == ["features"]
    assert [line.split(":")[0] for line in reconstructions(make_plan(one))] == ["reconstruction"]


def test_the_fields_of_packets_are_said_with_what_is_left_out(tmp_path: Path) -> None:
    views = "views: [{id: main, panels: [a], sampling: {method: framed}}, {id: light, panels: [b]}]\n"
    plan = make_plan(make_layout(load(written(tmp_path, CONFIG.replace("views: [{id: main}]\n", views)))))
    plain, adaptive = fields_of_packets(plan)
    assert plain.endswith(
        ": colour, position, time, 8 bytes a sample before compression; "
        "left out: depth and object, of which the graph makes nothing"
    )
    assert "depth, object, time, change, normal, light visibility (light changes); left out: albedo" in adaptive


def test_wall_without_named_displays_has_no_table_of_them(tmp_path: Path) -> None:
    text = CONFIG.replace("host: node1", "bezel: 0").replace("monitor: 2", "stereo: mono")

    first = [item for item, _ in zip(check(load(written(tmp_path, text))), range(3), strict=False)]

    assert all(isinstance(item, str) for item in first)


def test_windows_that_open_on_another_host_than_their_panel_s_are_noted(tmp_path: Path) -> None:
    text = CONFIG.replace("      rotation: 90\n", "      host: node2\n")
    alone = make_layout(load(written(tmp_path, text + "graph: {preset: sort-first, sinks: [window]}\n")))
    assert [note for note in alone.notes if "on node1, node2 all open where rank 0 runs" in note] != []
    both = make_layout(load(written(tmp_path, text + "graph: {preset: sort-first, sinks: [window], compositors: 2}\n")))
    assert [note for note in both.notes if note.startswith("graph: windows")] == []


def test_the_size_of_a_wall_counts_what_two_panels_light_once(tmp_path: Path) -> None:
    lines = check(load(written(tmp_path, CONFIG)))
    assert ", 0.75 x 0.3 m, shown at 60 Hz; the eye is " in [next(lines), next(lines)][1]


def test_lengths_of_a_very_large_wall_have_no_power_of_ten(tmp_path: Path) -> None:
    apart = CONFIG.replace("0.35", "0.4").replace("0.05", "0")
    large = re.sub(r"\b0\.\d+", lambda number: f"{float(number[0]) * 1e4:g}", apart)
    lines = check(load(written(tmp_path, large)))
    assert ", 7,500 x 3,000 m, shown at 60 Hz; the eye is " in [next(lines), next(lines)][1]


def test_wall_that_is_wrong_is_refused_before_its_scene_is_loaded(tmp_path: Path) -> None:
    path = written(tmp_path, CONFIG.replace("courtyard", "nowhere.glb").replace("overlap: 0.05", "overlap: 0.01"))

    with pytest.raises(ConfigError, match="pixels covered twice: panels a and b"):
        make_layout(load(path))


def test_layers_that_a_gpu_cannot_make_are_named_with_the_reason(tmp_path: Path) -> None:
    views = """views:
  - {id: main, panels: [a]}
  - {id: light, panels: [b], integrator: {method: path}}
  - {id: copy, viewport: {left: 0, top: 0, width: 0.1, height: 0.1}, integrator: {method: path}, reconstruction: cpu}
"""
    text = CONFIG.replace("views: [{id: main}]\n", views).replace("      host: node1\n", "      row_time: 1e-4\n")
    plan = make_plan(make_layout(load(written(tmp_path, text))))

    assert list(on_the_cpu(plan)) == [
        "reconstruction: cpu for a: panel a has a row_time, and on a GPU all rows of an image show one moment",
        "reconstruction: cpu for b: the noise of paths is filtered there alone",
    ]


def test_layers_of_light_and_depth_are_not_among_them(tmp_path: Path) -> None:
    graph = """\
graph:
  nodes:
    - {id: s, op: samples, panel: a, scale: 0.5}
    - {id: far, op: reconstruct, input: s, refresh_hz: 10}
    - {id: t, op: samples, panel: a}
    - {id: near, op: reconstruct, input: t, background: transparent}
    - {id: d, op: depth, inputs: [far, near]}
    - {id: u, op: samples, panel: b}
    - {id: plain, op: reconstruct, input: u}
    - {id: left, op: sink, kind: png, input: d}
    - {id: right, op: sink, kind: png, input: plain}
reconstruction: gpu
"""
    assert list(on_the_cpu(make_plan(make_layout(load(written(tmp_path, CONFIG + graph)))))) == []
