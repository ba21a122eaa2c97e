"""Parse JSON and JSON5 to a tree of nodes with lines and columns. The only file that imports the JSON5 library."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import Any

import json5
from json5 import model
from json5.loader import ModelLoader

from wall.importers.report import NotThisFormat
from wall.importers.source import Node, Scalar

MAX_DEPTH = 32  # the deepest known file has 9 levels
MAX_TOKENS = 120_000  # blanks among them; the library reads 30,000 a second
MAX_DIGITS = 400  # in a number; more may be many tokens

_PIECE = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
    |"[^"\\]*(?:\\.[^"\\]*)*"|'[^'\\]*(?:\\.[^'\\]*)*'
    |(?P<unclosed>/\*|["'])
    |(?P<open>[\[{])|(?P<close>[\]}])
    |(?P<number>\d[\w$\\]*)|[\w$\\]+|\s+|.""",
    re.VERBOSE | re.DOTALL,
)
_NO_LINE_END = re.compile(r"[^\n]")


def parse(text: str, name: str) -> Node:
    """The tree of one JSON5 document; JSON is JSON5. Raises NotThisFormat, whatever the text is."""
    text = without_comments(text, name)
    try:
        return _Tree(name).node(_document(text).value, "", "", 0)
    except NotThisFormat:
        raise
    except RecursionError:
        raise NotThisFormat(f"{name}:1:1: nested too deeply; accepted: at most {MAX_DEPTH} levels") from None
    except Exception as error:  # the library leaks errors of its scanner and of int() for malformed text
        raise NotThisFormat(f"{name}:{_place(text, error)}: not valid JSON5{_reason(error)}") from None


@lru_cache(maxsize=1)
def _document(text: str) -> Any:
    """The library's tree; a file is read once to detect its format and once to convert it."""
    return json5.loads(text, loader=ModelLoader())


def without_comments(text: str, name: str) -> str:
    """Replace comments by blanks, so that positions stay the same; in linear time.

    The library takes exponential time for a comment that is never closed. Raises NotThisFormat for such a comment or
    string, and for more levels, tokens or digits than a wall has.
    """
    parts, kept, depth = list[str](), 0, 0
    for tokens, found in enumerate(_PIECE.finditer(text)):
        kind = found.lastgroup
        if kind == "comment":
            parts += text[kept : found.start()], _NO_LINE_END.sub(" ", found[0])
            kept = found.end()
        elif kind in ("open", "close"):
            depth += 1 if kind == "open" else -1
        wrong = ""
        if kind == "unclosed":
            wrong = f"not valid JSON5 (this {'comment' if found[0] == '/*' else 'string'} is never closed)"
        elif depth > MAX_DEPTH + 1:
            wrong = f"nested too deeply; accepted: at most {MAX_DEPTH} levels"
        elif tokens >= MAX_TOKENS:
            wrong = f"more than {MAX_TOKENS} words, signs and blanks; accepted: a wall description"
        elif kind == "number" and len(found[0]) > MAX_DIGITS:
            wrong = f"a number of more than {MAX_DIGITS} characters; accepted: at most {MAX_DIGITS}"
        if wrong:
            raise NotThisFormat(f"{name}:{_line_column(text, found.start())}: {wrong}")
    return "".join([*parts, text[kept:]])


class _Tree:
    """Converts the library's nodes to Node."""

    def __init__(self, name: str) -> None:
        self._name = name

    def node(self, value: Any, path: str, key: str, depth: int) -> Node:
        """The tree of a value that stands at `path`. Raises NotThisFormat if it is nested too deeply."""
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
        """Add a key and its value to an object."""
        key = str(pair.key.name if isinstance(pair.key, model.Identifier) else pair.key.characters)
        path = f"{parent.name}.{key}" if parent.name else key
        inner = self.node(pair.value, path, key, depth + 1)
        if inner.kind != "value":
            inner.line, inner.column = pair.key.lineno, pair.key.col_offset + 1
        if (earlier := parent.fields.get(key)) is not None:  # the last one counts; the other is left over
            parent.items.append(earlier)
        parent.fields[key] = inner


def _scalar(value: Any) -> Scalar:
    """The plain value of the library's number, text or literal."""
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
    """line:column of a parse error; of the text's beginning or end where the library gives none."""
    if found := re.search(r"line (\d+),? column (\d+)", str(error)):
        return f"{found[1]}:{found[2]}"
    if found := re.search(r"at index (\d+)", str(error)):
        return _line_column(text, int(found[1]))
    return _line_column(text, len(text)) if "EOF" in str(error) else "1:1"


def _line_column(text: str, index: int) -> str:
    """line:column of an index into the text, both from 1."""
    return f"{text.count(chr(10), 0, index) + 1}:{index - text.rfind(chr(10), 0, index)}"


def _reason(error: Exception) -> str:
    """The library's first message in one line, without its position."""
    said = str(error).split("The primary error was:")[-1].strip().splitlines()
    first = re.sub(r"(:| at:?)? ?\(?line \d+,? column \d+.*$", "", said[0]) if said else ""
    return f" ({' '.join(first.split())[:120]})" if first else ""
