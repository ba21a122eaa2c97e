"""Record a run's renderers: what each is told goes to a file of its own, see event_file.py.

FOLDER/run.json says which wall was run, FOLDER/rank-N.events what rank N was told, and rank-N.1.events what it was told
after it had died and was started again. `wall replay FOLDER` reads them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from wall.config.loading import dump
from wall.core.clock import Clock
from wall.core.errors import ConfigError, RunError
from wall.display.files import replaced
from wall.packets.control import Hello, Message, serialise
from wall.roles.instructions import Input
from wall.roles.plan import Plan
from wall.run.clock import HeadClock
from wall.run.event_file import EventFile
from wall.run.ports import Ports
from wall.transport.base import Link
from wall.transport.curve import Keys

FORMAT = 2
RUN = "run.json"


def file_of(folder: Path, rank: int, life: int = 0) -> Path:
    """What a rank was told; `life`: how often it was started before."""
    return folder / (f"rank-{rank}.{life}.events" if life else f"rank-{rank}.events")


def check_unused(folder: Path) -> None:
    """Raises ConfigError where a run was recorded already: it is not replaced."""
    if (folder / RUN).exists():
        raise ConfigError(f"--record {folder}: a run is recorded there already; wanted: another folder")


def begin_recording(folder: Path, plan: Plan) -> None:
    """Say which wall is run. Raises RunError where that cannot be done."""
    layout = plan.layout
    about = {
        "format": FORMAT,
        "wall": version("wall"),
        "config": dump(layout.config),
        "path": str(layout.loaded.path.absolute()),
        "at_renderers": [layer.index for layer in layout.graph.layers if layer.at_renderer],
        "renderers": list(layout.renderers()),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replaced(folder / RUN) as part:
            part.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise RunError(f"events cannot be recorded to {folder}: {error.strerror or error}") from error


class RecordedClock:
    """A clock whose readings are kept."""

    def __init__(self, clock: Clock, events: EventFile) -> None:
        self._clock, self._events = clock, events

    def now(self) -> float:
        """Seconds of the head's clock."""
        seconds = self._clock.now()
        self._events.time(seconds)
        return seconds


class RecordedPorts(Ports):
    """Ports of a renderer; all that they tell its role is kept."""

    def __init__(
        self, hello: Hello, clock: HeadClock, manager: Link, ping_s: float | None, events: EventFile,
        *, keys: Keys | None, heartbeat_s: float | None = None,
    ) -> None:  # fmt: skip
        super().__init__(
            hello.rank, clock, hub=None, manager=manager, ping_s=ping_s, keys=keys, heartbeat_s=heartbeat_s
        )
        self._events = events
        events.message(serialise(hello))

    def receive(self) -> Iterator[Input]:
        """What came from the manager."""
        for message in super().receive():
            assert isinstance(message, Message)  # without a hub no packets come
            self._events.message(serialise(message))
            yield message
        self._events.no_more()
        self._pass_on()

    def offer(self, to: int, packet: bytes) -> list[bytes]:
        """Send a packet for credit. Returns those that gave way."""
        dropped = super().offer(to, packet)
        self._events.dropped(dropped)
        return dropped

    def ready(self, to: int) -> bool:
        """Whether a packet to a rank would be sent at once."""
        yes = super().ready(to)
        self._events.answer(yes)
        return yes

    def shares(self, to: int, size: int) -> bool:
        """Whether packets of so many bytes to a rank go through shared memory."""
        yes = super().shares(to, size)
        self._events.answer(yes)
        return yes

    def close(self) -> None:
        """Write the rest of what is recorded; close all ways."""
        self._events.close()
        self._pass_on()
        super().close()

    def _pass_on(self) -> None:
        note, self._events.note = self._events.note, ""
        if note:
            self.note("warning", note)
