"""Run the operators of one rank, in order, each only where its input changed.

Pure but for the framelets it owns, allocated once. Nothing here knows where an input comes from: a reconstruction of
this process, another process, a file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.compositing.graph import Graph, Step
from wall.core.data import Event, Framelet, Rect
from wall.operators.base import Following, Operator
from wall.operators.colour import encode
from wall.operators.overlay import Overlay, Statistics

Regions: TypeAlias = list[Rect]  # of the frame; they may overlap
Changes: TypeAlias = dict[int, Regions]  # by step
Settings: TypeAlias = Mapping[str, Mapping[str, float]]  # by node and key
NO_SETTINGS: Settings = {}
# of a panel: as it looks under an event, and whether what comes into sight shows what stands beside it, else nothing
Reproject: TypeAlias = Callable[[Framelet, Event, int, bool], Framelet]
DENSE = 0.6  # of their bounding box: above it, one large region costs less than many


class Executor:
    """`framelets` are what every step here holds, and what came from other ranks; `step` brings them up to date."""

    def __init__(
        self,
        graph: Graph,
        rank: int,
        sources: Mapping[int, Framelet],
        folder: Path,
        reproject: Reproject | None = None,
    ) -> None:
        """`sources`: the framelets that others write, by step; `folder`: where paths in nodes start.

        `following` is what nodes here have prepared whose pixels change by themselves.

        Raises ConfigError where an operator cannot read what it needs.
        """
        self._graph, self._reproject = graph, reproject
        self._steps = [s for s in graph.steps if s.rank == rank and isinstance(s.node, Operator)]
        self._prepared: dict[int, Any] = {}  # by step
        self.framelets: dict[int, Framelet] = dict(sources)
        self._light: dict[int, Framelet] = {}  # of nodes that compute with light, and give display bytes
        for s in self._steps:
            assert isinstance(s.node, Operator)
            self._prepared[s.index] = s.node.prepare(folder, [graph.steps[k].rect for k in s.inputs])
            self.framelets[s.index] = shown = Framelet.blank(s.rect, s.channels, encoded=s.encoded, order=s.order)
            if s.encoded and s.computes:
                light = np.zeros((s.rect.height, s.rect.width, 3), np.float32)
                self._light[s.index] = replace(shown, colour=light)
        self.following = [each for each in self._prepared.values() if isinstance(each, Following)]
        self._fresh = {s.index for s in self._steps if not s.inputs}  # files and constants: made once
        self._followed = graph.panels_followed()
        self._view_of = {layer.panel: layer.view for layer in graph.layers}  # by panel
        self._newest: dict[int, Event] = {}  # by view
        self._reprojected: set[int] = set()  # steps whose output was made of reprojected inputs
        self._redrawn: dict[int, Rect] = {}  # by step: where an overlay's text has changed
        self.pixels = 0  # written so far

    def step(self, changed: Mapping[int, Regions], event: Event | None, settings: Settings = NO_SETTINGS) -> Changes:
        """Recompute what depends on `changed` regions of sources, for the camera and scene time of `event`.

        `settings`: of nodes, where they are not as configured. Returns all that changed, sources included, by step.
        """
        found: Changes = {k: list(regions) for k, regions in changed.items() if regions}
        if event is not None:
            self._newest[event.view] = event
        for s in self._steps:
            shows = self._shown_by(s, event)
            regions = self._regions(s, found, shows, settings)
            if regions:
                self._apply(s, regions, shows)
                found[s.index] = regions
        return found

    def close(self) -> None:
        """End what is under way for nodes here."""
        for each in self.following:
            each.close()

    @property
    def waits(self) -> bool:
        """Whether some node here will change by itself."""
        return any(each.waits for each in self.following)

    def _shown_by(self, s: Step, event: Event | None) -> Event | None:
        """The event whose moment a step shows: the newest of its own view, which others of the wall may not have."""
        panel = self._followed[s.index]
        view = None if panel is None or not s.common_time else self._view_of.get(panel)
        return event if view is None or event is None or view == event.view else self._newest.get(view)

    def _regions(self, s: Step, found: Changes, event: Event | None, settings: Settings) -> Regions:
        prepared = self._prepared[s.index]
        anew = isinstance(prepared, Following) and prepared.follow(settings.get(s.node.id, {}))
        if anew or s.index in self._fresh:
            self._fresh.discard(s.index)
            return [s.rect]
        assert isinstance(s.node, Operator)
        rects = [self._graph.steps[k].rect for k in s.inputs]
        touched = (
            s.node.touched(region, rects, k).intersection(s.rect)
            for k, source in enumerate(s.inputs)
            for region in found.get(source, ())
        )
        regions = [region for region in touched if region is not None]
        if regions and self._shows_another_time(s, event):
            return [s.rect]
        if s.index in self._redrawn:
            regions.append(self._redrawn.pop(s.index))
        return merged(regions)

    def _shows_another_time(self, s: Step, event: Event | None) -> bool:
        """Whether all of a step must be recomputed: it shows another time, or was made of reprojected inputs."""
        if not s.common_time or self._reproject is None or event is None:
            return False
        shown = self.framelets[s.index].event
        return s.index in self._reprojected or shown is None or not same_time(shown, event)

    def _apply(self, s: Step, regions: Regions, event: Event | None) -> None:
        assert isinstance(s.node, Operator)
        out = self.framelets[s.index]
        inputs = [self.framelets[k] for k in s.inputs]
        newest = max((f for f in inputs if f.event is not None), key=lambda f: f.refreshed_at, default=None)
        if newest is not None:
            out.event = newest.event
            out.stamp(newest.refreshed_at)
        if s.common_time and self._reproject is not None and event is not None:
            moved = self._at_common_time(s, inputs, event)
            (self._reprojected.discard if moved == inputs else self._reprojected.add)(s.index)
            inputs, out.event = moved, event
        light = self._light.get(s.index)
        if light is not None:
            light.event, light.refreshed_at = out.event, out.refreshed_at
        for region in regions:
            s.node.apply(inputs, light or out, region, self._prepared[s.index])
            if light is not None:
                encode(light, out, region)
            self.pixels += region.area

    def _at_common_time(self, s: Step, inputs: Sequence[Framelet], event: Event) -> list[Framelet]:
        """Reproject inputs that show another time than `event`; those without an event, or without depth, stay."""
        assert self._reproject is not None
        panels = [self._followed[k] for k in s.inputs]
        return [
            self._reproject(f, event, panel, s.apart)
            if f.event is not None and f.depth is not None and panel is not None and not same_time(f.event, event)
            else f
            for f, panel in zip(inputs, panels, strict=True)
        ]

    def set_statistics(self, numbers: Mapping[str, float]) -> None:
        """Let overlays show these numbers at the next step."""
        for s in self._steps:
            shown = self._prepared[s.index]
            if isinstance(s.node, Overlay) and isinstance(shown, Statistics) and shown.numbers != numbers:
                shown.numbers = numbers
                self._redrawn[s.index] = s.node.box(s.rect)


def same_time(a: Event, b: Event) -> bool:
    """Whether two events show the same: camera and scene."""
    return a.camera == b.camera and a.scene_time == b.scene_time


def merged(regions: Regions) -> Regions:
    """The same pixels in fewer regions: without repeats, one where they nearly fill their bounding box."""
    distinct = list(dict.fromkeys(regions))
    if len(distinct) < 2:
        return distinct
    box = reduce(Rect.join, distinct)
    return [box] if sum(region.area for region in distinct) > DENSE * box.area else distinct


def tiles_to_regions(dirty: NDArray[np.bool_], tile: int, rect: Rect) -> Regions:
    """Rectangles of the frame that hold all dirty tiles of a framelet at `rect`.

    Every row of tiles from its first dirty one to its last; rows with the same ends together.

    Parameters
    ----------
    dirty : (rows, columns) bool, of squares of `tile` pixels from rect's top left corner
    """
    if dirty.all():
        return [rect]
    spans: list[tuple[int, int, int, int]] = []  # first row, behind the last, first column, behind the last
    for row in np.flatnonzero(dirty.any(axis=1)).tolist():
        columns = np.flatnonzero(dirty[row])
        first, last = int(columns[0]), int(columns[-1]) + 1
        if spans and spans[-1][1:] == (row, first, last):
            spans[-1] = (spans[-1][0], row + 1, first, last)
        else:
            spans.append((row, row + 1, first, last))
    found = []
    for top, bottom, left, right in spans:
        whole = Rect(
            x=rect.x + left * tile, y=rect.y + top * tile, width=(right - left) * tile, height=(bottom - top) * tile
        )
        inside = whole.intersection(rect)
        assert inside is not None
        found.append(inside)
    return found
