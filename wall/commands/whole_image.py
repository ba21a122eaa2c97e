"""One image of all views of a wall, each in its place, later ones in front: what offline commands render."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.commands.offline import (
    Band,
    OfflineRenderer,
    Tile,
    bands_of,
    event_at,
    image_size,
    panels_of,
    scale_to,
    tiles_of,
    view_panels,
)
from wall.commands.one_view import plans_of_views
from wall.core.data import Event, Float32
from wall.core.tone_mapping import Tone
from wall.display.image_file import Display, display_values
from wall.geometry.panels import NO_VIEW, Panel
from wall.roles.plan import Layout, Plan
from wall.tracing.tracer_scene import TracerScene


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ViewPart:
    """What one view shows of the image."""

    plan: Plan  # of the view alone
    tiles: list[Tile]

    @property
    def bands(self) -> list[Band]:
        """All of its tiles, cut into bands."""
        return [band for tile in self.tiles for band in bands_of(tile)]

    def event_at(self, at: float) -> Event:
        """What the view shows `at` seconds after a run began."""
        return event_at(self.plan, at)

    def renderer(
        self, tracer_scene: TracerScene, *, spp: int, at: float = 0.0, layers: Sequence[str] = ()
    ) -> OfflineRenderer:
        """Of its bands, at that moment; `tracer_scene`: of the plan of all views."""
        own = tracer_scene.under(self.plan.scene)
        return OfflineRenderer(self.plan, own, self.event_at(at), spp=spp, layers=layers)


def parts_of(plan: Plan, size: tuple[int, int] | None, *, seed: int) -> list[ViewPart]:
    """The parts of a plan's views, in their order, in an image of that size. Raises ConfigError."""
    plans = plans_of_views(plan)
    panels = panels_of_views(plan.layout, size)
    return [ViewPart(plan=own, tiles=tiles_of(panels.get(k, []), seed=seed)) for k, own in enumerate(plans)]


def panels_of_views(layout: Layout, size: tuple[int, int] | None, *, scale: float = 1.0) -> dict[int, list[Panel]]:
    """The panels to render of each view, by its number; see panels_of. Raises ConfigError."""
    if len(layout.config.views) == 1:
        return {0: panels_of(layout, size, scale=scale)}
    scale = scale if size is None else scale_to(size, layout)
    shown = sorted({panel.view for panel in layout.wall.viewports} - {NO_VIEW})
    return {view: view_panels(layout, view, scale) for view in shown}


def display_of(parts: Sequence[ViewPart], tones: Iterable[Tone]) -> Display:
    """How an image becomes display values: each view's part under its own exposure and tone mapping."""
    first, *others = tones

    def display(image: Float32) -> NDArray[np.uint8]:
        codes = display_values(image, tone=first)
        for part, tone in zip(parts[1:], others, strict=True):
            for rect in (tile.rect for tile in part.tiles):
                rows, columns = slice(rect.y, rect.bottom), slice(rect.x, rect.right)
                codes[rows, columns] = display_values(image[rows, columns], tone=tone)
        return codes

    return display


def assembled(bands: Sequence[Band], rendered: Sequence[Float32], blank: Float32) -> Float32:
    """Put bands in their places of the image, later ones in front; pixels of no band are `blank` (columns,)."""
    width, height = image_size(tile.panel for tile, _ in bands)
    image = np.tile(blank, (height, width, 1))
    for (tile, rect), band in zip(bands, rendered, strict=True):
        x, y = tile.rect.x + rect.x, tile.rect.y + rect.y
        image[y : y + rect.height, x : x + rect.width] = band
    return image
