"""The diagram of a configuration: processes, traffic calculated by hand, panels at their positions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.commands.drawing.diagram import diagram_of
from wall.commands.drawing.front_view import front_view
from wall.commands.drawing.model import TO, Diagram, Edge
from wall.commands.drawing.top_view import top_view
from wall.config.loading import load, loads
from wall.roles.plan import make_layout

CONFIGS = Path(__file__).parents[4] / "configs"
SORT_LAST = """
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [100, 50], size: [1, 0.5], bezel: 0.02}}
views: [{camera: auto, refresh_hz: 10}]
sampling: {method: frameless, samples_per_batch: 1024}
graph:
  compositors: 2
  nodes:
    - {id: a, op: samples, panel: r0c0, range: [0, 0.5]}
    - {id: b, op: samples, panel: r0c0, range: [0.5, 1], ranks: 2}
    - {id: fa, op: reconstruct, input: a, background: transparent, on: compositor 1}
    - {id: fb, op: reconstruct, input: b, background: transparent, on: head}
    - {id: sky, op: sky, panel: r0c0, on: head}
    - {id: near, op: depth, inputs: [fa, fb, sky], on: head}
    - {id: c, op: samples, panel: r0c1}
    - {id: fc, op: reconstruct, input: c, on: compositor 1}
    - {id: wall, op: tile, inputs: [near, fc], on: head}
    - {id: page, op: sink, kind: browser, input: wall}
    - {id: files, op: sink, kind: png, input: wall}
"""


@pytest.fixture(scope="module")
def sort_last() -> Diagram:
    return diagram_of(make_layout(loads(SORT_LAST, name="sort_last.yaml")), samples_per_s=2e6)


def edge(shown: Diagram, start: str, end: str) -> Edge:
    return next(edge for edge in shown.edges if (edge.start, edge.end) == (start, end))


def test_streams_carry_the_samples_of_all_their_ranks(sort_last: Diagram) -> None:
    """Packets of 1024 samples: 12 bytes each and 182 bytes of header."""
    of_a_rank = 2e6 * (12 + 182 / 1024)
    assert edge(sort_last, "a", "fa").bytes_per_s == pytest.approx(of_a_rank)
    assert edge(sort_last, "b", "fb").bytes_per_s == pytest.approx(2 * of_a_rank)
    assert edge(sort_last, "c", "fc").bytes_per_s == pytest.approx(2e6 * (8 + 182 / 1024))  # colour alone is shown


def test_a_framelet_that_depth_needs_carries_all_that_the_plan_sends(sort_last: Diagram) -> None:
    """100 x 50 pixels, 10 a second: three floats or bytes of colour, four bytes for every other channel."""
    step = make_layout(loads(SORT_LAST, name="sort_last.yaml")).graph.step("fa")
    assert {"colour", "depth"} <= step.channels
    found = edge(sort_last, "fa", "near")
    assert found.crosses
    assert found.bytes_per_s == 100 * 50 * 10 * ((3 if step.encoded else 12) + 4 * (len(step.channels) - 1))


def test_a_framelet_that_is_only_shown_is_sent_encoded(sort_last: Diagram) -> None:
    assert edge(sort_last, "fc", "wall").bytes_per_s == 100 * 50 * 10 * 3


def test_a_call_inside_a_process_carries_nothing(sort_last: Diagram) -> None:
    for start, end in (("fb", "near"), ("near", "wall"), ("wall", "page")):
        found = edge(sort_last, start, end)
        assert not found.crosses
        assert found.bytes_per_s == 0.0


def test_a_framelet_goes_once_to_a_process_that_needs_it_twice() -> None:
    text = SORT_LAST + "    - {id: again, op: tile, inputs: [near, fc], on: head}\n"
    text += "    - {id: more, op: sink, kind: png, input: again}\n"
    shown = diagram_of(make_layout(loads(text, name="twice.yaml")), samples_per_s=1e6)
    both = [edge(shown, "fc", "wall"), edge(shown, "fc", "again")]
    assert all(found.crosses for found in both)
    assert sorted(found.bytes_per_s for found in both) == [0.0, 100 * 50 * 10 * 3]


def test_boxes_say_where_they_run(sort_last: Diagram) -> None:
    processes = {box.id: box.process for box in sort_last.boxes}
    assert processes["near"] == processes["page"] == "head"
    assert processes["fa"] == processes["fc"] == "compositor 1"
    assert (processes["a"], processes["b"], processes["c"]) == ("rank 2", f"ranks 3{TO}4", "rank 5")
    assert {key: process.role for key, process in sort_last.processes.items()} == {
        "head": "head",
        "compositor 1": "compositor",
        "rank 2": "renderer",
        f"ranks 3{TO}4": "renderer",
        "rank 5": "renderer",
    }


def test_inputs_stand_before_those_who_need_them(sort_last: Diagram) -> None:
    order = [box.id for box in sort_last.boxes]
    assert all(order.index(found.start) < order.index(found.end) for found in sort_last.edges)


def test_the_assumption_is_stated(sort_last: Diagram) -> None:
    assert sort_last.assumptions[0] == "samples: 2 M samples/s a rank, 8.18 or 12.2 bytes each (frameless)"
    assert "10 a second" in sort_last.assumptions[1]


def test_a_panel_knows_who_composites_it_unless_several_do(sort_last: Diagram) -> None:
    assert [screen.process for screen in sort_last.screens] == ["", "compositor 1"]


def test_screens_have_their_bezels_and_the_eye_that_sees_them() -> None:
    """courtyard on a wall of 2 x 1 panels; the eye is where the configuration has it."""
    shown = diagram_of(make_layout(load(CONFIGS / "cave_corner.yaml")), samples_per_s=1e6)
    assert {tuple(eye) for screen in shown.screens for eye in screen.eyes} == {(0.0, -0.25, 1.1)}
    wide = diagram_of(make_layout(load(CONFIGS / "four_by_two_bezels.yaml")), samples_per_s=1e6)
    assert {screen.bezel for screen in wide.screens} == {(0.015, 0.015, 0.015, 0.03)}


STEREO = """
version: 1
scene: {source: courtyard}
wall:
  panels:
    - id: both
      pixels: [200, 100]
      stereo: side_by_side
      corners: {lower_left: [0, 0, 0], lower_right: [1, 0, 0], upper_left: [0, 0.5, 0]}
    - id: wall-left
      pixels: [100, 50]
      stereo: left
      host: a
      corners: {lower_left: [1.2, 0, 0], lower_right: [2.2, 0, 0], upper_left: [1.2, 0.5, 0]}
    - id: wall-right
      pixels: [100, 50]
      stereo: right
      host: b
      corners: {lower_left: [1.2, 0, 0], lower_right: [2.2, 0, 0], upper_left: [1.2, 0.5, 0]}
    - id: own
      pixels: [50, 100]
      eye: [2.6, 0.2, 0.9]
      rotation: 90
      host: own
      corners: {lower_left: [2.4, 0, 0], lower_right: [2.9, 0, 0], upper_left: [2.4, 1, 0]}
views: [{eye: [1, 0.5, 2], eye_separation: 0.07}]
"""


def test_panels_of_both_eyes_in_one_place_are_one_screen_with_two_eyes() -> None:
    both, passive, own = diagram_of(make_layout(loads(STEREO, name="stereo.yaml")), samples_per_s=1e6).screens
    assert (both.id, both.panels, both.notes) == ("both", ("both.left", "both.right"), ("stereo",))
    assert (passive.id, passive.panels) == ("wall-left + right", ("wall-left", "wall-right"))
    assert passive.notes == ("stereo", "a", "b")
    for screen in (both, passive):
        assert [tuple(eye) for eye in screen.eyes] == [pytest.approx((0.965, 0.5, 2)), pytest.approx((1.035, 0.5, 2))]
    assert [tuple(eye) for eye in own.eyes] == [(2.6, 0.2, 0.9)]
    assert own.notes == ("turned 90°",)  # its host is said by its id


def test_skipped_bezels_are_left_out_of_the_lit_area() -> None:
    text = SORT_LAST.replace("wall: {grid", "wall: {bezel: skip, grid")
    screens = diagram_of(make_layout(loads(text, name="skip.yaml")), samples_per_s=1e6).screens
    for shown in screens:
        assert shown.corners[1][0] - shown.corners[0][0] == pytest.approx(1.0)
        assert shown.corners[2][1] - shown.corners[0][1] == pytest.approx(0.5)
    assert screens[1].corners[0][0] - screens[0].corners[1][0] == pytest.approx(0.04)


def test_a_curved_screen_is_an_arc_from_above_and_as_wide_as_its_chord_from_the_front() -> None:
    shown = diagram_of(make_layout(load(CONFIGS / "walls" / "cylinder.yaml")), samples_per_s=1e6)
    above, front = top_view(shown.screens), front_view(shown.screens)
    assert [len(arc) > 100 for arc in above.screens] == [True] * 5
    for arc in above.screens:
        assert np.linalg.norm(arc, axis=1) == pytest.approx(2.4)
    assert front.kind == "unrolled"
    assert [placed.size for placed in front.placed] == [pytest.approx((2 * 2.4 * np.sin(np.radians(15)), 1.5))] * 5
    dome = diagram_of(make_layout(load(CONFIGS / "walls" / "dome.yaml")), samples_per_s=1e6)
    assert (np.linalg.norm(top_view(dome.screens).screens[0], axis=1) < 4.0).all()
