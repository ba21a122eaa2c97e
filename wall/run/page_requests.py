"""Requests over the page's WebSocket as the manager takes them: JSON messages with an `id`, and EditRequests.

docs/guide/websocket.md describes the messages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from wall.core.errors import EditError, LocalProtocolError, RemoteProtocolError
from wall.packets.control import ALL_BUT_OBJECTS, EditRequest, serialise
from wall.packets.json_body import MAX_COMMANDS, checked
from wall.transport.base import PAGE


def request_of(message: Mapping[str, Any], key: str) -> EditRequest:
    """The request of a message whose `id` is a number of the page's own; `key`: the run's.

    Raises EditError for what is none.
    """
    fields = {name: value for name, value in message.items() if name not in ("kind", "id")}
    kind = message["kind"]
    asked: dict[str, Any]
    if kind == "set" and "values" in fields:
        asked = {"assignments": _pairs(fields)}
    elif kind == "set" and fields.keys() == {"name", "numbers"}:
        asked = {"assignments": [[fields["name"], fields["numbers"]]]}
    elif kind in _FIELDS:
        asked = _FIELDS[kind](fields)
    else:
        asked = {"commands": [{"kind": kind, **fields}]}
    base = {"assignments": [], "listed": [], "undo": 0, "configuration": "", "path": "", "commands": [], "changes": []}
    try:
        request = checked(EditRequest, {"client": PAGE, "number": message["id"], "key": key, **base, **asked})
        serialise(request)  # what does not fit in a message is refused here
    except (LocalProtocolError, RemoteProtocolError) as error:
        raise EditError(f"{kind}: {error}") from error
    assert isinstance(request, EditRequest)
    return request


def message_of(request: EditRequest) -> dict[str, Any]:
    """The message of a request, without `id`. Raises EditError for one of several kinds."""
    asked: list[dict[str, Any]] = []
    if request.listed:
        asked.append({"kind": "list", "names": request.listed})
    if request.undo:
        asked.append({"kind": "undo", "steps": request.undo})
    if request.configuration:
        asked.append({"kind": "load", "text": request.configuration, "path": request.path})
    if request.changes:
        asked.append({"kind": "edit", "changes": request.changes})
    asked += request.commands
    if request.assignments or not asked:
        asked.append({"kind": "set", "values": dict(request.assignments)})
    if len(asked) != 1:
        raise EditError(f"{len(asked)} requests at once; over an address: one after the other")
    return asked[0]


def _pairs(fields: Mapping[str, Any]) -> list[list[Any]]:
    values = _only(fields, "set", "values")["values"]
    if not isinstance(values, dict) or len(values) > MAX_COMMANDS:
        raise EditError(f"set: values: want up to {MAX_COMMANDS} names with a number, a list of numbers or null each")
    return [[name, value] for name, value in values.items()]


def _listed(fields: Mapping[str, Any]) -> dict[str, Any]:
    names = _only(fields, "list", "names").get("names", [ALL_BUT_OBJECTS])
    if not isinstance(names, list) or not 0 < len(names) <= MAX_COMMANDS or not all(isinstance(n, str) for n in names):
        raise EditError(f"list: names: want a list of 1 to {MAX_COMMANDS} patterns, or nothing for all but objects")
    return {"listed": names}


def _undone(fields: Mapping[str, Any]) -> dict[str, Any]:
    steps = _only(fields, "undo", "steps").get("steps", 1)
    if type(steps) is not int or steps < 1:
        raise EditError(f"undo: steps = {str(steps)[:40]}: want a whole number from 1")
    return {"undo": steps}


def _loaded(fields: Mapping[str, Any]) -> dict[str, Any]:
    text, path = _only(fields, "load", "text", "path").get("text"), fields.get("path", "")
    if not isinstance(text, str) or not text or not isinstance(path, str):
        raise EditError("load: want the text of a configuration, and as `path` where it is from, or nothing")
    return {"configuration": text, "path": path}


def _changed(fields: Mapping[str, Any]) -> dict[str, Any]:
    changes = _only(fields, "edit", "changes").get("changes")
    if not isinstance(changes, list) or not 0 < len(changes) <= MAX_COMMANDS:
        raise EditError(f"edit: changes: want a list of 1 to {MAX_COMMANDS} texts, as `views-=map`")
    return {"changes": changes}


def _only(fields: Mapping[str, Any], kind: str, *names: str) -> Mapping[str, Any]:
    if others := fields.keys() - set(names):
        raise EditError(f"{kind} came with {', '.join(sorted(others))[:60]}: want {', '.join(names)}")
    return fields


_FIELDS: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    "list": _listed, "undo": _undone, "load": _loaded, "edit": _changed,
}  # fmt: skip
