"""Find the channels on each edge of the graph, only those that are needed, and where light is encoded to bytes."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

from wall.compositing.refusals import Refusals
from wall.compositing.structure import input_path, users_of
from wall.config.graph import ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.core.data import CHANNELS, Channels
from wall.operators.base import Node, Operator

COLOUR: Channels = frozenset({"colour"})
MOVED: Channels = frozenset({"depth", "object_id"})  # by which an image is reprojected
TRANSPARENT: Channels = frozenset({"colour", "depth", "alpha", "time", "object_id"})
OPAQUE: Channels = frozenset({"colour", "depth", "time", "object_id", "albedo", "normal"})  # with background: keep
Interval = tuple[int, int]


def find_channels(
    order: Sequence[Node], refusals: Refusals, *, moved: Container[str] = ()
) -> dict[str, Channels]:
    """What every node's framelet holds: what it can give, as far as somebody after it needs it.

    `moved`: ids of nodes whose inputs are reprojected.
    """
    given = _given(order, refusals)
    wanted = _wanted(order, moved)
    return {node.id: given[node.id] & (wanted[node.id] | node.MAKES | COLOUR) for node in order if node.id in given}


def _given(order: Sequence[Node], refusals: Refusals) -> dict[str, Channels]:
    given: dict[str, Channels] = {}
    for node in order:
        if isinstance(node, ReconstructNode):
            given[node.id] = OPAQUE if node.background == "keep" else TRANSPARENT
        elif isinstance(node, SkyNode):
            given[node.id] = frozenset({"colour", "depth", "alpha"})
        elif isinstance(node, Operator):
            inputs = [given[name] for name in node.sources]
            for k, channels in enumerate(inputs):
                if missing := sorted(node.NEEDS - channels, key=CHANNELS.index):
                    _refuse(node, k, missing, channels, refusals)
            given[node.id] = node.gives(inputs)
    return given


def _refuse(node: Operator, k: int, missing: list[str], channels: Channels, refusals: Refusals) -> None:
    has = ", ".join(name for name in CHANNELS if name in channels)
    hint = "a framelet with " + ", ".join(name for name in CHANNELS if name in node.NEEDS)
    if "alpha" in missing:
        hint += "; reconstruct has alpha with background: transparent"
    came = f"{getattr(node, 'op', 'it')} needs {', '.join(missing)}, and {node.sources[k]} gives only {has}"
    refusals.add(node, input_path(node, k), came, hint)


def _wanted(order: Sequence[Node], moved: Container[str]) -> dict[str, Channels]:
    wanted: dict[str, Channels] = {node.id: frozenset() for node in order}
    for node in reversed(order):
        if isinstance(node, SamplesNode):
            continue
        needs = node.NEEDS | node.USES if isinstance(node, Operator) else COLOUR
        needs |= MOVED if node.id in moved else frozenset()
        through = wanted[node.id] if isinstance(node, Operator) else frozenset()
        for name in node.sources:
            wanted[name] |= needs | through
    return wanted


def find_encoded(order: Sequence[Node], channels: Mapping[str, Channels], refusals: Refusals) -> dict[str, bool]:
    """Whether a node's colour is display bytes already: as soon as nothing after it computes with light.

    Nodes that only move values pass on what they get; so bytes are made before them, three a pixel instead of twelve.
    """
    by_id = {node.id: node for node in order}
    encoded = {node.id: not isinstance(node, SamplesNode | SinkNode) for node in order}
    users = users_of(order)
    light = {node.id for node in order if not isinstance(node, Operator) or node.op_name == "encode"}
    moving = {node.id: node.id not in light and not computes(node, channels) for node in order}
    changed = True
    while changed:
        before = dict(encoded)
        for node in order:
            if not encoded[node.id] or node.op_name == "encode":
                continue
            fed = not moving[node.id] or not node.sources or all(encoded[name] for name in node.sources)
            encoded[node.id] = fed and all(_takes_bytes(user, moving, encoded) for user in users[node.id])
        changed = encoded != before
    for node in order:
        for k, name in enumerate(node.sources):
            if by_id[name].op_name == "encode" and not _takes_bytes(node, moving, encoded):
                came = f"{node.op_name} computes with light, and {name} gives display bytes"
                refusals.add(node, input_path(node, k), came, "the node before encode")
    return encoded


def computes(node: Node, channels: Mapping[str, Channels]) -> bool:
    """Whether an operator computes with light, so that bytes can only be made of what comes out."""
    if not isinstance(node, Operator) or node.op_name == "encode":
        return False
    return not node.sources or not node.moves([channels[name] for name in node.sources])


def _takes_bytes(user: Node, moving: Mapping[str, bool], encoded: Mapping[str, bool]) -> bool:
    return isinstance(user, SinkNode) or (moving[user.id] and encoded[user.id])


def find_orders(order: Sequence[Node], refusals: Refusals) -> dict[str, int]:
    """The order of every framelet: its own, else the least of its inputs'. Inputs of `over` must have one each."""
    spans: dict[str, Interval | None] = {}
    for node in order:
        own = getattr(node, "order", None)
        inputs = [spans.get(name) for name in node.sources]
        known = [span for span in inputs if span is not None]
        if node.op_name == "over":
            _are_ordered(node, inputs, refusals)
        if own is not None:
            spans[node.id] = (own, own)
        else:
            spans[node.id] = (min(a for a, _ in known), max(b for _, b in known)) if known else None
    return {name: span[0] if span is not None else 0 for name, span in spans.items()}


def _are_ordered(node: Node, inputs: Sequence[Interval | None], refusals: Refusals) -> None:
    for k, span in enumerate(inputs):
        at, name = input_path(node, k), node.sources[k]
        if span is None:
            refusals.add(node, at, f"{name} has no order, so over cannot say what is before it", f"order: N at {name}")
            continue
        for j in range(k):
            other = inputs[j]
            if other is not None and other[0] <= span[1] and span[0] <= other[1]:
                came = f"{name} and {node.sources[j]} have the same order, or one lies amidst the other's inputs"
                refusals.add(node, at, came, "orders that differ: the smaller is the nearer")
