"""Collect what is wrong with a graph, each error with its position in the file."""

from __future__ import annotations

from collections.abc import Sequence

from wall.config.loading import Loaded
from wall.core.errors import ConfigError
from wall.operators.base import Node


class Refusals:
    """Errors of a graph's nodes, collected so that a user sees all of them at once."""

    def __init__(self, loaded: Loaded, nodes: Sequence[Node], *, written: bool) -> None:
        """`written`: the nodes stand in the file; else they come from a preset, and errors point to `graph`."""
        self._loaded, self._written = loaded, written
        self._index = {id(node): i for i, node in enumerate(nodes)}
        self._named = {node.id: i for i, node in enumerate(nodes)}
        self.found: list[ConfigError] = []

    def add(self, node: Node | None, at: Sequence[str | int], message: str, accepted: str = "") -> None:
        """`at` leads from the node (from `graph` without one) to the culprit inside it."""
        if node is not None and self._written:
            index = self._index.get(id(node), self._named[node.id])
            path: tuple[str | int, ...] = ("graph", "nodes", index, *at)
        elif node is not None:
            path, message = ("graph",), f"node {node.id}: {message}"
        else:
            path = ("graph", *at)
        self.found.append(self._loaded.error(path, message, accepted))

    def number(self, node: Node) -> str:
        """A node as errors call it."""
        return f"nodes[{self._index[id(node)]}]"

    def raise_any(self) -> None:
        """Raises ConfigError with all that was found, if anything was."""
        if self.found:
            raise ConfigError("\n".join(dict.fromkeys(str(problem) for problem in self.found)))
