"""Feed the window process of one X display: start it, share memory with it, send it images, take its input.

The other side is window_process.py, which describes the messages between the two.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import select
import socket
import subprocess
import threading
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from wall.core.data import Rect
from wall.core.errors import LocalProtocolError, RunError
from wall.core.system import own_module
from wall.display.base import PanelImage
from wall.display.stale_marks import draw, marked
from wall.display.tiles import changed_since, tile_rects
from wall.display.window_layout import Place, WindowRequest, request_of
from wall.geometry.panels import Panel

SWAP_CHAIN_LENGTH = 3  # buffers of a window: one that is uploaded, the next one, one to write the newest into
START_WAIT_S = 30.0  # a first start compiles shaders; longer means that the X server hangs
END_WAIT_S = 1.5  # for a process to close its windows after it was told to
MAX_COMMANDS = 256  # 4 s of dragging
MOST_RECTS = 64  # of one image of a panel; more take longer to upload than the pixels between them
MAX_PACKET = 1 << 20


class WindowHost:
    """The windows of one X display, seen from the run."""

    def __init__(self, display: str, panels: Sequence[Panel], *, height: int, refresh_hz: float) -> None:
        """Start the process; `begin` waits for it. `height`: of the whole wall, virtual screen pixels."""
        self.display = display
        self.notes: tuple[str, ...] = ()
        self.counters = Counter[str]()
        self.escape, self.gone = "", False
        self._requests, self.areas = _windows_of(panels, refresh_hz)
        self._bytes = [3 * request.pixels[0] * request.pixels[1] for request in self._requests]
        self._buffers, size = _buffers(self._bytes)
        self._changed = threading.Condition()
        self._newest: dict[str, PanelImage] = {}  # of each panel
        self._panels = {panel.id: panel for panel in panels}
        self._marks: dict[str, tuple[Rect, ...]] = {}  # of each panel, the parts that are framed
        self._sent: dict[str, tuple[int, tuple[Rect, ...]]] = {}  # of each panel, what its window has: version, frames
        self.copied = 0  # bytes of pixels that windows were sent
        self._waiting: set[int] = set()  # windows whose newest image is not on its way yet
        self._open = set(range(len(self._requests)))
        self._free = {k: list(range(SWAP_CHAIN_LENGTH)) for k in self._open}
        self._put, self._done = dict.fromkeys(self._open, 0), dict.fromkeys(self._open, 0)  # numbers of images
        self._commands: deque[dict[str, Any]] = deque()
        self._thread: threading.Thread | None = None
        self._wake, self._ending = os.eventfd(0), False
        self._memory = os.memfd_create("wall pictures")
        os.ftruncate(self._memory, size)
        self._shared = np.frombuffer(mmap.mmap(self._memory, size), np.uint8)
        self._pipe, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = self._start(theirs)
        about = {"panels": [asdict(w) for w in self._requests], "buffers": self._buffers, "bytes": self._bytes}
        self._send({"display": display, "height": height, **about})

    def begin(self) -> None:
        """Wait for the windows. Raises RunError as the process worded it."""
        where = f"panel {self._requests[0].id}: display {self.display}"
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
        command, environment = own_module("wall.display.window_process")
        about = {"DISPLAY": self.display, "PYGLFW_LIBRARY_VARIANT": "x11"}
        numbers = [str(n) for n in (os.getpid(), theirs.fileno(), self._memory)]
        return subprocess.Popen(
            [*command, *numbers],
            env=environment | about,
            pass_fds=(theirs.fileno(), self._memory),
            stdin=subprocess.DEVNULL,
            process_group=0,  # Ctrl-C is for the run; it closes the windows when it ends
        )

    def put(self, images: Sequence[PanelImage], stale: Sequence[tuple[float, float, float, float]] = ()) -> None:
        """Take the newest images of these panels, all at once: both eyes of a window stay together.

        stale : places on the virtual screen that are framed
        """
        for image in images:
            rect = self.areas[image.id].rect
            if image.rgb.shape != (rect.height, rect.width, 3):
                came = "x".join(str(n) for n in image.rgb.shape[1::-1])
                wanted = f"{rect.width}x{rect.height}"
                raise LocalProtocolError(f"panel {image.id}: an image of {came} pixels for {wanted}")
        marks = {image.id: marked(self._panels[image.id], stale) for image in images} if stale or self._marks else {}
        with self._changed:
            news = [
                image
                for image in images
                if image.id not in self._newest
                or self._newest[image.id].version != image.version
                or self._marks.get(image.id, ()) != marks.get(image.id, ())
            ]
            self._marks |= marks
            self._newest.update((image.id, image) for image in news)
            for k in {self.areas[image.id].window for image in news} & self._open:
                if k in self._waiting:
                    self.counters["window_overtaken"] += 1
                self._waiting.add(k)
                self._put[k] += 1
        if news:
            os.eventfd_write(self._wake, 1)

    def lay_out(self, places: Mapping[str, Sequence[Place]], count: int) -> None:
        """Tell the process where panels show which views, of `count`; `places`: by panel, in fractions of its image."""
        found: list[list[dict[str, Any]]] = [[] for _ in self._requests]
        for name, (window, rect) in self.areas.items():
            width, height = self._requests[window].pixels
            for place in places.get(name, ()):
                found[window].append(
                    {
                        "view": place.view,
                        "left": (rect.x + place.left * rect.width) / width,
                        "top": (rect.y + place.top * rect.height) / height,
                        "right": (rect.x + place.right * rect.width) / width,
                        "bottom": (rect.y + place.bottom * rect.height) / height,
                    }
                )
        self._send(["views", found, count])

    def settled(self, timeout_s: float) -> bool:
        """Wait until every image that was put is displayed or superseded, or its window is closed."""
        with self._changed:
            return self._changed.wait_for(lambda: all(self._done[k] == self._put[k] for k in self._open), timeout_s)

    def commands(self) -> list[dict[str, Any]]:
        """Steering commands since the last call."""
        taken = []
        while self._commands:
            taken.append(self._commands.popleft())
        return taken

    def end(self) -> None:
        """Tell the process to close its windows; `join` waits for it."""
        self._ending = True
        self._pipe.shutdown(socket.SHUT_RDWR)

    def join(self) -> None:
        """Wait for the thread and the process, END_WAIT_S each, and free what they used."""
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
            self.counters["window_display_lost"] += 1

    def _feed(self) -> None:
        """Copy what changed of every waiting image whose window has a free buffer, and tell the process."""
        with self._changed:
            ready = {k: (self._free[k].pop(), self._put[k]) for k in self._waiting if self._free[k]}
            self._waiting -= ready.keys()
            images = [image for image in self._newest.values() if self.areas[image.id].window in ready]
            marks = {image.id: self._marks.get(image.id, ()) for image in images}
        patches: dict[int, list[tuple[int, int, int, int]]] = {k: [] for k in ready}  # by window
        at = {k: self._buffers[k][buffer] for k, (buffer, _) in ready.items()}
        for image in images:
            k, area = self.areas[image.id]
            for rect in self._changed_rects(image, marks[image.id]):
                pixels = image.rgb[rect.y : rect.bottom, rect.x : rect.right]
                sent = self._shared[at[k] : at[k] + pixels.size].reshape(pixels.shape)
                sent[:] = pixels
                draw(sent, rect, marks[image.id], image.rgb.shape[1::-1])
                at[k] += pixels.size
                self.copied += pixels.size
                patches[k].append((area.x + rect.x, area.y + rect.y, rect.width, rect.height))
        for k, (buffer, number) in ready.items():
            self._send([k, buffer, *self._requests[k].pixels, number, patches[k]])

    def _changed_rects(self, image: PanelImage, marks: tuple[Rect, ...]) -> list[Rect]:
        """Rectangles of an image that hold all that its window has not been sent, and mark it as sent."""
        height, width = image.rgb.shape[:2]
        version, framed = self._sent.get(image.id, (None, ()))
        tiles = changed_since(image, version if framed == marks else None)  # all, where other parts are framed
        self._sent[image.id] = image.version, marks
        rects = tile_rects(tiles, width, height)
        return rects if len(rects) <= MOST_RECTS else [reduce(Rect.join, rects)]

    def _take(self, kind: str, said: list[Any]) -> None:
        if kind == "free":
            k, buffer = said
            self._free[k].append(buffer)
        elif kind == "shown":
            self._done[said[0]] = max(self._done[said[0]], said[1])
            self.counters["window_overtaken"] += said[2]
        elif kind == "command":
            if len(self._commands) < MAX_COMMANDS:
                self._commands.append(said[0])
            else:
                self.counters["window_command_overflow"] += 1
        elif kind == "escape":
            self.escape = f"Escape was pressed in the window of panel {self._requests[said[0]].id}"
        else:  # closed, lost
            self._open.discard(said[0])
            self._waiting.discard(said[0])
            self.counters[f"window_{kind}"] += 1

    def _send(self, message: Any) -> None:
        with contextlib.suppress(OSError):  # the process has ended; `_receive` sees it too
            self._pipe.send(json.dumps(message).encode())

    def _receive(self) -> tuple[Any, ...]:
        try:
            data = self._pipe.recv(MAX_PACKET)
        except OSError:
            data = b""
        return tuple(json.loads(data)) if data else ("",)


class PanelArea(NamedTuple):
    """The rectangle of a window that shows one panel: all of it, or the half of one eye."""

    window: int
    rect: Rect  # of the window's pixels


def _windows_of(panels: Sequence[Panel], refresh_hz: float) -> tuple[list[WindowRequest], dict[str, PanelArea]]:
    """A window for each physical panel, and by panel id the area of its image."""
    physical: dict[str, list[Panel]] = {}
    for panel in panels:
        physical.setdefault(panel.of or panel.id, []).append(panel)
    requests, areas = [], dict[str, PanelArea]()
    for k, (name, parts) in enumerate(physical.items()):
        for part in parts:
            (x, y), (width, height) = part.at, part.pixels
            areas[part.id] = PanelArea(k, Rect(x=x, y=y, width=width, height=height))
        rects = [areas[part.id].rect for part in parts]
        pixels = max(rect.right for rect in rects), max(rect.bottom for rect in rects)
        requests.append(replace(request_of(parts[0], refresh_hz), id=name, pixels=pixels))
    return requests, areas


def _buffers(sizes: Sequence[int]) -> tuple[list[list[int]], int]:
    """Offset of each buffer of each window in the shared memory, and its size, bytes; buffers start on whole pages."""
    starts, at = [], 0
    for size in sizes:
        step = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
        starts.append([at + k * step for k in range(SWAP_CHAIN_LENGTH)])
        at += SWAP_CHAIN_LENGTH * step
    return starts, at
