"""The top view: screens, eyes and frusta from above."""

from __future__ import annotations

import numpy as np
import pytest
from small_diagrams import EYE, screen, upright

from wall.commands.drawing.top_view import BEYOND, top_view


def test_rows_of_a_grid_are_one_line_from_above() -> None:
    found = top_view([upright("top", 0.0, 0.6), upright("bottom", 0.0, 0.0), upright("beside", 1.1, 0.0)])
    assert len(found.screens) == len(found.wedges) == 2
    assert len(found.eyes) == 1


def test_a_frustum_goes_from_the_eye_through_both_edges_of_its_screen() -> None:
    (wedge,) = top_view([upright("a", 0.5, 0.0)]).wedges
    ends = sorted(tuple(end) for end in (wedge.left, wedge.right))
    assert ends == [(0.5, 0.0), (1.5, 0.0)]
    assert tuple(wedge.eye) == (EYE[0], EYE[2])
    for end, edge in zip(wedge.ends(), (wedge.left, wedge.right), strict=True):
        assert end - wedge.eye == pytest.approx(BEYOND * (edge - wedge.eye))


def test_every_screen_is_seen_from_its_own_eye() -> None:
    found = top_view([upright("a", 0.0, 0.0), upright("b", 1.0, 0.0, eye=(1.5, 0.0, 1.0))])
    assert sorted(tuple(eye) for eye in found.eyes) == [(0.0, 2.0), (1.5, 1.0)]
    assert {tuple(wedge.eye) for wedge in found.wedges} == {(0.0, 2.0), (1.5, 1.0)}


def test_a_floor_under_the_eye_has_no_frustum_in_the_top_view() -> None:
    found = top_view([screen("floor", (-1, -1, 3), (1, -1, 3), (-1, -1, 1))])
    assert found.wedges == ()
    assert len(found.screens) == 1


def test_bounds_hold_screens_eyes_and_frusta() -> None:
    """From (0, 2) through (+-0.5, 0), 12 % farther: to (+-0.56, -0.24)."""
    found = top_view([upright("a", -0.5, 0.0)])
    assert found.bounds() == pytest.approx((-0.56, -0.24, 0.56, 2.0))


def test_of_many_frusta_only_the_outermost_edges_are_drawn() -> None:
    screens = [upright(f"p{k}", 0.1 * k - 2.0, 0.0, width=0.1) for k in range(40)]
    found = top_view(screens)
    assert len(found.edges(most=80)) == 80
    few = found.edges(most=79)
    ends = sorted(float(eye[0] + (end[0] - eye[0]) / BEYOND) for eye, end in few)
    assert ends == pytest.approx([-2.0, 2.0])


def test_a_gap_between_many_screens_keeps_its_edges() -> None:
    screens = [upright(f"p{k}", 0.1 * k + (0.5 if k >= 20 else 0.0), 0.0, width=0.1) for k in range(40)]
    few = top_view(screens).edges(most=10)
    ends = sorted(float(eye[0] + (end[0] - eye[0]) / BEYOND) for eye, end in few)
    assert ends == pytest.approx(np.array([0.0, 2.0, 2.5, 4.5]))
