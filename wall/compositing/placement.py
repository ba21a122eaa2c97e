"""Choose the compositor rank that runs each node: what `on` says, or where its input is. Rank 0 is the head.

Panels are dealt to compositors in order, panels of one host to compositors of that host. A host is wanted of a rank
here; which of the launched processes gets the rank is found when they know each other (run/hosts.py).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from wall.compositing.refusals import Refusals
from wall.config.graph import NodeGraph, ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.geometry.panels import Wall
from wall.operators.base import Node

HEAD = 0
ACCEPTED = "head, panel, rank N, host NAME or compositor N"
AT_RENDERER = "renderer"
_ON = re.compile(r"(head|panel)|(rank|compositor) +(\d{1,5})|host +(\S+)")


class Placement:
    """Finds the rank of each node; `hosts` grows with the hosts that nodes name."""

    def __init__(
        self, config: NodeGraph, wall: Wall, renderers: Mapping[str, tuple[int, ...]], refusals: Refusals
    ) -> None:
        """`renderers`: the ranks of every samples node."""
        self._config, self._ranks, self._refusals = config, renderers, refusals
        dealt = deal(wall, config.compositors)
        self.panel = tuple(dealt[viewport.on_panel] for viewport in wall.viewports)  # by index there
        self.hosts: dict[int, str] = {}  # wanted, by rank
        self._renderer_hosts: dict[int, str] = {}  # likewise, apart while compositors are looked for
        wanted: dict[int, set[str | None]] = {}
        for panel in wall.panels:
            wanted.setdefault(self.panel[panel.index], set()).add(panel.config.host)
        for rank, (host, *others) in wanted.items():
            if host is not None and not others:
                self.hosts[rank] = host
        self._named_hosts = {panel.config.host for panel in wall.panels if panel.config.host is not None}

    def find(self, order: Sequence[Node], panels: Mapping[str, frozenset[int]]) -> dict[str, int]:
        """The rank of every node but samples nodes. `order`: inputs first; `panels`: whose pixels a node holds."""
        found: dict[str, int] = {}
        asked = {node.id: self._asked(node, panels[node.id]) for node in order if node.on is not None}
        for node in order:
            if isinstance(node, SamplesNode):
                continue
            rank = asked.get(node.id)
            found[node.id] = rank if rank is not None else self._chosen(node, found, panels[node.id])
        self._pages_together(order, found)
        self._all_work(found)
        self.hosts |= self._renderer_hosts
        return found

    def _chosen(self, node: Node, found: Mapping[str, int], panels: frozenset[int]) -> int:
        if isinstance(node, SinkNode) and node.kind != "window":
            return HEAD
        if isinstance(node, ReconstructNode | SkyNode):
            return self.panel[min(panels)]
        inputs = [found[name] for name in node.sources if name in found]
        if not inputs:
            return HEAD  # a constant or a file: its users' edges decide nothing yet, and it changes never
        most = Counter(inputs).most_common()
        return min(rank for rank, times in most if times == most[0][1])

    def _asked(self, node: Node, panels: frozenset[int]) -> int | None:
        assert node.on is not None
        match = _ON.fullmatch(node.on)
        if isinstance(node, SamplesNode):
            if match is None or match[4] is None:
                accepted = "host NAME; or rank: N, or group: NAME, instead of on"
                self._refusals.add(node, ["on"], "samples come from renderers", accepted)
            elif node.ranks_of is not None:
                self._refusals.add(node, ["on"], f"its ranks are those of {node.ranks_of}", "`on` there")
            else:
                self._renderer_hosts |= dict.fromkeys(self._ranks.get(node.id, ()), match[4])
            return None
        if node.on == AT_RENDERER and isinstance(node, ReconstructNode):
            return self._chosen(node, {}, panels)  # where its image goes
        if match is None:
            self._refusals.add(node, ["on"], "names no compositor", ACCEPTED)
            return None
        word, kind, number, host = match.groups()
        if word == "head":
            return HEAD
        if word == "panel":
            return self._of_panels(node, panels)
        return self._on_host(node, host) if host else self._numbered(node, kind, int(number))

    def _numbered(self, node: Node, kind: str, number: int) -> int | None:
        count = self._config.compositors
        if number < count:
            return number
        if count == 1:
            what = "there is only compositor 0 (the head)"
        elif kind == "rank":
            what = f"rank {number} is no compositor: those are ranks 0 to {count - 1}"
        else:
            what = f"there are {count} compositors"
        self._refusals.add(node, ["on"], what, f"{kind} 0 to {count - 1}, or more graph.compositors")
        return None

    def _of_panels(self, node: Node, panels: frozenset[int]) -> int | None:
        ranks = {self.panel[panel] for panel in panels}
        if len(ranks) == 1:
            return ranks.pop()
        which = "no panel" if not ranks else f"panels of compositors {', '.join(map(str, sorted(ranks)))}"
        self._refusals.add(node, ["on"], f"this node holds pixels of {which}", "head or compositor N")
        return None

    def _on_host(self, node: Node, host: str) -> int | None:
        known = [rank for rank, name in self.hosts.items() if name == host]
        if known:
            return min(known)
        free = [k for k in range(1, self._config.compositors) if k not in self.hosts and k not in self.panel]
        if not free:
            accepted = ", ".join(sorted(self._named_hosts)) or "more graph.compositors"
            self._refusals.add(node, ["on"], f"no compositor is left that could be on host {host}", accepted)
            return None
        self.hosts[free[0]] = host
        return free[0]

    def _pages_together(self, order: Sequence[Node], found: Mapping[str, int]) -> None:
        pages = [node for node in order if isinstance(node, SinkNode) and node.kind == "browser"]
        for node in pages[1:]:
            if found[node.id] != (rank := found[pages[0].id]):
                what = f"{pages[0].id} is a page of rank {rank}, and all pages are served by one compositor"
                self._refusals.add(node, ["on"], what, "head" if rank == HEAD else f"compositor {rank}")

    def _all_work(self, found: Mapping[str, int]) -> None:
        idle = sorted(set(range(1, self._config.compositors)) - set(found.values()))
        if idle:
            which = ", ".join(map(str, idle))
            accepted = "nodes with `on` for each compositor, or fewer"
            self._refusals.add(None, ["compositors"], f"compositor {which} has nothing to do", accepted)


def deal(wall: Wall, compositors: int) -> tuple[int, ...]:
    """A compositor rank for every panel, by panel index; panels of different hosts share none if possible.

    With more compositors than hosts the head takes none of those panels.
    """
    hosts = list(dict.fromkeys(panel.config.host for panel in wall.panels))
    count = len(wall.panels)
    if None in hosts or not 1 < len(hosts) <= compositors:
        return tuple(panel.index * compositors // count for panel in wall.panels)
    head = int(len(hosts) < compositors)
    share, ranks = compositors - head, [0] * count
    for g, host in enumerate(hosts):
        mine = [panel.index for panel in wall.panels if panel.config.host == host]
        first, last = head + g * share // len(hosts), head + (g + 1) * share // len(hosts)
        for i, panel in enumerate(mine):
            ranks[panel] = first + i * (last - first) // len(mine)
    return tuple(ranks)
