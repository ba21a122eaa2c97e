"""`depth` and `newest` against a pixel by pixel twin."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import EVERY, applied, assert_equal, made, output_of, random_framelet, rect

from wall.core.data import BLANK, ORIGIN_STEP_S, Framelet
from wall.operators import selection
from wall.operators.base import Operator
from wall.operators.depth import Depth
from wall.operators.regions import BAND_PIXELS
from wall.operators.selection import Newest

OPAQUE = EVERY - {"alpha"}  # pixels that are covered in part have a test of their own
COVERAGE_LEFT = 1e-3  # of a pixel, above which no farther surface is looked for
OPERATORS: dict[str, Operator] = {
    "depth": made(Depth, inputs=("a", "b")),
    "time": made(Newest, inputs=("a", "b")),
}


def selected_one_by_one(inputs: list[Framelet], out: Framelet, key: str) -> Framelet:
    """Sort what each pixel has: first by key, then by input; times made absolute."""
    for y in range(out.rect.y, out.rect.bottom):
        for x in range(out.rect.x, out.rect.right):
            here, found = (y - out.rect.y, x - out.rect.x), []
            for k, framelet in enumerate(inputs):
                there = (y - framelet.rect.y, x - framelet.rect.x)
                if framelet.rect.contains(rect(x, y, 1, 1)) and not np.isnan(framelet.channel(key)[there]):
                    value = float(framelet.channel(key)[there]) + (framelet.time_origin if key == "time" else 0.0)
                    found.append((value if key == "depth" else -value, k, there))
            best = min(found, default=None)
            for name in out.channels:
                nothing = BLANK[name][0] if name in BLANK else 0
                value = inputs[best[1]].channel(name)[best[2]] if best else nothing
                later = inputs[best[1]].time_origin - out.time_origin if best and name == "time" else 0.0
                out.channel(name)[here] = value + later if later else value
    return out


@pytest.mark.parametrize("key", ["depth", "time"])
@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize(
    "places",
    [
        [(0, 0, 9, 7)],
        [(0, 0, 9, 7)] * 2,
        [(0, 0, 9, 7)] * 4,
        [(0, 0, 9, 7), (3, 2, 9, 7), (-4, 5, 6, 6)],
        [(0, 0, 3, 3), (5, 5, 3, 3)],
        [(0, 0, 70, 3), (60, 0, 80, 3)],
    ],
)
def test_the_winner_of_every_pixel_is_the_twins(
    key: str, encoded: bool, places: list[tuple[int, int, int, int]], random_numbers: np.random.Generator
) -> None:
    inputs = [random_framelet(random_numbers, rect(*place), channels=OPAQUE, encoded=encoded) for place in places]
    for k, framelet in enumerate(inputs):
        framelet.channel("time")[...] += 0.5 * k
        framelet.stamp(k * ORIGIN_STEP_S)  # exact in float32 with the times at hand
        framelet.channel(key)[random_numbers.random(framelet.channel(key).shape) < 0.2] = np.nan
    twin = selected_one_by_one(inputs, output_of(OPERATORS[key], inputs), key)
    assert_equal(applied(OPERATORS[key], *inputs), twin)


@pytest.mark.parametrize("share", [0.02, 1.0])
def test_with_alpha_each_surface_fills_what_nearer_ones_left_of_a_pixel(
    share: float, random_numbers: np.random.Generator
) -> None:
    """The twin takes the surfaces of a pixel in order and gives each its alpha, until they sum to 1."""
    inputs = [random_framelet(random_numbers, rect(0, 0, 13, 9), channels=OPAQUE | {"alpha"}) for _ in range(3)]
    for framelet in inputs:  # few pixels that are covered in part go another way than many
        alpha = framelet.channel("alpha")
        whole = (random_numbers.random(alpha.shape) >= share) & (alpha > 0.0)
        framelet.colour[whole] /= alpha[whole, None]
        alpha[whole] = 1.0
    inputs.append(random_framelet(random_numbers, rect(4, 3, 9, 9), channels=OPAQUE))  # opaque, and only there
    inputs[0].channel("depth")[random_numbers.random((9, 13)) < 0.2] = np.nan
    out = applied(OPERATORS["depth"], *inputs)
    assert out.channels == {"colour", "depth", "object_id", "alpha"}
    for y in range(out.rect.height):
        for x in range(out.rect.width):
            layers = []
            for k, framelet in enumerate(inputs):
                there = (y - framelet.rect.y, x - framelet.rect.x)
                if framelet.rect.contains(rect(x, y, 1, 1)) and not np.isnan(framelet.channel("depth")[there]):
                    alpha = 1.0 if framelet.alpha is None else float(framelet.alpha[there])
                    if alpha > 0.0:
                        layers.append((float(framelet.channel("depth")[there]), k, alpha, there))
            layers.sort()
            colour, covered = np.zeros(3), 0.0
            for _, k, alpha, there in layers:
                share = min(alpha, 1.0 - covered)
                colour += share / alpha * inputs[k].colour[there]
                covered += share
            np.testing.assert_allclose(out.colour[y, x], colour, atol=COVERAGE_LEFT)
            assert out.channel("alpha")[y, x] == pytest.approx(covered, abs=COVERAGE_LEFT)
            assert out.channel("depth")[y, x] == (layers[0][0] if layers else np.inf)
            assert out.channel("object_id")[y, x] == (
                inputs[layers[0][1]].channel("object_id")[layers[0][3]] if layers else 0
            )


def test_of_equally_far_surfaces_the_earlier_input_is_seen() -> None:
    one, other = (Framelet.blank(rect(0, 0, 4, 4), frozenset({"depth"})) for _ in range(2))
    one.colour[...] = 1.0
    other.colour[...] = 2.0
    assert (applied(OPERATORS["depth"], one, other).colour == 1.0).all()
    assert (applied(OPERATORS["depth"], other, one).colour == 2.0).all()


def test_bands_of_a_large_image_meet(compiled_only: None, random_numbers: np.random.Generator) -> None:
    where = rect(0, 0, 700, 3 * BAND_PIXELS // 700)
    inputs = [random_framelet(random_numbers, where, channels=frozenset({"depth", "object_id"})) for _ in range(3)]
    out = applied(OPERATORS["depth"], *inputs)
    depths = np.stack([framelet.channel("depth") for framelet in inputs])
    first = depths.argmin(axis=0)
    for name in ("colour", "depth", "object_id"):
        values = np.stack([framelet.channel(name) for framelet in inputs])
        index = first.reshape(1, *first.shape, *[1] * (values.ndim - 3))
        np.testing.assert_array_equal(out.channel(name), np.take_along_axis(values, index, axis=0)[0])


def test_nothing_outside_the_region_is_written(random_numbers: np.random.Generator) -> None:
    inputs = [random_framelet(random_numbers, rect(0, 0, 12, 8), channels=OPAQUE) for _ in range(2)]
    out = output_of(OPERATORS["depth"], inputs)
    selection.select(inputs, out, rect(3, 2, 5, 4), key="depth", sign=1)
    outside = np.ones((8, 12), np.bool_)
    outside[2:6, 3:8] = False
    assert all((out.channel(name)[outside] == 77).all() for name in OPAQUE)
    assert (out.colour[~outside] != 77).all()
