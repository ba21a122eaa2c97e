"""Serve the live page: one page over HTTP, images and status over a websocket, steering commands back.

The server has a thread and an event loop of its own. `show` only stores the newest image. A viewer holds at most
IN_FLIGHT images that it has not drawn; a slow one gets fewer, never older, images.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import defaultdict, deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from wall.core.errors import RemoteProtocolError
from wall.display.base import Answer, Choices, PanelImage, Status, WallImage, ZoomedPlace
from wall.display.gate import ANYONE, Access, Pace
from wall.display.metrics import CONTENT_TYPE, PageCounts, metrics_text, whole_status_message
from wall.display.page_files import page_file, table_of
from wall.display.page_viewer import PageViewer, Shown
from wall.display.parts import Held, PanelChanges, Part, Piece, parts_of
from wall.display.png import png_bytes
from wall.display.requests import Requests
from wall.display.sample_store import SampleStore
from wall.display.server import LEAVE_S, NOBODY, THIS_MACHINE, Server
from wall.display.steering import MAX_LOAD_BYTES, MAX_MESSAGE_BYTES, MAX_REQUEST_BYTES, parse_message
from wall.display.stream import (
    WATCHING,
    choices_message,
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
LONGEST_ANSWER_S = 600.0  # for that of the run, which may compile for another configuration; then it is refused
HEARTBEAT_S = 5.0  # a viewer whose machine vanished is forgotten after about this time


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
        access: Access = ANYONE,
        embed: bool = False,
        load: bool = False,
    ) -> None:
        """`views`: their names; `why_images`: see layout_message; port 0 takes any free one.

        `embed`, `load`: of BrowserConfig. With `access.tokens` the page is for those alone who know its address.
        Raises RunError naming what cannot be had.
        """
        self._max_viewers = max_viewers
        self._layout, self._wall, self._folder = layout_message(wall, views, why_images), wall, Path()
        self._newest: tuple[WallImage, Status] | None = None
        self._viewers: set[PageViewer] = set()
        self._commands: deque[dict[str, Any]] = deque()
        self._requests = Requests[PageViewer](loads=load)
        self._most_bytes = MAX_LOAD_BYTES if load else MAX_REQUEST_BYTES
        self._answering: set[asyncio.Task[None]] = set()
        self._stores: dict[int, SampleStore] = {}  # of panels whose samples come
        # the encoder's own: what was encoded, by Part.key, and what changed
        self._encoded: dict[Shown, dict[tuple[object, ...], tuple[int, list[Piece]]]] = {}
        self._changes: dict[Shown, PanelChanges] = defaultdict(PanelChanges)
        self._statistics_wanted = False  # as last told by `commands`
        self.sent_bytes = 0  # of images and samples, to all viewers
        self._encoder = ThreadPoolExecutor(1, thread_name_prefix="browser-encoder")
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="browser-reader")  # images do not wait for tables
        self._server = Server(host, port, access=access, frames=THIS_MACHINE if embed else NOBODY)
        self._loop, self._gate, self._counters = self._server.loop, self._server.gate, self._server.counters
        routes = {
            "/": page_file,
            "/stream": self._stream,
            "/wall.png": self._wall_png,
            "/status.json": self._status_json,
            "/metrics": self._metrics,
            "/table/{panel}": self._table,
            "/{name}": page_file,
        }
        where, (steer, watch) = self._server.start(routes, self._say_goodbye), self._gate.queries
        self.address, self.tokens = where + steer, self._gate.tokens
        self.watch_address = where + watch if access.tokens else ""  # for those who are not to steer
        self.notes: tuple[str, ...] = ()  # what its users should know
        if access.tokens and access.tls is None:
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
        self,
        wall: Wall,
        views: Sequence[str],
        why_images: Sequence[str],
        images: Sequence[ZoomedPlace] = (),
        folder: Path = Path(),
    ) -> None:
        """Tell all viewers where panels, insets, views, images are from now on; the panels are those of before.

        `folder`: of panels' files.
        """
        self._layout, self._wall, self._folder = layout_message(wall, views, why_images, images), wall, folder
        self._server.call(self._wake_viewers)

    def offer(self, choices: Choices) -> None:
        """Let those who steer choose what is shown. Any thread may call."""
        self._requests.choices = choices
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
        for executor in (self._encoder, self._reader):
            executor.shutdown(wait=False, cancel_futures=True)

    def _wake_viewers(self) -> None:
        for viewer in self._viewers:
            viewer.wake.set()

    # Below, everything runs in the server's thread, except _encode, png_bytes and table_of in their executors'.

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

    async def _table(self, request: web.Request) -> web.Response:
        body = await self._loop.run_in_executor(
            self._reader, table_of, request.match_info["panel"], self._wall, self._folder
        )
        return web.Response(body=body, content_type="application/octet-stream")

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
        viewer, pace = PageViewer(connection, steers), Pace(self._loop.time())
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

    async def _take(self, viewer: PageViewer, text: str) -> None:
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

    async def _ask(self, viewer: PageViewer, message: dict[str, Any], size: int) -> None:
        """Hand a request on, or refuse it here, once there is room for one more answer."""
        await viewer.requests.acquire()
        number, own = self._requests.take(viewer, message)
        refused = self._requests.why_not(message, size, steers=viewer.steers)
        own, refused = (own, refused) if refused else self._requests.chosen(own)
        if refused:
            self._counters["browser_watcher_refused" if not viewer.steers else "browser_request_refused"] += 1
        elif len(self._commands) >= MAX_COMMANDS:
            self._counters["browser_command_overflow"] += 1
            refused = "too many commands at once"
        else:
            self._commands.append(own)
            late = Answer(refused=f"no answer from the run for {LONGEST_ANSWER_S:g} s")
            self._loop.call_later(LONGEST_ANSWER_S, self._answer, number, late)  # unless it is answered by then
            return
        self._answer(number, Answer(refused=refused))

    def _answer(self, number: int, answer: Answer) -> None:
        if (said := self._requests.answered(number, answer)) is not None:
            sending = self._loop.create_task(self._send_answer(*said))
            self._answering.add(sending)  # or nobody would hold it
            sending.add_done_callback(self._answering.discard)

    async def _send_answer(self, viewer: PageViewer, text: str) -> None:
        with contextlib.suppress(ConnectionError):  # the viewer left
            await viewer.socket.send_str(text)
        viewer.requests.release()

    def _drawn(self, viewer: PageViewer, number: int) -> None:
        if number not in viewer.in_flight:
            self._counters["browser_bad_message"] += 1
            return
        while viewer.in_flight.popleft() != number:
            pass
        viewer.wake.set()

    async def _feed(self, viewer: PageViewer) -> None:
        """Send what is new until the connection ends."""
        try:
            while True:
                if viewer.layout != self._layout:
                    viewer.layout = self._layout
                    await viewer.socket.send_str(viewer.layout)
                    if not viewer.steers:
                        await viewer.socket.send_str(WATCHING)
                if viewer.choices is not (choices := self._requests.choices) and viewer.steers:
                    viewer.choices = choices
                    await viewer.socket.send_str(choices_message(choices))
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

    async def _send(self, viewer: PageViewer, image: WallImage, status: Status) -> None:
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
        assert self._newest is not None
        image = self._newest[0]  # of now: what was sent above may have taken its time
        panels = {(False, k): p for k, p in enumerate(image.panels)}
        panels |= {(True, k): p for k, p in enumerate(image.compared)}
        stores = {(False, k): store for k, store in self._stores.items()} if viewer.samples else {}
        wanted = [
            (shown, held, panel, stores.get(shown))
            for shown, panel in panels.items()
            if not (held := viewer.held[shown]).is_current(panel, stores.get(shown))  # of now: a page may begin anew
        ]
        if not wanted:
            return
        made = await self._loop.run_in_executor(self._encoder, self._encode, wanted, self._loop.time())
        if not made:
            return
        viewer.number += 1
        viewer.in_flight.append(viewer.number)
        messages = sum(len(pieces) for *_, pieces in made)
        await viewer.socket.send_str(image_message(image, panels=messages, number=viewer.number))
        for (compared, k), held, part, version, pieces in made:
            for piece in pieces:
                self.sent_bytes += len(piece.encoded)
                await viewer.socket.send_bytes(
                    part.message(k, piece, compared=compared, version=version, number=viewer.number)
                )
            part.sent(held, version, pieces)

    def _encode(
        self, wanted: list[tuple[Shown, Held, PanelImage, SampleStore | None]], now: float
    ) -> list[tuple[Shown, Held, Part, int, list[Piece]]]:
        """What a viewer needs of panels, its version and pieces: encoded once, however many viewers get them."""
        made = []
        for shown, held, panel, store in wanted:
            for part in parts_of(held, panel, store, self._changes[shown], now):
                encoded = self._encoded.get(shown, {})
                own = part.key  # once: that of samples changes meanwhile
                if not any(key[0] == own[0] for key in encoded):  # of other versions
                    self._encoded[shown] = encoded = {}
                if own not in encoded:
                    encoded[own] = part.encode()
                made.append((shown, held, part, *encoded[own]))
        return made


def _store(panel: PanelImage) -> SampleStore:
    return SampleStore(panel.rgb.shape[1], panel.rgb.shape[0])
