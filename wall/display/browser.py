"""Serve the live page: one page over HTTP, images and status over a websocket, steering commands back.

The server has a thread and an event loop of its own. `show` only stores the newest image. A viewer holds at most
IN_FLIGHT images that it has not drawn; a slow one gets fewer, never older, images.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import defaultdict, deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from wall.core.data import StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.display.base import Answer, Handles, PanelImage, ParameterState, Status, WallImage, ZoomedPlace
from wall.display.gate import Pace
from wall.display.metrics import CONTENT_TYPE, PageCounts, metrics_text, whole_status_message
from wall.display.parts import Held, Part, part_of
from wall.display.png import png_bytes
from wall.display.requests import Requests
from wall.display.sample_store import SampleStore
from wall.display.server import LEAVE_S, NOBODY, THIS_MACHINE, Server
from wall.display.steering import MAX_LOAD_BYTES, MAX_MESSAGE_BYTES, MAX_REQUEST_BYTES, parse_message
from wall.display.stream import (
    WATCHING,
    handles_message,
    image_message,
    layout_message,
    parameters_message,
    statistics_message,
    status_message,
)
from wall.geometry.panels import Wall

IN_FLIGHT = 2  # one on its way while one is drawn; more would only be older
STATUS_PERIOD_S = 0.25  # as often as numbers can be read
MAX_VIEWERS = 8
KEPT_FOR_STEERING = 2  # of them, where others only watch
MAX_COMMANDS = 256  # 4 s of one viewer's dragging
MAX_REQUESTS = 16  # of one viewer that wait for an answer, or to be sent it; no more is read from it meanwhile
HEARTBEAT_S = 5.0  # a viewer whose machine vanished is forgotten after about this time

PAGE = Path(__file__).resolve().parent / "page"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


_Shown = tuple[bool, int]  # second image of two that are compared, panel


@dataclass(slots=True, eq=False)
class _Viewer:
    socket: web.WebSocketResponse
    steers: bool = True
    wake: asyncio.Event = field(default_factory=asyncio.Event)
    held: dict[_Shown, Held] = field(default_factory=lambda: defaultdict(Held))
    in_flight: deque[int] = field(default_factory=deque)  # numbers of images sent, not yet drawn
    number: int = 0
    layout: str = ""  # as last sent
    told: tuple[object, ...] = ()  # of the status, as last sent
    status_due: float = 0.0
    overlay: str = ""  # one of OVERLAYS
    samples: bool = False  # it makes images itself, of what samples there are
    shows: bool = True  # it wants images, or samples, and status
    requests: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(MAX_REQUESTS))
    statistics_images: tuple[StatisticsImage, ...] = ()  # as last sent
    parameters: tuple[ParameterState, ...] = ()  # as last sent
    handles: Handles | None = None  # as last sent


class Browser:
    """Serves the page from construction to `close`.

    `commands` gives what the viewers asked for since the last call, checked by steering.parse_message, and
    `statistics` when the first of them puts an overlay on and the last one takes it off. What has an `id` among them
    is to be answered by `answer`.
    """

    def __init__(
        self,
        host: str,
        port: int,
        wall: Wall,
        *,
        views: Sequence[str] = ("main",),
        why_images: Sequence[str] = (),
        max_viewers: int = MAX_VIEWERS,
        tokens: bool = False,
        steer_token: str = "",
        watch_token: str = "",
        tls: tuple[Path, Path] | None = None,
        embed: bool = False,
        load: bool = False,
    ) -> None:
        """`views`: their names; `why_images`: see layout_message; port 0 takes any free one.

        `embed`, `load`: of BrowserConfig.

        `tokens`: the page is for those alone who know its address; `steer_token`, `watch_token`: see
        Gate; `tls`: files of a
        certificate and its key. Raises RunError naming what cannot be had.
        """
        self._max_viewers = max_viewers
        self._layout = layout_message(wall, views, why_images)
        self._newest: tuple[WallImage, Status] | None = None
        self._viewers: set[_Viewer] = set()
        self._commands: deque[dict[str, Any]] = deque()
        self._requests, self._most_bytes = Requests[_Viewer](loads=load), MAX_LOAD_BYTES if load else MAX_REQUEST_BYTES
        self._answering: set[asyncio.Task[None]] = set()
        self._stores: dict[int, SampleStore] = {}  # of panels whose samples come
        self._encoded: dict[_Shown, dict[tuple[object, ...], tuple[int, bytes]]] = {}  # by Part.key; the encoder's own
        self._statistics_wanted = False  # as last told by `commands`
        self.sent_bytes = 0  # of images and samples, to all viewers
        self._encoder = ThreadPoolExecutor(1, thread_name_prefix="browser-encoder")
        self._server = Server(
            host, port, tokens=tokens, steer_token=steer_token, watch_token=watch_token, tls=tls,
            frames=THIS_MACHINE if embed else NOBODY,
        )  # fmt: skip
        self._loop, self._gate, self._counters = self._server.loop, self._server.gate, self._server.counters
        routes = {
            "/": _page,
            "/stream": self._stream,
            "/wall.png": self._wall_png,
            "/status.json": self._status_json,
            "/metrics": self._metrics,
            "/{name}": _page,
        }
        where, (steer, watch) = self._server.start(routes, self._say_goodbye), self._gate.queries
        self.address, self.tokens = where + steer, self._gate.tokens
        self.notes: tuple[str, ...] = ()  # what its users should know
        if tokens:
            self.notes = (f"to watch the wall without steering it: {where}{watch}",)
        if tokens and tls is None:
            self.notes += ("the page is not encrypted (output.browser.tls): who listens can read its token",)

    def show(self, image: WallImage, status: Status) -> None:
        """Hand the newest image to all viewers."""
        stores = {new.panel: self._stores.get(new.panel) or _store(image.panels[new.panel]) for new in image.samples}
        for new in image.samples:
            stores[new.panel].take(new, image.panels[new.panel].rgb)
        self._stores = stores
        self._newest = (image, status)
        if self._viewers:
            self._server.call(self._wake_viewers)

    def tell(self, status: Status) -> None:
        """Tell all viewers how the run is doing, before the next image."""
        if self._newest is not None:
            self._newest = (self._newest[0], status)
            self._server.call(self._wake_viewers)

    def lay_out(
        self, wall: Wall, views: Sequence[str], why_images: Sequence[str], images: Sequence[ZoomedPlace] = ()
    ) -> None:
        """Tell all viewers where panels, insets, views, images are from now on; the panels are those of before."""
        self._layout = layout_message(wall, views, why_images, images)
        self._server.call(self._wake_viewers)

    def commands(self) -> list[dict[str, Any]]:
        """What viewers asked for since the last call."""
        taken = []
        while self._commands:
            taken.append(self._commands.popleft())
        watching = any(viewer.overlay for viewer in tuple(self._viewers))
        if watching != self._statistics_wanted:
            self._statistics_wanted = watching
            taken.append({"kind": "statistics", "value": "on" if watching else ""})
        return taken

    def answer(self, number: int, answer: Answer) -> None:
        """Tell who asked what came of the command with this id."""
        self._server.call(lambda: self._answer(number, answer))

    @property
    def wants_samples(self) -> bool:
        """Whether a viewer makes the images itself."""
        return any(viewer.samples for viewer in tuple(self._viewers))

    def dropped(self) -> dict[str, int]:
        """Requests, messages and commands that were refused so far, by name."""
        return dict(self._counters)

    def close(self) -> None:
        """Tell the viewers, stop serving; within a second."""
        self._server.close()
        self._encoder.shutdown(wait=False, cancel_futures=True)

    def _wake_viewers(self) -> None:
        for viewer in self._viewers:
            viewer.wake.set()

    # Below, everything runs in the server's thread, except _encode and png_bytes in the encoder's.

    async def _say_goodbye(self) -> None:
        goodbyes = [v.socket.close(code=WSCloseCode.GOING_AWAY, message=b"the run has ended") for v in self._viewers]
        await asyncio.gather(*goodbyes, return_exceptions=True)

    async def _status_json(self, request: web.Request) -> web.Response:
        if self._newest is None:
            raise web.HTTPServiceUnavailable(text="no image yet\n")
        text = whole_status_message(self._newest[1], self._page_counts())
        return web.Response(text=text, content_type="application/json")

    async def _metrics(self, request: web.Request) -> web.Response:
        status = None if self._newest is None else self._newest[1]
        return web.Response(text=metrics_text(status, self._page_counts()), headers={"Content-Type": CONTENT_TYPE})

    def _page_counts(self) -> PageCounts:
        return PageCounts(viewers=len(self._viewers), bytes=self.sent_bytes, dropped=self.dropped())

    async def _wall_png(self, request: web.Request) -> web.Response:
        if self._newest is None:
            raise web.HTTPServiceUnavailable(text="no image yet\n")
        body = await self._loop.run_in_executor(self._encoder, png_bytes, self._newest[0])
        return web.Response(body=body, content_type="image/png")

    async def _stream(self, request: web.Request) -> web.WebSocketResponse:
        steers = self._gate.steers(request)
        connection = web.WebSocketResponse(
            timeout=LEAVE_S, heartbeat=HEARTBEAT_S, compress=False,
            max_msg_size=self._most_bytes if steers else MAX_MESSAGE_BYTES,
        )  # fmt: skip
        await connection.prepare(request)
        if len(self._viewers) >= self._max_viewers - (0 if steers else KEPT_FOR_STEERING):
            self._counters["browser_viewer_refused"] += 1
            await connection.close(code=WSCloseCode.TRY_AGAIN_LATER, message=b"too many viewers")
            return connection
        viewer, pace = _Viewer(connection, steers), Pace(self._loop.time())
        self._viewers.add(viewer)
        feeder = asyncio.create_task(self._feed(viewer))
        try:
            async for message in connection:
                text = message.data if message.type is WSMsgType.TEXT else ""
                if not pace.allows(self._loop.time(), 1 + len(text) // MAX_MESSAGE_BYTES):
                    self._counters["browser_too_fast"] += 1
                    await connection.close(code=WSCloseCode.POLICY_VIOLATION, message=b"too many messages a second")
                    break
                await self._take(viewer, text)
        finally:
            self._viewers.discard(viewer)
            feeder.cancel()
            await asyncio.gather(feeder, return_exceptions=True)
        return connection

    async def _take(self, viewer: _Viewer, text: str) -> None:
        try:
            message = parse_message(text)
        except RemoteProtocolError:
            self._counters["browser_bad_message"] += 1
            return
        if "id" in message:
            await self._ask(viewer, message, len(text))
        elif message["kind"] == "shown":
            self._drawn(viewer, message["number"])
        elif message["kind"] == "overlay":
            viewer.overlay, viewer.statistics_images = message["value"], ()
        elif message["kind"] == "display":
            viewer.samples, viewer.shows = message["value"] == "samples", message["value"] != "nothing"
            viewer.held.clear()  # a page that asks begins anew
        elif not viewer.steers:
            self._counters["browser_watcher_refused"] += 1
        elif len(self._commands) >= MAX_COMMANDS:
            self._counters["browser_command_overflow"] += 1
        else:
            self._commands.append(message)

    async def _ask(self, viewer: _Viewer, message: dict[str, Any], size: int) -> None:
        """Hand a request on, or refuse it here, once there is room for one more answer."""
        await viewer.requests.acquire()
        number, own = self._requests.take(viewer, message)
        refused = self._requests.why_not(message, size, steers=viewer.steers)
        if refused:
            self._counters["browser_watcher_refused" if not viewer.steers else "browser_request_refused"] += 1
        elif len(self._commands) >= MAX_COMMANDS:
            self._counters["browser_command_overflow"] += 1
            refused = "too many commands at once"
        else:
            self._commands.append(own)
            return
        self._answer(number, Answer(refused=refused))

    def _answer(self, number: int, answer: Answer) -> None:
        if (said := self._requests.answered(number, answer)) is not None:
            sending = self._loop.create_task(self._send_answer(*said))
            self._answering.add(sending)  # or nobody would hold it
            sending.add_done_callback(self._answering.discard)

    async def _send_answer(self, viewer: _Viewer, text: str) -> None:
        with contextlib.suppress(ConnectionError):  # the viewer left
            await viewer.socket.send_str(text)
        viewer.requests.release()

    def _drawn(self, viewer: _Viewer, number: int) -> None:
        if number not in viewer.in_flight:
            self._counters["browser_bad_message"] += 1
            return
        while viewer.in_flight.popleft() != number:
            pass
        viewer.wake.set()

    async def _feed(self, viewer: _Viewer) -> None:
        """Send what is new until the connection ends."""
        try:
            while True:
                if viewer.layout != self._layout:
                    viewer.layout = self._layout
                    await viewer.socket.send_str(viewer.layout)
                    if not viewer.steers:
                        await viewer.socket.send_str(WATCHING)
                if self._newest is not None and viewer.shows:
                    await self._send(viewer, *self._newest)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(viewer.wake.wait(), STATUS_PERIOD_S)
                viewer.wake.clear()
        except ConnectionError:
            return  # the viewer left
        except Exception as error:
            self._counters["browser_feed_failed"] += 1
            await viewer.socket.close(code=WSCloseCode.INTERNAL_ERROR, message=repr(error).encode()[:120])

    async def _send(self, viewer: _Viewer, image: WallImage, status: Status) -> None:
        # to a command, for which the viewer waits, or something that it must not see as alive
        answer = (status.paused, status.sampler, status.compare, status.stale)
        if self._loop.time() >= viewer.status_due or answer != viewer.told:
            viewer.status_due, viewer.told = self._loop.time() + STATUS_PERIOD_S, answer
            await viewer.socket.send_str(status_message(status))
        if status.parameters != viewer.parameters:
            viewer.parameters = status.parameters
            await viewer.socket.send_str(parameters_message(status.parameters))
        if len(viewer.in_flight) >= IN_FLIGHT:
            return
        if viewer.overlay and image.statistics_images is not viewer.statistics_images:
            viewer.statistics_images = image.statistics_images
            for statistics_image in image.statistics_images:
                await viewer.socket.send_bytes(statistics_message(statistics_image, viewer.overlay))
        if image.handles is not viewer.handles:
            viewer.handles = image.handles
            await viewer.socket.send_str(handles_message(image.handles))
        panels = {(False, k): p for k, p in enumerate(image.panels)}
        panels |= {(True, k): p for k, p in enumerate(image.compared)}
        stores = {(False, k): store for k, store in self._stores.items()} if viewer.samples else {}
        now, parts = self._loop.time(), dict[_Shown, Part]()
        held = {shown: viewer.held[shown] for shown in panels}  # those of now: a page may begin anew meanwhile
        for shown, panel in panels.items():
            if part := part_of(held[shown], panel, stores.get(shown), now):
                parts[shown] = part
        if not parts:
            return
        viewer.number += 1
        viewer.in_flight.append(viewer.number)
        encoded = await self._loop.run_in_executor(self._encoder, self._encode, parts)
        await viewer.socket.send_str(image_message(image, panels=len(parts), number=viewer.number))
        for (shown, part), (version, data) in zip(parts.items(), encoded, strict=True):
            compared, k = shown
            await viewer.socket.send_bytes(
                part.message(k, compared=compared, encoded=data, version=version, number=viewer.number)
            )
            self.sent_bytes += len(data)
            part.sent(held[shown], version, now)

    def _encode(self, parts: dict[_Shown, Part]) -> list[tuple[int, bytes]]:
        """Versions and bytes of parts, encoded once, however many viewers get them."""
        made = []
        for shown, part in parts.items():
            encoded = self._encoded.get(shown, {})
            own = part.key  # once: that of samples changes meanwhile
            if not any(key[0] == own[0] for key in encoded):  # of other versions
                self._encoded[shown] = encoded = {}
            if own not in encoded:
                encoded[own] = part.encode()
            made.append(encoded[own])
        return made


def _store(panel: PanelImage) -> SampleStore:
    return SampleStore(panel.rgb.shape[1], panel.rgb.shape[0])


async def _page(request: web.Request) -> web.Response:
    name = request.match_info.get("name", "index.html")
    path = PAGE / name
    if name not in os.listdir(PAGE) or path.suffix not in TYPES:  # whatever is asked for, nothing else is looked at
        raise web.HTTPNotFound(text="no such page\n")
    text = path.read_text(encoding="utf-8")
    return web.Response(text=text, content_type=TYPES[path.suffix], charset="utf-8")
