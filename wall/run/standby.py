"""A head that dies is replaced: it is a process that another one has forked, as it has forked all ranks.

That process has the scene and the kernels of the start, no thread and no socket. It hands on what the head says, tells
it of ranks that have ended, and forks the next head where one dies by a signal. What a head knows and nobody else, it
keeps writing down in memory that it shares with its parent. Under MPI it forks heads alone: mpirun has made the ranks,
and watches them.
"""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from types import FrameType
from typing import Any, Generic, TypeVar

from wall.core.errors import ConfigError, RunError, WallError
from wall.roles.legacy import Legacy
from wall.roles.plan import HEAD
from wall.run.bootstrap import Bootstrap
from wall.run.bootstrap_local import STOP_WAIT_S, LocalBootstrap, as_rank
from wall.run.children import Children, PipeEnd, belong_to, how_ended
from wall.run.control_file import new_key
from wall.run.endings import REASONS, held_back
from wall.run.shared_state import MOST_BYTES, SharedState
from wall.run.sinks import PageAt
from wall.transport.curve import Keys

MOST_HEADS, WITHIN_S = 3, 60.0  # another one takes over so often; after that its death ends the run
WRITE_S = 0.1  # between two copies of it
FROZEN_SHARE = 0.5  # of the time after which ranks give up without a head: it is killed if it did nothing for so long
FROZEN_AGAIN_S = 600.0  # a head that stands still so soon after another one did ends the run
TOLD_WAIT_S = 180.0  # for ranks that a launcher made, which load and compile: more than they are given for it
AWAKE_S = 0.5  # a signal that another thread of this process takes does not end a wait: it is passed on after it
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Where:
    """Where others find a head."""

    address: str  # as ranks were told
    endpoint: str  # of the manager
    page: PageAt | None
    metrics: PageAt | None  # at a port of their own


@dataclass(frozen=True, slots=True, kw_only=True)
class Estate:
    """What a head leaves to the next."""

    where: Where
    legacy: Legacy


class StandbyBootstrap:
    """The head's side. It is rank 0, and its parent has forked the others, or tells those that were launched."""

    rank = HEAD

    def __init__(
        self, size: int, pipe: Connection, keys: Keys | None, state: SharedState, key: str, how: str,
        *, launched: bool = False,
    ) -> None:  # fmt: skip
        """`key`: of the run's requests, the same for all heads; `how`: the head before died, "" for the first.

        `launched`: mpirun has made the other ranks.
        """
        self.killed_soon = self._launched = launched
        self.size, self.keys, self.key, self.how = size, keys, key, how
        self._pipe, self._state, self._due = pipe, state, 0.0
        self._left: Legacy | None = None
        self._fits = True  # what was left last
        self._ended: dict[int, str] = {}
        self._finished = False
        data = state.read() if how else None
        self.estate: Estate | None = None if data is None else pickle.loads(data)  # of the head before

    def broadcast(self, text: str) -> str:
        """What ranks are told, which they know already where this is not the first head."""
        if self.estate is not None:
            return self.estate.where.address
        self._say("address", text)
        if self._launched:  # they load and compile by themselves: who is not ready yet is not silent
            self._wait_for("told", TOLD_WAIT_S)
        return text

    def end(self) -> None:
        """The run ends: from now on no other head is to take this one's place."""
        self._say("ends")

    def leave(self, estate: Callable[[Legacy | None], Estate]) -> str:
        """Write down what the next head needs, if that is due; `estate` is told what was made before.

        Returns what a user should know of it, once.
        """
        now = time.monotonic()
        if now < self._due or self._finished:
            return ""
        self._due = now + WRITE_S
        left = estate(self._left)
        self._left = left.legacy
        data, fitted = pickle.dumps(left), self._fits
        self._fits = self._state.write(data)
        if self._fits or not fitted:
            return ""
        return f"another head would go on where there was room last: {len(data)} bytes; wanted: {MOST_BYTES} at most"

    def dead(self) -> dict[int, str]:
        """Ranks that have ended badly: how."""
        with contextlib.suppress(OSError, EOFError):  # nobody is there: this process ends, too
            while not self._finished and self._pipe.poll():
                self._take(self._pipe.recv())
        return dict(self._ended)

    def start_again(self, rank: int, text: str) -> bool:
        """Start a rank that is dead once more; it gets `text` as a broadcast. Returns whether that can be tried."""
        self._ended.pop(rank, None)
        return not self._launched and self._say("fork", rank, text)

    def finish(self, *, told: bool = True) -> None:
        """Let all ranks end, and wait for that; at once where nobody told them to."""
        if self._finished or not self._say("finish", told):
            return
        self._wait_for("finished", 2 * STOP_WAIT_S)

    def _wait_for(self, word: str, seconds: float) -> None:
        """Take in what the parent says until it says this, or is not there."""
        limit = time.monotonic() + seconds
        with contextlib.suppress(OSError, EOFError):
            while self._pipe.poll(max(0.0, limit - time.monotonic())) and self._take(self._pipe.recv()) != word:
                pass

    def _take(self, said: tuple[Any, ...]) -> str:
        """Returns the first word."""
        if said[0] == "ended":
            self._ended[said[1]] = said[2]
        self._finished |= said[0] == "finished"
        return str(said[0])

    def _say(self, *words: object) -> bool:
        try:
            self._pipe.send(words)
        except OSError:
            return False
        return True


class Stand(Generic[T]):
    """The parent's side: forks heads and ranks until a head comes to an end of its own."""

    _launched = False  # whether a launcher has made the ranks

    def __init__(
        self, size: int, main: Callable[[LocalBootstrap], None], head: Callable[[StandbyBootstrap], T], *,
        encrypted: bool, patience_s: float,
    ) -> None:  # fmt: skip
        """`main`: of the other ranks; `head`: what a head does, and what comes of it, which can be pickled.

        `patience_s`: after so long ranks give up without a head.
        """
        self._size, self._head = size, head
        keys: Sequence[Keys | None] = Keys.of_all(size) if encrypted else [None] * size
        self._keys, self._key = keys, new_key()
        self._children, self._state = Children(as_rank(size, main), keys), SharedState()
        self._writers: dict[int, Connection] = {}  # to ranks that were not told the address yet
        self._pipe: Connection | None = None
        self._ended: dict[int, str] = {}  # ranks, badly, and not started again since
        self._limit: float | None = None  # for ranks to end
        self._deaths: list[float] = []  # of heads
        self._came: T | WallError | None = None
        self._before: dict[signal.Signals, Any] = {}
        self._told: int | None = None  # the signal that is to end the run
        self._ending = False  # the head is: it gives no sign of life any more
        self._frozen_s, self._froze, self._froze_at = FROZEN_SHARE * patience_s, "", -math.inf  # the last: when one did
        self._first_sign, self._signs = 0, 0  # how many there were before this head, and by now
        self._since, self._looked = 0.0, 0.0  # when there was a new one, and when it was looked for

    def run(self) -> T:
        """Run the wall. Raises what a head has raised, and RunError for one that died for good."""
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        try:
            with held_back():
                self._before = {number: signal.signal(number, self._pass_on) for number in REASONS}
                for number, handler in self._before.items():
                    if handler is signal.SIG_IGN:
                        signal.signal(number, handler)
                self._fork_ranks()
                self._begin("")
            while self._children.processes:
                self._turn()
        finally:
            self._children.kill()
            for number, handler in self._before.items():
                signal.signal(number, handler)
        if isinstance(self._came, WallError):
            raise self._came
        assert self._came is not None
        return self._came

    def _fork_ranks(self) -> None:
        for rank in range(1, self._size):
            self._writers[rank] = self._children.fork(rank, list(self._writers.values()))

    def _begin(self, how: str) -> None:
        """Fork a head; `how`: the one before died."""
        self._first_sign = self._state.signs
        ours, its = Pipe()
        others = [ours, *self._writers.values(), *filter(None, [self._pipe])]
        make = partial(
            StandbyBootstrap, self._size, its, self._keys[HEAD], self._state, self._key, how, launched=self._launched
        )  # fmt: skip
        with held_back():  # what would end the run finds this head
            self._children.start(HEAD, _be_head, make, others, self._head, os.getpid(), self._before)
        its.close()
        if self._pipe is not None:
            self._pipe.close()
        self._pipe = ours
        for rank, ended in self._ended.items():
            self._tell("ended", rank, ended)
        if self._told is not None:  # while there was no head
            self._pass_on(self._told, None)

    def _turn(self) -> None:
        left = AWAKE_S if self._limit is None else min(AWAKE_S, max(0.0, self._limit - time.monotonic()))
        ready = wait([*filter(None, [self._pipe]), *self._children.sentinels], left)
        died = ""
        for rank, code in self._children.ended(ready):
            if rank == HEAD:
                died = how_ended(code) + self._froze
            elif code:
                self._ended[rank] = how_ended(code)
                self._tell("ended", rank, self._ended[rank])
        self._hear()
        if died and self._came is None:
            self._replace(died)
        if self._limit is not None:
            self._end_ranks()
        self._watch()

    def _watch(self) -> None:
        """Kill a head that stands still, once it has given a sign. What this process did not get either is no time."""
        now, before = time.monotonic(), self._looked
        self._looked, signs = now, self._state.signs
        watched = signs > self._first_sign and not self._ending and self._limit is None and self._told is None
        if signs != self._signs or not watched or now - before > 4.0 * AWAKE_S:
            self._signs, self._since = signs, now
        elif now - self._since > self._frozen_s and (pid := self._children.processes.get(HEAD)) is not None:
            self._since, self._froze = now, f" after it had done nothing for {self._frozen_s:g} s"
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _ends(self) -> None:
        self._ending = True

    def _hear(self) -> None:
        """Do what the head says."""
        try:
            while self._pipe is not None and self._pipe.poll():
                word, *values = self._pipe.recv()
                getattr(self, f"_{word}")(*values)
        except (OSError, EOFError):
            self._pipe = None  # it has ended

    def _address(self, text: str) -> None:
        for writer in self._writers.values():
            with contextlib.suppress(OSError), writer:  # that rank has ended
                writer.send_bytes(text.encode())
        self._writers = {}

    def _fork(self, rank: int, text: str) -> None:
        try:
            with held_back():
                writer = self._children.fork(rank, list(filter(None, [self._pipe])))
        except OSError as error:  # no memory, or no process left
            self._ended[rank] = f"could not be started: {error}"
            self._tell("ended", rank, self._ended[rank])
            return
        self._ended.pop(rank, None)
        with contextlib.suppress(OSError), writer:
            writer.send_bytes(text.encode())

    def _finish(self, told: bool) -> None:
        self._ending = True
        self._limit = time.monotonic() + STOP_WAIT_S * told

    def _outcome(self, came: T | WallError) -> None:
        self._came = came
        self._limit = time.monotonic() if self._limit is None else self._limit

    def _end_ranks(self) -> None:
        """Tell the head once no rank is left; end those that stay too long."""
        assert self._limit is not None
        left = {rank for rank in self._children.processes if rank != HEAD}
        if left and time.monotonic() >= self._limit:
            for rank in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self._children.processes[rank], signal.SIGKILL)
            self._limit = time.monotonic() + STOP_WAIT_S
        elif not left:
            self._tell("finished")
            self._limit = None if HEAD in self._children.processes else self._limit

    def _replace(self, how: str) -> None:
        """Fork another head, or end the run."""
        now = time.monotonic()
        self._deaths = [time_of for time_of in self._deaths if now - time_of < WITHIN_S]
        may = how.startswith("signal") and self._limit is None and not self._ending and len(self._deaths) < MOST_HEADS
        if self._froze:
            may, self._froze, self._froze_at = may and now - self._froze_at > FROZEN_AGAIN_S, "", now
        told = next((number for number in REASONS if number == self._told or how == how_ended(-number)), None)
        if told is not None:
            self._outcome(RunError(f"{REASONS[told]} before a head could end the run in order ({how})"))
        elif may and self._state.read() is not None:
            self._deaths.append(now)
            self._begin(f"died ({how})")
        else:
            self._outcome(RunError(f"the head ended ({how}), and no other one takes its place"))

    def _tell(self, *words: object) -> None:
        if self._pipe is not None:
            with contextlib.suppress(OSError):
                self._pipe.send(words)

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        """A signal that is to end the run is the head's."""
        self._told = number
        if (pid := self._children.processes.get(HEAD)) is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)


class LaunchedStand(Stand[T]):
    """The parent's side where a launcher has made the ranks: this process is the head's rank, and forks heads alone."""

    _launched = True

    def __init__(self, launched: Bootstrap, head: Callable[[StandbyBootstrap], T], *, patience_s: float) -> None:
        """`head`, `patience_s`: see Stand."""
        super().__init__(launched.size, lambda bootstrap: None, head, encrypted=False, patience_s=patience_s)
        self._keys, self._own = [launched.keys], launched

    def _fork_ranks(self) -> None:
        """They are there."""

    def _address(self, text: str) -> None:
        self._own.broadcast(text)
        self._tell("told")


def _be_head(
    make: Callable[[], StandbyBootstrap], others: list[Connection], head: Callable[[StandbyBootstrap], object],
    parent: int, handlers: dict[signal.Signals, Any], siblings: set[PipeEnd],
) -> None:  # fmt: skip
    """A forked head: tells its parent what came of it."""
    belong_to(parent, others, siblings)
    for number, handler in handlers.items():
        signal.signal(number, handler)
    bootstrap = make()
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, REASONS)
        came = head(bootstrap)
    except WallError as error:
        came = (ConfigError if isinstance(error, ConfigError) else RunError)(str(error))
    except KeyboardInterrupt:
        came = RunError("interrupted")
    bootstrap._say("outcome", came)
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.flush()
    os._exit(0)
