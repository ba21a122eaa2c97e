"""The loop of every rank: give a role its messages and the time, carry out what it asks for, sleep until more is due.

while not finished:
    role.on_message(each message that came)   -> instructions
    role.on_tick(now)                         -> instructions
    wait for a message, at most until role.due
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import chain

from wall.core.clock import Clock
from wall.core.errors import RunError, WallError
from wall.display.base import Sink, Status, TakesSamples, TellsStatus, WallImage
from wall.packets.control import Adopt, Heartbeat, Membership, Message, Prepare
from wall.roles.instructions import (
    MANAGER,
    Admit,
    Broadcast,
    Connect,
    Dropped,
    Finish,
    Input,
    Instruction,
    Instructions,
    Make,
    Offer,
    Presented,
    Reassign,
    Restart,
    Role,
    Send,
    Show,
    Tell,
    Trace,
)
from wall.roles.renderer import Renderer
from wall.run.ports import Ports
from wall.run.succession import Preparer, Succession
from wall.run.tracers import BatchError, Tracers
from wall.run.turns import Turns
from wall.run.usage import Usage, usage

Source = Callable[[], Iterable[Input]]  # of messages that come by other ways than the network
OnShown = Callable[[Sequence[WallImage], Status], None]


class Loop:
    """Executes one role; belongs to one thread."""

    def __init__(
        self,
        role: Role,
        ports: Ports,
        clock: Clock,
        *,
        tracers: Tracers | None = None,
        sinks: Sequence[Sink | None] = (),
        sources: Sequence[Source] = (),
        longest_wait_s: float = 0.05,
        shown: OnShown | None = None,
        succession: Succession | Preparer | None = None,
        used: Callable[[], Usage] = usage,
    ) -> None:
        """`tracers` execute Trace, `sinks` take what is shown; after them `shown` is told of it, too.

        `sources` are asked at least every `longest_wait_s`. `succession`: of a rank, or what prepares for the manager;
        None: the configuration stays.
        """
        self.role, self.finished = role, False
        self._succession, self._membership = succession, Membership()
        self._shown, self._used, self._before = shown, used, used().cpu_seconds
        self._ports, self._clock, self._tracers, self._sinks = ports, clock, tracers, sinks
        self._sample_sinks = [sink for sink in sinks if isinstance(sink, TakesSamples)]
        self._tellers = [sink for sink in sinks if isinstance(sink, TellsStatus)]
        self._sources, self._longest_wait_s = sources, longest_wait_s
        self.turns: Turns | None = None  # that a renderer takes with others; None: it goes on as it can

    def run(self, alive: Callable[[], bool] = lambda: True) -> None:
        """Turn until the role finishes, or `alive` does not hold. Raises RunError where the role ends by a failure."""
        try:
            self._run(alive)
        except Exception as error:
            text = str(error) if isinstance(error, WallError) else traceback.format_exc()
            self._ports.note("error", text, error.replay if isinstance(error, BatchError) else None)
            raise

    def _run(self, alive: Callable[[], bool]) -> None:
        self._ports.synchronise()
        while not self.finished and alive():
            self._take_turn()
            wait_s = min(max(0.0, self.role.due - self._clock.now()), self._longest_wait_s)
            if self._tracers is not None and self._tracers.running:
                self._tracers.wait(wait_s)
            elif wait_s > 0 and not self.finished:
                self._ports.wait(wait_s)

    def _take_turn(self) -> None:
        """Turn once, alone among those who share `turns`."""
        if self.turns is None:
            self.turn()
            return
        self.turns.begin()
        try:
            self.turn()
        except BaseException:
            self.turns.end()
            raise
        hurries = isinstance(self.role, Renderer) and self.role.hurries
        self.turns.end(hold=hurries and not self.finished)

    def close(self) -> None:
        """End the threads that trace."""
        if self._tracers is not None:
            self._tracers.close()

    def turn(self) -> None:
        """Take in what came, do what is due."""
        done = self._tracers.finished() if self._tracers is not None else ()
        for message in chain(self._ports.receive(), done, *(source() for source in self._sources)):
            if isinstance(self._succession, Succession) and isinstance(message, Prepare | Adopt):
                self._succeed(self._succession, message)
            else:
                self.tell(message)
        if isinstance(self._succession, Succession):
            for answer in self._succession.answers():
                self._ports.send(MANAGER, answer)
        self._execute(self.role.on_tick(self._clock.now()))

    def _succeed(self, succession: Succession, message: Prepare | Adopt) -> None:
        """Prepare for another configuration, or become what this rank is under it."""
        if isinstance(message, Prepare):
            succession.prepare(message)
        elif (made := succession.adopt(message, self.role)) is not None:
            self.close()  # waits for the batches under way
            self.role, self._tracers = made
            self.tell(self._membership)

    def tell(self, message: Input) -> None:
        """Give the role one message."""
        if isinstance(message, Membership):
            self._membership = message
        self._execute(self.role.on_message(message, self._clock.now()))

    def _execute(self, instructions: Instructions) -> None:
        for instruction in instructions:
            for answer in self._answers(instruction):
                self.tell(answer)

    def _answers(self, instruction: Instruction) -> Sequence[Input]:
        """Carry out one instruction. Returns what the role is to hear of it."""
        match instruction:
            case Send(to, message):
                own = to == MANAGER  # what the manager passes on is of other ranks
                self._ports.send(to, self._completed(message) if own else message)
            case Broadcast(message):
                self._ports.broadcast(message)
            case Offer(to, packet):
                return [Dropped(to, dropped) for dropped in self._ports.offer(to, packet)]
            case Connect(rank, endpoint):
                self._ports.connect(rank, endpoint)
            case Admit(rank, key):
                self._ports.admit(rank, key)
            case Trace():
                assert self._tracers is not None
                return self._tracers.start(instruction)
            case Restart():
                assert self._tracers is not None
                self._tracers.restart(instruction)
            case Reassign(regions):
                assert self._tracers is not None
                self._tracers.reassign(regions)
            case Make(wanted):
                assert isinstance(self._succession, Preparer)
                self._succession.begin(wanted)
            case Show(images, status):
                for sink, image in zip(self._sinks, images, strict=True):
                    if sink is not None:
                        sink.show(image, status)
                if self._shown is not None:
                    self._shown(images, status)
                return [Presented(any(sink.wants_samples for sink in self._sample_sinks))]
            case Tell(status):
                for teller in self._tellers:
                    teller.tell(status)
            case Finish(failure):
                self.finished = True
                if failure:
                    raise RunError(failure)
        return ()

    def _completed(self, message: Message) -> Message:
        """A heartbeat of this rank with what its role cannot know: memory, CPU time, credit, drops outside it."""
        if not isinstance(message, Heartbeat):
            return message
        dropped = self._ports.drops()
        dropped.update(message.dropped)
        for sink in {id(sink): sink for sink in self._sinks if sink is not None}.values():
            dropped.update(sink.dropped())
        used = self._used()
        return replace(
            message, process=used.process, memory=used.memory, peak_memory=used.peak_memory,
            cpu_seconds=used.cpu_seconds - self._before, dropped=dict(+dropped), credit=self._ports.credit(),
        )  # fmt: skip
