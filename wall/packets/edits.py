"""Edits of the scene as bytes: the end of an Event. Names are UTF-8 and in order, numbers finite."""

from __future__ import annotations

import math
import struct

from wall.core.data import Edits
from wall.core.errors import LocalProtocolError, RemoteProtocolError

MAX_EDITS_BYTES = 1 << 18  # some thousand values
MAX_NAME_BYTES = 255
MAX_NUMBERS = 16  # of one value: a matrix


def fits(edits: Edits) -> bool:
    """Whether so many values go into one event."""
    return len(edits_body(edits)) <= MAX_EDITS_BYTES


def edits_body(edits: Edits) -> bytes:
    """For each value: name length u8, name, count u8, numbers f64. Raises LocalProtocolError for what does not fit."""
    parts = []
    for name, numbers in edits.values:
        text = name.encode()
        if not 0 < len(text) <= MAX_NAME_BYTES or not 0 < len(numbers) <= MAX_NUMBERS:
            raise LocalProtocolError(
                f"edit {edits.number}: {name!r} with {len(numbers)} numbers; "
                f"names have 1 to {MAX_NAME_BYTES} bytes, values 1 to {MAX_NUMBERS} numbers"
            )
        parts.append(struct.pack(f"<B{len(text)}sB{len(numbers)}d", len(text), text, len(numbers), *numbers))
    return b"".join(parts)


def parse_edits(number: int, body: bytes) -> Edits:
    """The edits of some bytes. Raises RemoteProtocolError for anything else."""
    if len(body) > MAX_EDITS_BYTES:
        raise RemoteProtocolError(f"edit {number}: {len(body)} bytes of values; at most {MAX_EDITS_BYTES}")
    values: list[tuple[str, tuple[float, ...]]] = []
    at = 0
    while at < len(body):
        try:
            (length,) = struct.unpack_from("<B", body, at)
            text, count = struct.unpack_from(f"<{length}sB", body, at + 1)
            numbers = struct.unpack_from(f"<{count}d", body, at + 2 + length)
            name = text.decode()
        except (struct.error, UnicodeDecodeError) as error:
            raise RemoteProtocolError(f"edit {number}: value {len(values)}: {error}") from error
        if not name or not 0 < count <= MAX_NUMBERS or not all(map(math.isfinite, numbers)):
            raise RemoteProtocolError(f"edit {number}: value {name!r} with {count} numbers, or one not finite")
        if values and name <= values[-1][0]:
            raise RemoteProtocolError(f"edit {number}: value {name!r} after {values[-1][0]!r}; wanted names in order")
        values.append((name, numbers))
        at += 2 + length + 8 * count
    return Edits(number, tuple(values))
