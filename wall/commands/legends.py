"""The legends of a configuration's graph, over images of its scene: `wall render --legend`, and films of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from wall.core.data import Framelet, Rect
from wall.core.errors import ConfigError
from wall.operators.legend import Drawn, Legend
from wall.roles.plan import Layout

SMALLEST = 6  # pixels of a line of text
ROUNDED = 1e-9  # of a pixel


@dataclass(frozen=True, slots=True)
class Legends:
    """Legends of an image of one size, drawn anew for its pixels: text is sharp at any size."""

    size: tuple[int, int]
    drawn: tuple[tuple[Legend, Drawn], ...]

    def draw(self, pixels: NDArray[Any]) -> None:
        """Draw over (h, w, 3), float32 linear light or uint8 sRGB, in place."""
        width, height = self.size
        image = Framelet(rect=Rect(x=0, y=0, width=width, height=height), colour=pixels)
        for legend, drawn in self.drawn:
            region = drawn.rect.intersection(image.rect)
            if region is not None:
                legend.apply([image], image, region, drawn)


def wanted_legends(layout: Layout, size: tuple[int, int] | None) -> Legends:
    """Those of a layout's graph, where they are asked for; `size`: see legends_of.

    Raises ConfigError where there are none, or the image is too small for them.
    """
    found, small = legends_of(layout, size)
    if small:
        raise ConfigError(f"--legend: {small[0]}; wanted: a larger --size")
    if not found.drawn:
        wanted = "a graph with a node of op: legend (docs/guide/data.md)"
        raise ConfigError(f"--legend: {layout.loaded.name} has no legend; wanted: {wanted}")
    return found


def legends_of(layout: Layout, size: tuple[int, int] | None) -> tuple[Legends, list[str]]:
    """Those of a layout's graph, as they stand on its wall, and words for each that an image is too small for.

    size : of the image, which the wall's height fills; None: the wall's own
    """
    found = [step.node for step in layout.graph.steps if isinstance(step.node, Legend)]
    wall = layout.wall
    width, height = size or (wall.width, wall.height)
    scale = height / wall.height
    left = (width - scale * wall.width) / 2.0
    drawn, small = [], list[str]()
    for legend in found:
        x, y, across, down = legend.area
        area = round(left + scale * x), round(scale * y), round(scale * across), round(scale * down)
        text = min(int(scale * legend.size + ROUNDED), min(area[2:]) // 4)
        if text < SMALLEST:
            high = f"{text} pixels high in {width}x{height}, less than {SMALLEST}"
            small.append(f"text of legend {legend.id} would be {high}")
            continue
        scaled = legend.model_copy(update={"area": area, "size": text})
        drawn.append((scaled, scaled.prepare(layout.loaded.folder, ())))
    return Legends((width, height), tuple(drawn)), small
