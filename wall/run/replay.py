"""Replay a recorded renderer: its role, its workers and its loop, told what they were told in the run.

The samples have the same bits, whatever the sampler, as the roles read clocks and messages from the file alone. Every
batch is compared with the checksum that the run kept of it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from wall.config.loading import loads
from wall.core.data import Batch, Event
from wall.core.errors import ConfigError, RunError
from wall.packets.control import Hello, Message, parse_control
from wall.packets.samples import decode
from wall.roles.instructions import Input, Trace
from wall.roles.plan import Plan, make_layout, make_plan
from wall.roles.renderer import Renderer
from wall.roles.renderer_image import image_at
from wall.run.clock import HeadClock
from wall.run.event_file import EndOfFileError, EventReader, checksum
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.run.recording import FORMAT, RUN, file_of
from wall.run.tracers import Tracers
from wall.tracing.tracer_scene import TracerScene


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recorded run."""

    folder: Path
    plan: Plan
    ranks: tuple[int, ...]  # that were recorded
    missing: tuple[int, ...]  # renderers of the run whose files are not there
    version: str  # of the program that ran

    def lives(self, rank: int) -> tuple[int, ...]:
        """How often the rank was started before, for each of its files."""
        return _lives(self.folder, rank)


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """What came of a rank's replay."""

    rank: int
    life: int  # how often it was started before
    batches: int  # that had the same bits as in the run
    samples: int  # in them
    seconds: float  # of the run


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayedBatch:
    """One batch of a replay."""

    number: int
    worker: int
    event: Event  # that it was to be traced under
    batch: Batch | None  # None: nothing was missing, or nothing is to be shown yet


def open_recording(folder: Path) -> Recorded:
    """Load the wall of a recording. Raises ConfigError for what is none, or of another format."""
    try:
        about = json.loads((folder / RUN).read_text(encoding="utf-8"))
        if about["format"] != FORMAT:
            raise ConfigError(f"{folder / RUN}: format {about['format']}; accepted: {FORMAT}")
        path, version = Path(about["path"]), str(about["wall"])
        loaded = loads(about["config"], name=str(folder / RUN), path=path)
        layout = make_layout(loaded)
        layers = {index: layout.graph.layers[index].ranks[0] for index in about["at_renderers"]}
        ranks = tuple(rank for rank in about["renderers"] if _lives(folder, rank))
    except FileNotFoundError:
        raise ConfigError(f"{folder}: no {RUN} there; wanted a folder that `wall run --record` wrote") from None
    except OSError as error:
        raise ConfigError(f"{folder / RUN}: cannot be read ({error.strerror or error})") from error
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise ConfigError(f"{folder / RUN}: not what `wall run --record` wrote ({error!r})") from error
    if not ranks:
        raise ConfigError(f"{folder}: no rank-N.events there; wanted those that `wall run --record` wrote")
    layout = replace(layout, graph=layout.graph.reconstructed_at(layers))
    missing = tuple(rank for rank in layout.renderers() if rank not in ranks)
    return Recorded(folder=folder, plan=make_plan(layout), ranks=ranks, missing=missing, version=version)


def _lives(folder: Path, rank: int) -> tuple[int, ...]:
    """As Recorded.lives; a rank may die before its first file is there."""
    later = (path.suffixes[0][1:] for path in folder.glob(f"rank-{rank}.*.events"))
    first = (0,) if file_of(folder, rank).exists() else ()
    return (*first, *sorted(int(life) for life in later if life.isdecimal()))


def replay_rank(recorded: Recorded, scene: TracerScene, rank: int, life: int = 0) -> Replayed:
    """Replay all of a rank; `life`: how often it was started before.

    Raises RunError where it does otherwise than in the run.
    """
    try:
        replay = _Replay(recorded, scene, rank, life)
    except EndOfFileError:  # it was ended before anything was written
        return Replayed(rank=rank, life=life, batches=0, samples=0, seconds=0.0)
    replay.run()
    first, last = replay.events.seconds
    return Replayed(
        rank=rank,
        life=life,
        batches=replay.events.batches,
        samples=replay.renderer.done.samples,
        seconds=last - first,
    )


def replay_batch(recorded: Recorded, scene: TracerScene, rank: int, number: int, life: int = 0) -> ReplayedBatch:
    """Replay a rank up to one of its batches. Raises RunError where the recording has none of that number."""
    replay = _Replay(recorded, scene, rank, life, wanted=number)
    replay.run()
    if replay.found is None:
        file = file_of(recorded.folder, rank, life)
        raise RunError(f"{file}: ends at batch {replay.events.batches - 1}; wanted {number}")
    return replay.found


def recorded_events(recorded: Recorded, view: int) -> tuple[list[Event], float]:
    """The events of a view in the order of their times, and when the run ended; all seconds of the head's clock.

    Raises RunError where no renderer of that view was recorded.
    """
    ranks = [rank for rank in recorded.ranks if view in recorded.plan.layout.views_of(rank)]
    if not ranks:
        name = recorded.plan.layout.config.views[view].id
        raise RunError(f"{recorded.folder}: no renderer of view {name} is there; wanted its rank-N.events, or --view")
    events, end = {}, 0.0
    for rank in ranks:
        for life in recorded.lives(rank):
            reader = EventReader(file_of(recorded.folder, rank, life))
            for message in map(parse_control, reader.messages()):
                if isinstance(message, Event) and message.view == view:
                    events[message.number] = message
            end = max(end, reader.seconds[1])
    return sorted(events.values(), key=lambda event: (event.input_time, event.number)), end


class _FoundError(Exception):
    """The batch that was wanted is there."""


class _Replay:
    def __init__(
        self, recorded: Recorded, scene: TracerScene, rank: int, life: int, *, wanted: int | None = None
    ) -> None:
        self._life = life
        self.rank, self.folder, self._wanted, self._version = rank, recorded.folder, wanted, recorded.version
        self.found: ReplayedBatch | None = None
        self.events = EventReader(file_of(recorded.folder, rank, life))
        plan = replace(recorded.plan, cores=self.events.cores())
        hello = parse_control(self.events.message() or b"")
        assert isinstance(hello, Hello)
        clock, ports = ReplayedClock(self.events), ReplayedPorts(rank, self.events)
        image = image_at(plan, rank, ports.ready, clock, ports.shares)
        tracers = Tracers(plan, scene, rank, clock, threads=False, image=image, traced=self._compare)
        self.renderer = Renderer(plan, hello, ports.ready, image)
        self._loop = Loop(self.renderer, ports, clock, tracers=tracers)

    def run(self) -> None:
        with suppress(EndOfFileError, _FoundError):  # a rank that was ended at once says no last words
            self._loop.run()

    def _compare(self, number: int, trace: Trace, result: bytes | Batch | None) -> None:
        if number == self._wanted:
            batch = (decode(result) if result else None) if isinstance(result, bytes) else result
            self.found = ReplayedBatch(number=number, worker=trace.worker, event=trace.event, batch=batch)
            raise _FoundError
        recorded, crc = self.events.batch()
        if (number, checksum(result)) != (recorded, crc):
            life = f"@{self._life}" if self._life else ""
            raise RunError(
                f"rank {self.rank}, batch {number}{life}: other samples than in the run, which wall {self._version} "
                f"recorded to {self.folder}; wanted: the program, the scene and a processor as of the run"
            )


class ReplayedClock:
    """Gives the readings of the run."""

    def __init__(self, events: EventReader) -> None:
        self._events = events

    def now(self) -> float:
        """Seconds of the head's clock, as they were read in the run."""
        return self._events.time()


class ReplayedPorts(Ports):
    """Tells a renderer's role what it was told in the run. What it says goes nowhere."""

    def __init__(self, rank: int, events: EventReader) -> None:
        super().__init__(rank, HeadClock(), hub=None)
        self._events = events

    def receive(self) -> Iterator[Input]:
        """What came in the run."""
        while (data := self._events.message()) is not None:
            message = parse_control(data)
            assert isinstance(message, Message)
            yield message

    def offer(self, to: int, packet: bytes) -> list[bytes]:
        """Those that gave way in the run."""
        return self._events.dropped()

    def ready(self, to: int) -> bool:
        """What was answered in the run."""
        return self._events.answer()

    def shares(self, to: int, size: int) -> bool:
        """What was answered in the run."""
        return self._events.answer()

    def connect(self, rank: int, endpoint: str) -> None:
        """Connect to nobody."""

    def wait(self, seconds: float) -> None:
        """Wait for nothing."""
