"""What viewers and programs command: edits are made at once, all else waits until the next event takes it in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from wall.core.errors import EditError, RemoteProtocolError
from wall.geometry.steering import EVERY_VIEW, OF_ONE_TIME, OF_ONE_VIEW, Command, parse
from wall.packets.control import Selection
from wall.roles.director import Director
from wall.roles.editing import Editor
from wall.roles.plan import Plan
from wall.roles.status import samplers_of


class Commands:
    """Those that no event tells of yet, and what pages share beside the scene."""

    def __init__(self) -> None:
        self.waiting: list[Command] = []
        self.selection = Selection()  # what pages show

    def take(self, command: Command, editor: Editor, directors: Sequence[Director], now: float) -> bool:
        """Do what a command edits, else keep it. Returns whether it edits. Raises EditError where that is refused."""
        events = [director.event for director in directors]
        if editor.apply(command, events, now):
            return True
        if command.kind == "select":
            names = editor.clicks.select(self.selection.names, events, command.x, command.y)
            self.selection = replace(self.selection, names=names)
            return False
        self.waiting.append(command)
        if command.kind == "bookmark":
            kept = {*self.selection.bookmarks, int(command.value)}
            self.selection = replace(self.selection, bookmarks=sorted(kept))
        return False

    def taken(self) -> list[Command]:
        """All that waited; it does no more."""
        taken, self.waiting = self.waiting, []
        return taken

    def take_asked(
        self, asked: Sequence[object], editor: Editor, *, plan: Plan, directors: Sequence[Director], now: float
    ) -> None:
        """Take commands for whose answer somebody waits, one after the other; the first that is refused ends it.

        Raises EditError for what is no command, and for what would do nothing.
        """
        try:
            commands = [parse(_with_index(each, [director.name for director in directors])) for each in asked]
        except RemoteProtocolError as error:
            raise EditError(str(error)) from error
        for command in commands:
            self._check(command, plan, directors)
        for command in commands:
            self.take(command, editor, directors, now)

    def _check(self, command: Command, plan: Plan, directors: Sequence[Director]) -> None:
        if command.kind == "statistics":
            raise EditError("command statistics: want `overlay` of a page, which asks for them")
        if command.view >= len(directors):
            raise EditError(f"command {command.kind}: view = {command.view}: want one of {_views(directors)}")
        if command.kind == "sampler" and command.value not in (known := samplers_of(plan)):
            raise EditError(f"command sampler: this wall has no {command.value}: want one of {', '.join(known)}")
        if command.kind == "recall" and int(command.value) not in (kept := self.selection.bookmarks):
            want = ", ".join(map(str, kept)) or "one that was kept; none was"
            raise EditError(f"command recall: no camera was kept as {command.value}: want {want}")
        if command.kind == "compare" and command.value and not directors[0].compares:
            raise EditError("command compare: this wall has several views, or no second image: want one view, unlocked")


def commands_of(
    director: Director, commands: Sequence[Command], directors: Sequence[Director]
) -> list[Command]:
    """Those that a view takes; all views before it have taken theirs."""
    own = [command for command in commands if _meant(command, directors) in (EVERY_VIEW, director.view)]
    first = directors[0]
    if director is first:
        return own
    alike = "on" if first.paused else "off"  # what turns every time on or off has them agree
    return [replace(c, value=alike) if c.kind == "pause" and c.view == EVERY_VIEW and not c.value else c for c in own]


def _meant(command: Command, directors: Sequence[Director]) -> int:
    """The view that a command is for: the one whose camera, or whose time, that of the view is that it names."""
    if command.view not in range(len(directors)):
        return command.view
    if command.kind in OF_ONE_TIME:
        return directors[command.view].timed
    if command.kind in OF_ONE_VIEW:
        return command.view if command.kind == "sampler" else directors[command.view].steered
    return EVERY_VIEW


def _with_index(asked: object, names: Sequence[str]) -> object:
    """A command whose `view` is a name, with that view's index."""
    if not isinstance(asked, Mapping) or not isinstance(name := asked.get("view"), str):
        return asked
    if name not in names:
        raise EditError(f"view = {name[:40]!r}: want one of {', '.join(names)}, or its number from 0")
    return {**asked, "view": names.index(name)}


def _views(directors: Sequence[Director]) -> str:
    return ", ".join(f"{director.view} ({director.name})" for director in directors)
