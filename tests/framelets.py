"""Framelets for tests of operators: random ones, and comparing them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wall.core.data import CHANNELS, Channels, Framelet, Rect
from wall.operators.base import Operator

EVERY: Channels = frozenset(CHANNELS)


def rect(x: int, y: int, width: int, height: int) -> Rect:
    return Rect(x=x, y=y, width=width, height=height)


def random_framelet(
    rng: np.random.Generator, where: Rect, *, channels: Channels = EVERY, encoded: bool = False, order: int = 0
) -> Framelet:
    """Few different depths, times and alphas, so that there are ties; some far, unseen or transparent."""
    made = Framelet.blank(where, channels, encoded=encoded, order=order)
    size = (where.height, where.width)
    if encoded:
        made.colour[...] = rng.integers(0, 256, (*size, 3))
    else:
        made.colour[...] = rng.random((*size, 3), np.float32)
    few: dict[str, list[float]] = {
        "depth": [1.0, 2.0, 3.5, np.inf],
        "alpha": [0.0, 0.25, 0.7, 1.0],
        "time": [-2.0, -1.0, -0.25, -np.inf],
        "object_id": [0, 1, 2, 70000],
        "variance": [0.01, 0.5, 2.0, np.inf],
        "albedo": [0.0, 0.04, 0.3, 1.0],
        "normal": [-1.0, 0.0, 0.25, 1.0],
    }
    for name in channels - {"colour"}:
        made.channel(name)[...] = rng.choice(np.array(few[name]), made.channel(name).shape)
    if made.alpha is not None and not encoded:
        made.colour *= made.alpha[..., None]
    return made


def output_of(operator: Operator, inputs: Sequence[Framelet], *, encoded: bool | None = None) -> Framelet:
    """What an executor would prepare for an operator's output, filled with values that it must overwrite."""
    where = operator.rect([framelet.rect for framelet in inputs])
    channels = operator.gives([framelet.channels for framelet in inputs])
    as_input = bool(inputs) and inputs[0].encoded
    out = Framelet.blank(where, channels, encoded=as_input if encoded is None else encoded)
    for name in out.channels:
        out.channel(name)[...] = 77
    return out


def applied(
    operator: Operator, *inputs: Framelet, encoded: bool | None = None, folder: Path = Path(), refreshed_at: float = 0.0
) -> Framelet:
    """The whole output at once."""
    out = output_of(operator, inputs, encoded=encoded)
    out.refreshed_at = refreshed_at
    operator.apply(inputs, out, out.rect, operator.prepare(folder, [framelet.rect for framelet in inputs]))
    return out


def by_regions(
    operator: Operator, inputs: Sequence[Framelet], cuts: tuple[list[int], list[int]], whole: Framelet, folder: Path
) -> Framelet:
    """The output region by region, cut at the given columns and rows; every pixel must be written."""
    out = output_of(operator, inputs, encoded=whole.encoded)
    out.refreshed_at, prepared, area = (
        whole.refreshed_at,
        operator.prepare(folder, [framelet.rect for framelet in inputs]),
        out.rect,
    )
    xs, ys = (
        [start, *sorted({c for c in cut if start < c < end}), end]
        for start, end, cut in ((area.x, area.right, cuts[0]), (area.y, area.bottom, cuts[1]))
    )
    for top, bottom in pairwise(ys):
        for left, right in pairwise(xs):
            operator.apply(inputs, out, rect(left, top, right - left, bottom - top), prepared)
    return out


def assert_equal(got: Framelet, expected: Framelet) -> None:
    assert got.rect == expected.rect
    assert got.channels == expected.channels
    for name in got.channels:
        np.testing.assert_array_equal(got.channel(name), expected.channel(name), err_msg=name)


def made(operator: type[Operator], **keys: Any) -> Operator:
    """An operator of its YAML's keys; `id` and `op` need not be said."""
    word = operator.model_fields["op"].annotation.__args__[0]  # type: ignore[union-attr]
    return operator.model_validate({"id": "it", "op": word, **keys})
