"""Parse XML to a tree of nodes with lines and columns, by expat. Internal and external entities are refused.

lxml gives no position of an attribute, and no column of an element, which reports and refusals name; expat does.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import Any
from xml.parsers import expat

from wall.importers.report import NotThisFormat
from wall.importers.source import Node

MAX_DEPTH = 32  # the deepest known file has 7 levels
MAX_NODES = 50_000  # elements and attributes; a wall of 1,024 panels has 10,000

_START_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
_ATTRIBUTE = re.compile(r"""([^\s=<>/"']+)\s*=\s*(?:"[^"]*"|'[^']*')""")
_ENCODING = re.compile(r"""^(\s*<\?xml[^>]{0,99}?)\s{1,99}encoding\s*=\s*(["'])[^"']*\2""")


def parse(text: str, name: str) -> Node:
    """The tree of one XML document: attributes are fields, elements items. Raises NotThisFormat only.

    Text between elements becomes a field `#text` of its element.
    """
    reader = _Reader(text, name)
    try:
        return reader.read()
    except expat.ExpatError as error:
        what = expat.errors.messages.get(error.code, "cannot be read")
        raise NotThisFormat(f"{name}:{error.lineno}:{error.offset + 1}: not valid XML ({what})") from None
    except (ValueError, UnicodeError) as error:
        raise NotThisFormat(f"{name}:1:1: not valid XML ({error})") from None


class _Reader:
    """Builds the tree from expat's callbacks."""

    def __init__(self, text: str, name: str) -> None:
        self._data = _ENCODING.sub(r"\1", text).encode("utf-8", "replace")  # it is decoded already
        self._name = name
        self._parser = expat.ParserCreate("utf-8")
        self._parser.buffer_text = True
        self._parser.ordered_attributes = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.EntityDeclHandler = self._entity
        self._open: list[Node] = []
        self._counts: list[Counter[str]] = []  # of the open elements' children, by tag
        self._nodes = 0
        self._root: Node | None = None

    def read(self) -> Node:
        """The tree of the whole document."""
        self._parser.Parse(self._data, True)
        assert self._root is not None  # expat refuses a document without an element
        return self._root

    def _start(self, tag: str, attributes: list[str]) -> None:
        """Add an element with its attributes to the tree. Raises NotThisFormat beyond the limits."""
        line, column = self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1
        if len(self._open) >= MAX_DEPTH:
            where = f"{self._name}:{line}:{column}"
            raise NotThisFormat(f"{where}: nested too deeply; accepted: at most {MAX_DEPTH} levels")
        parent = self._open[-1] if self._open else None
        self._nodes += 1 + len(attributes) // 2
        if self._nodes > MAX_NODES:
            where = f"{self._name}:{line}:{column}"
            raise NotThisFormat(f"{where}: more than {MAX_NODES} elements and attributes; accepted: a wall description")
        path = tag if parent is None else f"{parent.name}.{tag}[{self._counts[-1][tag]}]"
        node = Node(name=path, line=line, column=column, kind="object", key=tag)
        places = _attribute_places(self._start_tag(), line, column)
        for key, value in zip(attributes[::2], attributes[1::2], strict=True):
            at_line, at_column = places.get(key, (line, column))
            node.fields[key] = Node(
                name=f"{path}.{key}", line=at_line, column=at_column, kind="value", key=key, value=value
            )
        if parent is None:
            self._root = node
        else:
            parent.items.append(node)
            self._counts[-1][tag] += 1
        self._open.append(node)
        self._counts.append(Counter())

    def _start_tag(self) -> str:
        """The start tag that is being read, as it is written."""
        found = _START_TAG.match(self._data, self._parser.CurrentByteIndex)
        return found[0].decode("utf-8") if found else ""

    def _end(self, _: str) -> None:
        self._open.pop()
        self._counts.pop()

    def _text(self, text: str) -> None:
        """Add text to the open element."""
        if not (said := text.strip()) or not self._open:
            return
        node = self._open[-1]
        line = self._parser.CurrentLineNumber
        if (before := node.fields.get("#text")) is not None:
            before.value = f"{before.value} {said}"
            return
        node.fields["#text"] = Node(
            name=f"{node.name} text", line=line, column=1, kind="value", key="#text", value=said
        )

    def _entity(self, *_: Any) -> None:
        """Refuse an entity declaration."""
        line = self._parser.CurrentLineNumber
        raise NotThisFormat(f"{self._name}:{line}:1: entities are not read; accepted: text written out")


def _attribute_places(source: str, line: int, column: int) -> dict[str, tuple[int, int]]:
    """Line and column of each attribute in the start tag `source` that begins at line, column; in linear time."""
    found, start, after = dict[str, tuple[int, int]](), 0, column  # `after`: the column of source[start]
    for attribute in _ATTRIBUTE.finditer(source):
        between = source[start : attribute.start()]
        line += between.count("\n")
        after = len(between) - between.rfind("\n") if "\n" in between else after + len(between)
        start = attribute.start()
        found.setdefault(attribute[1], (line, after))
    return found
