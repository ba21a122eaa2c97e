"""`overlay`: numbers in a corner."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from framelets import made, output_of, random_framelet, rect
from pydantic import ValidationError

from wall.core.data import Framelet
from wall.operators.overlay import Overlay, Statistics


def drawn(operator: Overlay, source: Framelet, shown: Statistics) -> Framelet:
    out = output_of(operator, [source])
    operator.apply([source], out, out.rect, shown)
    return out


def overlay(**keys: object) -> Overlay:
    operator = made(Overlay, input="a", **keys)
    assert isinstance(operator, Overlay)
    return operator


@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize("at", ["top_left", "top_right", "bottom_left", "bottom_right"])
def test_text_stands_in_its_corner_and_nothing_else_changes(
    at: str, encoded: bool, random_numbers: np.random.Generator
) -> None:
    source = random_framelet(random_numbers, rect(10, 20, 90, 60), encoded=encoded, channels=frozenset({"depth"}))
    operator = overlay(text="{fps}\nfps", at=at, size=12)
    shown = operator.prepare(Path(), [])
    shown.numbers = {"fps": 59.94}
    out, box = drawn(operator, source, shown), operator.box(source.rect)
    assert source.rect.contains(box)
    assert (box.x == 10) == at.endswith("left")
    assert (box.y == 20) == at.startswith("top")
    differs = (out.colour != source.colour).any(axis=2)
    inside = np.zeros_like(differs)
    inside[box.inside(source.rect)] = True
    assert not differs[~inside].any()
    assert out.colour[inside].max() == (255 if encoded else 1.0)
    np.testing.assert_array_equal(out.channel("depth"), source.channel("depth"))


def test_numbers_are_filled_in_and_unknown_ones_are_a_dash() -> None:
    operator = overlay(text="{fps} {samples_per_s} {latency_ms} {ranks}")
    assert operator.filled({}) == "- - - -"
    numbers = {"fps": 59.94, "samples_per_s": 1_234_567.0, "latency_ms": float("nan"), "ranks": 8}
    assert operator.filled(numbers) == "59.9 1.235M - 8"
    assert operator.filled({"samples_per_s": 12_345.0, "fps": 2.5e9, "latency_ms": 0.123}) == "2.5G 12.35k 0.123 -"


def test_the_box_is_the_same_whatever_the_numbers_are() -> None:
    operator, whole = overlay(text="{samples_per_s}", size=10), rect(0, 0, 200, 40)
    source = Framelet.blank(whole, frozenset({"alpha"}))
    inside = np.zeros((40, 200), np.bool_)
    inside[operator.box(whole).inside(whole)] = True
    for value in (0.0, 1e12, 1_234_567.0, 1e-9):
        out = drawn(operator, source, Statistics({"samples_per_s": value}))
        assert (out.channel("alpha")[~inside] == 0.0).all()
        assert (out.channel("alpha")[inside] > 0.5).all()


def test_a_image_smaller_than_the_text_gets_its_beginning() -> None:
    source = Framelet.blank(rect(0, 0, 9, 5), frozenset())
    assert drawn(overlay(), source, Statistics()).rect == rect(0, 0, 9, 5)


def test_unknown_placeholders_are_refused() -> None:
    with pytest.raises(ValidationError, match=r"\{speed\}"):
        overlay(text="{speed}")
