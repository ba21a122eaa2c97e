"""Ranks that a process forks, one after the other, and what it knows them by."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import stat
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeAlias

from wall.core.errors import WallError
from wall.core.system import die_with
from wall.run.endings import leave_to_head
from wall.transport.curve import Keys

END_S = 6.0  # for a process that was killed
PipeEnd: TypeAlias = tuple[int, int]  # descriptor and inode, for the descriptor may be used again
Main: TypeAlias = Callable[[int, Connection, Keys | None], None]  # of a rank, that is told by this what rank 0 says


class Children:
    """Belongs to a process that has no threads. They end with it."""

    def __init__(self, main: Main, keys: Sequence[Keys | None]) -> None:
        """`main`: what each of them does; `keys`: by rank."""
        self._main, self._keys = main, keys
        self._running: dict[int, BaseProcess] = {}
        self._held: dict[int, set[PipeEnd]] = {}  # by rank: by what this process knows of it

    @property
    def sentinels(self) -> list[int]:
        """What to wait for."""
        return [child.sentinel for child in self._running.values()]

    @property
    def processes(self) -> dict[int, int]:
        """By rank, of those that run."""
        return {rank: child.pid for rank, child in self._running.items() if child.pid is not None}

    def fork(self, rank: int, others: list[Connection]) -> Connection:
        """Fork a rank. Returns how it is told what rank 0 says. `others`: what it has to close. Raises OSError."""
        reader, writer = multiprocessing.get_context("fork").Pipe(duplex=False)
        try:
            args = (rank, reader, [*others, writer], self._main, os.getpid(), self._keys[rank])
            self.start(rank, run_child, *args)
        finally:
            reader.close()  # so that a rank that is gone is noticed, and does not hold up what it was to be told
        return writer

    def start(self, rank: int, target: Callable[..., None], *args: Any) -> None:
        """Fork a process that calls this, and as the last argument gets pipes that are others'."""
        siblings = set().union(*self._held.values())
        child = multiprocessing.get_context("fork").Process(target=target, args=(*args, siblings))
        self._running[rank], self._held[rank] = child, start_process(child)

    def ended(self, ready: Sequence[object]) -> Iterator[tuple[int, int]]:
        """Ranks that have ended, with their exit codes; `ready`: of `sentinels` and others."""
        for rank, child in list(self._running.items()):
            if child.sentinel in ready:
                child.join()
                code = child.exitcode
                del self._running[rank], self._held[rank]
                child.close()
                assert code is not None
                yield rank, code

    def join(self) -> None:
        """Wait until all have ended."""
        for child in self._running.values():
            child.join()

    def kill(self) -> None:
        """End all, at once."""
        for child in self._running.values():
            child.kill()
        for child in self._running.values():
            child.join(END_S)


def start_process(process: BaseProcess) -> set[PipeEnd]:
    """Start it. Returns the pipes by which this process knows of it, which others inherit.

    Nothing else: threads of libraries open and close files meanwhile.
    """
    before = open_pipes()
    process.start()
    return open_pipes() - before


def open_pipes() -> set[PipeEnd]:
    """All that this process has."""
    found = set()
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):  # it is closed by now, as that of the folder itself is
            status = os.fstat(int(name))
            if stat.S_ISFIFO(status.st_mode):
                found.add((int(name), status.st_ino))
    return found


def how_ended(exit_code: int) -> str:
    """Of a process, in words."""
    return f"signal {-exit_code}" if exit_code < 0 else f"exit code {exit_code}"


def belong_to(parent: int, ends: list[Connection], siblings: set[PipeEnd]) -> None:
    """Of a forked process: die with its parent, which gets the signals that end the run; close what is others'.

    `siblings`: by what the parent knows of other ranks.
    """
    die_with(parent)
    for end in ends:
        end.close()
    for descriptor, _ in siblings & open_pipes():
        os.close(descriptor)


def run_child(
    rank: int,
    pipe: Connection,
    others: list[Connection],
    main: Main,
    parent: int,
    keys: Keys | None,
    siblings: set[PipeEnd],
) -> None:
    """A forked rank: says why it failed."""
    leave_to_head()
    belong_to(parent, others, siblings)
    code = 1
    try:
        main(rank, pipe, keys)
        code = 0
    except WallError as error:
        said = str(error)
        print(said if said.startswith("rank ") else f"rank {rank}: {said}", file=sys.stderr, flush=True)
    except Exception:
        traceback.print_exc()
    finally:
        if sys.stderr is not None:
            sys.stderr.flush()
        os._exit(code)  # no exit handlers of the parent's libraries
