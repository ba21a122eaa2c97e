"""`wall set`: change parameters of a running wall, or list them."""

from __future__ import annotations

import math
import re
import secrets
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wall.core.colour import srgb_decoded
from wall.core.errors import EditError, LocalProtocolError, RemoteProtocolError, RunError
from wall.packets.control import MAX_COMMANDS, EditAnswer, EditRequest, parse_control, serialise
from wall.run import control_file
from wall.run.ports import FIRST_CLIENT
from wall.transport.factory import connect

ANSWER_S = 5.0  # wait for a wall's answer, at most
COLOUR = re.compile("#[0-9a-fA-F]{6}")
ASK_AGAIN_S = 1.0  # a request that found no wall yet, or whose answer was lost, says the same again


def set_parameters(folder: Path, assignments: Sequence[str], *, listed: bool) -> EditAnswer:
    """Ask the wall that writes its results to `folder`, within ANSWER_S seconds.

    assignments : "NAME=VALUE" each, where `listed` also patterns of the names to be listed; without one, all are.
        Raises EditError where it is refused, RunError where no wall answers.
    """
    patterns = [text for text in assignments if listed and "=" not in text]
    pairs = [list(parse_assignment(text)) for text in assignments if text not in patterns]
    if max(len(pairs), len(patterns)) > MAX_COMMANDS:
        raise EditError(f"{max(len(pairs), len(patterns))} parameters at once; at most {MAX_COMMANDS}")
    names = (patterns or ["*"]) if listed else []
    control = control_file.read(folder)
    client = FIRST_CLIENT + secrets.randbelow(FIRST_CLIENT)
    try:
        request = serialise(EditRequest(client=client, key=control.key, assignments=pairs, listed=names))
    except LocalProtocolError as error:
        raise EditError(f"the request is too long: {error}") from error
    answer = _asked(control, request, client)
    if answer.refused:
        raise EditError(answer.refused)
    if listed and not answer.parameters and not answer.left_out:
        raise EditError(f"no parameter is named like {', '.join(names)}; wall set --list names them all")
    return answer


def _asked(control: control_file.Control, request: bytes, client: int) -> EditAnswer:
    link = connect(control.endpoint, rank=client)
    limit, again = time.monotonic() + ANSWER_S, -math.inf
    try:
        while (now := time.monotonic()) < limit:
            if now >= again:  # edits are absolute: one that comes twice changes nothing
                link.send(request)
                again = now + ASK_AGAIN_S
            link.wait(min(limit, again) - now)
            for data in link.receive():
                answer = _parsed(data)
                if isinstance(answer, EditAnswer) and answer.client == client:
                    return answer
    finally:
        link.close()
    raise RunError(
        f"no answer from {control.endpoint} within {ANSWER_S:g} s: the wall of process {control.pid} on {control.host} "
        "has ended or does not respond"
    )


def _parsed(data: bytes) -> Any:
    try:
        return parse_control(data)
    except RemoteProtocolError as error:
        raise RunError(f"the wall speaks another version: {error}") from error


def parse_assignment(text: str) -> tuple[str, object]:
    """Name and value of NAME=VALUE: numbers with commas, #rrggbb, or `default`. Raises EditError."""
    name, equals, value = text.rpartition("=")
    if not equals or not name.strip():
        raise EditError(f"{text[:80]!r}: want NAME=VALUE, as in lights.0.intensity=8,7,5")
    return name.strip(), parse_value(value.strip())


def parse_value(text: str) -> object:
    """None for `default`, else a number, or a list of numbers. Raises EditError."""
    if text == "default":
        return None
    if COLOUR.fullmatch(text):
        codes = np.array(list(bytes.fromhex(text[1:])))
        return [float(x) for x in srgb_decoded(codes / 255.0)]
    try:
        numbers = [float(part) for part in text.strip("[]()").split(",")]
    except ValueError:
        raise EditError(f"value {text[:60]!r}: want numbers with commas between, #rrggbb or default") from None
    if not all(map(math.isfinite, numbers)):
        raise EditError(f"value {text[:60]!r}: want finite numbers")
    return numbers if len(numbers) > 1 else numbers[0]


def lines_of(parameters: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line for each parameter: name, value, unit, what is accepted, and what is configured where that differs."""
    width = max((len(p["name"]) for p in parameters), default=0)
    for p in parameters:
        value, default = numbers_of(p["value"]), numbers_of(p["default"])
        kind = (
            p["kind"] if p["kind"] in ("direction", "position") else f"{p['kind']} from {p['low']:g} to {p['high']:g}"
        )
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


def numbers_of(value: Sequence[float]) -> str:
    """A value as `wall set` takes it."""
    return ",".join(f"{x:.6g}" for x in value)
