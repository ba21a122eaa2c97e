"""Compose YAML of bounded size and depth: the library's time grows with the square of the depth."""

from __future__ import annotations

from typing import Any

from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError

MOST_LEVELS = 64


class BoundedComposer(Composer):
    """Stops at too many values with MarkedYAMLError, at too many levels with RecursionError."""

    most_values = 1 << 18  # keys, values and lists
    _composed = _level = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """A value and all within it."""
        self._composed += 1
        if self._composed > self.most_values:
            mark = self.parser.peek_event().start_mark
            raise MarkedYAMLError(
                problem=f"more than {self.most_values} keys and values are too many", problem_mark=mark
            )
        if self._level >= MOST_LEVELS:
            raise RecursionError
        self._level += 1
        node = super().compose_node(parent, index)
        self._level -= 1
        return node
