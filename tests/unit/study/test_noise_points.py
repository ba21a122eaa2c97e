"""How fast noise falls with samples: ours faster than independent ones, whose error is as 1 / sqrt(N)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from wall.core.errors import ConfigError
from wall.core.kernel_cache import PACKAGE
from wall.study.noise.points import PointsRow, error_of, measure_points
from wall.study.options import counts_of

SMOOTH = PACKAGE.parent / "configs" / "measure" / "lamps.yaml"
WORTH = 110.0  # independent samples that 64 of ours are to equal, at least


@cache
def rows() -> list[PointsRow]:
    return measure_points(SMOOTH, size=(16, 16), counts=(4, 64), say=lambda _: None)


def test_64_samples_are_worth_110_independent_ones(compiled_only: None) -> None:
    assert rows()[1].equals >= WORTH


def test_error_falls_faster_than_that_of_independent_samples(compiled_only: None) -> None:
    """By 16 times as many samples: independent ones by 4 (within 15 %, errors of 768 values), ours by 5 or more."""
    few, many = rows()
    assert few.independent / many.independent == pytest.approx(4.0, rel=0.15)
    assert few.ours / many.ours >= 5.0


def test_the_error_of_two_images_is_that_of_either(random_numbers: np.random.Generator) -> None:
    a, b = random_numbers.normal(3.0, 0.2, (2, 100, 100, 3))
    assert error_of(a, b) == pytest.approx(0.2, rel=0.02)


def test_numbers_of_samples_are_whole_and_positive() -> None:
    assert counts_of("--spp", "64, 4,4") == (4, 64)
    for text in ("0", "x", "1.5", ""):
        with pytest.raises(ConfigError, match="--spp"):
            counts_of("--spp", text)
