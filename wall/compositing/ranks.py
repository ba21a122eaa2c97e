"""Number the ranks that render each samples node: those that it names, else the next free numbers.

Rank 0 is the head (a compositor), then come remote compositors, then renderers.
"""

from __future__ import annotations

from collections.abc import Sequence

from wall.compositing.refusals import Refusals
from wall.config.graph import NodeGraph, SamplesNode
from wall.config.loading import nearest
from wall.operators.base import Node


def number_ranks(config: NodeGraph, order: Sequence[SamplesNode], refusals: Refusals) -> dict[str, tuple[int, ...]]:
    """The ranks of every samples node. `order`: those nodes by panel; free numbers are dealt in it."""
    named = {node.id: _named(config, node, refusals) for node in order}
    taken = _each_once(config, order, named, refusals)
    free = (rank for rank in range(config.compositors, 1 << 20) if rank not in taken)
    ranks = {}
    for node in order:
        if node.ranks_of is not None:
            continue
        own = named[node.id]
        ranks[node.id] = own if own is not None else tuple(next(free) for _ in range(node.ranks or 1))
    for node in order:
        if node.ranks_of is not None and (shared := _shared(node, order, ranks, refusals)):
            ranks[node.id] = shared
    _no_gap(config, ranks, order, refusals)
    _no_idle_group(config, order, refusals)
    return ranks


def _shared(
    node: SamplesNode, order: Sequence[SamplesNode], ranks: dict[str, tuple[int, ...]], refusals: Refusals
) -> tuple[int, ...]:
    """The ranks of the node that `ranks_of` names."""
    others = [other.id for other in order if other.ranks_of is None]
    if node.ranks_of not in others:
        accepted = ", ".join(others) + nearest(str(node.ranks_of), others)
        refusals.add(node, ["ranks_of"], "there is no such samples node with ranks of its own", accepted)
        return ()
    return ranks[node.ranks_of]


def _named(config: NodeGraph, node: SamplesNode, refusals: Refusals) -> tuple[int, ...] | None:
    if node.rank is not None:
        return (node.rank,)
    if node.group is None:
        return None
    members = config.groups.get(node.group)
    if members is None:
        known = list(config.groups)
        accepted = ", ".join(known) or "a group of graph.groups"
        refusals.add(node, ["group"], "there is no such group", accepted + nearest(node.group, known))
        return ()
    if node.ranks is not None and node.ranks > len(members):
        came = f"more ranks than group {node.group} names ({', '.join(map(str, members))})"
        refusals.add(node, ["ranks"], came, f"1 to {len(members)}, or more ranks in the group")
    if node.ranks is not None and node.ranks < len(members):
        idle = ", ".join(map(str, members[node.ranks :]))
        refusals.add(node, ["ranks"], f"rank {idle} of group {node.group} has no work", str(len(members)))
    return members


def _each_once(
    config: NodeGraph, order: Sequence[SamplesNode], named: dict[str, tuple[int, ...] | None], refusals: Refusals
) -> set[int]:
    first = config.compositors
    taken: dict[int, Node] = {}
    for node in order:
        for rank in named[node.id] or ():
            at = ["rank"] if node.rank is not None else ["group"]
            if rank < first:
                what = "rank 0 is the head" if first == 1 else f"ranks 0 to {first - 1} are compositors"
                refusals.add(node, at, f"rank {rank} cannot render: {what}", f"rank {first} or above")
            elif rank in taken:
                refusals.add(node, at, f"rank {rank} renders node {taken[rank].id} already", "a rank of its own")
            taken[rank] = node
    return set(taken)


def _no_gap(
    config: NodeGraph, ranks: dict[str, tuple[int, ...]], order: Sequence[SamplesNode], refusals: Refusals
) -> None:
    order = [node for node in order if node.id in ranks]
    used = {rank for own in ranks.values() for rank in own if rank >= config.compositors}
    idle = [rank for rank in range(config.compositors, max(used, default=0)) if rank not in used]
    if not idle or refusals.found:
        return
    node = next(n for n in order if max(used) in ranks[n.id])
    at = ["rank"] if node.rank is not None else ["group"]
    which = ", ".join(map(str, idle[:8])) + (" ..." if len(idle) > 8 else "")
    refusals.add(node, at, f"rank {max(used)} is named, and rank {which} has no work", "ranks without a gap")


def _no_idle_group(config: NodeGraph, order: Sequence[SamplesNode], refusals: Refusals) -> None:
    used = {node.group for node in order}
    for name, members in config.groups.items():
        if name not in used:
            which = ", ".join(map(str, members))
            refusals.add(None, ["groups", name], f"rank {which} has no work", f"a samples node with group: {name}")
