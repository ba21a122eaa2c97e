"""`wall convert`: a file of another system to YAML, checked, with a report of what could not be carried."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.table import Table

from wall.compositing.checks import note_of_windows
from wall.config import yaml_text
from wall.core.errors import ConfigError
from wall.importers.archive import Files
from wall.importers.dropped_values import checked_layout
from wall.importers.formats import MOST_CHARACTERS, Format, detect, known, named
from wall.importers.report import Conversion, Item

LINES_SHOWN = 8
MOST_BYTES = 4 * MOST_CHARACTERS  # of UTF-8, for each character


def convert_file(path: Path, format_name: str | None = None, folder: str = "") -> tuple[Format, Conversion, str]:
    """Convert a file: its format, the conversion with its report, and YAML text that passes the project's checks.

    `folder`: beside the YAML, for files that belong to it. Raises ConfigError if the file cannot be read, has no known
    format, or describes no wall that is possible here.
    """
    files = Files(path, folder)
    if files.is_archive:
        return convert_text(files.description(), str(path), format_name or "mpcdi", files)
    return convert_text(read(path), str(path), format_name, files)


def convert_text(
    text: str, name: str, format_name: str | None = None, files: Files | None = None
) -> tuple[Format, Conversion, str]:
    """Convert text that errors call `name`; `files`: those that it may name. As `convert_file`."""
    if len(text) > MOST_CHARACTERS:
        raise ConfigError(f"{name}: {len(text)} characters are too many; accepted: at most {MOST_CHARACTERS}")
    chosen = named(format_name) if format_name else detect(text, name)
    conversion = chosen.convert(text, name, files)
    try:
        layout = checked_layout(conversion)
    except ConfigError as error:
        raise ConfigError(f"{name}: what it describes is refused here: {error}") from error
    conversion.ranks = len(layout.regions)
    if note := note_of_windows(layout.graph, layout.wall):
        conversion.assumed.append(f"{note[0].upper()}{note[1:]}.")
    return chosen, conversion, header(conversion, chosen, Path(name).name) + yaml_text.write(conversion.values)


def read(path: Path) -> str:
    """The text of a file in UTF-8, UTF-16 with its mark, or Latin-1. Raises ConfigError."""
    try:
        if (size := path.stat().st_size) > MOST_BYTES:
            raise ConfigError(f"{path}: {size} bytes are too many; accepted: at most {MOST_BYTES}")
        data = None
        if not path.is_dir():
            with path.open("rb") as file:
                data = file.read(MOST_BYTES + 1)  # a pipe has no size before it is read
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if data is None:
        raise ConfigError(f"{path}: this is a folder; accepted: {known()}")
    if len(data) > MOST_BYTES:
        raise ConfigError(f"{path}: more than {MOST_BYTES} bytes are too many; accepted: at most {MOST_BYTES}")
    try:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return data.decode("utf-16")
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # comments in old files; the rest is ASCII
    if "\0" in text:
        raise ConfigError(f"{path}:1:1: this is not text; accepted: {known()}")
    return text


def header(conversion: Conversion, chosen: Format, name: str) -> str:
    """The comment before the YAML: the source, the assumptions, and the number of items not carried."""
    lines = [f"Converted from {_plain(name)} ({chosen.name}) by `wall convert`."]
    lines += [_plain(sentence) for sentence in conversion.assumed]
    if conversion.not_carried:
        lines.append(f"Not carried: {len(conversion.not_carried)} of its values, which `wall convert` lists.")
    return "".join(f"# {line}\n" for line in lines) + "\n"


def table(conversion: Conversion) -> Table | None:
    """A table of the items not carried, with their lines; None if there are none.

    Items inside another such item share its row, and so do items that differ only in their indices.
    """
    if not conversion.not_carried:
        return None
    rows = Table(title="not carried", title_justify="left")
    for name in ("line", "what", "why"):
        rows.add_column(name, justify="left", overflow="fold")
    groups: dict[tuple[str, str], list[Item]] = {}
    for item in _outermost(conversion.not_carried):
        groups.setdefault((_without_indices(item.what), item.why), []).append(item)
    for (_, why), items in groups.items():
        lines = [str(line) for line in sorted({item.line for item in items})]
        more = f" and {len(lines) - LINES_SHOWN} more" if len(lines) > LINES_SHOWN else ""
        what = items[0].what if len(items) == 1 else f"{items[0].what} and {len(items) - 1} like it"
        rows.add_row(", ".join(lines[:LINES_SHOWN]) + more, _plain(what), _plain(why))
    return rows


def _outermost(items: Sequence[Item]) -> list[Item]:
    """The items that are inside no other item with the same reason."""
    named = {(item.what, item.why) for item in items}
    return [item for item in items if not any((head, item.why) in named for head in _around(item.what))]


def _around(what: str) -> Iterator[str]:
    """The names of all that an item is inside of: a, a.b for a.b[2]."""
    name = what.split(" = ")[0]
    return (name[:k] for k, ch in enumerate(name) if ch in ".[")


def check_outputs(source: Path, *outputs: Path | None) -> None:
    """Refuse to write over the file that is read, before anything is. Raises ConfigError."""
    for path in outputs:
        with contextlib.suppress(OSError):
            if path is not None and path.samefile(source):
                raise ConfigError(f"{path}: is the file that is to be converted; wanted: another one to write")


def write_report(path: Path, conversion: Conversion) -> None:
    """Write the report as JSON. Raises ConfigError if it cannot be written."""
    write(path, json.dumps(conversion.as_json(), indent=2, ensure_ascii=False) + "\n")


def write(path: Path, data: str | bytes) -> None:
    """Write a file, text in UTF-8. Raises ConfigError if that cannot be done."""
    try:
        path.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror or error})") from None


def write_conversion(path: Path, yaml: str, conversion: Conversion) -> None:
    """Write a YAML file, and beside it the files that belong to it. Raises ConfigError if that cannot be done."""
    write(path, yaml)
    for name, data in conversion.files.items():
        own = path.parent / name
        with contextlib.suppress(OSError):  # `write` says what is wrong with the folder
            own.parent.mkdir(parents=True, exist_ok=True)
        write(own, data)


def _without_indices(what: str) -> str:
    """An item's name without indices, so that items of one kind can be counted."""
    return "".join(ch for ch in what.split(" = ")[0] if not ch.isdigit())


def _plain(text: str) -> str:
    """The text as one printable line."""
    return "".join(ch if ch.isprintable() else " " for ch in text)
