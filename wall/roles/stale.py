"""Which parts of the wall get nothing new, since the ranks that make them are not heard of or stuck."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from wall.core.data import Rect
from wall.geometry.panels import Panel
from wall.geometry.rects import panel_rect
from wall.roles.edges import targets_of
from wall.roles.plan import Layout

Place = tuple[float, float, float, float]  # x, y, width, height in virtual screen pixels


def marked_places(layout: Layout, absent: Iterable[int]) -> tuple[Place, ...]:
    """What is to be marked while these ranks are not heard of: stale_places, unless nothing is ever marked."""
    return stale_places(layout, absent) if math.isfinite(layout.config.transport.marked_after_s) else ()


def stale_places(layout: Layout, absent: Iterable[int]) -> tuple[Place, ...]:
    """Where on the virtual screen regions of absent renderers are, and what absent compositors make for others."""
    found = [
        place
        for rank in sorted(absent)
        for place in (_rendered(layout, rank) if layout.role(rank) == "renderer" else _composed(layout, rank))
    ]
    return tuple(dict.fromkeys(found))


def _rendered(layout: Layout, rank: int) -> Iterator[Place]:
    for region in layout.regions_of(rank):
        shown, traced = layout.wall.viewports[layout.layer(region).panel], layout.panel(region)
        if region.rect.area:
            yield _place(shown, region.rect, traced.pixels)


def _composed(layout: Layout, rank: int) -> Iterator[Place]:
    for index in targets_of(layout.graph, rank):
        rect = layout.graph.steps[index].rect
        for panel in layout.wall.panels:
            whole = panel_rect(panel)
            if rect.overlaps(whole):
                left, top = max(rect.x, whole.x), max(rect.y, whole.y)
                width, height = min(rect.right, whole.right) - left, min(rect.bottom, whole.bottom) - top
                part = Rect(x=left - whole.x, y=top - whole.y, width=width, height=height)
                yield _place(panel, part, panel.pixels)


def _place(panel: Panel, part: Rect, pixels: tuple[int, int]) -> Place:
    """Where a part of a panel is that has been traced in so many pixels."""
    across, down = (span or own for span, own in zip(panel.span, panel.pixels, strict=True))
    x, y = across / pixels[0], down / pixels[1]
    return (panel.screen[0] + part.x * x, panel.screen[1] + part.y * y, part.width * x, part.height * y)
