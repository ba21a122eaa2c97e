"""Resolve what panels show to the values of `graph:`: a preset where each panel has its own ranks, else nodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from wall.importers.equalizer.compounds import EVERYTHING, Compound, Draw, Part, Range, Trace, draws_of
from wall.importers.equalizer.resources import Channel, Rect
from wall.importers.equalizer.wall_values import PanelPart

SINKS = ["browser", "png"]
LOCAL = (None, "localhost", "127.0.0.1")  # names of no machine in particular

Shape = tuple[Any, ...]  # ("part", range) or ("join", channel, shapes): what pixels show, without who rendered it


@dataclass(slots=True)
class ResolvedPanel:
    """A panel: its rectangles with what they show, and the leaves that render each part of the scene."""

    part: PanelPart
    areas: list[tuple[Rect, Shape]]  # pixels from the panel's top left
    leaves: dict[Range, list[Draw]]

    @property
    def draws(self) -> Iterator[Draw]:
        """All draws of the panel."""
        for draws in self.leaves.values():
            yield from draws

    @property
    def joiners(self) -> set[int]:
        """Identities of the channels that join rendered parts."""
        found, shapes = set(), [shape for _, shape in self.areas]
        while shapes:
            shape = shapes.pop()
            if shape[0] == "join":
                found.add(id(shape[1]))
                shapes.extend(shape[2])
        return found

    @property
    def plain(self) -> bool:
        """Whether it shows the whole scene without a join."""
        return [shape for _, shape in self.areas] == [("part", EVERYTHING)]


def resolve_panel(part: PanelPart, name: str) -> ResolvedPanel:
    """Resolve what a panel shows by its compounds; without any, its own channel renders it. Raises ConfigError."""
    roots = part.destination.roots
    trace = Trace(roots, label=part.destination.channel.name, eye=part.eye, pixels=part.pixels, name=name)
    for block in trace.unknown:
        block.drop("its frame comes from outside this panel, which renders all it shows itself")
    cells = trace.cells()
    leaves: dict[Range, list[Draw]] = {}
    for draw in (draw for _, shown in cells if shown is not None for draw in draws_of(shown)):
        known = leaves.setdefault(draw.range, [])
        if all(draw.leaf is not other.leaf for other in known):
            known.append(draw)
    shapes = [(rect, _shape(shown)) for rect, shown in cells if shown is not None]
    if not leaves:
        leaves, shapes = {EVERYTHING: []}, [((0, 0, *part.pixels), ("part", EVERYTHING))]
    elif len(shapes) < len(cells):  # pixels that no leaf renders get the shape that most others have
        common = Counter(shape for _, shape in shapes).most_common(1)[0][0]
        shapes = [(rect, common if shown is None else _shape(shown)) for rect, shown in cells]
    return ResolvedPanel(part, _merged(shapes), dict(sorted(leaves.items())))


def _shape(shown: Part) -> Shape:
    """A part without who rendered it: parts of the scene, each once, joined where there are several."""
    if isinstance(shown, Draw):
        return ("part", shown.range)
    parts = tuple(dict.fromkeys(_shape(part) for part in shown.parts))
    return parts[0] if len(parts) == 1 else ("join", shown.where, parts)


def _merged(cells: list[tuple[Rect, Shape]]) -> list[tuple[Rect, Shape]]:
    """Merge neighbours of one shape: along rows, then rows of equal width."""
    for axis in (0, 1):
        found: list[tuple[Rect, Shape]] = []
        for rect, shape in sorted(cells, key=lambda cell: (cell[0][1 - axis], cell[0][axis])):
            same = (i for i, (area, what) in enumerate(found) if what == shape and _continues(area, rect, axis))
            before = next(same, None)
            if before is None:
                found.append((rect, shape))
            else:
                x, y, w, h = found[before][0]
                grown = (x, y, w + rect[2], h) if axis == 0 else (x, y, w, h + rect[3])
                found[before] = (grown, shape)
        cells = found
    return sorted(cells, key=lambda cell: (cell[0][1], cell[0][0]))


def _continues(a: Rect, b: Rect, axis: int) -> bool:
    """Whether b begins where a ends along an axis, with equal extent across it."""
    other = 1 - axis
    return a[other] == b[other] and a[2 + other] == b[2 + other] and a[axis] + a[2 + axis] == b[axis]


def share_channels(panels: list[ResolvedPanel]) -> None:
    """Make a channel that a view_equalizer shares among panels a rank of one: its own panel, or that with fewest."""
    users: dict[Channel, list[tuple[ResolvedPanel, Range, Draw]]] = {}
    for one in panels:
        for part, leaves in one.leaves.items():
            for draw in leaves:
                channel = draw.where if isinstance(draw.where, Channel) else one.part.destination.channel
                if _balanced(draw.leaf):
                    users.setdefault(channel, []).append((one, part, draw))
    for uses in (uses for uses in users.values() if len({id(one) for one, _, _ in uses}) > 1):
        keeper = next((use for use in uses if use[2].where == "panel"), None)
        keeper = keeper or min(uses, key=lambda use: (sum(map(len, use[0].leaves.values())), use[0].part.id))
        for one, part, draw in uses:
            if one is keeper[0] or len(one.leaves[part]) == 1:
                continue
            one.leaves[part].remove(draw)
            draw.leaf.statement.drop(
                f"load balance between panels: here its channel is a rank of panel {keeper[0].part.id} alone"
            )


def _balanced(leaf: Compound) -> bool:
    """Whether a view_equalizer balances a leaf."""
    here: Compound | None = leaf
    while here is not None:
        if here.statement.all("view_equalizer"):
            return True
        here = here.parent
    return False


@dataclass(slots=True)
class GraphValues:
    """The YAML's values of the graph."""

    panels: list[ResolvedPanel]
    screens: dict[str, tuple[int, int]]  # top left pixel of each panel in the virtual screen
    nodes: list[dict[str, Any]] = field(default_factory=list)
    areas: list[str] = field(default_factory=list)  # ids of the nodes that the wall's image is tiled from
    compositors: dict[tuple[str, int], str] = field(default_factory=dict)  # where a channel's joins run
    hosts: set[str] = field(default_factory=set)  # machines that joins are placed on

    @property
    def renderers(self) -> int:
        """The number of ranks that render."""
        return sum(max(1, len(draws)) for one in self.panels for draws in one.leaves.values())

    def values(self) -> dict[str, Any]:
        """The values of a preset if one is enough, else of single nodes."""
        counts = {max(1, len(draws)) for one in self.panels for draws in one.leaves.values()}
        if all(one.plain for one in self.panels) and len(counts) == 1:
            ranks = counts.pop()
            return {"preset": "sort-first", **({"ranks_per_panel": ranks} if ranks > 1 else {}), "sinks": SINKS}
        for one in self.panels:
            self._name_compositors(one, (shape for _, shape in one.areas))
        self._name_hosts()
        for one in self.panels:
            self._panel(one)
        self.nodes.append({"id": "wall", "op": "tile", "inputs": self.areas})
        if self.compositors:
            self.nodes[-1]["on"] = "head"
        self.nodes.extend({"id": kind, "op": "sink", "kind": kind, "input": "wall"} for kind in SINKS)
        head = {"compositors": 1 + len(self.compositors)} if self.compositors else {}
        return {**head, "nodes": self.nodes}

    def _name_compositors(self, one: ResolvedPanel, shapes: Iterable[Shape]) -> None:
        """Name a compositor for each channel that joins; panels' own channels are the head."""
        for shape in shapes:
            if shape[0] == "join":
                if shape[1] != "panel":
                    self.compositors.setdefault(self._key(one, shape[1]), f"compositor {len(self.compositors) + 1}")
                self._name_compositors(one, shape[2])

    def _name_hosts(self) -> None:
        """Place the joins of a single panel on their channels' machines, if each has one of its own."""
        channels = {id(draw.where): draw.where for one in self.panels for draw in one.draws}
        joining = [channels.get(where) for _, where in self.compositors]
        hosts = [channel.host for channel in joining if isinstance(channel, Channel) and channel.host not in LOCAL]
        apart = {*hosts, *(one.part.destination.channel.host for one in self.panels)}
        if len(self.panels) == 1 and len(hosts) == len(joining) and len(apart) == len(hosts) + 1:
            self.hosts = {str(host) for host in hosts}
            self.compositors = {key: f"host {host}" for key, host in zip(self.compositors, hosts, strict=True)}

    @staticmethod
    def _key(one: ResolvedPanel, where: object) -> tuple[str, int]:
        """The key of a panel's join in `compositors`."""
        return one.part.id, id(where)

    def _place(self, node: dict[str, Any], one: ResolvedPanel, where: object) -> None:
        """Set the compositor that a node runs on, if there are others than the head."""
        if self.compositors:
            node["on"] = self.compositors.get(self._key(one, where), "head")

    def _panel(self, one: ResolvedPanel) -> None:
        """Add the nodes of a panel: samples and framelets of its parts of the scene, then each of its rectangles."""
        framelets: dict[Range, str] = {}
        name = one.part.id
        for i, (part, draws) in enumerate(one.leaves.items()):
            suffix = f"{i}" if len(one.leaves) > 1 else ""
            samples: dict[str, Any] = {"id": f"{name}.s{suffix}", "op": "samples", "panel": name}
            samples["ranks"] = max(1, len(draws))
            if part != EVERYTHING:
                samples["range"] = list(part)
            framelet = {"id": f"{name}.f{suffix}", "op": "reconstruct", "input": samples["id"]}
            self._place(framelet, one, draws[0].where if draws else "panel")
            framelets[part] = str(framelet["id"])
            self.nodes.extend((samples, framelet))
        whole = len(one.areas) == 1
        for k, (rect, shape) in enumerate(one.areas):
            self.areas.append(
                self._area_node(one, framelets, shape, None if whole else rect, f"{k}" if not whole else "")
            )

    def _area_node(
        self, one: ResolvedPanel, framelets: dict[Range, str], shape: Shape, rect: Rect | None, suffix: str
    ) -> str:
        """Add the nodes of a shape and return the last one's id; `rect`: its area of the panel, None for all of it."""
        name = one.part.id
        if shape[0] == "part":
            if rect is None:
                return framelets[shape[1]]
            x, y = self.screens[name]
            node: dict[str, Any] = {"id": f"{name}.c{suffix}", "op": "crop", "input": framelets[shape[1]]}
            node["area"] = [x + rect[0], y + rect[1], rect[2], rect[3]]
        else:
            inputs = [self._area_node(one, framelets, part, rect, f"{suffix}.{i}") for i, part in enumerate(shape[2])]
            node = {"id": f"{name}.d{suffix}", "op": "depth", "inputs": inputs}
            self._place(node, one, shape[1])
        self.nodes.append(node)
        return str(node["id"])
