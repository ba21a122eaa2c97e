"""Record what the wall shows as numbered JPEG files with an index.

An image is recorded when a period has passed and something changed. Composing, compressing and writing happen in the
recorder's own thread; when that falls behind, images are dropped and counted.
"""

from __future__ import annotations

import json
import queue
import threading
from pathlib import Path
from typing import TextIO

import simplejpeg

from wall.core.errors import RunError, WallError
from wall.display.base import Status, WallImage
from wall.display.png import make_folder, whole_wall

QUALITY = 90  # JPEG: no blocks to be seen on rendered edges, a seventh of the PNG's bytes
QUEUE_IMAGES = 4  # a slow disk may lag this far; each holds a whole wall in memory
CLOSE_S = 5.0  # what waits in the queue is still written, a disk that hangs is left behind
ROUNDING_S = 1e-4  # a display at exactly the recorder's rate must not lose images to rounding

_Taken = tuple[WallImage, tuple[float, float, float]]


class Recorder:
    """At most `hz` images a second: FOLDER/000000.jpg, 000001.jpg, ... and FOLDER/index.jsonl.

    A line of the index holds `file`, `time` (seconds of the head's clock), `camera_event`, `scene_event` and
    `latency_ms` [p50, p95, p99]. An earlier recording in the folder is replaced, or resumed.
    """

    def __init__(self, folder: Path, *, hz: float, resume: bool = False) -> None:
        """`resume`: go on with the folder's recording. Raises RunError when the folder cannot be created or written."""
        make_folder(folder)
        path = folder / "index.jsonl"
        try:
            kept = _whole_lines(path) if resume else []
            for old in folder.glob("[0-9]*.jpg"):
                if not old.stem.isdecimal() or int(old.stem) >= len(kept):
                    old.unlink()
            self._number = len(kept)
            self._index: TextIO = path.open("w", encoding="utf-8")
            self._index.writelines(kept)
            self._index.flush()
        except OSError as error:
            raise RunError(f"cannot record to {folder}: {error.strerror or error}") from error
        self._folder, self._period = folder, 1.0 / hz
        self._due = float("-inf")
        self._seen: tuple[int, ...] = ()
        self._queue: queue.Queue[_Taken | None] = queue.Queue(QUEUE_IMAGES)
        self._behind = self._unwritten = 0
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._write_all, name="recorder", daemon=True)
        self._thread.start()

    def show(self, image: WallImage, status: Status) -> None:
        """Queue the image if a period has passed and a panel changed."""
        versions = tuple(panel.version for panel in image.panels)
        if image.time < self._due - ROUNDING_S or versions == self._seen:
            return
        late = image.time - self._due
        self._due = self._due + self._period if late < self._period else image.time + self._period
        self._seen = versions
        try:
            self._queue.put_nowait((image, status.latency_ms))
        except queue.Full:
            self._behind += 1

    def close(self) -> None:
        """Write what waits, at most CLOSE_S long. Raises RunError if images could not be written."""
        if not self._thread.is_alive():
            return
        try:
            self._queue.put(None, timeout=CLOSE_S)
        except queue.Full:
            self._failure = self._failure or OSError(f"the disk did not answer for {CLOSE_S:g} s")
        else:
            self._thread.join(CLOSE_S)
        if self._failure is not None:
            why = getattr(self._failure, "strerror", None) or self._failure
            raise RunError(f"{self._folder}: {self._unwritten} images could not be recorded: {why}")

    def dropped(self) -> dict[str, int]:
        """Images that the queue had no room for or that could not be written, by name."""
        counts = {"recorder_behind": self._behind, "recorder_unwritten": self._unwritten}
        return {name: n for name, n in counts.items() if n}

    def _write_all(self) -> None:
        with self._index:
            while (taken := self._queue.get()) is not None:
                try:
                    self._write(self._number, *taken)
                    self._number += 1
                except (OSError, ValueError, WallError) as error:  # ValueError: too wide for a JPEG
                    self._unwritten += 1
                    self._failure = self._failure or error

    def _write(self, number: int, image: WallImage, latency_ms: tuple[float, float, float]) -> None:
        name = f"{number:06d}.jpg"
        jpeg = simplejpeg.encode_jpeg(whole_wall(image), QUALITY, "RGB", "444", True)
        (self._folder / name).write_bytes(jpeg)
        line = {
            "file": name,
            "time": image.time,
            "camera_event": image.camera_event,
            "scene_event": image.scene_event,
            "latency_ms": list(latency_ms),
        }
        self._index.write(json.dumps(line) + "\n")
        self._index.flush()


def _whole_lines(path: Path) -> list[str]:
    """The lines of an index; one that was not finished is left out."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []
    return [line for line in lines if line.endswith("\n")]
