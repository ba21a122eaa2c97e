"""Parts of framelets: what operators copy, blank and work through band by band."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import BLANK, Framelet, Rect

BAND_PIXELS = (
    1 << 15
)  # 512 kB of colour and depth: a band stays in a core's own cache while input after input is folded


def bands(region: Rect) -> Iterator[Rect]:
    """Cut a region into strips over its whole width."""
    rows = max(1, BAND_PIXELS // region.width)
    for y in range(region.y, region.bottom, rows):
        yield Rect(x=region.x, y=y, width=region.width, height=min(rows, region.bottom - y))


def part(framelet: Framelet, name: str, rect: Rect) -> NDArray[Any]:
    """A view of one channel: the pixels of `rect` (frame coordinates, inside the framelet)."""
    view: NDArray[Any] = framelet.channel(name)[rect.inside(framelet.rect)]
    return view


def corner(framelet: Framelet, rect: Rect) -> tuple[int, int]:
    """x, y of a rectangle's corner in a framelet's arrays."""
    return rect.x - framelet.rect.x, rect.y - framelet.rect.y


def later(framelet: Framelet, out: Framelet) -> np.float32:
    """What must be added to a framelet's times for them to count from the output's origin, seconds."""
    return np.float32(framelet.time_origin - out.time_origin)


def copy(source: Framelet, out: Framelet, rect: Rect, *, but: frozenset[str] = frozenset()) -> None:
    """Copy the pixels of `rect`, inside both, in every channel that `out` has."""
    for name in out.channels - but:
        there, here = part(source, name, rect), part(out, name, rect)
        if name == "time" and later(source, out) != 0.0:
            np.add(there, later(source, out), out=here)
        else:
            here[...] = there


def blank(out: Framelet, rect: Rect, where: NDArray[np.bool_] | None = None) -> None:
    """Nothing there: black, infinitely far, opaque nowhere, never traced; in all of `rect` or where the mask says."""
    for name in out.channels:
        here = part(out, name, rect)
        value = BLANK[name][0] if name in BLANK else 0
        if where is None:
            here[...] = value
        else:
            here[where] = value


def covered(rects: Sequence[Rect], region: Rect) -> bool:
    """Whether rectangles that do not overlap cover all of a region; False if they might not."""
    inside = [met for rect in rects if (met := rect.meet(region))]
    apart = all(not a.meets(b) for i, a in enumerate(inside) for b in inside[:i])
    return any(rect.holds(region) for rect in rects) or (apart and sum(r.area for r in inside) == region.area)


def contiguous(framelet: Framelet, name: str) -> NDArray[Any]:
    """A channel as kernels take it: no stride but its own rows'."""
    return np.ascontiguousarray(framelet.channel(name))
