"""Which pixels each node holds: rectangles, what lies outside, what is there twice, what nobody brings."""

from __future__ import annotations

from collections.abc import Sequence

from wall.compositing.refusals import Refusals
from wall.compositing.structure import input_path
from wall.config.schema import NodeConfig, ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.data import Rect
from wall.geometry.panels import Panel, Wall
from wall.operators.base import Operator

Cover = tuple[Rect, ...]  # that do not meet each other


def panel_rect(panel: Panel) -> Rect:
    """Where a panel lies in the frame."""
    (x, y), (width, height) = panel.screen, panel.pixels
    return Rect(x=x, y=y, width=width, height=height)


def less(cover: Sequence[Rect], taken: Rect) -> Cover:
    """What of a cover is left without a rectangle."""
    left: list[Rect] = []
    for rect in cover:
        common = rect.meet(taken)
        if common is None:
            left.append(rect)
            continue
        parts = (
            (rect.x, rect.y, rect.width, common.y - rect.y),
            (rect.x, common.bottom, rect.width, rect.bottom - common.bottom),
            (rect.x, common.y, common.x - rect.x, common.height),
            (common.right, common.y, rect.right - common.right, common.height),
        )
        left += [Rect(x=x, y=y, width=w, height=h) for x, y, w, h in parts if w > 0 and h > 0]
    return tuple(left)


def union(covers: Sequence[Cover]) -> Cover:
    """Every pixel of any of them once."""
    found: Cover = ()
    for rect in (rect for cover in covers for rect in cover):
        fresh: Cover = (rect,)
        for known in found:
            fresh = less(fresh, known)
        found += fresh
    return found


def common(first: Cover, second: Cover) -> Rect | None:
    """The first rectangle that two covers share."""
    return next((both for a in first for b in second if (both := a.meet(b)) is not None), None)


def said(rect: Rect) -> str:
    """A rectangle in words: 480x270+490+0."""
    return f"{rect.width}x{rect.height}{rect.x:+}{rect.y:+}"


class Covering:
    """Rectangles and covers of all nodes, found in order; what is wrong is refused."""

    def __init__(self, wall: Wall, refusals: Refusals) -> None:
        self._wall, self._refusals = wall, refusals
        self._panels = {panel.id: panel_rect(panel) for panel in wall.panels}
        self._index = {panel.id: panel.index for panel in wall.panels}
        self.rect: dict[str, Rect] = {}
        self.cover: dict[str, Cover] = {}
        self.panels: dict[str, frozenset[int]] = {}  # whose pixels, or what was made of them
        self._twice = [a.meet(b) for i, a in enumerate(self._panels.values()) for b in list(self._panels.values())[:i]]

    def find(self, order: Sequence[NodeConfig]) -> None:
        for node in order:
            self.panels[node.id] = self._panels_of(node)
            if isinstance(node, SamplesNode | SkyNode):
                self._set(node, self._panels[node.panel], (self._panels[node.panel],))
            elif isinstance(node, ReconstructNode | SinkNode):
                self._set(node, self.rect[node.sources[0]], self.cover[node.sources[0]])
            elif isinstance(node, Operator):
                self._operator(node)

    def _panels_of(self, node: NodeConfig) -> frozenset[int]:
        if isinstance(node, SamplesNode | SkyNode):
            return frozenset({self._index[node.panel]})
        return frozenset().union(*(self.panels[name] for name in node.sources))

    def _set(self, node: NodeConfig, rect: Rect, cover: Cover) -> None:
        self.rect[node.id], self.cover[node.id] = rect, cover

    def _operator(self, node: Operator) -> None:
        inputs = [self.rect[name] for name in node.sources]
        rect = node.rect(inputs)
        covers = [self._through(node, k, rect) for k in range(len(inputs))]
        if not inputs:
            covers = [(rect,)]
        op = getattr(node, "op", "")
        if op == "tile":
            self._once(node, covers)
        if op == "crop" and not inputs[0].holds(rect):
            came = f"{said(rect)} reaches outside what it is cut from, {said(inputs[0])}"
            self._refusals.add(node, ["rect"], came, f"a rectangle inside {said(inputs[0])}")
        elif not inputs and not Rect(x=0, y=0, width=self._wall.width, height=self._wall.height).holds(rect):
            came = f"{said(rect)} reaches outside the wall of {self._wall.width}x{self._wall.height} pixels"
            self._refusals.add(node, ["rect"], came, "a rectangle inside the wall")
        self._set(node, rect, union(covers))

    def _through(self, node: Operator, k: int, rect: Rect) -> Cover:
        """What of the output comes of input k."""
        inputs = [self.rect[name] for name in node.sources]
        parts = [node.touched(part, inputs, k).meet(rect) for part in self.cover[node.sources[k]]]
        return tuple(part for part in parts if part is not None)

    def _once(self, node: Operator, covers: Sequence[Cover]) -> None:
        """Framelets side by side must not meet, but where panels of the wall share light themselves."""
        for k, cover in enumerate(covers):
            for j in range(k):
                both = common(covers[j], cover)
                if both is not None and not any(shared is not None and shared.holds(both) for shared in self._twice):
                    came = f"pixels {said(both)} come from {node.sources[j]} already"
                    accepted = "depth, over, newest, age_blend or average, which say how"
                    self._refusals.add(node, input_path(node, k), came, accepted)

    def check_sinks(self, order: Sequence[NodeConfig]) -> None:
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
        shown = set()
        for name, panel in self._panels.items():
            left: Cover = (panel,)
            for rect in self.cover[node.id]:
                left = less(left, rect)
            if not left:
                shown.add(name)
            elif sum(rect.area for rect in left) < panel.area and self.rect[node.id].holds(panel):
                came = f"nobody covers pixels {said(left[0])} of panel {name}"
                self._refusals.add(node, ["input"], came, "whole panels")
        return shown


def panels_shown(wall: Wall, cover: Cover) -> tuple[Panel, ...]:
    """The panels of which a cover holds every pixel."""
    found = []
    for panel in wall.panels:
        left: Cover = (panel_rect(panel),)
        for rect in cover:
            left = less(left, rect)
        if not left:
            found.append(panel)
    return tuple(found)
