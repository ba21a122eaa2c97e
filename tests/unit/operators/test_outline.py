"""`outline`: a line along the edges of a framelet, and around insets where a view has a border."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import made, output_of, random_framelet, rect

from wall.operators.outline import SIDES, Outline, Side


@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize("sides", [SIDES, ("left",), ("top", "right")])
def test_the_line_lies_inside_of_the_edges_that_have_one_and_nothing_else_changes(
    sides: tuple[Side, ...], encoded: bool, random_numbers: np.random.Generator
) -> None:
    source = random_framelet(random_numbers, rect(10, 20, 9, 7), encoded=encoded)
    operator = made(Outline, input="a", width=2, color=(1.0, 0.0, 0.5), sides=sides)
    out = output_of(operator, [source])
    operator.apply([source], out, out.rect, None)
    line = np.zeros((7, 9), bool)
    for side, part in {"left": np.s_[:, :2], "top": np.s_[:2], "right": np.s_[:, -2:], "bottom": np.s_[-2:]}.items():
        line[part] |= side in sides
    np.testing.assert_array_equal(out.colour[line], [[255, 0, 188] if encoded else [1.0, 0.0, 0.5]] * line.sum())
    assert out.alpha is not None
    assert source.alpha is not None
    assert (out.alpha[line] == 1.0).all()
    np.testing.assert_array_equal(out.colour[~line], source.colour[~line])
    np.testing.assert_array_equal(out.alpha[~line], source.alpha[~line])


def test_of_an_image_smaller_than_two_lines_all_is_line(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 3, 5))
    operator = made(Outline, input="a", width=4)
    out = output_of(operator, [source])
    operator.apply([source], out, out.rect, None)
    assert (out.colour == 1.0).all()
