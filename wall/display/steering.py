"""Check the live page's messages and where requests come from. Pure: text in; values, or RemoteProtocolError, out."""

from __future__ import annotations

import ipaddress
import json
from typing import Any
from urllib.parse import urlsplit

from wall.core.errors import RemoteProtocolError
from wall.core.network import is_loopback
from wall.geometry.steering import parse

MAX_MESSAGE_BYTES = 1024  # the longest honest message of a page has about 80
MAX_REQUEST_BYTES = 16384  # of a message with an `id`: 64 parameters with long names
MAX_LOAD_BYTES = 1 << 19  # of one with the text of a configuration
MAX_ID = 64  # characters of an `id`
OVERLAYS = ("", "tiles", "age", "density")
DISPLAYS = ("images", "samples", "nothing")  # what a viewer is sent
MAX_NUMBER = 2**53  # the largest whole number that a page can count to
NOT_FROM_PAGES = ("statistics",)  # commands that a compositor sends, for the overlays of its pages


def parse_message(text: str) -> dict[str, Any]:
    """Checks one message of a page and returns it as a dict with exactly the fields of its kind.

    A message is a steering command (see geometry.steering.parse), what the page lays over its image (`overlay`, one
    of OVERLAYS), what it wants to be sent (`display`, one of DISPLAYS), or `shown` with the number of the image it has
    drawn. One with an `id` is a request, of which only the id and that there is a kind are looked at: who answers it
    says what is wrong with the rest. Raises RemoteProtocolError for anything else.
    """
    if len(text) > MAX_LOAD_BYTES:
        raise RemoteProtocolError(f"page message: {len(text)} characters, at most {MAX_LOAD_BYTES}")
    try:
        message = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise RemoteProtocolError(f"page message is no JSON: {text[:60]!r}") from error
    kind = message.get("kind") if isinstance(message, dict) else None
    if isinstance(message, dict) and "id" in message:
        return _request(message)
    if len(text) > MAX_MESSAGE_BYTES:
        raise RemoteProtocolError(f"page message: {len(text)} characters, at most {MAX_MESSAGE_BYTES}")
    if kind == "overlay":
        valid = set(message) == {"kind", "value"} and message["value"] in OVERLAYS
        wanted = f"a value of {', '.join(OVERLAYS[1:])}, or nothing"
    elif kind == "display":
        valid = set(message) == {"kind", "value"} and message["value"] in DISPLAYS
        wanted = f"a value of {', '.join(DISPLAYS)}"
    elif kind == "shown":
        number = message.get("number")
        valid = set(message) == {"kind", "number"} and type(number) is int and 0 <= number <= MAX_NUMBER
        wanted = "the number of an image"
    else:
        valid, wanted = kind not in NOT_FROM_PAGES, "a command of a page"
    if not valid:
        raise RemoteProtocolError(f"page message {text[:60]!r}: want {wanted}")
    if kind not in ("overlay", "display", "shown"):
        try:
            parse(message)
        except RemoteProtocolError as error:
            raise RemoteProtocolError(f"page message: {error}") from error
    return dict(message)


def _request(message: dict[str, Any]) -> dict[str, Any]:
    own, kind = message["id"], message.get("kind")
    number = type(own) is int and 0 <= own <= MAX_NUMBER
    if not number and not (isinstance(own, str) and 0 < len(own) <= MAX_ID):
        raise RemoteProtocolError(f"page message: id = {str(own)[:40]!r}: want a whole number, or some characters")
    if not isinstance(kind, str):
        raise RemoteProtocolError(f"page message: kind = {str(kind)[:40]!r}: want a word")
    return message


def _no_number(text: str) -> float:
    raise ValueError(text)


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
