"""The head's process: the manager in a thread of its own, a compositor with the sinks and the page, the summary."""

from __future__ import annotations

import json
import os
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wall.core.errors import WallError
from wall.display.base import Sink, Status, WallImage
from wall.display.files import replaced
from wall.display.image_log import ImageLog
from wall.display.saving import Saver
from wall.packets.control import Hello
from wall.packets.notes import Level, note_of
from wall.roles.compositor import Compositor
from wall.roles.instructions import MANAGER, Died, End, Invitation
from wall.roles.legacy import inherit, legacy_of, plan_after
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan
from wall.roles.status import summary_of
from wall.run.bootstrap import Bootstrap
from wall.run.clock import HeadClock
from wall.run.control_file import NAME as CONTROL_FILE
from wall.run.control_file import Control, announced, new_key
from wall.run.deaths import Deaths
from wall.run.endings import EndSignals, WriterApart
from wall.run.joined import Inviter
from wall.run.journal import Journal
from wall.run.loop import Loop, Source
from wall.run.ports import Ports
from wall.run.ranks import compositor_loop, hello_of, open_data_hub, told_again, ways_of
from wall.run.served_elsewhere import ServedElsewhere
from wall.run.sinks import (
    PageAt,
    distinct,
    make_metrics_server,
    make_sinks,
    notes_of,
    page_answers,
    save_images,
    window_input_of,
)
from wall.run.standby import Estate, StandbyBootstrap, Where
from wall.run.succession import FileWatch, Preparer
from wall.run.tracker_input import TrackerInput
from wall.run.usage import cpu_seconds
from wall.transport.factory import LOOPBACK
from wall.transport.shared_memory import machine_id

INPUT_POLL_S = 0.004  # a quarter of a 60 Hz refresh: how long a viewer's command may wait
STOP_WAIT_S = 6.0  # for the manager to end the run in all its steps
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line adds to a configuration."""

    out: Path
    seconds: float | None = None  # None: until stopped
    headless: bool = False  # no browser page
    until_complete: bool = False  # stop when the still image has all its samples
    still: bool = False  # begin paused
    record: Path | None = None  # folder that keeps what renderers are told, for a replay
    images: Path | None = None  # folder that keeps every image shown
    watch: bool = False  # adopt the configuration's file again whenever it changes


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a run."""

    summary: dict[str, Any]
    failed: str  # why the run failed, "" if it did not


class Closing(ExitStack):
    """Closes what was opened, the newest first. What cannot be closed in order keeps nothing else from being closed."""

    def __init__(self) -> None:
        super().__init__()
        self.failures: list[str] = []

    def later(self, close: Callable[[], object]) -> None:
        """Call `close` at the end; its error is kept in `failures`."""
        self.callback(self._close, close)

    def _close(self, close: Callable[[], object]) -> None:
        try:
            close()
        except (WallError, OSError) as error:
            self.failures.append(str(error))


class HeadProcess:
    """Rank 0 of a run, from its hubs to its summary."""

    def __init__(self, plan: Plan, bootstrap: Bootstrap, preparer: Preparer, options: Options) -> None:
        self._plan, self._bootstrap, self._preparer, self._options = plan, bootstrap, preparer, options
        self._clock, self._cpu = HeadClock(), cpu_seconds()
        self._began = self._clock.now()
        self._ends: deque[End | Died] = deque()
        self._manager: Manager | None = None
        self._loop: Loop | None = None  # of the compositor
        self._dead = Deaths(self._start_again)
        self._address: dict[str, str] = {}  # what ranks are told when they start
        self._inviter = Inviter(preparer.machines, bootstrap.keys, headless=options.headless)
        self._sinks: list[Sink] = []
        self._signals, self._told = EndSignals(self._end), ""  # why this process was first told to end
        self._apart = WriterApart(self._save)
        self._managed = False
        self.failures: list[str] = []
        self.summary: dict[str, Any] | None = None  # None: the run did not even begin

    def run(self, say: Say, opened: Say) -> None:
        """Open everything, run both loops, close everything."""
        with Closing() as closing:
            self.failures = closing.failures
            closing.callback(self._signals.restore)
            self._run(closing, say, opened)

    def _run(self, closing: Closing, say: Say, opened: Say) -> None:
        plan, options, clock = self._plan, self._options, self._clock
        trackers = TrackerInput(lambda: self._manager.plan if self._manager is not None else plan, clock, say)
        closing.later(trackers.close)
        standby = self._bootstrap if isinstance(self._bootstrap, StandbyBootstrap) else None
        before = standby.estate if standby is not None else None
        key, keys = standby.key if standby is not None else new_key(), self._bootstrap.keys
        with_guests = None if keys is None else keys.with_guests(key)
        control = open_data_hub(plan, with_guests, again=before.where.endpoint if before is not None else "")
        manager_ways = Ports(MANAGER, clock, hub=control)
        closing.later(manager_ways.close)
        elsewhere = not options.headless and plan.layout.graph.page_rank != HEAD
        address = {"manager": control.endpoint, "machine": machine_id()} | ({"key": key} if elsewhere else {})
        self._bootstrap.broadcast(json.dumps(address))
        self._address = address
        journal = Journal(options.out, self._host_of)
        closing.callback(self._close_journal, journal, say)
        self._log_begin(journal)
        data = open_data_hub(plan, keys)
        ways = ways_of(plan, self._bootstrap, address, clock, data)
        closing.later(ways.close)
        closing.later(self._end_ranks)
        closing.later(self._write_last_summary)
        sinks, browser = make_sinks(
            plan, HEAD, options.out, headless=options.headless, again=before is not None,
            page=before.where.page if before is not None else None,
        )  # fmt: skip
        self._sinks = distinct(sinks)
        for sink in self._sinks:
            closing.later(sink.close)
        for note in (*notes_of(sinks), *(browser.notes if browser else ())):
            say(f"note: {note}")
        if browser and browser.watch_address:
            say(f"note: to watch the wall without steering it: {browser.watch_address}")
        log = ImageLog(options.images) if options.images is not None else None
        if log is not None:
            closing.later(log.close)
        metrics = make_metrics_server(plan, before.where.metrics if before is not None else None)
        if metrics is not None:
            closing.later(metrics.close)
            say(f"note: metrics at {metrics.address}")

        def shown(images: Sequence[WallImage], status: Status) -> None:
            if log is not None:
                log.take(images, clock.now())
            if metrics is not None:
                metrics.tell(status)

        closing.later(self._apart.wait)
        page_elsewhere = ServedElsewhere(self._page_server, say, opened, announces=before is None)
        self._loop = loop = compositor_loop(
            plan, hello_of(HEAD, data.endpoint), data, ways, clock, sinks, self._preparer, [page_elsewhere.look],
            shown=shown,
        )  # fmt: skip
        began = clock.now()
        self._manager = Manager(
            plan, began, still=options.still, seconds=options.seconds, until_complete=options.until_complete, key=key,
            fixed="its events are recorded" if options.record is not None else "",
        )  # fmt: skip
        if standby is not None and before is not None:
            inherit(self._manager, before.legacy, standby.how)
            if isinstance(loop.role, Compositor):
                loop.role.run_began = before.legacy.began
        if log is not None:
            log.begin(began=began, display_delay_s=plan.view.display_delay_s)

        def tell() -> tuple[()]:
            assert self._manager is not None
            for note in self._manager.register.take_notes():
                journal.take(note)
                if note.level == "warning":
                    say(f"note: {note.said}")
            return ()

        closing.callback(tell)
        sources: list[Source] = [
            window_input_of(HEAD, sinks, key), self._take_ends, self._deaths, self._preparer.news, trackers.receive,
            tell,
        ]  # fmt: skip
        manager_ways.answer_page = page_answers(sinks)
        manager_ways.page_rank = plan.layout.graph.page_rank if elsewhere else None
        if not control.endpoint.startswith(LOOPBACK):
            sources.append(self._invitations)
        page = browser.address if browser else ""
        if standby is not None:
            page_at = PageAt(page, browser.tokens) if browser else None
            metrics_at = PageAt(metrics.address, metrics.tokens) if metrics is not None else None
            where = Where(json.dumps(address), control.endpoint, page_at, metrics_at)
            sources.append(partial(self._leave, standby, where))
        if options.watch:
            sources.append(FileWatch(plan.layout.loaded.path).changes)
        managing = ManagerThread(
            Loop(
                self._manager, manager_ways, clock, sources=sources, longest_wait_s=INPUT_POLL_S,
                succession=self._preparer,
            )
        )  # fmt: skip
        self._signals.install()
        closing.later(Saver(self._save_summary).close)
        served = browser or metrics
        with self._reachable(control.endpoint, key, served.address if served else "") as page_elsewhere.write:
            if before is None and not elsewhere:
                opened(page)
            managing.start()
            self._managed = True  # it tells ranks to end
            try:
                loop.run(alive=managing.is_alive)
            except BaseException:
                self._ends += [Died(HEAD, "an error"), End("the head's compositor failed")]
                raise
            finally:
                managing.join(STOP_WAIT_S)
                if standby is not None:
                    standby.end()
        if managing.failure is not None:
            self.failures.append(f"the manager failed: {managing.failure!r}")

    def _leave(self, standby: StandbyBootstrap, where: Where) -> tuple[()]:
        """Write down what the next head needs, should this one die."""
        assert self._manager is not None
        manager = self._manager
        lacks = standby.leave(lambda before: Estate(where=where, legacy=legacy_of(manager, before)))
        if lacks:
            manager.register.news.append(note_of(HEAD, "warning", lacks))
        return ()

    def _page_server(self) -> Hello | None:
        return None if self._manager is None else self._manager.page_server

    def _reachable(self, endpoint: str, key: str, page: str) -> AbstractContextManager[Callable[[str], None] | None]:
        """While inside, other processes find the manager; gives what tells them of a page that comes later."""
        if endpoint.startswith(LOOPBACK):
            return nullcontext()
        keys = self._bootstrap.keys
        head = keys.ranks[HEAD] if keys is not None else ""
        host = socket.gethostname()
        here = Control(endpoint=endpoint, key=key, head=head, host=host, pid=os.getpid(), page=page)
        return announced(self._options.out, here)

    def _host_of(self, rank: int) -> str:
        """The host of a rank; "" where it is not known."""
        if rank == HEAD:
            return socket.gethostname()
        member = self._manager.register.members.get(rank) if self._manager is not None else None
        return member.host if member is not None else ""

    def _log_begin(self, journal: Journal) -> None:
        layout = self._plan.layout
        text = f"wall {version('wall')} begins: {layout.loaded.path}, {layout.size} ranks, process {os.getpid()}"
        journal.take(note_of(HEAD, "info", text))

    def _close_journal(self, journal: Journal, say: Say) -> None:
        """Write the last line of a run's log: how it ended."""
        ended = (self._manager.ended if self._manager is not None else "") or self._told or "interrupted"
        failed = self._failed
        level: Level = "error" if failed else "info"
        journal.take(note_of(HEAD, level, f"ended: {ended}" + (f"; {failed}" if failed else "")))
        journal.close()
        if journal.failure or journal.dropped:
            say(f"note: the log is not complete: {journal.failure or f'{journal.dropped} notes found no room'}")

    def _take_ends(self) -> list[End | Died]:
        return [self._ends.popleft() for _ in range(len(self._ends))]

    def _deaths(self) -> Iterator[Died]:
        if self._manager is None or self._manager.ended:
            most = 0
        else:
            most = self._manager.plan.layout.config.transport.restarts
        given = self._manager.joining.ranks if self._manager is not None else ()  # whose place others have by now
        dead = {rank: how for rank, how in self._bootstrap.dead().items() if rank not in given}
        return self._dead.news(dead, most, self._clock.now())

    def _invitations(self) -> Iterator[Invitation]:
        assert self._manager is not None
        return self._inviter.look(self._manager.plan)

    def _end_ranks(self) -> None:
        self._bootstrap.finish(told=self._managed)

    def _start_again(self, rank: int, life: int) -> bool:
        """Start a rank again that died. Returns whether that was tried."""
        assert self._manager is not None
        return self._bootstrap.start_again(rank, told_again(self._address, self._manager.newest_plan, life=life))

    def _end(self, reason: str) -> None:
        """This process was told to end. Called between two steps of the main thread."""
        self._told = self._told or reason
        self._ends.append(End(reason))
        if self._bootstrap.killed_soon:
            self._apart.begin()

    def _save(self) -> None:
        """Write the results as they are, in a copy of this process, which is killed soon."""
        (self._options.out / CONTROL_FILE).unlink(missing_ok=True)
        save_images(self._sinks)
        self._save_summary()

    def _save_summary(self) -> None:
        if (summary := self._summary(self._told or "running")) is not None:
            self._write(summary)

    def _write_last_summary(self) -> None:
        self.summary = self._summary("interrupted")
        if self.summary is not None:
            self._write(self.summary)  # what fails here is kept by Closing

    def _write(self, summary: dict[str, Any]) -> None:
        with replaced(self._options.out / "summary.json") as part:
            part.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")

    def _summary(self, ended: str) -> dict[str, Any] | None:
        """None before the run began. `ended`: how, where the manager has not decided that."""
        if self._manager is None or self._loop is None:
            return None
        assert isinstance(self._loop.role, Compositor)
        now = self._clock.now()
        seconds, own = now - self._manager.began, now - self._began  # of the run, of this head
        cores = (cpu_seconds() - self._cpu) / max(own, 1e-3)
        return summary_of(self._manager, self._loop.role, now=now, seconds=seconds, cores=cores, ended=ended)

    def outcome(self) -> Outcome:
        """The outcome of a run that began."""
        assert self.summary is not None
        return Outcome(summary=self.summary, failed=self._failed)

    @property
    def _failed(self) -> str:
        """What went wrong so far: ranks that are missed, and failures here; "" if nothing did."""
        manager = self._manager
        missed = manager.register.missed(manager.heartbeats.copy()) if manager is not None else {}
        return "; ".join([*(f"rank {rank} {how}" for rank, how in sorted(missed.items())), *self.failures])


def lead(plan: Plan, bootstrap: Bootstrap, preparer: Preparer, options: Options, say: Say, opened: Say) -> Outcome:
    """Be the head. Whatever fails, everything is closed, and what came is written."""
    if isinstance(bootstrap, StandbyBootstrap) and bootstrap.estate is not None:
        legacy = bootstrap.estate.legacy
        if legacy.number:
            plan, _ = preparer.make(legacy.number, legacy.text, legacy.path)
        plan = plan_after(plan, legacy)
    head = HeadProcess(plan, bootstrap, preparer, options)
    try:
        head.run(say, opened)
    except WallError as error:
        if head.summary is None:
            raise
        head.failures.append(str(error))
    return head.outcome()


class ManagerThread(threading.Thread):
    """The manager's loop beside the compositor's: events go out while images are made."""

    def __init__(self, loop: Loop) -> None:
        super().__init__(name="manager", daemon=True)
        self._loop = loop
        self.failure: BaseException | None = None

    def run(self) -> None:
        """Turn the loop until it is finished, and keep its failure."""
        try:
            self._loop.run()
        except BaseException as failure:
            self.failure = failure
