"""What the command line shares: consoles, exit codes, and how paths and sizes given on it are read."""

from __future__ import annotations

import copy
import errno
import os
import re
import signal
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from wall.core.errors import ConfigError, EditError, WallError
from wall.core.garbage import collect_as_usual, collect_rarely
from wall.core.mpi import mpi_rank, under_mpi

if TYPE_CHECKING:  # reading configurations takes libraries that `wall --help` does without
    from wall.config.loading import Loaded
    from wall.roles.plan import Plan

FAILED, REFUSED, INTERRUPTED = 1, 2, 130  # exit codes
SIGNALLED = 128  # likewise, and the number of a signal

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # all but tab and line end


class Terminal(Console):
    """A console for texts that come from outside: names of files, of panels, of hosts.

    It shows text as it is: brackets and colons are no markup, control characters are spelled out. Once nobody takes
    what is printed, it prints nothing more: what the command does goes on.
    """

    def __init__(self, **options: Any) -> None:
        """`options`: of rich's Console. Under MPI nothing is coloured: where the launcher writes to is not known."""
        if under_mpi():
            options = {"force_terminal": False} | options
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """A text as it is shown."""
        return super().render_str(spelled_out(text), **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print, unless the output is gone or full. Tables that are too wide stand on edge, or as lists."""
        parts = [part for each in objects for part in (self._fitting(each) if isinstance(each, Table) else [each])]
        try:
            super().print(*parts, **options)
        except OSError:
            self.quiet = True

    def _fitting(self, table: Table) -> list[RenderableType]:
        """The table and its note: on edge where a word would be broken otherwise; as a list where that is too wide."""
        rows = [[str(cell) for cell in column.cells] for column in table.columns]
        note = [] if table.caption is None else [table.caption]
        table = copy.copy(table)
        table.caption = None
        edge, listed = (Table(title=table.title, title_justify="left", show_header=False) for _ in range(2))
        for column, cells in zip(table.columns, rows, strict=True):
            edge.add_row(str(column.header), *cells)
        for line in zip(*rows, strict=True):
            for column, cell in zip(table.columns, line, strict=True):
                listed.add_row(str(column.header), cell)
            listed.add_section()
        fits = (each for each in (table, edge) if not self._breaks(each))
        return [next(fits, listed) if rows and rows[0] else table, *note]

    def _breaks(self, table: Table) -> bool:
        """Whether a word has no room; else every column has the room of its longest, and a share of what is left."""
        texts = [[str(column.header), *map(str, column.cells)] for column in table.columns]
        widest = [max(cell_len(line) for text in texts_ for line in text.splitlines() or [""]) for texts_ in texts]
        words = [max((cell_len(word) for text in texts_ for word in text.split()), default=1) for texts_ in texts]
        borders = 3 * len(texts) + 1
        missing, left = sum(widest) + borders - self.width, self.width - sum(words) - borders
        if missing > 0 <= left:
            for column, wide, word in zip(table.columns, widest, words, strict=True):
                column.width = word + left * (wide - word) // (sum(widest) - sum(words))
        return left < 0

    def on_broken_pipe(self) -> None:
        """The reader of the output has ended: what is left in Python's buffer has nowhere to go either."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, (sys.stderr if self.stderr else sys.stdout).fileno())
        os.close(nowhere)


def spelled_out(text: str) -> str:
    """The text, its control characters as \\x1b and the like."""
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


console = Terminal()
errors = Terminal(stderr=True, soft_wrap=True)


def open_standard_streams() -> None:
    """Give streams that are closed somewhere to write: or what is opened next would be taken for them."""
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(number)


def say_version(wanted: bool) -> None:
    """Print the version and end the process, if that is wanted."""
    if wanted:
        from importlib.metadata import version

        print(f"wall {version('wall')}")
        raise SystemExit(0)


def fail(message: str) -> NoReturn:
    """Print a message and end the process with the exit code of a failed run."""
    errors.print(_with_rank(message), style="red")
    raise SystemExit(FAILED)


def load_config(
    path: Path, scene: Path | None = None, *, up: str | None = None, integrator: str | None = None, fit: bool = False
) -> Loaded:
    """Load a configuration, or the default one around a model or a built-in scene; `scene` replaces what it shows.

    `up`: direction that is up in models; `integrator`: how light is followed; `fit`: fewer pixels on fewer cores.
    """
    from wall.commands.inputs import load_any
    from wall.config.loading import with_integrator, with_scene, with_up

    loaded = load_any(path)
    loaded = with_scene(loaded, scene) if scene is not None else loaded
    loaded = with_up(loaded, up) if up is not None else loaded
    loaded = with_integrator(loaded, integrator) if integrator is not None else loaded
    if fit:
        from wall.commands.fit import fitted

        loaded, said = fitted(loaded, len(os.sched_getaffinity(0)))
        if said:
            errors.print(f"note: {said}")
    return loaded


def print_notes(plan: Plan) -> None:
    """Say at rank 0 what is unusual about the wall, and what of its models is not drawn as their files say."""
    for note in (*plan.layout.notes, *plan.scene.notes) if mpi_rank() == 0 else ():
        errors.print(f"note: {note}")


def write_text(path: Path, text: str) -> None:
    """Write a text file; ends the process if that cannot be done."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        fail(f"{path}: cannot be written ({error.strerror or error})")


def si(value: float) -> str:
    """Shorten a number with a unit prefix: 1234567 as 1.23 M; a unit may follow at once."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.0f} "


def parse_size(text: str | None) -> tuple[int, int] | None:
    """Width and height of `WIDTHxHEIGHT` in pixels. Raises ConfigError."""
    if text is None:
        return None
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ConfigError(f"--size {text}: wanted WIDTHxHEIGHT in pixels, such as 960x540")
    return int(width), int(height)


def end_in_order() -> None:
    """Let SIGTERM and SIGHUP end this command as Ctrl-C does: what it has started is ended, too."""

    def end(number: int, _: object) -> None:
        sys.exit(SIGNALLED + number)

    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup wants it
            signal.signal(number, end)


def _with_rank(message: str) -> str:
    """The message, and which rank of an MPI launch says so, where; not at the first, and outside of one."""
    if mpi_rank() == 0 or message.startswith("rank "):
        return message
    return f"rank {mpi_rank()} on {socket.gethostname()}: {message}"


def _refusal(message: str) -> str:
    """A refusal of a configuration, of which other ranks than the first repeat a line: all read the same files."""
    first, _, more = message.partition("\n")
    return _with_rank(message if mpi_rank() == 0 or not more else f"{first} (and more, as rank 0 says)")


def readably(run: Callable[[], object]) -> None:
    """Call a command line; every refusal and failure is one readable text and an exit code."""
    open_standard_streams()
    collect_rarely()
    try:
        run()
    except (ConfigError, EditError) as error:
        errors.print(_refusal(str(error)), style="red")
        sys.exit(REFUSED)
    except WallError as error:
        fail(str(error))
    except SystemExit as end:
        if end.code == INTERRUPTED:  # typer takes Ctrl-C itself
            errors.print("interrupted", style="red")
        raise
    except BrokenPipeError:  # of print(): who reads the output has ended
        sys.stdout = None
        sys.exit(FAILED)
    except OSError as error:  # of this machine: no descriptor, no memory, no disk is left
        full = error.errno in (errno.EMFILE, errno.ENFILE)
        fail(f"{error}{'; wanted: more open files (ulimit -n)' * full}")
    except KeyboardInterrupt:
        fail("interrupted")
    finally:
        collect_as_usual()
