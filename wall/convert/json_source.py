"""JSON and JSON5 text to a tree of nodes with lines. The only file that knows the JSON5 library."""

from __future__ import annotations

import math
import re
from typing import Any

import json5
from json5 import model
from json5.loader import ModelLoader

from wall.convert.report import NotThisFormat
from wall.convert.source import Node, Scalar

MAX_DEPTH = 32  # the deepest known file has 9 levels
MAX_BRACKETS = 50_000  # a wall of 1,024 panels has 10,000


def parse(text: str, name: str) -> Node:
    """The tree of one JSON5 document; JSON is JSON5. Raises NotThisFormat, whatever the text is."""
    if text.count("[") + text.count("{") > MAX_BRACKETS:
        raise NotThisFormat(f"{name}:1:1: more than {MAX_BRACKETS} lists and objects; accepted: a wall description")
    try:
        document = json5.loads(text, loader=ModelLoader())
        return _Tree(name).node(document.value, "", "", 0)
    except NotThisFormat:
        raise
    except RecursionError:
        raise NotThisFormat(f"{name}:1:1: nested too deeply; accepted: at most {MAX_DEPTH} levels") from None
    except Exception as error:  # the library leaks errors of its scanner and of int() for malformed text
        raise NotThisFormat(f"{name}:{_place(text, error)}: not valid JSON5{_reason(error)}") from None


class _Tree:
    """From the library's nodes to ours."""

    def __init__(self, name: str) -> None:
        self._name = name

    def node(self, value: Any, path: str, key: str, depth: int) -> Node:
        line, column = value.lineno or 1, (value.col_offset or 0) + 1
        if depth > MAX_DEPTH:
            where = f"{self._name}:{line}:{column}"
            raise NotThisFormat(f"{where}: nested too deeply; accepted: at most {MAX_DEPTH} levels")
        if isinstance(value, model.JSONObject):
            found = Node(name=path, line=line, column=column, kind="object", key=key)
            for pair in value.key_value_pairs:
                self._member(found, pair, depth)
            return found
        if isinstance(value, model.JSONArray):
            found = Node(name=path, line=line, column=column, kind="list", key=key)
            found.items = [self.node(item, f"{path}[{i}]", "", depth + 1) for i, item in enumerate(value.values)]
            return found
        return Node(name=path, line=line, column=column, kind="value", key=key, value=_scalar(value))

    def _member(self, parent: Node, pair: Any, depth: int) -> None:
        key = str(pair.key.name if isinstance(pair.key, model.Identifier) else pair.key.characters)
        path = f"{parent.name}.{key}" if parent.name else key
        inner = self.node(pair.value, path, key, depth + 1)
        if inner.kind != "value":
            inner.line, inner.column = pair.key.lineno, pair.key.col_offset + 1
        if (earlier := parent.fields.get(key)) is not None:  # the last one counts; the other is left over
            parent.items.append(earlier)
        parent.fields[key] = inner


def _scalar(value: Any) -> Scalar:
    if isinstance(value, model.UnaryOp):
        inner = _scalar(value.value)
        return -inner if value.op == "-" and isinstance(inner, (int, float)) else inner
    if isinstance(value, model.String):
        return str(value.characters)
    if isinstance(value, model.Infinity):
        return math.inf
    if isinstance(value, model.NaN):
        return math.nan
    if isinstance(value, (model.Integer, model.Float, model.BooleanLiteral)):
        plain: int | float | bool = value.value
        return plain
    return None


def _place(text: str, error: Exception) -> str:
    """line:column of a parse error; of the text's end or beginning if the library does not say."""
    if found := re.search(r"line (\d+),? column (\d+)", str(error)):
        return f"{found[1]}:{found[2]}"
    if found := re.search(r"at index (\d+)", str(error)):
        before = text[: int(found[1])]
        return f"{before.count(chr(10)) + 1}:{len(before) - (before.rfind(chr(10)) + 1) + 1}"
    if "EOF" in str(error):
        return f"{text.count(chr(10)) + 1}:{len(text) - (text.rfind(chr(10)) + 1) + 1}"
    return "1:1"


def _reason(error: Exception) -> str:
    """The library's first complaint in one line, without its place, which is said already."""
    said = str(error).split("The primary error was:")[-1].strip().splitlines()
    first = re.sub(r"(:| at:?)? ?\(?line \d+,? column \d+.*$", "", said[0]) if said else ""
    return f" ({' '.join(first.split())[:120]})" if first else ""
