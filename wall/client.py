"""Talk to a running wall from Python: read its parameters, change them, undo.

>>> import wall.client
>>> with wall.client.connect("OUT") as run:  # the folder of results of `wall run`
...     run.set({"lights.0.intensity": (8, 7, 5), "exposure": 1})
...     run.parameters("lights.*")["lights.0.intensity"].value
...     run.undo()
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from wall.core.errors import EditError, LocalProtocolError, RemoteProtocolError, RunError
from wall.display.base import ParameterState
from wall.packets.control import ALL_BUT_OBJECTS, MAX_COMMANDS, EditAnswer, EditRequest, parse_control, serialise
from wall.run import control_file
from wall.run.ports import FIRST_CLIENT
from wall.transport.factory import connect as open_link

ANSWER_S = 5.0  # wait for a wall's answer, at most
ASK_AGAIN_S = 1.0  # a request that found no wall yet, or whose answer was lost, is sent again: it is done once


class Client:
    """A way to one run. Every call waits for the wall's answer, at most `patience_s` seconds.

    Raises RunError where no wall answers, EditError where it refuses; then nothing was changed.
    """

    def __init__(self, control: control_file.Control, *, patience_s: float = ANSWER_S) -> None:
        self._control, self._patience_s = control, patience_s
        self._client, self._number = FIRST_CLIENT + secrets.randbelow(FIRST_CLIENT), 0
        self._link = open_link(control.endpoint, rank=self._client)

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection. What was set stays."""
        self._link.close()

    def parameters(self, *patterns: str) -> dict[str, ParameterState]:
        """Parameters by name: those named like a pattern with * and ?; without one, all but those of objects.

        docs/guide/parameters.md explains each.
        """
        answer = self.request(listed=patterns or (ALL_BUT_OBJECTS,))
        if answer.left_out:
            raise EditError(f"{answer.left_out} parameters too many for one answer; name fewer, as in 'lights.*'")
        return {row["name"]: ParameterState(**(row | _numbers_of(row))) for row in answer.parameters}

    def set(self, values: Mapping[str, object]) -> int:
        """Set parameters, all or none: numbers or sequences of numbers, None for what is configured.

        Returns the number of the edit. The next refresh shows it.
        """
        pairs = [[name, list(value) if isinstance(value, tuple) else value] for name, value in values.items()]
        return self.request(assignments=pairs).edit

    def undo(self, steps: int = 1) -> int:
        """Take back the newest edits, whoever made them. Returns the number of the edit that does so.

        What follows at once on the same parameters, as of a slider that is drawn, is one step.
        """
        return self.request(undo=steps).edit

    def request(self, *, assignments: Sequence[Any] = (), listed: Sequence[str] = (), undo: int = 0) -> EditAnswer:
        """Ask the wall for something, as EditRequest has it."""
        if max(len(assignments), len(listed)) > MAX_COMMANDS:
            raise EditError(f"{max(len(assignments), len(listed))} parameters at once; at most {MAX_COMMANDS}")
        self._number += 1
        try:
            request = serialise(
                EditRequest(
                    client=self._client, number=self._number, key=self._control.key, assignments=list(assignments),
                    listed=list(listed), undo=undo,
                )
            )  # fmt: skip
        except LocalProtocolError as error:
            raise EditError(f"the request is too long: {error}") from error
        answer = self._answer(request)
        if answer.refused:
            raise EditError(answer.refused)
        return answer

    def _answer(self, request: bytes) -> EditAnswer:
        limit, again = time.monotonic() + self._patience_s, -math.inf
        while (now := time.monotonic()) < limit:
            if now >= again:
                self._link.send(request)
                again = now + ASK_AGAIN_S
            self._link.wait(min(limit, again) - now)
            for data in self._link.receive():
                answer = _parsed(data)
                if isinstance(answer, EditAnswer) and (answer.client, answer.number) == (self._client, self._number):
                    return answer
        control = self._control
        raise RunError(
            f"no answer from {control.endpoint} within {self._patience_s:g} s: the wall of process {control.pid} on "
            f"{control.host} has ended or does not respond"
        )


def connect(folder: str | Path = "OUT", *, patience_s: float = ANSWER_S) -> Client:
    """A client of the wall that writes its results to `folder`. Raises RunError where none does."""
    return Client(control_file.read(Path(folder)), patience_s=patience_s)


def _parsed(data: bytes) -> Any:
    try:
        return parse_control(data)
    except RemoteProtocolError as error:
        raise RunError(f"the wall speaks another version: {error}") from error


def _numbers_of(row: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """What JSON has as lists."""
    return {name: tuple(row[name]) for name in ("default", "value")}
