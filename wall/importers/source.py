"""A parsed source file: a tree whose every node has its line, and the report on each node.

A converter reads nodes, and reports each as carried or as not carried. `Source.close` lists every node that the
converter never read as not carried, so nothing is dropped silently.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from wall.importers.report import Conversion, Item, NotThisFormat

Scalar: TypeAlias = str | int | float | bool | None
LARGEST = 1e9  # metres, pixels, degrees: anything larger is a typing error
LONGEST_TEXT = 4096  # characters of a name that are kept
LONGEST_SHOWN = 60  # characters of a value that reports show
NO_COUNTERPART = "has no counterpart here"
_SECRET = re.compile("secret|token|password|passwd|key", re.IGNORECASE)  # reports do not repeat such values


@dataclass(slots=True, eq=False, kw_only=True)
class Node:
    """A value, a list or an object of the source; an XML element is an object whose items are its children."""

    name: str  # from the root, as people write it: nodes[0].windows[1].size
    line: int  # from 1
    column: int  # from 1
    kind: Literal["value", "list", "object"]
    key: str = ""  # its own key, or its XML tag
    value: Scalar = None
    fields: dict[str, Node] = field(default_factory=dict)  # members by key; XML attributes
    items: list[Node] = field(default_factory=list)  # of a list; XML child elements
    reported: bool = False  # as carried or as not carried
    panel: bool = False  # became a panel, whatever it holds

    def get(self, key: str) -> Node | None:
        """The member of that key; None where it is absent or null."""
        found = self.fields.get(key)
        return None if found is None or (found.kind == "value" and found.value is None) else found

    def children(self, tag: str) -> list[Node]:
        """XML child elements of that tag, in order."""
        return [item for item in self.items if item.key == tag]

    def inside(self) -> Iterator[Node]:
        """Its members and items."""
        yield from self.fields.values()
        yield from self.items


class Source:
    """A tree with the report on it. Refusals are NotThisFormat, and say name:line:column."""

    def __init__(self, name: str, root: Node, reasons: Mapping[str, str] | None = None) -> None:
        """`reasons` say by key why something has no counterpart."""
        self.name = name
        self._reasons = dict(reasons or {})
        self.root = root
        self.assumed: list[str] = []
        self.origins: list[Item] = []  # what each panel comes from
        self._carried: list[Item] = []
        self._not_carried: list[Item] = []

    def refuse(self, node: Node, what: str, accepted: str) -> NotThisFormat:
        """The error for a node without which there is no wall; the caller raises it."""
        where = f"{self.name}:{node.line}:{node.column}"
        return NotThisFormat(f"{where}: {node.name or 'the file'}: {what}; accepted: {accepted}")

    def carry(self, node: Node | None, into: str = "") -> None:
        """Report a node, with all inside it, as carried; `into` says where in the configuration."""
        if node is not None and not node.reported:
            self._carried.append(Item(what=node.name, line=node.line, why=into))
            _mark_reported(node)

    def drop(self, node: Node | None, why: str = NO_COUNTERPART) -> None:
        """Report a node as not carried, and every value inside it that was not carried either."""
        if node is not None and not node.reported:
            self._not_carried.append(Item(what=_shown(node), line=node.line, why=why))
            node.reported = True
            for inner in node.inside():
                self._drop_values(inner, why)

    def _drop_values(self, node: Node, why: str) -> None:
        """Report every value inside a node that was not reported yet as not carried."""
        if not node.reported and node.kind == "value":
            self._not_carried.append(Item(what=_shown(node), line=node.line, why=why))
        node.reported = True
        for inner in node.inside():
            self._drop_values(inner, why)

    def note(self, node: Node, why: str) -> None:
        """Report a node that was carried only in part: `why` says what is missing."""
        self._not_carried.append(Item(what=_shown(node), line=node.line, why=why))

    def assume(self, sentence: str) -> None:
        """Report an assumption about what the file leaves open, once."""
        if sentence not in self.assumed:
            self.assumed.append(sentence)

    def close(self, values: dict[str, Any], *, panels: int, ranks: int) -> Conversion:
        """The conversion; nodes that were never read are listed as not carried."""
        self._leftovers(self.root)
        return Conversion(
            values=values,
            carried=sorted(self._carried, key=lambda item: item.line),
            not_carried=sorted(self._not_carried, key=lambda item: item.line),
            panels=panels,
            ranks=ranks,
            assumed=self.assumed,
            origins=self.origins,
        )

    def _leftovers(self, node: Node) -> None:
        """Report every node that was never read as not carried."""
        for inner in node.inside():
            if inner.reported:
                continue
            if _touched(inner):
                self._leftovers(inner)
            else:
                self.drop(inner, self._reasons.get(inner.key, NO_COUNTERPART))

    def number(self, node: Node | None) -> float | None:
        """A finite number, also one written as text; None, and reported as not carried, where it cannot be read."""
        if node is None:
            return None
        found = as_number(node.value)
        if found is None:
            self.drop(node, "is not a number that can be used")
        return found

    def whole(self, node: Node | None) -> int | None:
        """A whole number (2.0 is one); None as for `number`."""
        found = self.number(node)
        if found is None or node is None:
            return None
        if found != int(found):
            self.drop(node, "is not a whole number")
            return None
        return int(found)

    def text(self, node: Node | None) -> str | None:
        """A printable text without blanks around it; None where there is none, or only blanks."""
        if node is None or node.kind != "value" or node.value is None or isinstance(node.value, bool):
            return None
        return "".join(ch for ch in str(node.value).strip()[:LONGEST_TEXT] if ch.isprintable()).strip() or None

    def flag(self, node: Node | None) -> bool | None:
        """true or false, also as 0, 1 or text; None where there is neither."""
        if node is None or node.kind != "value":
            return None
        if isinstance(node.value, str):
            return {"true": True, "1": True, "false": False, "0": False}.get(node.value.strip().lower())
        return None if node.value is None else bool(node.value)

    def positive(self, parent: Node, key: str) -> int:
        """A whole number above 0 that must be there. Raises NotThisFormat."""
        node = parent.get(key)
        if node is None:
            raise self.refuse(parent, f"{key} is missing", f"{key}: a whole number above 0")
        found = as_number(node.value)
        if found is None or found != int(found) or found < 1:
            raise self.refuse(node, f"is {node.value!r}"[:80], "a whole number above 0")
        return int(found)


def as_number(value: Scalar) -> float | None:
    """The number that a value is or spells; None if there is none, or it is not finite or beyond LARGEST."""
    if value is None or isinstance(value, bool):
        return None
    try:
        found = float(value)
    except (ValueError, OverflowError):
        return None
    return found if math.isfinite(found) and abs(found) <= LARGEST else None


def _mark_reported(node: Node) -> None:
    """Mark a node and all inside it as reported."""
    node.reported = True
    stack = [node]
    while stack:
        for inner in stack.pop().inside():
            inner.reported = True
            stack.append(inner)


def _touched(node: Node) -> bool:
    """Whether a converter used a node: it is a panel, or something inside it was reported."""
    return node.panel or any(inner.reported or _touched(inner) for inner in node.inside())


def _shown(node: Node) -> str:
    """A node's name, with the value if it is one that may be shown."""
    if node.kind != "value" or _SECRET.search(node.key):
        return node.name
    text = {True: "true", False: "false"}.get(node.value, "") if isinstance(node.value, bool) else repr(node.value)
    return f"{node.name} = {text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + '...'}"
