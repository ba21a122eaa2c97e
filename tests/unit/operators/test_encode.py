"""`encode`: the same display values as images that are shown directly."""

from __future__ import annotations

import numpy as np
from framelets import applied, made, random_framelet, rect

from wall.core.colour import srgb_encoded
from wall.operators.colour import Encode
from wall.reconstruction.display_values import update_display

ENCODE = made(Encode, input="a")
ODD = np.array([0.0, -0.0, -3.0, 1.0, 9.0, np.inf, -np.inf, np.nan, 1e-40], np.float32)


def test_codes_are_within_one_of_exact_srgb_and_equal_to_the_reconstructions(
    random_numbers: np.random.Generator,
) -> None:
    source = random_framelet(random_numbers, rect(3, 4, 37, 29))
    source.colour *= 1.2
    source.colour.reshape(-1)[: len(ODD)] = ODD
    out = applied(ENCODE, source, encoded=True)
    exact = np.round(255 * srgb_encoded(np.nan_to_num(source.colour.astype(np.float64), nan=0.0)))
    assert np.abs(out.colour.astype(int) - exact).max() <= 1
    shown = np.zeros_like(out.colour)
    update_display(source.colour, np.ones((1, 1), np.bool_), 64, shown)
    np.testing.assert_array_equal(out.colour, shown)


def test_other_channels_stay(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 6, 5))
    out = applied(ENCODE, source, encoded=True)
    for name in out.channels - {"colour"}:
        np.testing.assert_array_equal(out.channel(name), source.channel(name))
