"""What a rank has to tell people: a message to the manager, for the terminal, the page and the log."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Literal

MOST_BYTES = 15_000  # of a text in JSON, so that the message fits
REFUSED = "refused: "  # how a note on an edit of a viewer begins
LEVELS = ("info", "warning", "error")
Level = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """info: for the log; warning: also for the terminal and the page; error: the rank ends by it, and prints it."""

    rank: int
    level: str  # one of LEVELS
    text: str
    replay: dict[str, int] = field(default_factory=dict)  # of a batch that failed: what finds it in a recorded run

    @property
    def said(self) -> str:
        """The text, and whose it is: what rank 0 tells is of the run."""
        return f"rank {self.rank}: {self.text}" if self.rank else self.text


def note_of(rank: int, level: Level, text: str, replay: dict[str, int] | None = None) -> Note:
    """A note that can be sent: of a text that is too long its end, which says most of a traceback."""
    sendable = text.encode(errors="replace").decode()
    sendable = sendable[-MOST_BYTES:]
    while len(json.dumps(sendable)) > MOST_BYTES:
        sendable = sendable[1 + len(sendable) // 8 :]
    return Note(rank=rank, level=level, text=sendable, replay=replay or {})
