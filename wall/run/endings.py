"""How a run is told from outside to end: Ctrl-C, SIGTERM, a terminal that is closed.

The head ends the run in order, however often it is told; the other ranks leave that to it. mpirun kills its processes a
quarter of a second after it told them to end, and Slurm's time limit comes by it. So there the results are written at
once, by a process of their own that is not in the group which is killed.
"""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import thread as executors
from types import FrameType

REASONS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "its terminal was closed"}
WRITE_S = 30  # for that process: a disk that does not answer keeps nothing for longer
_LOOK_S = 0.01


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """While inside, what would end the run waits; processes that are forked begin so.

    For a process without threads, which would take the signals.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, REASONS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def leave_to_head() -> None:
    """Let this process, a rank, ignore what ends the run, also what waits: the head tells it."""
    for number in REASONS:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, REASONS)


class EndSignals:
    """While installed, signals that would end this process call a function with the reason instead."""

    def __init__(self, told: Callable[[str], None]) -> None:
        """`told` is called in the main thread, between any two of its steps."""
        self._told = told
        self._before: dict[signal.Signals, object] = {}

    def install(self) -> None:
        """Begin. A hang-up that this process was started to ignore, by `nohup`, stays ignored."""
        for number in REASONS:
            if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._stop)

    def restore(self) -> None:
        """End; also where it did not begin."""
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]  # what signal.signal gave
        self._before = {}

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self._told(REASONS[signal.Signals(number)])


class WriterApart:
    """Writes the results as they are, in a copy of this process that outlives it."""

    def __init__(self, write: Callable[[], None]) -> None:
        """`write` must use no other thread."""
        self._write, self._begun, self._copied, self._pid = write, False, True, 0

    def begin(self) -> None:
        """Begin to write, unless that was done."""
        if self._begun:
            return
        self._begun, self._copied = True, False  # at once: the next signal may come while this process is being copied
        if executors._global_shutdown_lock.locked():  # fork waits for it, and this thread may hold it, amid a submit
            _thread.start_new_thread(self._copy, ())
        else:
            self._copy()

    def _copy(self) -> None:
        with contextlib.suppress(OSError):  # without memory for a copy the run still ends in order
            self._pid = os.fork()
            if self._pid == 0:
                self._write_and_exit()
        self._copied = True

    def wait(self) -> None:
        """Wait until it is done, so that what is written from now on is newer."""
        limit = time.monotonic() + WRITE_S
        while not self._copied and time.monotonic() < limit:
            time.sleep(_LOOK_S)
        while self._pid and os.waitpid(self._pid, os.WNOHANG)[0] == 0:
            if time.monotonic() > limit:
                os.kill(self._pid, signal.SIGKILL)
            time.sleep(_LOOK_S)
        self._pid = 0

    def _write_and_exit(self) -> None:
        try:
            os.setsid()
            leave_to_head()
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(WRITE_S)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for number in range(3):  # mpirun waits for all who might still print
                os.dup2(nowhere, number)
            os.closerange(3, 1 << 30)
            self._write()
        finally:
            os._exit(0)  # nothing of the run that this is a copy of is to be ended
