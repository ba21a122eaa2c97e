"""The file by which another process finds a running wall: `control.json` in its folder of results.

It holds where the manager listens, how it proves itself, and the key that requests must bring; only its owner may read
it. It is there as long as the wall runs.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TextIO

from wall.core.errors import RunError

NAME = "control.json"
KEY_BYTES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """How to reach a wall."""

    endpoint: str  # of the manager
    key: str
    head: str  # its public key, by which it proves itself; "" where nothing is encrypted
    host: str
    pid: int
    page: str = ""  # address of its page, or of its metrics, with the token; "" without either


def new_key() -> str:
    """A key that nobody can guess."""
    return secrets.token_hex(KEY_BYTES)


@contextmanager
def announced(folder: Path, control: Control) -> Iterator[Callable[[str], None]]:
    """While inside, `folder` has the file; yields what says where the page is, once that is known.

    Raises RunError where it cannot be written, or is another wall's.
    """
    check_free(folder)
    newest = control
    with contextlib.ExitStack() as files:
        files.enter_context(_written(folder, control))

        def tell_page(page: str) -> None:
            nonlocal newest
            told = replace(control, page=page)
            files.enter_context(_written(folder, told))
            newest = told

        try:
            yield tell_page
        finally:
            with contextlib.suppress(RunError, OSError):
                if read(folder) == newest:  # else another wall uses the folder by now
                    (folder / NAME).unlink()


def _written(folder: Path, control: Control) -> TextIO:
    """The folder's file, with this in it; locked as long as it is open. Raises RunError."""
    path, part = folder / NAME, folder / f".{NAME}.{os.getpid()}"
    try:
        part.unlink(missing_ok=True)
        file = open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8")  # noqa: SIM115
    except OSError as error:
        raise RunError(f"cannot write {path}: {error.strerror or error}") from error
    try:
        json.dump(asdict(control), file)
        file.flush()
        with contextlib.suppress(OSError):  # of a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):  # what could not be written is tried once more, and told once more
            file.close()
        part.unlink(missing_ok=True)
        raise RunError(f"cannot write {path}: {error.strerror or error}") from error
    return file


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """While inside, no other wall writes to `folder`, which is there. Raises RunError where one does.

    A wall locks first and looks then: of two that start at once one is refused before it has written anything.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise _taken(folder) from None
        except OSError:
            pass  # a file system without locks of folders, such as NFS: the file's lock has to do
        check_free(folder)
        yield
    finally:
        os.close(descriptor)


def check_free(folder: Path) -> None:
    """Raises RunError where a wall that still runs writes to the folder: its file is locked."""
    try:
        with (folder / NAME).open(encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return
    except BlockingIOError:
        raise _taken(folder) from None
    except OSError:
        return  # no such file, or no locks


def _taken(folder: Path) -> RunError:
    """That a wall writes to a folder; one that has just begun has not said yet who it is."""
    who = ""
    with contextlib.suppress(RunError):
        there = read(folder)
        who = f" (process {there.pid} on {there.host})"
    return RunError(
        f"{folder}: another wall writes its results there{who}; wanted: another --out, or the end of that wall"
    )


def read(folder: Path) -> Control:
    """How to reach the wall that writes its results to `folder`. Raises RunError where none does."""
    path = folder / NAME
    try:
        return parse(path.read_text(encoding="utf-8"), str(path))
    except FileNotFoundError:
        raise RunError(
            f"{path}: no such file, so no wall runs with --out {folder}; wanted: the folder of results of a running "
            "wall (one inside a single process, transport: loopback, has no way in)"
        ) from None
    except (OSError, ValueError) as error:
        raise RunError(f"{path}: cannot be read ({error}); wanted: that of a running wall") from error


def parse(text: str, name: str) -> Control:
    """How to reach a wall, by the text of its file. Raises RunError for another text; `name`: whose text it is."""
    try:
        values = json.loads(text)
        texts = {name: str(values[name]) for name in ("endpoint", "key", "head", "host")}
        return Control(**texts, pid=int(values["pid"]), page=str(values.get("page", "")))
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{name}: does not say how to reach a wall ({error}); wanted: that of a running one") from error
