"""Read and write rectangles of framelets: what operators copy and blank, band by band."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import BLANK, Channels, Framelet, Rect
from wall.operators.kernels import resample as kernels

MIXED: Channels = frozenset({"colour", "alpha", "variance", "albedo", "normal"})  # may be computed of several pixels
WHOLE: Channels = frozenset({"depth", "time", "object_id"})  # not so: a mean of two surfaces would be of neither
BAND_PIXELS = 1 << 15  # 512 kB of colour and depth: a band stays in a core's own cache while inputs are folded into it


def bands(region: Rect) -> Iterator[Rect]:
    """Cut a region into strips over its whole width, of BAND_PIXELS or one row."""
    rows = max(1, BAND_PIXELS // region.width)
    for y in range(region.y, region.bottom, rows):
        yield Rect(x=region.x, y=y, width=region.width, height=min(rows, region.bottom - y))


def overlapping(framelets: Sequence[Framelet], region: Rect) -> list[tuple[Framelet, Rect]]:
    """The framelets that have pixels in a region, each with the rectangle of those."""
    return [(f, overlap) for f in framelets if (overlap := f.rect.intersection(region)) is not None]


def pixels_of(framelet: Framelet, name: str, rect: Rect) -> NDArray[Any]:
    """A view of one channel: the pixels of `rect` (frame coordinates, inside the framelet)."""
    view: NDArray[Any] = framelet.channel(name)[rect.inside(framelet.rect)]
    return view


def values_for(out: Framelet, framelet: Framelet, name: str, rect: Rect) -> NDArray[Any]:
    """One channel's pixels of `rect` as `out` holds them: times count from its origin. Not to be written to."""
    return timed(out, framelet, name, pixels_of(framelet, name, rect))


def timed(out: Framelet, framelet: Framelet, name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Values of one of the framelet's channels as `out` holds them: times count from its origin."""
    shift = time_shift(framelet, out)
    return values + shift if name == "time" and shift != 0.0 else values


def time_shift(framelet: Framelet, out: Framelet) -> np.float32:
    """What must be added to a framelet's times for them to count from the output's origin, seconds."""
    return np.float32(framelet.time_origin - out.time_origin)


def corner_of(framelet: Framelet, rect: Rect) -> tuple[int, int]:
    """x, y of a rectangle's top left corner in a framelet's arrays."""
    return rect.x - framelet.rect.x, rect.y - framelet.rect.y


def copy(source: Framelet, out: Framelet, rect: Rect, *, but: Channels = frozenset()) -> None:
    """Copy the pixels of `rect`, inside both, in every channel that `out` has, except those of `but`."""
    for name in out.channels - but:
        pixels_of(out, name, rect)[...] = values_for(out, source, name, rect)


def copy_where(values: NDArray[Any], out: NDArray[Any], where: NDArray[np.bool_]) -> None:
    """Copy the pixels of a channel, of one or three numbers each, where the mask (h, w) says."""
    np.copyto(out, values, where=where if out.ndim == where.ndim else where[..., None])


def blank(out: Framelet, rect: Rect, where: NDArray[np.bool_] | None = None) -> None:
    """Make pixels black, infinitely far, transparent, never traced: all of `rect`, or where the mask says."""
    for name in out.channels:
        pixels_of(out, name, rect)[... if where is None else where] = BLANK[name][0] if name in BLANK else 0


def copy_nearest(
    source: Framelet, out: Framelet, region: Rect, y: NDArray[Any], x: NDArray[Any], *, where: Any = True
) -> None:
    """Write depth, time and object of the source's pixels y, x, one for each pixel of a region, where that says so."""
    for name in out.channels & WHOLE:
        nearest = timed(out, source, name, source.channel(name)[y, x])
        np.copyto(pixels_of(out, name, region), nearest, where=where)


def look_up(source: Framelet, out: Framelet, region: Rect, positions: NDArray[np.int32]) -> None:
    """Write the pixels of a region, each from its position (h, w, 2) in the source; see kernels.look_up_bilinear."""
    positions = np.ascontiguousarray(positions)
    blank(out, region)
    for name in out.channels & MIXED:
        here = pixels_of(out, name, region)
        written = np.ascontiguousarray(here)  # the same memory where the region is as wide as the framelet
        planes, found = (a.reshape(*a.shape[:2], -1) for a in (source.channel(name), written))
        kernels.look_up_bilinear(planes, positions, name == "variance", found)
        if not np.may_share_memory(written, here):
            here[...] = written
    if not out.channels & WHOLE:
        return
    inside = positions[..., 0] != kernels.NOWHERE
    size = (source.rect.width, source.rect.height)
    rounded = (positions + kernels.SUBPIXELS // 2) // kernels.SUBPIXELS
    x, y = (np.clip(rounded[..., c], 0, size[c] - 1) for c in range(2))
    copy_nearest(source, out, region, y, x, where=inside)


def copy_all(inputs: Sequence[Framelet], out: Framelet, region: Rect) -> None:
    """Copy every input's pixels of a region, the later input's where two have some; blank where none has any."""
    parts = overlapping(inputs, region)
    apart = all(not a.overlaps(b) for i, (_, a) in enumerate(parts) for _, b in parts[:i])
    full = any(rect == region for _, rect in parts) or (apart and sum(rect.area for _, rect in parts) == region.area)
    if not full:
        blank(out, region)
    for framelet, rect in parts:
        copy(framelet, out, rect)
