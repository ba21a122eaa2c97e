"""`wall set`: change parameters of a running wall, or list them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from wall.client import connect
from wall.core.errors import EditError
from wall.packets.control import ALL_BUT_OBJECTS, EditAnswer

WORD = re.compile("#?[A-Za-z0-9][A-Za-z0-9_]*")


def set_parameters(folder: Path, assignments: Sequence[str], *, listed: bool, undo: int = 0) -> EditAnswer:
    """Ask the wall that writes its results to `folder`.

    assignments : "NAME=VALUE" each, where `listed` also patterns of the names to be listed; without one, all are.
        Raises EditError where it is refused, RunError where no wall answers.
    """
    patterns = [text for text in assignments if listed and "=" not in text]
    pairs = [list(parse_assignment(text)) for text in assignments if text not in patterns]
    given = [name for name, _ in pairs]
    if twice := next((name for name in given if given.count(name) > 1), ""):
        raise EditError(f"{twice}: given twice; wanted: one value for each parameter")
    names = (patterns or [ALL_BUT_OBJECTS]) if listed else []
    with connect(folder) as run:
        answer = run.request(assignments=pairs, listed=names, undo=undo)
    if listed and not answer.parameters and not answer.left_out:
        raise EditError(f"no parameter is named like {', '.join(names)}; wall set --list names them all")
    return answer


def parse_assignment(text: str) -> tuple[str, object]:
    """Name and value of NAME=VALUE: numbers with commas, a name, #rrggbb, or `default`. Raises EditError."""
    name, equals, value = text.rpartition("=")
    if not equals or not name.strip():
        raise EditError(f"{text[:80]!r}: want NAME=VALUE, as in lights.0.intensity=8,7,5")
    return name.strip(), parse_value(value.strip())


def parse_value(text: str) -> object:
    """None for `default`, else a number, a list of numbers, or a word: the wall knows which. Raises EditError."""
    if text == "default":
        return None
    try:
        numbers = [float(part) for part in text.strip("[]()").split(",")]
    except ValueError:
        if WORD.fullmatch(text):
            return text
        wanted = "numbers with commas between, #rrggbb, default, or a name"
        raise EditError(f"value {text[:60]!r}: want {wanted}") from None
    if not all(map(math.isfinite, numbers)):
        raise EditError(f"value {text[:60]!r}: want finite numbers")
    return numbers if len(numbers) > 1 else numbers[0]


def lines_of(parameters: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line for each parameter: name, value, unit, what is accepted, and what is configured where that differs."""
    width = max((len(p["name"]) for p in parameters), default=0)
    for p in parameters:
        value, default = (text_of(p[what], p["choices"]) for what in ("value", "default"))
        kind = (
            p["kind"] if p["kind"] in ("direction", "position") else f"{p['kind']} from {p['low']:g} to {p['high']:g}"
        )
        if p["choices"]:
            kind = f"one of {', '.join(p['choices'])}"
        configured = "" if value == default else f"; configured: {default}"
        yield f"{p['name']:{width}}  {value:24} {p['unit']:11} {kind}{configured}"


def note_of(answer: EditAnswer) -> str:
    """What a list leaves out, in words; "" for nothing."""
    if not answer.left_out:
        return ""
    return (
        f"{answer.left_out} more parameters have no room in one answer and are not listed; "
        "name those that you want, with * and ?, as in wall set --list 'lights.*'"
    )


def text_of(value: Sequence[float], choices: Sequence[str] = ()) -> str:
    """A value as `wall set` takes it; `choices`: the names of its numbers, if they have names."""
    return choices[int(value[0])] if choices else ",".join(f"{x:.6g}" for x in value)
