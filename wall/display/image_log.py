"""Keep every image that the head shows, lossless, with the moment it was shown: `wall run --images FOLDER`.

FOLDER/images.raw holds the panels one after the other, each h * w * 3 bytes of sRGB, only those that changed.
FOLDER/index.jsonl holds a first line about the run, a line for each panel kept, and a last line with what keeping cost.
Images are appended by the thread that shows them, without compression: a copy to the file system's cache.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.errors import ConfigError, RunError
from wall.display.base import PanelImage, WallImage
from wall.display.png import make_folder

PIXELS, INDEX = "images.raw", "index.jsonl"
MOST_BYTES = 8 << 30  # of a log: three minutes of the demo's wall at 30 Hz


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedPanel:
    """One panel's image in a log: a line of the index, keys in this order."""

    time: float  # when the sinks had been given it, seconds of the head's clock
    refresh: float  # when its refresh began
    panel: str
    version: int
    screen: tuple[int, int]  # x, y of its top left pixel in the virtual screen
    size: tuple[int, int]  # width, height
    offset: int  # of its first byte in the file of pixels
    camera_event: int  # the newest event then
    scene_event: int
    scene_time: float  # of that event, seconds


class ImageLog:
    """Appends what is shown. Where the disk is full, or the log too large, it stops; `close` says so."""

    def __init__(self, folder: Path, *, most_bytes: int = MOST_BYTES) -> None:
        """Replaces a log that is in the folder. Raises RunError where it cannot be written."""
        make_folder(folder)
        try:
            self._index = (folder / INDEX).open("w", encoding="utf-8")
            self._pixels = (folder / PIXELS).open("wb", buffering=0)
        except OSError as error:
            raise RunError(f"cannot keep images in {folder}: {error.strerror or error}") from error
        self._folder, self._most_bytes = folder, most_bytes
        self._kept: dict[str, tuple[int, int]] = {}  # by panel: the sink whose image of it is kept, its version
        self._bytes, self._lost, self._cpu_s = 0, 0, 0.0
        self._failure = ""

    def begin(self, *, began: float, display_delay_s: float) -> None:
        """Say when the animation began (its time 0 on the head's clock), and how long after a refresh light comes."""
        self._line({"format": 1, "began": began, "display_delay_s": display_delay_s})

    def take(self, images: Sequence[WallImage], now: float) -> None:
        """Keep the panels that changed. `images`: one a sink, of which the first that has a panel speaks for it."""
        started = time.thread_time()
        for number, image in enumerate(images):
            for panel in image.panels:
                sink, version = self._kept.get(panel.id, (number, -1))
                if sink == number and version != panel.version:
                    self._kept[panel.id] = (number, panel.version)
                    self._keep(panel, image, now)
        self._cpu_s += time.thread_time() - started

    def close(self) -> None:
        """Finish the files. Raises RunError if an image could not be kept."""
        if self._index.closed:
            return
        try:
            self._line({"end": True, "bytes": self._bytes, "lost": self._lost, "cpu_s": round(self._cpu_s, 6)})
            self._index.close()
            self._pixels.close()
        except OSError as error:
            self._failure = self._failure or error.strerror or str(error)
        if self._failure:
            raise RunError(f"{self._folder}: {self._lost} images of panels were not kept: {self._failure}")

    def _keep(self, panel: PanelImage, image: WallImage, now: float) -> None:
        height, width = panel.rgb.shape[:2]
        if not self._failure and self._bytes + panel.rgb.nbytes > self._most_bytes:
            self._failure = f"the log would have more than {self._most_bytes / 1e9:.3g} GB; wanted: a shorter run"
        if self._failure:
            self._lost += 1
            return
        about = LoggedPanel(
            time=now, refresh=image.time, panel=panel.id, version=panel.version, screen=panel.screen,
            size=(width, height), offset=self._bytes, camera_event=image.camera_event,
            scene_event=image.scene_event, scene_time=image.scene_time,
        )  # fmt: skip
        try:
            self._append(panel.rgb)
            self._line(asdict(about))
        except OSError as error:
            self._lost += 1
            self._failure = error.strerror or str(error)

    def _append(self, rgb: NDArray[np.uint8]) -> None:
        """One write, or more where the disk takes only a part of it: the last of them says why."""
        left = np.ascontiguousarray(rgb).ravel().data
        while left:
            left = left[self._pixels.write(left) :]
        self._bytes += rgb.nbytes

    def _line(self, values: dict[str, Any]) -> None:
        self._index.write(json.dumps(values) + "\n")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedImages:
    """A log that was read."""

    began: float  # time 0 of the animation, seconds of the head's clock
    display_delay_s: float  # from the beginning of a refresh to its light
    panels: tuple[LoggedPanel, ...]  # in the order in which they were shown
    cpu_s: float  # that keeping them took
    pixels: NDArray[np.uint8]  # the whole file of pixels, mapped

    def rgb(self, panel: LoggedPanel) -> NDArray[np.uint8]:
        """(h, w, 3) uint8 sRGB of a panel, read from the disk as it is used."""
        width, height = panel.size
        return self.pixels[panel.offset : panel.offset + 3 * width * height].reshape(height, width, 3)


def read_log(folder: Path) -> LoggedImages:
    """Read a finished log. Raises ConfigError for anything else."""
    path = folder / INDEX
    try:
        first, *lines, last = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
        if first["format"] != 1 or not last["end"]:
            raise ValueError("not finished, or of another format")
        panels = tuple(_panels(lines))
        pixels = np.memmap(folder / PIXELS, np.uint8, "r") if panels else np.empty(0, np.uint8)
        if len(pixels) != last["bytes"]:
            raise ValueError(f"{len(pixels)} bytes of pixels, wanted {last['bytes']}")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: not the index of recorded images ({error})") from None
    return LoggedImages(
        began=first["began"], display_delay_s=first["display_delay_s"], panels=panels, cpu_s=last["cpu_s"],
        pixels=pixels,
    )  # fmt: skip


def _panels(lines: Iterable[dict[str, Any]]) -> Iterable[LoggedPanel]:
    names = [field.name for field in fields(LoggedPanel)]
    for line in lines:
        values = {name: line[name] for name in names}
        yield LoggedPanel(**values | {"screen": tuple(values["screen"]), "size": tuple(values["size"])})
