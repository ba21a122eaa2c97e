"""Parse YAML text into plain values and their positions; write values as YAML text.

Only what a configuration needs is understood: mappings, lists, texts, numbers, true/false and null. Anchors,
aliases, merge keys and tags are refused: one written value would stand in several positions. This is the only
file that knows the YAML library.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from wall.operators.bounded_yaml import BoundedComposer

YamlPath: TypeAlias = tuple[str | int, ...]

MAX_CHARACTERS = 1 << 20  # a wall of 1,024 panels written out takes 250 kB
MAX_BYTES = 4 * MAX_CHARACTERS + 3  # in UTF-8, with its mark
MAX_VALUES = 1 << 16  # keys, values and lists: three times a wall of 1,024 panels written out; read in some seconds
MAX_DEPTH = 24  # the deepest shipped path is 8
MAX_DIGITS = 18  # whatever is longer than an int64 is a typing error

_TAG = "tag:yaml.org,2002:"


PLAIN_WORDS = {  # for those of YAML's grammar in the library's errors
    "'<scalar>'": "a value",
    "'<stream end>'": "the end of the file",
    "'<block mapping start>'": "a mapping that is indented otherwise",
    "'<block sequence start>'": "a list that is indented otherwise",
    "'?'": "a key",
    "'<block end>'": "less indentation",
    "<block end>": "a line as far indented, or less",
    "while parsing a flow node: expected the node content": "expected a value",
    "flow sequence": "list in [ ]",
    "flow mapping": "mapping in { }",
    "block sequence": "list",
    "block mapping": "mapping",
    "block collection": "list",
}


@dataclass(frozen=True, slots=True)
class Position:
    """Position in a text: line and column, counted from 1."""

    line: int
    column: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A part of the text that is refused."""

    what: str
    accepted: str = ""
    path: YamlPath = ()
    position: Position | None = None


@dataclass(slots=True, kw_only=True)
class Document:
    """The values of a text, their positions, and what is refused."""

    values: Any = None
    positions: dict[YamlPath, Position] = field(default_factory=dict)  # of values
    keys: dict[YamlPath, Position] = field(default_factory=dict)  # of keys
    problems: list[Problem] = field(default_factory=list)

    def position(self, path: YamlPath, *, key: bool = False) -> Position | None:
        """Position of a value (or its key); for a path that is not in the text, of its nearest parent."""
        for end in range(len(path), -1, -1):
            of_key = self.keys.get(path[:end])
            of_value = self.positions.get(path[:end])
            if found := (of_key or of_value) if key else (of_value or of_key):
                return found
        return None

    def refuse(self, node: Node, path: YamlPath, what: str, *, accepted: str = "") -> None:
        """Adds a problem at `node`: what is wrong there, and what is accepted."""
        self.problems.append(Problem(position=_position(node.start_mark), path=path, what=what, accepted=accepted))


def parse(text: str) -> Document:
    """Read one YAML document. Never raises: whatever is wrong is in `problems`, with its position."""
    document = Document()
    if len(text) > MAX_CHARACTERS:
        what = f"{len(text)} characters are too many"
        document.problems.append(Problem(what=what, accepted=f"at most {MAX_CHARACTERS}"))
        return document
    try:
        yaml = YAML(typ="safe", pure=True)
        yaml.Composer = _Composer
        node = yaml.compose(io.StringIO(text))
        if node is None:
            return document
        document.values = _value(document, node, ())
    except RecursionError:
        document.problems.append(Problem(what="lists or mappings are nested too deeply"))
    except MarkedYAMLError as error:
        document.problems.append(_syntax(error))
    except ReaderError as error:
        document.problems.append(_character(text, error))
    except (YAMLError, ValueError, AttributeError, KeyError, AssertionError, NotImplementedError) as error:
        # the library's scanner leaks such errors for some malformed directives and escapes
        document.problems.append(Problem(what=f"not valid YAML ({_one_line(error)})"))
    return document


class _Composer(BoundedComposer):
    most_values = MAX_VALUES


def write(values: Any) -> str:
    """Plain values as YAML text: block style, short lists of plain values in one line."""
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None  # plain lists in one line, the rest in blocks
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]  # keeps the models' order
    yaml.width = 110
    yaml.representer.ignore_aliases = lambda data: True  # a value that stands twice is written twice
    out = io.StringIO()
    yaml.dump(values, out)
    return out.getvalue()


def _position(mark: Any) -> Position:
    return Position(mark.line + 1, mark.column + 1)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())[:200]


def _syntax(error: MarkedYAMLError) -> Problem:
    mark = error.problem_mark or error.context_mark
    what = _one_line(": ".join(part for part in (error.context, error.problem) if part)) or "not valid YAML"
    if "\\t" in what:
        return Problem(what="a tab cannot indent YAML", accepted="spaces", position=mark and _position(mark))
    for words, plain in PLAIN_WORDS.items():
        what = what.replace(words, plain)
    return Problem(what=f"not valid YAML: {what}", position=mark and _position(mark))


def _character(text: str, error: ReaderError) -> Problem:
    before = text[: error.position]
    position = Position(before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1)
    code = error.character if isinstance(error.character, int) else ord(str(error.character)[:1] or "\0")
    what = f"the character U+{code:04X} is not allowed in YAML"
    return Problem(what=what, accepted="printable text", position=position)


def _value(document: Document, node: Node, path: YamlPath) -> Any:
    document.positions[path] = _position(node.start_mark)
    if node.anchor is not None:
        what = f"anchors and aliases (&{node.anchor}) are not used here"
        document.refuse(node, path, what, accepted="the value written out")
        return None
    if len(path) > MAX_DEPTH:
        document.refuse(node, path, "nested too deeply", accepted=f"at most {MAX_DEPTH} levels")
        return None
    if not isinstance(node, ScalarNode) and str(node.tag) not in (_TAG + "map", _TAG + "seq"):
        document.refuse(node, path, f"tags ({_tag_name(node)}) are not used here", accepted="a plain value")
        return None
    if isinstance(node, MappingNode):
        return _mapping(document, node, path)
    if isinstance(node, SequenceNode):
        return [_value(document, item, (*path, i)) for i, item in enumerate(node.value)]
    return _scalar(document, node, path)


def _mapping(document: Document, node: MappingNode, path: YamlPath) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = key_node.value
        if not isinstance(key_node, ScalarNode):
            document.refuse(key_node, path, "a key must be one word", accepted="key: value")
            continue
        here = (*path, key)
        if key == "<<":
            document.refuse(key_node, here, "merge keys (<<) are not used here", accepted="the keys written out")
        elif key in values:
            first = document.keys[here]
            document.refuse(key_node, here, f"this key stands on line {first.line} already", accepted="each key once")
        else:
            document.keys[here] = _position(key_node.start_mark)
            values[key] = _value(document, value_node, here)
    return values


def _scalar(document: Document, node: Node, path: YamlPath) -> Any:
    kind = str(node.tag).removeprefix(_TAG)
    text = str(node.value)
    if kind in ("str", "timestamp"):
        return text
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind in ("int", "float"):
        return _number(document, node, path)
    document.refuse(node, path, f"tags ({_tag_name(node)}) are not used here", accepted="a plain value")
    return None


def _tag_name(node: Node) -> str:
    return "!" + str(node.tag).removeprefix(_TAG).lstrip("!")[:40]


def _number(document: Document, node: Node, path: YamlPath) -> int | float | None:
    text = str(node.value).replace("_", "").lower()
    if len(text) > 64 or (str(node.tag).endswith("int") and len(text.lstrip("+-0xob")) > MAX_DIGITS):
        document.refuse(node, path, f"{text[:12]}... has too many digits", accepted=f"at most {MAX_DIGITS} digits")
        return None
    try:
        if str(node.tag).endswith("int"):
            return int(text, 0) if text.lstrip("+-")[:2] in ("0x", "0o", "0b") else int(text)
        return float(text.replace(".inf", "inf").replace(".nan", "nan"))
    except ValueError:
        document.refuse(node, path, f"{text} is not a number", accepted="a number such as 12 or 0.5")
        return None
