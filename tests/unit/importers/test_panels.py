"""Drafts become panels that a configuration accepts; every change is reported."""

from __future__ import annotations

import numpy as np
import pytest

from wall.importers.overlaps import declare_overlaps
from wall.importers.panels import Draft, configuration, corners_of, fit_panels, unique_names, upright
from wall.importers.report import NotThisFormat
from wall.importers.source import Node, Source


def node(line: int = 1) -> Node:
    return Node(name="screen", line=line, column=1, kind="object")


def source() -> Source:
    return Source("w.json", Node(name="", line=1, column=1, kind="object"))


def draft(corners: np.ndarray, **given: object) -> Draft:
    return Draft(**{"node": node(), "name": "a", "pixels": (100, 50), "corners": corners} | given)  # type: ignore[arg-type]


def remarks(made: Source) -> list[str]:
    return [item.why for item in made.close({}, panels=0, ranks=0).not_carried]


def test_a_skewed_screen_keeps_its_lower_edge_and_gets_a_right_angle() -> None:
    made = source()
    skewed = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.1, 1.0, 0.0]])

    panel = fit_panels(made, [draft(skewed)], None)[0][0]

    assert panel["corners"]["lower_right"] == [2.0, 0.0, 0.0]
    assert panel["corners"]["upper_left"] == [0.0, 1.0, 0.0]
    assert "84.3 degrees" in remarks(made)[0]  # atan(1 / 0.1)


def test_a_corner_within_half_a_degree_stays_as_it_is() -> None:
    made = source()
    nearly = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.005, 1.0, 0.0]])

    assert fit_panels(made, [draft(nearly)], None)[0][0]["corners"]["upper_left"] == [0.005, 1.0, 0.0]
    assert remarks(made) == []


def test_a_screen_with_its_back_to_the_eye_is_turned_round() -> None:
    made = source()
    backwards = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 0.0]])

    panel = fit_panels(made, [draft(backwards)], np.array([0.0, 0.0, 2.0]))[0][0]

    assert panel["corners"]["lower_left"] == [0.0, 0.0, 0.0]
    assert panel["corners"]["upper_left"] == [0.0, 1.0, 0.0]
    assert "left and right are exchanged" in remarks(made)[0]


def test_an_eye_in_the_plane_of_a_panel_is_moved_before_it() -> None:
    made = source()

    _, eye = fit_panels(made, [draft(upright(-1.0, -0.5, 2.0, 1.0))], np.zeros(3))

    np.testing.assert_allclose(eye, [0.0, 0.0, 2.0])
    assert "it is at [0, 0, 2] now" in remarks(made)[0]


def test_an_eye_that_is_moved_stays_before_all_other_panels() -> None:
    across = np.array([[1.0, -1.0, 1.5], [-1.0, -1.0, 1.5], [1.0, 1.0, 1.5]])  # faces -z, 1.5 m behind the viewer

    _, eye = fit_panels(source(), [draft(upright(-1.0, -1.0, 2.0, 2.0)), draft(across)], np.zeros(3))

    np.testing.assert_allclose(eye, [0.0, 0.0, 1.0])


def test_too_many_pixels_are_scaled_down_at_the_same_aspect() -> None:
    panel = fit_panels(source(), [draft(upright(0, 0, 1, 1), pixels=(40_000, 20_000))], None)[0][0]

    assert panel["pixels"] == [16384, 8192]


def test_odd_pixels_leave_one_out_where_two_eyes_share_them() -> None:
    panel = fit_panels(source(), [draft(upright(0, 0, 1, 1), pixels=(101, 50), stereo="side_by_side")], None)[0][0]

    assert panel["pixels"] == [100, 50]


def test_more_panels_than_a_configuration_holds_are_refused() -> None:
    with pytest.raises(NotThisFormat, match="has 1025 panels; accepted: 1 to 1024"):
        fit_panels(source(), [draft(upright(0, 0, 1, 1))] * 1025, None)


def test_a_panel_wider_than_a_rank_can_render_gets_more_ranks() -> None:
    panels, _ = fit_panels(source(), [draft(upright(0, 0, 8, 1), pixels=(8192, 1024))], None)

    assert configuration(panels)["graph"] == {"preset": "sort-first", "ranks_per_panel": 2}
    assert "graph" not in configuration([panels[0] | {"pixels": [4096, 1024]}])


def test_names_are_made_valid_and_unique() -> None:
    assert unique_names(["Wand 1", "Wand 1", "", "..", "ä", "x" * 100]) == [
        "Wand-1",
        "Wand-1-2",
        "panel2",
        "panel3",
        "panel4",
        "x" * 48,
    ]


def test_names_of_both_eyes_stay_free() -> None:
    assert unique_names(["a", "a.left"]) == ["a", "a.left-2"]


def test_corners_that_span_no_rectangle_are_none() -> None:
    assert corners_of([0, 0, 0], [1, 0, 0], [1, 0, 0]) is None
    assert corners_of([0, 0, 0], [1, 0, 0], [2, 0, 0]) is None
    assert corners_of([0, 0, 0], [0, 0, 0], [0, 0, 0]) is None


def test_overlaps_are_declared_at_the_sides_that_meet() -> None:
    left, right, above = upright(0, 0, 2, 1), upright(1.75, 0, 2, 1), upright(0, 0.9, 2, 1)

    assert declare_overlaps([(left, "mono"), (right, "mono")]) == [{"right": 0.25}, {"left": 0.25}]
    assert declare_overlaps([(left, "mono"), (above, "mono")]) == [{"top": 0.1}, {"bottom": 0.1}]


def test_the_overlap_of_a_screen_inside_a_larger_one_is_its_width() -> None:
    whole, part = upright(0, 0, 6, 2), upright(0, 0, 2, 2)

    assert declare_overlaps([(whole, "mono"), (part, "mono")]) == [
        {"right": 2.0, "left": 2.0},
        {"left": 2.0, "right": 2.0},
    ]


def test_panels_for_different_eyes_do_not_overlap() -> None:
    screen = upright(0, 0, 2, 1)

    assert declare_overlaps([(screen, "left"), (screen, "right"), (screen, "mono")]) == [{}, {}, {}]
    assert declare_overlaps([(screen, "left"), (screen, "side_by_side")])[0] == {"right": 2.0, "left": 2.0}


def test_screens_in_different_planes_do_not_overlap() -> None:
    behind = upright(0, 0, 2, 1) - np.array([0.0, 0.0, 0.1])
    turned = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])

    assert declare_overlaps([(upright(0, 0, 2, 1), "mono"), (behind, "mono"), (turned, "mono")]) == [{}, {}, {}]


def test_a_bezel_is_dropped_where_panels_overlap() -> None:
    frame = dict.fromkeys(("left", "right", "top", "bottom"), 0.01)
    drafts = [draft(upright(0, 0, 2, 1), bezel=frame), draft(upright(1.9, 0, 2, 1), bezel=frame)]

    first = fit_panels(source(), drafts, None)[0][0]

    assert first["overlap"] == {"right": 0.1}
    assert first["bezel"] == {"left": 0.01, "top": 0.01, "bottom": 0.01}
