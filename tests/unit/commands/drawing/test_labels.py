"""Names on panels: in their panel, beside each other, and as much as there is room for."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import pytest
from small_diagrams import screen, upright

from wall.commands.drawing.front_view import front_view
from wall.commands.drawing.labels import Label, labels
from wall.commands.drawing.model import TIMES, Screen
from wall.commands.drawing.page import SMALL_PT


def texts(label: Label | None) -> list[str]:
    return [] if label is None else [text for text, _, _ in label.lines]


def labelled(screens: list[Screen], scale: float) -> list[Label | None]:
    """`scale`: mm of paper a metre."""
    return labels(front_view(screens), scale)


def test_a_large_panel_says_all_of_it_in_its_middle() -> None:
    (label,) = labelled([replace(upright("big", 1.0, 2.0), notes=("node3",))], 40.0)
    assert texts(label) == ["big", f"800 {TIMES} 600", "node3"]
    assert label is not None
    assert label.middle == pytest.approx((1.5 * 40.0, 2.25 * 40.0))


@pytest.mark.parametrize("scale", [4.0, 8.0, 12.0, 20.0, 30.0, 60.0])
def test_a_label_stays_in_its_panel_or_is_left_out(scale: float) -> None:
    found = labelled([upright("name", 0.0, 0.0), screen("steep", (2, 0, 0), (2.7, 0.7, 0), (1.5, 0.5, 0))], scale)
    for k, (x, y) in enumerate(((0.5, 0.25), (2.1, 0.6))):
        if (label := found[k]) is not None:
            left, bottom, right, top = label.box
            assert left >= (x - 0.6) * scale
            assert right <= (x + 0.6) * scale
            assert bottom >= (y - 0.6) * scale
            assert top <= (y + 0.6) * scale


def test_a_tiny_panel_has_no_label() -> None:
    assert labelled([upright("p", 0.0, 0.0)], 2.0) == [None]


def test_an_id_is_broken_at_its_signs_before_it_is_set_smaller() -> None:
    (label,) = labelled([upright("upper-left", 0.0, 0.0, width=0.4, height=0.4)], 30.0)
    assert texts(label)[:2] == ["upper-", "left"]


def test_type_becomes_smaller_before_the_id_is_left_out() -> None:
    (label,) = labelled([upright("abcdefg", 0.0, 0.0, width=0.4, height=0.2)], 27.0)
    assert label is not None
    assert label.lines == [("abcdefg", SMALL_PT, True)]


def test_equal_resolutions_are_written_on_all_panels_or_on_none() -> None:
    wide, small = upright("wide", 0.0, 0.0), upright("s", 1.0, 0.0, width=0.3, height=0.12)
    assert [texts(label) for label in labelled([wide, small], 30.0)] == [["wide"], ["s"]]
    other = replace(small, pixels=(300, 120))
    assert texts(labelled([wide, other], 30.0)[0]) == ["wide", f"800 {TIMES} 600"]


def test_a_panel_behind_others_finds_room_beside_their_names() -> None:
    whole = upright("preview", 0.0, 0.0, width=2.0, height=1.0)
    halves = [upright("a", 0.0, 0.0, height=1.0), upright("b", 1.0, 0.0, height=1.0)]
    found = [label for label in labelled([whole, *halves], 30.0) if label is not None]
    assert len(found) == 3
    for one, other in combinations(found, 2):
        a, b = one.box, other.box
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_a_name_stands_outside_the_overlap_of_its_panel() -> None:
    (label, _) = labelled([upright("a", 0.0, 0.0), upright("b", 0.45, 0.0)], 40.0)
    assert label is not None
    assert label.box[2] <= 0.45 * 40.0
