"""Talk to a running wall from Python: read its parameters, change them, undo, steer, load another configuration.

>>> import wall.client
>>> with wall.client.connect("OUT") as run:  # the folder of results of `wall run`, or the address of its page
...     run.set({"lights.0.intensity": (8, 7, 5), "exposure": 1})
...     run.parameters("lights.*")["lights.0.intensity"].value
...     run.undo()
...     run.orbit(0.25, view="map")
...     run.load("another.yaml")
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from wall.core.errors import EditError, LocalProtocolError, RemoteProtocolError, RunError
from wall.display.base import ParameterState
from wall.packets.control import ALL_BUT_OBJECTS, EditAnswer, EditRequest, parse_control, serialise
from wall.packets.joining import JoinAnswer, JoinRequest
from wall.packets.json_body import MAX_COMMANDS
from wall.run import control_file
from wall.run.page_requests import message_of
from wall.transport.base import FIRST_CLIENT
from wall.transport.curve import Keys
from wall.transport.factory import connect as open_link

if TYPE_CHECKING:
    from wall.display.page_client import PageClient

A = TypeVar("A", EditAnswer, JoinAnswer)
ANSWER_S = 5.0  # wait for a wall's answer, at most
LOAD_S = 600.0  # for a configuration: ranks load a model, and compile for it
ASK_AGAIN_S = 1.0  # a request that found no wall yet, or whose answer was lost, is sent again: it is done once


class Client:
    """A way to one run. Every call waits for the wall's answer, at most `patience_s` seconds.

    Raises RunError where no wall answers, EditError where it refuses; then nothing was changed.
    """

    def __init__(self, wall: control_file.Control | PageClient, *, patience_s: float = ANSWER_S) -> None:
        """`wall`: how to reach it, or a connection to its page, which is closed with this."""
        self._way = _ByControl(wall) if isinstance(wall, control_file.Control) else _ByPage(wall)
        self._patience_s, self._closed = patience_s, False

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection. What was set stays."""
        self._closed = True
        self._way.close()

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

    def undo(self, steps: int = 1, *, patience_s: float = LOAD_S) -> int:
        """Take back the newest edits, whoever made them. Returns the number of the edit that does so.

        What follows at once on the same parameters, as of a slider that is drawn, is one step. `patience_s`: seconds to
        wait; where a configuration is taken back, every rank loads the one before.
        """
        return self.request(undo=steps, patience_s=patience_s).edit

    def orbit(self, x: float, y: float = 0.0, *, view: int | str = 0) -> None:
        """Turn a view's camera about what it looks at, as a drag does: wall heights, x to the right, y down.

        One height is half a turn. `view`: its name, or its number from 0; a view that follows another steers that.
        """
        self._steer({"kind": "orbit", "x": x, "y": y, "view": view})

    def pan(self, x: float, y: float = 0.0, *, view: int | str = 0) -> None:
        """Shift the scene in a view as a drag does, wall heights."""
        self._steer({"kind": "pan", "x": x, "y": y, "view": view})

    def zoom(self, factor: float, *, view: int | str = 0) -> None:
        """Let things grow by a factor in a view, 1/64 to 64."""
        self._steer({"kind": "zoom", "x": factor, "view": view})

    def reset(self, *, view: int | str = 0) -> None:
        """Take a view's camera back to its path, or to where it is configured."""
        self._steer({"kind": "reset", "view": view})

    def pause(self, paused: bool = True, *, view: int | str | None = None) -> None:
        """Stop the time of the scene and of camera paths; `paused` False: let it go on.

        `view`: its name, or its number from 0: that view's time alone, and that of views that follow it; None: all.
        """
        self._steer({"kind": "pause", "paused": paused} | ({} if view is None else {"view": view}))

    def seek(self, seconds: float, *, view: int | str | None = None) -> None:
        """Add seconds to that time, back at most to 0; an hour at once; `view`: as above."""
        self._steer({"kind": "seek", "x": seconds} | ({} if view is None else {"view": view}))

    def _steer(self, command: dict[str, object]) -> None:
        self.request(commands=[command])

    def load(self, configuration: str | Path, *, patience_s: float = LOAD_S) -> int:
        """Let the wall adopt another configuration while it goes on: another model, other objects, views, calibration.

        configuration : file, or its text, whose relative paths then start where those of the run's own file do
        patience_s : seconds to wait until every rank has loaded it

        Over an address only where the run's `output.browser.load` allows it; the wall's machines read what it names.
        Processes, displays and their pixels stay those of the run. Raises EditError where it is refused, with all
        that is wrong in the file; then nothing has changed. Returns the number of the newest edit.
        """
        text, path = str(configuration), ""
        if isinstance(configuration, Path) or "\n" not in text:
            from wall.config.loading import read_text  # half a second, which no other request takes

            path = str(Path(configuration).absolute())
            text = read_text(path)
        return self.request(configuration=text, path=path, patience_s=patience_s).edit

    def edit(self, *changes: str, patience_s: float = LOAD_S) -> int:
        """Change the wall's configuration while it goes on, all of it or nothing: objects, views, panels.

        changes : PATH=VALUE, PATH+=VALUE to add to a list, PATH-=VALUE to remove; entries by number or id, values in
        YAML, as in "scene.source+=chair.glb", "views-=map", "wall.panels.r0c1.warp={file: right.obj}"

        It holds, and is refused, as what `load` loads; `undo` takes it back where no parameter was set since.
        """
        return self.request(changes=changes, patience_s=patience_s).edit

    def request(
        self, *, assignments: Sequence[Any] = (), listed: Sequence[str] = (), undo: int = 0, configuration: str = "",
        path: str = "", commands: Sequence[Any] = (), changes: Sequence[str] = (), patience_s: float | None = None,
    ) -> EditAnswer:  # fmt: skip
        """Ask the wall for something, as EditRequest has it; `patience_s`: None: the client's."""
        if (most := max(len(assignments), len(listed), len(changes))) > MAX_COMMANDS:
            raise EditError(f"{most} {'changes' if changes else 'parameters'} at once; at most {MAX_COMMANDS}")
        for name, value in assignments:
            _check_finite(name, value)
        for command in commands:
            for value in command.values():
                _check_finite(command["kind"], value)
        self._check_open()
        request = EditRequest(
            client=0, number=0, key="", assignments=list(assignments), listed=list(listed), undo=undo,
            configuration=configuration, path=path, commands=list(commands), changes=list(changes),
        )  # fmt: skip
        if patience_s is None:
            patience_s = self._patience_s
        elif patience_s > self._patience_s:
            self.request(listed=("exposure",))  # a wall that has ended answers nothing: not for that long
        answer = self._way.edit(request, patience_s)
        if answer.refused:
            raise EditError(answer.refused)
        return answer

    def join(self, host: str, *, configuration: int, public: str) -> JoinAnswer:
        """Ask for a place as a rank, or for what that takes, as JoinRequest has it."""
        assert isinstance(self._way, _ByControl)
        self._check_open()
        answer = self._way.join(
            JoinRequest(client=0, number=0, key="", host=host, configuration=configuration, public=public),
            self._patience_s,
        )
        if answer.refused:
            raise EditError(answer.refused)
        return answer

    def _check_open(self) -> None:
        if self._closed:
            raise RunError("this client is closed; wanted: another one, by connect()")


class _ByControl:
    """A link to the manager, for who can read its control file."""

    def __init__(self, control: control_file.Control) -> None:
        self._control = control
        self._client, self._number = FIRST_CLIENT + secrets.randbelow(FIRST_CLIENT), 0
        keys = Keys.of_guest(control.key, control.head) if control.head else None
        self._link = open_link(control.endpoint, rank=self._client, keys=keys)

    def close(self) -> None:
        self._link.close()

    def edit(self, request: EditRequest, patience_s: float) -> EditAnswer:
        self._number += 1
        mine = replace(request, client=self._client, number=self._number, key=self._control.key)
        try:
            return self._answer(EditAnswer, serialise(mine), patience_s)
        except LocalProtocolError as error:
            raise EditError(f"the request is too long: {error}") from error

    def join(self, request: JoinRequest, patience_s: float) -> JoinAnswer:
        self._number += 1
        mine = replace(request, client=self._client, number=self._number, key=self._control.key)
        return self._answer(JoinAnswer, serialise(mine), patience_s)

    def _answer(self, kind: type[A], request: bytes, patience_s: float) -> A:
        """The wall's answer of that kind. Raises RunError where none comes."""
        limit, again = time.monotonic() + patience_s, -math.inf
        while (now := time.monotonic()) < limit:
            if now >= again:
                self._link.send(request)
                again = now + ASK_AGAIN_S
            self._link.wait(min(limit, again) - now)
            for data in self._link.receive():
                answer = _parsed(data)
                if isinstance(answer, kind) and (answer.client, answer.number) == (self._client, self._number):
                    return answer
        control = self._control
        raise RunError(
            f"no answer from {control.endpoint} within {patience_s:g} s: the wall of process {control.pid} on "
            f"{control.host} has ended or does not respond"
        )


class _ByPage:
    """The WebSocket of the wall's page, for who knows its address."""

    def __init__(self, page: PageClient) -> None:
        self._page = page

    def close(self) -> None:
        self._page.close()

    def edit(self, request: EditRequest, patience_s: float) -> EditAnswer:
        said = self._page.ask(message_of(request), patience_s=patience_s)
        return EditAnswer(
            client=0, number=0, refused=said.get("refused", ""), edit=said.get("edit", 0),
            parameters=said.get("parameters", []), left_out=said.get("left_out", 0),
        )  # fmt: skip


def connect(wall: str | Path = "OUT", *, patience_s: float = ANSWER_S) -> Client:
    """A client of the wall that writes its results to a folder, or whose page is at an address with its token.

    Raises RunError where there is none, or where an address lets nobody in.
    """
    if isinstance(wall, Path) or not wall.startswith(("http://", "https://")):
        return Client(control_file.read(Path(wall)), patience_s=patience_s)
    from wall.display.page_client import PageClient  # and aiohttp, 0.2 s, for addresses alone

    return Client(PageClient(wall, patience_s=patience_s), patience_s=patience_s)


def _check_finite(name: str, value: object) -> None:
    """Raises EditError for a number that JSON cannot have."""
    for number in value if isinstance(value, list | tuple) else [value]:
        if isinstance(number, float) and not math.isfinite(number):
            raise EditError(f"{name} = {number}: want a finite number")


def _parsed(data: bytes) -> Any:
    try:
        return parse_control(data)
    except RemoteProtocolError as error:
        raise RunError(f"the wall speaks another version: {error}") from error


def _numbers_of(row: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """What JSON has as lists."""
    return {name: tuple(row[name]) for name in ("default", "value", "choices")}
