"""Hand samples on to sinks that make the image themselves, where a panel's image is the newest sample of each pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.config.graph import SinkNode
from wall.core.data import Float32
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.display.base import PanelSamples
from wall.operators.outline import Outline
from wall.roles.plan import Layout


class HandedSamples:
    """`refresh` after the panel's image was, `take` what changed it: first every pixel, then those that got samples."""

    def __init__(self, panel: int, buffer: PixelBuffer) -> None:
        """Notes in `buffer.changed` what changes, from now on."""
        self._panel, self._buffer = panel, buffer
        self._changed = buffer.changed = np.ones((buffer.height, buffer.width), np.bool_)
        self._new: tuple[NDArray[np.int64], Float32] | None = None  # pixels and radiance, until they are taken
        self._tone, self._whole = AS_IT_IS, False  # of the image; whether every pixel was new once

    def begin_anew(self) -> None:
        """The panel shows something else; when it shows these samples again, every pixel is new."""
        self._changed[:] = True
        self._new, self._whole = None, False

    def refresh(self, tone: Tone) -> None:
        """Note what the panel shows now, exposed and mapped by `tone`."""
        self._tone = tone
        if self._new is None:
            pixels = np.flatnonzero(self._changed)
            self._new, self._whole = (pixels, self._buffer.records.reshape(-1)["shown"][pixels]), True
            self._changed[:] = False

    def take(self) -> PanelSamples | None:
        """What changed since it was last taken. None where the panel does not show these samples."""
        if not self._whole:
            return None
        none = np.empty(0, np.int64), np.empty((0, 3), np.float32)
        (pixels, radiance), self._new = self._new or none, None
        return PanelSamples(panel=self._panel, pixels=pixels, radiance=radiance, tone=self._tone)


def why_images(layout: Layout) -> tuple[str, ...]:
    """For each panel why its samples are not handed to the page, "" where they are if their sampler lets them."""
    graph, wall = layout.graph, layout.wall
    covered = {panel.inset_of for panel in wall.insets}
    layers = {layer.panel: layer for layer in graph.layers}
    pages = [s for s in graph.steps if isinstance(s.node, SinkNode) and s.node.kind == "browser"]
    lined = {panel for s in graph.steps if isinstance(s.node, Outline) for panel in s.panels}
    found = []
    for k in range(len(wall.panels)):
        if k in layers and layers[k].of_its_own:
            found.append("it has a rate or a resolution of its own")
        elif not graph.plain or k in lined or any(page.panels != tuple(range(len(wall.panels))) for page in pages):
            found.append("operators of the graph change them")
        elif k in covered or k not in layers:
            found.append("another view lies on a panel")
        elif layers[k].at_renderer:
            found.append("renderers make them; output.browser.samples: true in the configuration sends samples here")
        elif layers[k].compositor != graph.page_rank:
            found.append("another compositor makes them")
        else:
            found.append("")
    return tuple(found)
