"""Files of rows: one line of JSON a row, appended as it is measured."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any, Protocol, TypeVar

from wall.core.errors import ConfigError

T = TypeVar("T")


class Identified(Protocol):
    """A row that may be measured again."""

    @property
    def identity(self) -> tuple[object, ...]:
        """Equal for two rows that measured the same."""


R = TypeVar("R", bound=Identified)


def newest(rows: Iterable[R]) -> list[R]:
    """One row of each identity: of several, the last."""
    return list({row.identity: row for row in rows}.values())


def line_of(row: Any) -> str:
    """A dataclass as one line of JSON, keys in the order of its fields."""
    return json.dumps({name: _plain(value) for name, value in asdict(row).items()}, allow_nan=False)


def append(path: Path, row: Any) -> None:
    """One write of one line, after whatever another run left."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(line_of(row) + "\n")


def read(path: Path, kind: type[T]) -> list[T]:
    """The rows of a file, none if it is absent. A line that a killed run left unfinished at the end is cut off.

    Raises ConfigError for any other line that is not a row.
    """
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return [_row(line, kind, f"{path}:{number}") for number, line in enumerate(whole.splitlines(), start=1)]


def _row(line: str, kind: Any, where: str) -> Any:
    try:
        values = json.loads(line)
        wanted = [f.name for f in fields(kind) if f.name in values or f.default_factory is MISSING]
        return kind(**{name: values[name] for name in wanted})
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{where}: not a row of this experiment ({error}); move the file, or take another --out"
        ) from None


def _plain(value: Any) -> Any:
    """Floats to eight digits; NaN, which JSON does not know, to null."""
    if isinstance(value, float):
        return float(f"{value:.8g}") if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    return value
