"""Find the pixels that each node holds; refuse rectangles outside the wall, overlaps, and pixels without a source."""

from __future__ import annotations

from collections.abc import Sequence

from wall.compositing.refusals import Refusals
from wall.compositing.structure import input_path
from wall.config.graph import ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.core.data import Rect
from wall.geometry.panels import Panel, Wall
from wall.geometry.rects import Cover, Rects, panel_rect
from wall.operators.base import Node, Operator

MOST_PIXELS = 1 << 28  # of a node, unless the wall has more: 3 GB of linear light, 1 GB a further channel


def union(covers: Sequence[Cover]) -> Cover:
    """All pixels of several covers, without overlaps."""
    rects = [rect for cover in covers for rect in cover]
    known = Rects(rects)
    return tuple(fresh for i, rect in enumerate(rects) for fresh in known.left_of(rect, i))


def said(rect: Rect) -> str:
    """A rectangle in words: 480x270+490+0."""
    return f"{rect.width}x{rect.height}{rect.x:+}{rect.y:+}"


class Covering:
    """Rectangles and covers of all nodes; errors are added to the refusals."""

    def __init__(self, wall: Wall, refusals: Refusals) -> None:
        self._wall, self._refusals = wall, refusals
        self._panels = {panel.id: panel_rect(panel) for panel in wall.panels}
        self._viewports = {panel.id: (panel.index, panel_rect(panel)) for panel in wall.viewports}
        self.rect: dict[str, Rect] = {}
        self.cover: dict[str, Cover] = {}
        self._lies: dict[str, dict[int, Rect]] = {}  # by panel: around its pixels, or what was made of them
        rects = [rect for _, rect in self._viewports.values()]
        known = Rects(rects)
        pairs = ((a, rects[j]) for i, a in enumerate(rects) for j in known.meeting(a, i))
        self._twice = [both for a, b in pairs if (both := a.intersection(b))]
        self._shared = Rects(self._twice)

    def find(self, order: Sequence[Node]) -> None:
        """Find rectangle and cover of every node; inputs come first in `order`."""
        for node in order:
            if isinstance(node, SamplesNode | SkyNode):
                index, rect = self._viewports[node.panel]
                self._set(node, rect, (rect,), {index: rect})
            elif isinstance(node, ReconstructNode | SinkNode):
                (name,) = node.sources
                self._set(node, self.rect[name], self.cover[name], self._lies[name])
            elif isinstance(node, Operator):
                self._operator(node)

    @property
    def panels(self) -> dict[str, frozenset[int]]:
        """By node: whose pixels it holds, or what was made of them."""
        return {name: frozenset(lies) for name, lies in self._lies.items()}

    def _panels_in(self, node: Operator, rect: Rect) -> dict[int, Rect]:
        """The panels that a node holds something of, and where: the box around it."""
        inputs, found = [self.rect[name] for name in node.sources], dict[int, Rect]()
        for k, name in enumerate(node.sources):
            for panel, held in self._lies[name].items():
                there = node.touched(held, inputs, k).intersection(rect)
                if there is not None:
                    found[panel] = there.join(found.get(panel, there))
        return found

    def _set(self, node: Node, rect: Rect, cover: Cover, lies: dict[int, Rect]) -> None:
        self.rect[node.id], self.cover[node.id], self._lies[node.id] = rect, cover, lies

    def _operator(self, node: Operator) -> None:
        inputs = [self.rect[name] for name in node.sources]
        rect = node.rect(inputs)
        covers = [self._through(node, k, rect) for k in range(len(inputs))]
        if not inputs:
            covers = [(rect,)]
        self._is_small_enough(node, inputs, rect)
        if node.op_name == "tile":
            self._once(node, covers)
        if node.op_name == "crop" and not inputs[0].contains(rect):
            came = f"{said(rect)} reaches outside what it is cut from, {said(inputs[0])}"
            self._refusals.add(node, _area_path(node), came, f"a rectangle inside {said(inputs[0])}")
        elif not inputs and not Rect(x=0, y=0, width=self._wall.width, height=self._wall.height).contains(rect):
            came = f"{said(rect)} reaches outside the wall of {self._wall.width}x{self._wall.height} pixels"
            self._refusals.add(node, _area_path(node), came, "a rectangle inside the wall")
        self._set(node, rect, union(covers), self._panels_in(node, rect))

    def _is_small_enough(self, node: Operator, inputs: Sequence[Rect], rect: Rect) -> None:
        most = max(MOST_PIXELS, self._wall.width * self._wall.height)
        if rect.area > most >= max((given.area for given in inputs), default=0):  # the first node of a chain is told
            came = f"{said(rect)} is {rect.area:,} pixels"
            self._refusals.add(node, _area_path(node), came, f"at most {most:,} pixels")

    def _through(self, node: Operator, k: int, rect: Rect) -> Cover:
        """The part of the output that comes from input k."""
        inputs = [self.rect[name] for name in node.sources]
        covered = [part for held in self.cover[node.sources[k]] for part in node.covers(held, inputs, k)]
        return tuple(met for part in covered if (met := part.intersection(rect)) is not None)

    def _once(self, node: Operator, covers: Sequence[Cover]) -> None:
        """Framelets side by side must not meet, but where panels of the wall share light themselves."""
        rects = [(k, rect) for k, cover in enumerate(covers) for rect in cover]
        known, told = Rects([rect for _, rect in rects]), set[tuple[int, int]]()
        for i, (k, rect) in enumerate(rects):
            for j, other in (rects[m] for m in known.meeting(rect, i)):
                both = other.intersection(rect)
                shared = both and any(self._twice[n].contains(both) for n in self._shared.meeting(both))
                if both is None or (j, k) in told or shared:
                    continue
                told.add((j, k))
                came = f"pixels {said(both)} come from {node.sources[j]} already"
                accepted = "depth, over, newest, age_blend or average, which say how"
                self._refusals.add(node, input_path(node, k), came, accepted)

    def check_sinks(self, order: Sequence[Node]) -> None:
        """Every panel is shown somewhere, and nowhere a part of one."""
        shown: set[str] = set()
        for node in order:
            if isinstance(node, SinkNode):
                shown |= self._shown(node)
        missing = [name for name in self._panels if name not in shown]
        if missing and not self._refusals.found:
            which = ", ".join(missing[:8]) + (" ..." if len(missing) > 8 else "")
            self._refusals.add(None, ["nodes"], f"nobody covers panel {which}", "nodes that lead from it to a sink")

    def _shown(self, node: SinkNode) -> set[str]:
        shown, cover = set(), Rects(self.cover[node.id])
        for name, panel in self._panels.items():
            left = cover.left_of(panel)
            if not left:
                shown.add(name)
            elif sum(rect.area for rect in left) < panel.area and self.rect[node.id].contains(panel):
                came = f"nobody covers pixels {said(left[0])} of panel {name}"
                self._refusals.add(node, ["input"], came, "whole panels")
        return shown


def _area_path(node: Node) -> list[str | int]:
    """Where in a node its rectangle, or what makes it, stands, as it was written."""
    written = node.model_fields_set
    return next(([name] for name in ("panel", "area", "size", "factor") if name in written), [])


def panels_shown(wall: Wall, cover: Cover) -> tuple[Panel, ...]:
    """The panels of which a cover holds every pixel."""
    rects = Rects(cover)
    return tuple(panel for panel in wall.panels if not rects.left_of(panel_rect(panel)))
