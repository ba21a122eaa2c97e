"""Panels cut into rectangles of nearly equal area, one for each rank that renders a part."""

from __future__ import annotations

from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.geometry.panels import Panel

MAX_EDGE = 4096  # pixels; positions on the wire keep two sub-pixel bits up to this


def panel_regions(panel: Panel, ranks: int) -> tuple[Rect, ...]:
    """A panel cut by `split` among its ranks.

    Raises ConfigError: a region would have an edge above MAX_EDGE pixels, or the panel has fewer pixels than ranks.
    """
    whole = Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1])
    size = f"{whole.width} x {whole.height} pixels"
    if ranks > whole.area:
        raise ConfigError(f"panel {panel.id} ({size}): {ranks} ranks are too many; accepted: up to {whole.area}")
    rects = split(whole, ranks)
    if any(max(rect.width, rect.height) > MAX_EDGE for rect in rects):
        needed = _ranks_needed(whole, ranks)
        raise ConfigError(
            f"panel {panel.id} ({size}): with ranks: {ranks} a region is larger than {MAX_EDGE} pixels; accepted: "
            f"{needed} ranks for this panel, or more, as of graph: {{ranks_per_panel: {needed}}}"
        )
    return rects


def split(rect: Rect, n: int) -> tuple[Rect, ...]:
    """Cut a rectangle into n that cover it exactly, of nearly equal area and as square as may be.

    Halves the number again and again, always across the longer edge, in proportion. Each cut is rounded to a
    whole pixel, so with edges of parts above 100 pixels areas differ by a few per cent. ValueError unless
    1 <= n <= area.
    """
    if not 1 <= n <= rect.area:
        raise ValueError(f"{rect.width} x {rect.height} pixels cannot be cut in {n} parts; accepted: 1 to {rect.area}")
    if n == 1:
        return (rect,)
    long, short = max(rect.width, rect.height), min(rect.width, rect.height)
    few = n // 2
    cut = min(max((2 * long * few + n) // (2 * n), 1), long - 1)
    few = min(max(few, n - (long - cut) * short), cut * short)  # no more parts than pixels on either side
    if rect.width >= rect.height:
        first = Rect(x=rect.x, y=rect.y, width=cut, height=rect.height)
        rest = Rect(x=rect.x + cut, y=rect.y, width=rect.width - cut, height=rect.height)
    else:
        first = Rect(x=rect.x, y=rect.y, width=rect.width, height=cut)
        rest = Rect(x=rect.x, y=rect.y + cut, width=rect.width, height=rect.height - cut)
    return split(first, few) + split(rest, n - few)


def _ranks_needed(rect: Rect, ranks: int) -> int:
    """The smallest number of ranks, `ranks` or more, whose parts have no edge above MAX_EDGE."""
    while any(max(part.width, part.height) > MAX_EDGE for part in split(rect, ranks)):
        ranks += 1
    return ranks
