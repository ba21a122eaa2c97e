"""Messages of viewers that bring an `id`, each of which is answered to its sender alone.

They leave here with numbers of our own in place of the ids, which viewers choose as they like.
"""

from __future__ import annotations

import itertools
import json
import secrets
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from wall.core.errors import EditError
from wall.display.base import Answer, Choices
from wall.display.steering import MAX_REQUEST_BYTES

V = TypeVar("V")  # a viewer
CHOOSE = "choose"
LOAD = "load"  # the kind that may be longer than MAX_REQUEST_BYTES
WATCHES = "this address lets watch, not change anything"
NAME_FILES = (LOAD, "edit")  # kinds whose configuration may name any file that the wall's machines can read
NO_LOAD = "this wall takes no configuration over its page; wanted: output.browser.load: true, or its folder of results"


class Requests(Generic[V]):
    """Requests that wait for their answers. Belongs to the server's thread."""

    def __init__(self, *, loads: bool) -> None:
        """`loads`: whether configurations are taken."""
        # answers to a page that served before are not taken for those to this one
        self._numbers, self._loads = itertools.count(1 + secrets.randbits(48)), loads
        self.choices: Choices | None = None
        self._open: dict[int, tuple[V, dict[str, Any]]] = {}

    def take(self, viewer: V, message: dict[str, Any]) -> tuple[int, dict[str, Any]]:
        """Its number, and the message with that as its id."""
        number = next(self._numbers)
        self._open[number] = viewer, {"kind": message["kind"], "id": message["id"]}
        return number, {**message, "id": number}

    def why_not(self, message: Mapping[str, Any], size: int, *, steers: bool) -> str:
        """Why a request of `size` characters is refused here, "" if it is not; `steers`: may its viewer."""
        if not steers:
            return WATCHES
        if message["kind"] in NAME_FILES and not self._loads:
            return NO_LOAD
        if message["kind"] == LOAD:
            return ""
        return "" if size <= MAX_REQUEST_BYTES else f"{size} characters at once: want at most {MAX_REQUEST_BYTES}"

    def chosen(self, message: dict[str, Any]) -> tuple[dict[str, Any], str]:
        """A request as the run takes it: with the text of what is chosen by its name; and why that cannot be, or ""."""
        if message["kind"] != CHOOSE:
            return message, ""
        name = message.get("name")
        if self.choices is None or not isinstance(name, str) or message.keys() != {"kind", "id", "name"}:
            return message, "choose: want a `name`, where this wall offers any"
        try:
            text, path = self.choices.load(name)
        except EditError as error:
            return message, str(error)
        return {"kind": LOAD, "id": message["id"], "text": text, "path": path}, ""

    def answered(self, number: int, answer: Answer) -> tuple[V, str] | None:
        """Whom to tell, and what; None for a number that nobody waits for."""
        if number not in self._open:
            return None
        viewer, asked = self._open.pop(number)
        said: dict[str, Any] = {"kind": "answer", "id": asked["id"]}
        if answer.refused:
            return viewer, json.dumps(said | {"refused": answer.refused})
        said["edit"] = answer.edit
        if asked["kind"] == "list":
            said |= {"parameters": list(answer.parameters), "left_out": answer.left_out}
        try:
            return viewer, json.dumps(said, allow_nan=False)
        except ValueError as error:
            refused = f"edit {answer.edit} holds, but the answer cannot be sent: {error}"
            return viewer, json.dumps({"kind": "answer", "id": asked["id"], "refused": refused})
