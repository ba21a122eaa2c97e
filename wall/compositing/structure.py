"""Check that nodes form a typed acyclic graph: unique ids, inputs that exist and fit, and every path ends in a sink."""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

from wall.compositing.refusals import Refusals
from wall.config.graph import SamplesNode, SinkNode
from wall.config.loading import nearest
from wall.operators.base import Node

WORDS = {"samples": "samples", "framelet": "a framelet", "nothing": "nothing"}


def check_structure(nodes: Sequence[Node], refusals: Refusals) -> None:
    """Refuse what is no typed acyclic graph."""
    by_id = _by_id(nodes, refusals)
    _inputs_exist_and_fit(nodes, by_id, refusals)
    if not any(isinstance(node, SinkNode) for node in nodes):
        refusals.add(None, ["nodes"], "no image ends anywhere", "a node with op: sink")
    if not any(isinstance(node, SamplesNode) for node in nodes):
        refusals.add(None, ["nodes"], "nothing is rendered: there is no samples node", "a node with op: samples")
    if not refusals.found:  # with a wrong input every node after it would be called unused as well
        _is_acyclic(nodes, by_id, refusals)
        _is_used(nodes, refusals)


def in_order(nodes: Sequence[Node]) -> tuple[Node, ...]:
    """Inputs before those who need them; else as they stand in the file."""
    by_id = {node.id: node for node in nodes}
    return tuple(by_id[name] for name in TopologicalSorter({n.id: n.sources for n in nodes}).static_order())


def _by_id(nodes: Sequence[Node], refusals: Refusals) -> dict[str, Node]:
    by_id: dict[str, Node] = {}
    for node in nodes:
        if node.id in by_id:
            refusals.add(node, ["id"], f"{refusals.number(by_id[node.id])} has this id already", "ids that differ")
        else:
            by_id[node.id] = node
    return by_id


def users_of(nodes: Sequence[Node]) -> dict[str, list[Node]]:
    """By id the nodes that take from each node, once for each input."""
    users: dict[str, list[Node]] = {node.id: [] for node in nodes}
    for node in nodes:
        for name in node.sources:
            users[name].append(node)
    return users


def input_path(node: Node, k: int) -> list[str | int]:
    """Where input k stands in a node."""
    single = getattr(node, "input", None) is not None
    return ["input"] if single and k == 0 else ["inputs", k - single]


def _inputs_exist_and_fit(nodes: Sequence[Node], by_id: dict[str, Node], refusals: Refusals) -> None:
    for node in nodes:
        for k, name in enumerate(node.sources):
            at, giver = input_path(node, k), by_id.get(name)
            if giver is not None and giver.GIVES == node.TAKES:
                continue
            fitting = [n.id for n in nodes if n.GIVES == node.TAKES and n is not node]
            accepted = ", ".join(fitting) or f"a node that gives {WORDS[node.TAKES]}"
            if giver is None:
                refusals.add(node, at, "there is no such node", accepted + nearest(name, fitting))
            else:
                came = f"{node.op_name} needs {WORDS[node.TAKES]}, {giver.op_name} gives {WORDS[giver.GIVES]}"
                refusals.add(node, at, came, accepted)


def _is_acyclic(nodes: Sequence[Node], by_id: dict[str, Node], refusals: Refusals) -> None:
    try:
        TopologicalSorter({node.id: node.sources for node in nodes}).prepare()
    except CycleError as error:
        circle = error.args[1]
        node = by_id[circle[1]]
        at = input_path(node, node.sources.index(circle[0]))
        refusals.add(node, at, f"needs its own result: {' -> '.join(circle)}", "a graph without cycles")


def _is_used(nodes: Sequence[Node], refusals: Refusals) -> None:
    users = users_of(nodes)
    for node in nodes:
        if isinstance(node, SinkNode):
            continue
        if not users[node.id]:
            rendered = isinstance(node, SamplesNode)
            work = "its ranks would work for nothing" if rendered else f"{node.op_name} is done in vain"
            refusals.add(node, ["id"], f"nobody uses what this node gives: {work}", f"a node with input: {node.id}")
        elif isinstance(node, SamplesNode) and len(users[node.id]) > 1:
            several = ", ".join(user.id for user in users[node.id])
            refusals.add(node, ["id"], f"samples are used more than once ({several})", "one reconstruct node")
