"""Check the messages of the live page and where requests come from. Pure: text in; values, or RemoteProtocolError, out.

orbit and pan carry `x` and `y` in heights of the wall (x right, y down, as the pointer moved); zoom carries
the factor `x` by which things should look larger.
"""

from __future__ import annotations

import ipaddress
import json
from typing import Any
from urllib.parse import urlsplit

from wall.core.errors import RemoteProtocolError

MAX_MESSAGE_BYTES = 1024  # the longest honest message has about 80
MAX_MOVE = 10.0  # wall heights in one message: more than any hand can do in a frame
MAX_ZOOM = 64.0
MAX_NAME = 64  # characters of a sampler's name
OVERLAYS = ("", "tiles", "age", "density")
MAX_NUMBER = 2**53  # the largest whole number that a page can count to

FIELDS = {
    "orbit": {"kind", "x", "y"},
    "pan": {"kind", "x", "y"},
    "zoom": {"kind", "x"},
    "pause": {"kind"},
    "reset": {"kind"},
    "sampler": {"kind", "value"},
    "compare": {"kind", "value"},
    "overlay": {"kind", "value"},
    "shown": {"kind", "number"},
}


def parse_message(text: str) -> dict[str, Any]:
    """One message of a page: a steering command, what it lays over its picture (`overlay`, one of OVERLAYS), or
    `shown` with the number of the picture it has drawn.

    Returns a dict with exactly the fields of its kind, checked. Raises RemoteProtocolError for anything else.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        raise RemoteProtocolError(f"page message: {len(text)} characters, at most {MAX_MESSAGE_BYTES}")
    try:
        message = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise RemoteProtocolError(f"page message is no JSON: {text[:60]!r}") from error
    kind = message.get("kind") if isinstance(message, dict) else None
    if not isinstance(kind, str) or kind not in FIELDS:
        known = ", ".join(FIELDS)
        raise RemoteProtocolError(f"page message of kind {str(kind)[:60]!r}: wanted one of {known}")
    if set(message) != FIELDS[kind]:
        raise RemoteProtocolError(f"page message {kind}: wanted the fields {sorted(FIELDS[kind])}")
    _check_values(kind, message)
    return dict(message)


def _check_values(kind: str, message: dict[str, Any]) -> None:
    if kind in ("orbit", "pan"):
        _check_number(message["x"], -MAX_MOVE, MAX_MOVE)
        _check_number(message["y"], -MAX_MOVE, MAX_MOVE)
    elif kind == "zoom":
        _check_number(message["x"], 1 / MAX_ZOOM, MAX_ZOOM)
    elif kind == "shown":
        _check_number(message["number"], 0, MAX_NUMBER)
        if not isinstance(message["number"], int):
            raise RemoteProtocolError(f"page message shown: {message['number']}, wanted a whole number")
    elif kind in ("sampler", "compare"):
        value, least = message["value"], int(kind == "sampler")
        if not isinstance(value, str) or not least <= len(value) <= MAX_NAME:
            raise RemoteProtocolError(f"page message {kind}: wanted a name of {least} to {MAX_NAME} characters")
    elif kind == "overlay" and message["value"] not in OVERLAYS:
        raise RemoteProtocolError(f"page message overlay: wanted one of {', '.join(OVERLAYS[1:])}, or nothing")


def _check_number(value: object, low: float, high: float) -> None:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not low <= value <= high:  # type: ignore[operator]  # `number` says that it is one
        raise RemoteProtocolError(f"page message: {str(value)[:20]}, wanted a number of {low:g} to {high:g}")


def _no_number(text: str) -> float:
    raise ValueError(text)


def is_loopback(host: str) -> bool:
    """Whether nobody but this machine can reach what is bound to `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def host_is_ours(header: str, bound: str, names: frozenset[str]) -> bool:
    """Whether a request's Host header names us: a page that rebinds its own name to our address does not.

    Bound to loopback only loopback names pass, on any port (it may have been forwarded); elsewhere also
    `bound`, any IP address (rebinding needs a name) and our `names`.
    """
    try:
        name = (urlsplit(f"//{header}").hostname or "").rstrip(".")
    except ValueError:
        return False
    if is_loopback(name):
        return True
    if is_loopback(bound):
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in names or name == bound.lower()
    return True


def origin_is_ours(origin: str | None, header: str) -> bool:
    """Whether a websocket is asked for by a page that we served, or by a script (which sends no Origin)."""
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == header.lower()
