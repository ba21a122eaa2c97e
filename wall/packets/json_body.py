"""JSON bodies of messages: dataclasses whose fields have checked types."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from typing import Any

from wall.core.errors import RemoteProtocolError

MAX_NUMBER = 1e15  # of a float in JSON: no rate, no time and no error is as large, nor are sums of a thousand ranks'
MAX_COUNTERS = 64
MAX_ANSWERS = 256  # of a Heartbeat
MAX_COMMANDS = 64  # of a WindowInput; more go in several
_LONE_SURROGATE = re.compile("[\ud800-\udfff]")


def json_body(message: object) -> bytes:
    """The JSON of a message, and of those that it holds. Raises ValueError where a number is not finite."""
    return json.dumps(message, default=_values_of, allow_nan=False).encode()


def checked(cls: Any, values: Any) -> Any:
    """An object of a dataclass from a dictionary that has exactly its fields, of their types.

    Raises RemoteProtocolError for anything else.
    """
    known = _types_of(cls)
    if not isinstance(values, dict) or values.keys() != known.keys():
        raise RemoteProtocolError(f"a {cls.__name__} with other fields than {', '.join(known)}")
    for name, wanted in known.items():
        if not _FITS[wanted](values[name]):
            raise RemoteProtocolError(f"a {cls.__name__} whose {name} is {str(values[name])[:40]!r}; wanted {wanted}")
    return cls(**values)


def _values_of(message: Any) -> dict[str, Any]:
    """The fields of a message by name, not copied."""
    return {name: getattr(message, name) for name in _types_of(message.__class__)}


@cache
def _types_of(cls: Any) -> dict[str, str]:
    """The type of each field, by its name."""
    return {field.name: str(field.type) for field in fields(cls)}


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and -1 <= value < 2**63


def _is_float(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_NUMBER


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and _LONE_SURROGATE.search(value) is None


def _is_list_of(fits: Callable[[Any], bool], most: int | None = None) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and (most is None or len(value) <= most) and all(map(fits, value))


def _are_counters(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and len(value) <= MAX_COUNTERS
        and all(_is_text(name) and _is_int(count) for name, count in value.items())
    )


_FITS: dict[str, Callable[[Any], bool]] = {
    "bool": lambda value: isinstance(value, bool),
    "int": _is_int,
    "float": _is_float,
    "str": _is_text,
    "dict[str, int]": _are_counters,
    "list[Any]": _is_list_of(lambda value: True, MAX_COMMANDS),
    "list[dict[str, Any]]": _is_list_of(lambda value: isinstance(value, dict)),
    "list[float]": _is_list_of(_is_float, MAX_ANSWERS),
    "list[int]": _is_list_of(_is_int),
    "list[str]": _is_list_of(_is_text),
    "tuple[Hello, ...]": lambda value: isinstance(value, tuple),
}
