"""The run's end of one X display: its process, the memory it shares with it, and the thread that feeds it.

The other end is window_process.py; the messages between the two are described there.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import select
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import wall
from wall.core.data import Counters
from wall.core.errors import LocalProtocolError, RunError
from wall.display.base import PanelPicture
from wall.display.placing import Wanted, wanted_of
from wall.geometry.panels import Panel

SLOTS = 3  # pictures of a window: one on its way to the glass, the next one, one to write the newest into
START_WAIT_S = 30.0  # a first start compiles shaders; longer means that the X server hangs
END_WAIT_S = 1.5  # for a process to close its windows after it was told to
MAX_COMMANDS = 256  # 4 s of dragging
MAX_PACKET = 1 << 20


class Glass:
    """The parent's end of one X display."""

    def __init__(self, display: str, panels: Sequence[Panel], *, height: int, refresh_hz: float) -> None:
        """Start its process; `begin` waits for it."""
        self.display = display
        self.notes: tuple[str, ...] = ()
        self.counters = Counters()
        self.escape, self.gone = "", False
        self._wanted, self.parts = _windows_of(panels, refresh_hz)
        self._bytes = [3 * wanted.pixels[0] * wanted.pixels[1] for wanted in self._wanted]
        self._slots, size = _slots(self._bytes)
        self._changed = threading.Condition()
        self._newest: dict[str, PanelPicture] = {}  # of each panel
        self._waiting: set[int] = set()  # windows whose newest picture is not on its way yet
        self._open = set(range(len(self._wanted)))
        self._free = {k: list(range(SLOTS)) for k in self._open}
        self._put, self._done = dict.fromkeys(self._open, 0), dict.fromkeys(self._open, 0)  # numbers of pictures
        self._commands: deque[dict[str, Any]] = deque()
        self._thread: threading.Thread | None = None
        self._wake, self._ending = os.eventfd(0), False
        self._memory = os.memfd_create("wall pictures")
        os.ftruncate(self._memory, size)
        self._shared = np.frombuffer(mmap.mmap(self._memory, size), np.uint8)
        self._pipe, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = self._start(theirs)
        about = {"panels": [asdict(w) for w in self._wanted], "slots": self._slots, "bytes": self._bytes}
        self._send({"display": display, "height": height, **about})

    def begin(self) -> None:
        """Wait for the windows. Raises RunError as the process worded it."""
        where = f"panel {self._wanted[0].id}: display {self.display}"
        ready, _, _ = select.select([self._pipe], [], [], START_WAIT_S)
        if not ready:
            raise RunError(f"{where} did not answer for {START_WAIT_S:.0f} s; wanted an X server that does")
        kind, *said = self._receive()
        if kind == "":
            raise RunError(f"{where}: the process of its windows ended with exit code {self._process.wait(END_WAIT_S)}")
        if kind == "failed":
            raise RunError(said[0])
        self.notes = tuple(said[0])
        self._thread = threading.Thread(target=self._run, name=f"windows {self.display}", daemon=True)
        self._thread.start()

    def _start(self, theirs: socket.socket) -> subprocess.Popen[bytes]:
        here = str(Path(wall.__file__).resolve().parent.parent)
        path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
        about = {"DISPLAY": self.display, "PYTHONPATH": path, "PYGLFW_LIBRARY_VARIANT": "x11"}
        numbers = [str(n) for n in (os.getpid(), theirs.fileno(), self._memory)]
        return subprocess.Popen(
            [sys.executable, "-m", "wall.display.window_process", *numbers],
            env={**os.environ, **about},
            pass_fds=(theirs.fileno(), self._memory),
            stdin=subprocess.DEVNULL,
            process_group=0,  # Ctrl-C is for the run; it closes the windows when it ends
        )

    def put(self, pictures: Sequence[PanelPicture]) -> None:
        """Take the newest pictures of these panels, all at once: both eyes of a window stay together."""
        for picture in pictures:
            width, height = self.parts[picture.id].size
            if picture.rgb.shape != (height, width, 3):
                came = "x".join(str(n) for n in picture.rgb.shape[1::-1])
                raise LocalProtocolError(f"panel {picture.id}: a picture of {came} pixels for {width}x{height}")
        with self._changed:
            news = [p for p in pictures if p.id not in self._newest or self._newest[p.id].version != p.version]
            self._newest.update((picture.id, picture) for picture in news)
            for k in {self.parts[picture.id].window for picture in news} & self._open:
                if k in self._waiting:
                    self.counters.add("window_overtaken")
                self._waiting.add(k)
                self._put[k] += 1
        if news:
            os.eventfd_write(self._wake, 1)

    def settled(self, timeout_s: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: all(self._done[k] == self._put[k] for k in self._open), timeout_s)

    def commands(self) -> list[dict[str, Any]]:
        taken = []
        while self._commands:
            taken.append(self._commands.popleft())
        return taken

    def end(self) -> None:
        self._ending = True
        self._pipe.shutdown(socket.SHUT_RDWR)

    def join(self) -> None:
        if self._thread is not None:
            self._thread.join(END_WAIT_S)
        try:
            self._process.wait(END_WAIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._pipe.close()
        os.close(self._wake)
        os.close(self._memory)

    # Below, everything runs in the thread of this display.

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._pipe.fileno(), self._wake], [], [])
            if self._wake in ready:
                os.eventfd_read(self._wake)
            if self._pipe.fileno() in ready:
                kind, *said = self._receive()
                if kind == "":
                    break
                with self._changed:
                    self._take(kind, said)
                    self._changed.notify_all()
            self._feed()
        with self._changed:
            self.gone = True
            self._open.clear()
            self._changed.notify_all()
        if not self._ending and not self.escape:
            self.counters.add("window_display_lost")

    def _feed(self) -> None:
        """Hand over every waiting picture that has a free slot."""
        with self._changed:
            ready = {k: (self._free[k].pop(), self._put[k]) for k in self._waiting if self._free[k]}
            self._waiting -= ready.keys()
            pictures = [picture for picture in self._newest.values() if self.parts[picture.id].window in ready]
        for picture in pictures:
            part = self.parts[picture.id]
            self._pixels(part.window, ready[part.window][0])[part.inside] = picture.rgb
        for k, (slot, number) in ready.items():
            self._send([k, slot, *self._wanted[k].pixels, number])

    def _pixels(self, k: int, slot: int) -> NDArray[np.uint8]:
        (width, height), start = self._wanted[k].pixels, self._slots[k][slot]
        return self._shared[start : start + self._bytes[k]].reshape(height, width, 3)

    def _take(self, kind: str, said: list[Any]) -> None:
        if kind == "free":
            k, slot, used = said
            self._free[k].append(slot)
            if not used:
                self.counters.add("window_overtaken")
        elif kind == "shown":
            self._done[said[0]] = max(self._done[said[0]], said[1])
        elif kind == "command":
            if len(self._commands) < MAX_COMMANDS:
                self._commands.append(said[0])
            else:
                self.counters.add("window_command_overflow")
        elif kind == "escape":
            self.escape = f"Escape was pressed in the window of panel {self._wanted[said[0]].id}"
        else:  # closed, lost
            self._open.discard(said[0])
            self._waiting.discard(said[0])
            self.counters.add(f"window_{kind}")

    def _send(self, message: Any) -> None:
        with contextlib.suppress(OSError):  # the process has ended; `_receive` sees it too
            self._pipe.send(json.dumps(message).encode())

    def _receive(self) -> tuple[Any, ...]:
        try:
            data = self._pipe.recv(MAX_PACKET)
        except OSError:
            data = b""
        return tuple(json.loads(data)) if data else ("",)


@dataclass(frozen=True, slots=True)
class _Part:
    """Where a panel is in its window: all of it, or one eye's half."""

    window: int
    at: tuple[int, int]  # x, y of its top left pixel
    size: tuple[int, int]  # width, height

    @property
    def inside(self) -> tuple[slice, slice]:
        (x, y), (width, height) = self.at, self.size
        return np.s_[y : y + height, x : x + width]


def _windows_of(panels: Sequence[Panel], refresh_hz: float) -> tuple[list[Wanted], dict[str, _Part]]:
    """A window for each physical panel, and where each panel's picture goes."""
    physical: dict[str, list[Panel]] = {}
    for panel in panels:
        physical.setdefault(panel.of or panel.id, []).append(panel)
    wanted, parts = [], {}
    for k, (name, halves) in enumerate(physical.items()):
        places = {panel.id: _Part(k, panel.at, panel.pixels) for panel in halves}
        pixels = (max(p.at[0] + p.size[0] for p in places.values()), max(p.at[1] + p.size[1] for p in places.values()))
        wanted.append(replace(wanted_of(halves[0], refresh_hz), id=name, pixels=pixels))
        parts.update(places)
    return wanted, parts


def _slots(sizes: Sequence[int]) -> tuple[list[list[int]], int]:
    """Where each slot of each panel begins in the shared memory, and how much of it there is; whole pages."""
    starts, at = [], 0
    for size in sizes:
        step = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
        starts.append([at + k * step for k in range(SLOTS)])
        at += SLOTS * step
    return starts, at
