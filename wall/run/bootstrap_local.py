"""Ranks as forked processes of this machine, watched by rank 0."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from wall.core.errors import RunError, WallError

START_WAIT_S = 30.0  # for the address of rank 0, which has little to do before it tells it
STOP_WAIT_S = 6.0  # for ranks to end by themselves after they were told to, and to write what their sinks hold
_PR_SET_PDEATHSIG = 1


class LocalBootstrap:
    """Rank 0 makes one of these by `start`; the others get theirs inside `main`."""

    def __init__(self, rank: int, size: int, pipes: list[Connection], children: list[BaseProcess]) -> None:
        self.rank, self.size = rank, size
        self._pipes, self._children = pipes, children

    @classmethod
    def start(cls, size: int, main: Callable[[LocalBootstrap], None]) -> LocalBootstrap:
        """Fork ranks 1..size-1, each running `main`, and be rank 0."""
        sys.stdout.flush()
        sys.stderr.flush()
        context = multiprocessing.get_context("fork")
        pipes = [context.Pipe(duplex=False) for _ in range(size - 1)]
        children = []
        ctrl_c = signal.signal(signal.SIGINT, signal.SIG_IGN)  # ranks leave Ctrl-C to the head, from their start
        for rank in range(1, size):
            args = (rank, size, pipes, main, os.getpid())
            child = context.Process(target=_run_child, args=args, name=f"wall rank {rank}")
            child.start()
            children.append(child)
        signal.signal(signal.SIGINT, ctrl_c)
        for reader, _ in pipes:
            reader.close()
        return cls(0, size, [writer for _, writer in pipes], list(children))

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
        ended = {}
        for rank, child in enumerate(self._children, start=1):
            if child.exitcode:
                ended[rank] = f"signal {-child.exitcode}" if child.exitcode < 0 else f"exit code {child.exitcode}"
        return ended

    def finish(self) -> None:
        """Wait for the ranks to end, then end them."""
        limit = time.monotonic() + STOP_WAIT_S
        for child in self._children:
            child.join(max(0.0, limit - time.monotonic()))
        for child in self._children:
            if child.is_alive():
                child.kill()
                child.join(STOP_WAIT_S)
        for pipe in self._pipes:
            pipe.close()


def _run_child(
    rank: int,
    size: int,
    pipes: list[tuple[Connection, Connection]],
    main: Callable[[LocalBootstrap], None],
    parent: int,
) -> None:
    """A forked rank: dies with its parent, leaves Ctrl-C to it, and says why it failed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for k, (reader, writer) in enumerate(pipes, start=1):
        writer.close()
        if k != rank:
            reader.close()
    code = 1
    try:
        main(LocalBootstrap(rank, size, [pipes[rank - 1][0]], []))
        code = 0
    except WallError as error:
        print(f"rank {rank}: {error}", file=sys.stderr, flush=True)
    except Exception:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)  # no exit handlers of the parent's libraries


def _receive(pipe: Connection) -> str:
    why = ""
    try:
        if pipe.poll(START_WAIT_S):
            return pipe.recv_bytes().decode()
    except (OSError, EOFError) as error:
        why = f" ({error!r})"
    raise RunError(f"rank 0 did not start: it ended or said nothing for {START_WAIT_S:.0f} s{why}")
