"""The log of a run: what ranks and the run have to tell, gathered at the head.

OUT/log/rank-N.jsonl has a line of JSON for each note of rank N: time (UTC), rank, host, level, message, and for a batch
that failed `replay`, by which `wall replay` finds it. A file that has grown to MOST_BYTES becomes rank-N.1.jsonl, in
the place of the one before. Files of earlier runs are gone on with.
"""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from wall.packets.notes import Note

FOLDER = "log"
MOST_BYTES = 1 << 20  # of a file; of a rank twice as much
MOST_WAITING = 1024  # notes that wait for a slow disk
CLOSE_S = 2.0  # for these at the end


class Journal:
    """Writes notes in a thread of its own: nobody waits for the disk."""

    def __init__(self, out: Path, host_of: Callable[[int], str], *, most_bytes: int = MOST_BYTES) -> None:
        """`out`: folder of results; `host_of`: a rank's host, "" where it is not known."""
        self._folder, self._host_of, self._most_bytes = out / FOLDER, host_of, most_bytes
        self.failure, self.dropped = "", 0  # why nothing can be written, "" while it can; notes that found no room
        self._waiting: queue.Queue[tuple[int, str] | None] = queue.Queue(MOST_WAITING)
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def take(self, note: Note) -> None:
        """Write a note soon; one that finds too many before it is dropped and counted."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        line = {"time": now, "rank": note.rank, "host": self._host_of(note.rank), "level": note.level}
        line |= {"message": note.text} | ({"replay": note.replay} if note.replay else {})
        try:
            self._waiting.put_nowait((note.rank, json.dumps(line) + "\n"))
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Write what waits, within CLOSE_S."""
        try:
            self._waiting.put(None, timeout=CLOSE_S)
        except queue.Full:
            return  # the disk does not answer
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        while (taken := self._waiting.get()) is not None:
            try:
                self._write(*taken)
            except OSError as error:
                self.failure = self.failure or f"{self._folder}: {error.strerror or error}"

    def _write(self, rank: int, line: str) -> None:
        path = self._folder / f"rank-{rank}.jsonl"
        self._folder.mkdir(exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(line)
            size = file.tell()
        if size >= self._most_bytes:
            path.replace(path.with_suffix(".1.jsonl"))
