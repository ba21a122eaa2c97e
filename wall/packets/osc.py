"""Positions in packets of Open Sound Control 1.0: one message, or a bundle of messages. Bytes in, numbers out, no I/O.

Strings and numbers are read by python-osc. Its own reader of packets logs what it cannot read and goes as deep into
nested bundles as a stranger likes, so messages are taken apart here, and bundles in bundles are refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.parsing import osc_types

from wall.core.errors import RemoteProtocolError

MAX_BYTES = 1472  # of a packet: what Ethernet carries in one piece
MAX_ARGUMENTS = 64
BUNDLE = b"#bundle\0"
BUNDLE_HEAD = len(BUNDLE) + 8  # and its time, which is not used: clocks differ
NUMBERS = {"f": osc_types.get_float, "d": osc_types.get_double, "i": osc_types.get_int, "h": osc_types.get_int64}
WITHOUT_BYTES = "TFNI"  # true, false, nothing, impulse

Position = tuple[float, float, float]


def positions(data: bytes, address: str, first: int) -> list[Position]:
    """The positions that a packet tells at an OSC address, in its order; none where all is for other addresses.

    `first`: arguments before x, y and z, which are numbers of any kind. Raises RemoteProtocolError for what is not a
    whole packet, and for a message at the address without three finite numbers there.
    """
    if len(data) > MAX_BYTES:
        raise RemoteProtocolError(f"an OSC packet of {len(data)} bytes; at most {MAX_BYTES}")
    try:
        return [_position(message, first) for message in _messages(data) if _address(message) == address]
    except (osc_types.ParseError, UnicodeDecodeError) as error:
        raise RemoteProtocolError(f"not an OSC packet: {error}") from error


def message_of(address: str, numbers: Position, before: int = 0) -> bytes:
    """A packet that `positions` reads: `before` zeros, then three numbers as float32."""
    builder = OscMessageBuilder(address)
    for number in (*[0.0] * before, *numbers):
        builder.add_arg(float(number), "f")
    packet: bytes = builder.build().dgram
    return packet


def _messages(data: bytes) -> Iterator[bytes]:
    if not data.startswith(BUNDLE):
        yield data
        return
    at = BUNDLE_HEAD
    while at < len(data):
        size, at = osc_types.get_int(data, at)
        if not 0 < size <= len(data) - at or data[at : at + len(BUNDLE)] == BUNDLE:
            raise RemoteProtocolError(f"an OSC bundle with an element of {size} bytes, or a bundle, at byte {at}")
        yield data[at : at + size]
        at += size


def _address(message: bytes) -> str:
    address, _ = osc_types.get_string(message, 0)
    return str(address)


def _position(message: bytes, first: int) -> Position:
    address, at = osc_types.get_string(message, 0)
    tags, at = osc_types.get_string(message, at)
    if len(message) % 4:
        raise RemoteProtocolError(f"OSC message {address} of {len(message)} bytes; want a multiple of 4")
    if not tags.startswith(",") or len(tags) > 1 + MAX_ARGUMENTS:
        raise RemoteProtocolError(f"OSC message {address} with arguments {tags[:40]!r}; at most {MAX_ARGUMENTS}")
    found = []
    for tag in tags[1 : first + 4]:
        value, at = _argument(message, tag, at)
        found.append(value)
    numbers = found[first:]
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise RemoteProtocolError(f"OSC message {address} tells {numbers} from argument {first} on; want x, y, z")
    x, y, z = numbers
    return x, y, z


def _argument(message: bytes, tag: str, at: int) -> tuple[float, int]:
    """An argument and where the next begins; NaN for what is no number."""
    if tag in NUMBERS and at < len(message):  # else python-osc reads zeros
        number, at = NUMBERS[tag](message, at)
        return float(number), at
    if tag in "sS":
        _, at = osc_types.get_string(message, at)
    elif tag not in WITHOUT_BYTES:
        raise RemoteProtocolError(f"OSC argument of type {tag!r} at byte {at} of {len(message)}; want a number or text")
    return math.nan, at
