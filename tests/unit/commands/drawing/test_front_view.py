"""Screens laid flat: true sizes, neighbours beside each other, overlaps as they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_diagrams import screen, upright

from wall.commands.drawing.front_view import FrontView, area, front_view, meet, meeting
from wall.commands.drawing.model import Screen
from wall.core.data import Float64

EXACT_M = 1e-9  # metres: rounding of float64 alone


def corners_of(found: FrontView, name: str) -> Float64:
    """(4, 2) from the lower left, anticlockwise."""
    return next(placed.rect() for placed in found.placed if placed.screen.id == name)


def ring(count: int, *, gap: float = 0.0) -> list[Screen]:
    """Upright screens 1 m wide around the origin, as the sides of a regular polygon that is open at the back."""
    distance = (0.5 + gap / 2) / math.tan(math.pi / 12)
    found = []
    for k in range(count):
        turn = (k - (count - 1) / 2) * math.pi / 6
        ahead = np.array([math.sin(turn), 0.0, -math.cos(turn)])
        right = np.array([math.cos(turn), 0.0, math.sin(turn)])
        left = distance * ahead - 0.5 * right
        found.append(screen(f"p{k}", left, left + right, left + np.array([0.0, 0.8, 0.0])))
    return found


OPEN_BOX = [
    screen("front", (0, 0, 0), (1, 0, 0), (0, 1, 0)),
    screen("side", (1, 0, 0), (1, 0, 1), (1, 1, 0)),
    screen("lid", (0, 1, 0), (1, 1, 0), (0, 1, 1)),
    screen("floor", (0, 0, 1), (1, 0, 1), (0, 0, 0)),
    screen("other", (0, 0, 1), (0, 0, 0), (0, 1, 1)),
]


def covered(found: FrontView) -> float:
    """The largest area that two screens have in common."""
    rects = np.array([placed.rect() for placed in found.placed])
    shared = [meet(rects[i], rects[j]) for i, j in meeting(rects)]
    return max((area(polygon) for polygon in shared if polygon is not None), default=0.0)


def test_flat_wall_is_drawn_as_it_stands() -> None:
    found = front_view([upright("a", -1.0, 0.25), upright("b", 0.25, -0.5)])
    assert found.kind == "flat"
    assert corners_of(found, "a") == pytest.approx(np.array([[-1, 0.25], [0, 0.25], [0, 0.75], [-1, 0.75]]))
    assert corners_of(found, "b")[0] == pytest.approx(np.array([0.25, -0.5]))


def test_a_floor_alone_is_seen_from_above_with_its_own_right() -> None:
    found = front_view([screen("floor", (0, 0, 2), (3, 0, 2), (0, 0, 0))])
    assert found.kind == "flat"
    assert np.ptp(corners_of(found, "floor"), axis=0) == pytest.approx(np.array([3.0, 2.0]))


def test_a_panel_that_is_turned_in_its_plane_stays_turned() -> None:
    c, s = math.cos(0.3), math.sin(0.3)
    found = front_view([upright("a", 0.0, 0.0), screen("b", (2, 0, 0), (2 + c, s, 0), (2 - 0.5 * s, 0.5 * c, 0))])
    assert found.kind == "flat"
    assert corners_of(found, "b")[1] == pytest.approx(np.array([2 + c, s]))


def test_curved_wall_unrolls_to_a_straight_row_of_true_sizes() -> None:
    found = front_view(ring(5))
    assert found.kind == "unrolled"
    for k in range(4):
        right_edge, left_edge = corners_of(found, f"p{k}")[[1, 2]], corners_of(found, f"p{k + 1}")[[0, 3]]
        assert np.abs(right_edge - left_edge).max() < EXACT_M
    left, bottom, right, top = found.bounds()
    assert (right - left, top - bottom) == pytest.approx((5.0, 0.8))


def test_gaps_between_curved_panels_stay_as_wide_as_they_are() -> None:
    """Screens 1 m wide as sides of a dodecagon with sides of 1.1 m: their edges are 0.1 * cos(15 degrees) apart."""
    found = front_view(ring(3, gap=0.1))
    apart = corners_of(found, "p1")[0, 0] - corners_of(found, "p0")[1, 0]
    assert apart == pytest.approx(0.1 * math.cos(math.pi / 12), abs=EXACT_M)


def test_cave_with_floor_unfolds_to_a_net() -> None:
    """FrontView 2 x 2 m at z = -1, sides and floor fold outwards."""
    found = front_view(
        [
            screen("left", (-1, -1, 1), (-1, -1, -1), (-1, 1, 1)),
            screen("front", (-1, -1, -1), (1, -1, -1), (-1, 1, -1)),
            screen("right", (1, -1, -1), (1, -1, 1), (1, 1, -1)),
            screen("floor", (-1, -1, 1), (1, -1, 1), (-1, -1, -1)),
        ]
    )
    assert found.kind == "unrolled"
    middle = corners_of(found, "front").mean(axis=0)
    away = {name: corners_of(found, name).mean(axis=0) - middle for name in ("left", "right", "floor")}
    assert away["left"] == pytest.approx(np.array([-2.0, 0.0]), abs=EXACT_M)
    assert away["right"] == pytest.approx(np.array([2.0, 0.0]), abs=EXACT_M)
    assert away["floor"] == pytest.approx(np.array([0.0, -2.0]), abs=EXACT_M)


def test_panels_that_meet_nothing_stand_beside_each_other() -> None:
    found = front_view([upright("a", 0.0, 0.0), screen("b", (9, 0, 5), (9, 0, 6), (9, 1, 5))])
    assert found.kind == "apart"
    rects = np.array([placed.rect() for placed in found.placed])
    assert meeting(rects) == []
    assert sorted(area(rect) for rect in rects) == pytest.approx([0.5, 1.0])


def test_an_open_box_unfolds_without_covering_itself() -> None:
    found = front_view(OPEN_BOX)
    assert found.kind == "unrolled"
    assert covered(found) < EXACT_M


def test_a_net_that_would_cover_itself_is_laid_apart() -> None:
    """A higher side and a wider lid would both be unfolded to the position right above the side."""
    higher = screen("higher", (1, 1, 0), (1, 1, 1), (1, 2, 0))
    wider = screen("wider", (1, 1, 0), (2, 1, 0), (1, 1, 1))
    found = front_view([*OPEN_BOX[:3], higher, wider])
    assert found.kind == "apart"
    assert covered(found) < EXACT_M


def test_overlap_of_two_projectors_is_what_both_light() -> None:
    a, b = front_view([upright("a", 0.0, 0.0), upright("b", 0.8, 0.1)]).placed
    shared = meet(a.rect(), b.rect())
    assert shared is not None
    assert (shared.min(axis=0), shared.max(axis=0)) == (
        pytest.approx(np.array([0.8, 0.1])),
        pytest.approx(np.array([1.0, 0.5])),
    )


def test_squares_that_share_an_edge_have_no_area_in_common() -> None:
    a, b = front_view([upright("a", 0.0, 0.0), upright("b", 1.0, 0.0)]).placed
    assert meet(a.rect(), b.rect()) is None


def test_overlap_of_a_turned_square_is_an_octagon() -> None:
    """A square of side 2 and the same one turned by 45 degrees meet in a regular octagon: area 8 (sqrt(2) - 1)."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    c = math.sqrt(0.5)
    shared = meet(square, square @ np.array([[c, c], [-c, c]]))
    assert shared is not None
    assert len(shared) == 8
    assert area(shared) == pytest.approx(8 * (math.sqrt(2) - 1))
