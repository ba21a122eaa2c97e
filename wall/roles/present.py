"""What sinks are given: the framelet that a sink's node takes, cut into the panels that it shows."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wall.compositing.executor import Changes
from wall.compositing.graph import Graph, Step
from wall.core.colour import srgb_curve
from wall.core.data import Framelet, Rect
from wall.display.base import PanelImage
from wall.display.tiles import updated
from wall.geometry.panels import Wall
from wall.geometry.rects import panel_rect
from wall.operators.kernels import pixels as kernels

_CURVE = srgb_curve()
_versions = itertools.count(1)  # of all images: sinks keep images of panels from one comparison to the next


class PanelCrops:
    """The images of one sink: of each panel that it shows, a crop; else one of all that it is given.

    New where changed.
    """

    def __init__(self, graph: Graph, sink: Step, wall: Wall) -> None:
        self._input = sink.inputs[0]
        rect = graph.steps[self._input].rect
        if sink.panels:
            panels = [wall.panels[k] for k in sink.panels]
            self._rects = {panel.id: panel_rect(panel) for panel in panels}
        else:
            self._rects = {sink.node.id: rect}
        spans = {wall.panels[k].id: wall.panels[k].span for k in sink.panels}
        left, top = (0, 0) if sink.panels else (rect.x, rect.y)
        self.size = (wall.width, wall.height) if sink.panels else (rect.width, rect.height)
        self._images = {
            name: PanelImage(
                id=name,
                rgb=np.zeros((r.height, r.width, 3), np.uint8),
                screen=(r.x - left, r.y - top),
                version=0,
                span=spans.get(name),
            )
            for name, r in self._rects.items()
        }

    def begin_with(self, before: PanelCrops) -> None:
        """Show what another sink of the same panels shows, until something changes."""
        self._images = {
            name: replace(old, screen=new.screen, span=new.span)
            if (old := before._images.get(name)) is not None and old.rgb.shape == new.rgb.shape
            else new
            for name, new in self._images.items()
        }

    def take(self, changes: Changes, framelets: Mapping[int, Framelet]) -> None:
        """Cut out the panels that changed; an image in which no pixel differs stays as it is."""
        regions, framelet = changes.get(self._input, []), framelets[self._input]
        for name, rect in self._rects.items():
            if any(rect.overlaps(region) for region in regions):
                self._images[name] = updated(self._images[name], display_bytes(framelet, rect), next(_versions))

    def images(self) -> tuple[PanelImage, ...]:
        """The image of each panel of the sink."""
        return tuple(self._images.values())


def display_bytes(framelet: Framelet, rect: Rect) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """(h, w, 3) uint8 sRGB of a part of a framelet, a copy: sinks keep what they get."""
    if framelet.encoded:
        return np.array(framelet.colour[rect.inside(framelet.rect)])
    out = np.empty((rect.height, rect.width, 3), np.uint8)
    x, y = rect.x - framelet.rect.x, rect.y - framelet.rect.y
    kernels.encode(framelet.colour, x, y, _CURVE, out, 0, 0, rect.width, rect.height)
    return out
