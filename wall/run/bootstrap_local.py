"""Ranks as forked processes of this machine, watched by rank 0.

A rank that died is started again by the nursery: a process forked before rank 0 had threads, which does nothing but
fork ranks, so that they begin with the scene and the kernels that were loaded then.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from wall.core.errors import RunError
from wall.run.children import Children, Main, PipeEnd, belong_to, how_ended, run_child, start_process
from wall.run.endings import leave_to_head
from wall.transport.curve import Keys

START_WAIT_S = 30.0  # for the address of rank 0, which has little to do before it tells it
STOP_WAIT_S = 6.0  # for ranks to end by themselves after they were told to, and to write what their sinks hold


class LocalBootstrap:
    """Rank 0 makes one of these by `start`; the others get theirs inside `main`."""

    killed_soon = False

    def __init__(
        self, rank: int, size: int, pipes: list[Connection], children: list[BaseProcess],
        nursery: Nursery | None = None, keys: Keys | None = None,
    ) -> None:  # fmt: skip
        self.rank, self.size, self.keys = rank, size, keys
        self._pipes, self._children, self._nursery = pipes, children, nursery
        self._again: set[int] = set()  # ranks that were started again: the nursery tells how they end

    @classmethod
    def start(
        cls, size: int, main: Callable[[LocalBootstrap], None], *, again: bool = False, encrypted: bool = False
    ) -> LocalBootstrap:
        """Fork ranks 1..size-1, each running `main`, and be rank 0. `again`: have a nursery. `encrypted`: have keys.

        Forked processes inherit their keys. A rank that is started again has those of the one before. Call it
        while signals are held_back: one that comes amid the forks must find them all, to end them.
        """
        keys: list[Keys] | list[None] = Keys.of_all(size) if encrypted else [None] * size
        for stream in filter(None, (sys.stdout, sys.stderr)):  # None: closed when this process was started
            stream.flush()
        context = multiprocessing.get_context("fork")
        pipes = [context.Pipe(duplex=False) for _ in range(size - 1)]
        to_nursery, at_nursery = context.Pipe()
        children: list[BaseProcess] = []
        siblings: set[PipeEnd] = set()  # by what this process knows of its children
        for rank in range(1, size):
            own = pipes[rank - 1][0]
            others = [end for pipe in pipes for end in pipe if end is not own] + [to_nursery, at_nursery]
            child = context.Process(
                target=run_child,
                args=(rank, own, others, as_rank(size, main), os.getpid(), keys[rank], siblings),
                name=f"wall rank {rank}",
            )
            siblings |= start_process(child)
            children.append(child)
        nursery = None
        if again:
            others = [end for pipe in pipes for end in pipe] + [to_nursery]
            args = (size, at_nursery, others, main, os.getpid(), keys, siblings)
            nursery = Nursery(context.Process(target=_nurse, args=args, name="wall nursery"), to_nursery)
        for reader, _ in pipes:
            reader.close()
        at_nursery.close()
        return cls(0, size, [writer for _, writer in pipes], children, nursery, keys[0])

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank."""
        if self.rank != 0:
            return _receive(self._pipes[0])
        for pipe in self._pipes:
            with contextlib.suppress(BrokenPipeError):  # that rank has ended; `dead` says how
                pipe.send_bytes(text.encode())
        return text

    def dead(self) -> dict[int, str]:
        """Ranks that have ended badly: how."""
        ended = self._nursery.ended() if self._nursery is not None else {}
        for rank, child in enumerate(self._children, start=1):
            if child.exitcode and rank not in self._again:
                ended[rank] = how_ended(child.exitcode)
        if ended and self._nursery is not None and (gone := self._nursery.gone):
            said = f"; what starts ranks again had ended, {gone}"
            return {rank: how + said * (rank not in self._again) for rank, how in ended.items()}
        return ended

    def start_again(self, rank: int, text: str) -> bool:
        """Start a rank that is dead once more; it gets `text` as a broadcast. Returns whether that can be tried."""
        if self._nursery is None or not self._nursery.fork(rank, text):
            return False
        self._again.add(rank)
        return True

    def finish(self, *, told: bool = True) -> None:
        """Wait for the ranks to end, then end them; at once where nobody told them to."""
        limit = time.monotonic() + STOP_WAIT_S * told
        for child in self._children:
            child.join(max(0.0, limit - time.monotonic()))
        for child in self._children:
            if child.is_alive():
                child.kill()
                child.join(STOP_WAIT_S)
        if self._nursery is not None:
            self._nursery.close(max(0.0, limit - time.monotonic()))
        for pipe in self._pipes:
            pipe.close()


class Nursery:
    """Rank 0's side of the process that forks ranks again."""

    def __init__(self, process: BaseProcess, pipe: Connection) -> None:
        self._process, self._pipe = process, pipe
        process.start()
        self._forked: set[int] = set()  # ranks, once at least
        self._ended: dict[int, str] = {}  # of these: how they ended

    @property
    def gone(self) -> str:
        """How it has ended; "" while it is there."""
        return "" if self._process.exitcode is None else how_ended(self._process.exitcode)

    def fork(self, rank: int, text: str) -> bool:
        """Fork a rank, which gets `text` as a broadcast. Returns whether the nursery is there."""
        try:
            self._pipe.send((rank, text))
        except OSError:
            return False
        self._ended.pop(rank, None)
        self._forked.add(rank)
        return True

    def ended(self) -> dict[int, str]:
        """Ranks that were forked again and have ended badly: how."""
        try:
            while self._pipe.poll():
                rank, how = self._pipe.recv()
                self._ended[rank] = how
        except (OSError, EOFError):  # the nursery is gone, and its ranks with it
            for rank in self._forked:
                self._ended.setdefault(rank, "ended with the process that had started it again")
        return dict(self._ended)

    def close(self, wait_s: float) -> None:
        """Let its ranks end within `wait_s`, then end them, and it."""
        self._pipe.close()
        self._process.join(wait_s)
        if self._process.is_alive():
            self._process.kill()  # its ranks go with it
            self._process.join(STOP_WAIT_S)


def as_rank(size: int, main: Callable[[LocalBootstrap], None]) -> Main:
    """What a forked process does to be a rank of so many."""
    return lambda rank, pipe, keys: main(LocalBootstrap(rank, size, [pipe], [], keys=keys))


def _nurse(
    size: int,
    pipe: Connection,
    others: list[Connection],
    main: Callable[[LocalBootstrap], None],
    parent: int,
    keys: Sequence[Keys | None],
    siblings: set[PipeEnd],
) -> None:
    """The nursery: forks the ranks that it is told to, tells of those that end badly, ends when nobody can tell it."""
    leave_to_head()
    belong_to(parent, others, siblings)
    children = Children(as_rank(size, main), keys)
    while True:
        ready = wait([pipe, *children.sentinels])
        for rank, code in children.ended(ready):
            if code:
                with contextlib.suppress(OSError):  # rank 0 asks no more
                    pipe.send((rank, how_ended(code)))
        if pipe in ready:
            try:
                rank, text = pipe.recv()
            except (OSError, EOFError):
                break
            try:
                writer = children.fork(rank, [pipe])
            except OSError as error:  # no memory, or no process left
                with contextlib.suppress(OSError):
                    pipe.send((rank, f"could not be started: {error}"))
                continue
            with contextlib.suppress(OSError), writer:
                writer.send_bytes(text.encode())
    children.join()  # rank 0 ends this process, and they with it, when that takes too long
    os._exit(0)


def _receive(pipe: Connection) -> str:
    why = ""
    try:
        if pipe.poll(START_WAIT_S):
            return pipe.recv_bytes().decode()
    except (OSError, EOFError) as error:
        why = f" ({error!r})"
    raise RunError(f"rank 0 did not start: it ended or said nothing for {START_WAIT_S:.0f} s{why}")
