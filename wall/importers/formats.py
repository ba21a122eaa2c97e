"""The known formats, and how a file's format is detected: by its suffix, then by its content."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import PurePath

from wall.core.errors import ConfigError
from wall.importers import json_source, xml_source
from wall.importers.archive import Files
from wall.importers.report import Conversion, NotThisFormat

MOST_CHARACTERS = 1 << 20  # of a file
LONGEST_QUOTE = 60  # characters of a file that a refusal repeats


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A known format: its name, how a person recognises it, and the module of its `convert(text, name)`."""

    name: str
    known_by: str
    module: str
    names_files: bool = False  # its function takes those that the text names

    def convert(self, text: str, name: str, files: Files | None = None) -> Conversion:
        """Convert `text`, which errors call `name`. Raises NotThisFormat, with name:line:column."""
        function: Callable[..., Conversion] = import_module(self.module).convert
        return function(text, name, files) if self.names_files else function(text, name)


FORMATS = {
    found.name: found
    for found in (
        Format(name="paraview", known_by="<pvx> in XML (.pvx)", module="wall.importers.paraview"),
        Format(name="tide", known_by="surfaces and processes in JSON", module="wall.importers.tide"),
        Format(name="displaycluster", known_by="<configuration> in XML", module="wall.importers.displaycluster"),
        Format(name="sgct", known_by="nodes and masteraddress in JSON, <Cluster> in XML", module="wall.importers.sgct"),
        Format(name="sage2", known_by="resolution, layout and displays in JSON5", module="wall.importers.sage2"),
        Format(
            name="mpcdi",
            known_by="an archive with mpcdi.xml (.mpcdi), <MPCDI> in XML",
            module="wall.importers.mpcdi",
            names_files=True,
        ),
        Format(name="equalizer", known_by="server { config { (.eqc)", module="wall.importers.equalizer"),
    )
}
_BLANK = re.compile(r"\s+|//[^\n]*\n|/\*.*?(?:\*/|\Z)", re.DOTALL)
SUFFIXES = {".pvx": "paraview", ".eqc": "equalizer"}  # others are shared by many formats


def detect(text: str, name: str) -> Format:
    """The format of a file. Raises NotThisFormat that says what the file begins with."""
    if not text.strip():
        raise NotThisFormat(f"{name}:1:1: the file is empty; accepted: {known()}")
    suffix = PurePath(name).suffix
    if suffix.lower() in SUFFIXES:
        return FORMATS[SUFFIXES[suffix.lower()]]
    seen = _json(text, name) if _looks_like_json(text) else _markup(text, name) if "<" in text[:4096] else _words(text)
    if seen in FORMATS:
        return FORMATS[seen]
    looked_at = f"{seen}, suffix {suffix}" if suffix else seen
    raise NotThisFormat(f"{name}:1:1: {looked_at}: not a wall that is known here; accepted: {known()}")


def named(name: str) -> Format:
    """The format of that name. Raises ConfigError."""
    if name not in FORMATS:
        raise ConfigError(f"--format {name}: is not known; accepted: {', '.join(FORMATS)}")
    return FORMATS[name]


def known() -> str:
    """The names and descriptions of all formats, for refusals."""
    return "; ".join(f"{found.name}: {found.known_by}" for found in FORMATS.values())


def _looks_like_json(text: str) -> bool:
    """Whether the text begins with { or [ after blanks and comments."""
    at = 0
    while found := _BLANK.match(text, at):  # one by one: comments in a repeated group take exponential time
        at = found.end()
    return text[at : at + 1] in ("{", "[")


def _json(text: str, name: str) -> str:
    """The format of a JSON file by its top-level keys, else a description of it."""
    root = json_source.parse(text, name)
    keys = set(root.fields)
    if keys & {"nodes", "masteraddress"}:
        return "sgct"
    if keys & {"surfaces", "processes"}:
        return "tide"
    if "resolution" in keys or {"layout", "displays"} <= keys:
        return "sage2"
    return f"a JSON {root.kind} with {', '.join(sorted(keys)[:8]) or 'nothing in it'}"[:200]


def _markup(text: str, name: str) -> str:
    """The format of an XML file by its first element, else a description of it."""
    root = xml_source.parse(text, name)
    kind = {"pvx": "paraview", "configuration": "displaycluster", "Cluster": "sgct", "MPCDI": "mpcdi"}.get(root.key)
    return kind or f"XML with <{root.key[:LONGEST_QUOTE]}>"


def _words(text: str) -> str:
    """The format of other text: Equalizer's by its first block, else a description of it."""
    if re.search(r"^\s*#\s*Equalizer|^\s*(?:global|server|config|appNode|node)\s*\n?\s*\{", text, re.MULTILINE):
        return "equalizer"
    first = next(line.strip() for line in text.splitlines() if line.strip())
    return f"text that begins with {first[:40]!r}"
