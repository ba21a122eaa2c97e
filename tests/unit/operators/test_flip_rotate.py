"""`flip` and `rotate`: where each pixel goes."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, assert_equal, made, random_framelet, rect

from wall.operators.arrange import Flip, Rotate


@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize(
    ("operator", "place"),
    [
        (made(Flip, input="a", axis="horizontal"), lambda x, y, w, h: (w - 1 - x, y)),
        (made(Flip, input="a", axis="vertical"), lambda x, y, w, h: (x, h - 1 - y)),
        (made(Rotate, input="a", degrees=90), lambda x, y, w, h: (h - 1 - y, x)),  # the top row to the right
        (made(Rotate, input="a", degrees=180), lambda x, y, w, h: (w - 1 - x, h - 1 - y)),
        (made(Rotate, input="a", degrees=270), lambda x, y, w, h: (y, w - 1 - x)),
    ],
)
def test_every_pixel_goes_to_its_place(operator, place, encoded: bool, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(3, -2, 5, 4), encoded=encoded)
    out = applied(operator, source)
    assert (out.rect.x, out.rect.y) == (3, -2)
    for name in source.channels:
        for y in range(4):
            for x in range(5):
                to = place(x, y, 5, 4)
                np.testing.assert_array_equal(out.channel(name)[to[1], to[0]], source.channel(name)[y, x])


def test_turning_on_and_back_changes_nothing(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(3, -2, 5, 4))
    there = applied(made(Rotate, input="a", degrees=90), source)
    assert_equal(applied(made(Rotate, input="a", degrees=270), there), source)
