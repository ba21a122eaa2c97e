"""A viewer without a page: takes in what a page is sent, answers as soon as it has it, and counts it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import aiohttp

from wall.core.errors import RunError
from wall.display.page_client import stream_of
from wall.display.stream import SAMPLES_COUNTS, SAMPLES_HEADER

SETTLE_S = 2.0  # before anything is counted: the first images are of every pixel
AGAIN_S = 0.2  # until a viewer whose page has gone tries again
LOST_S = 10.0  # a run that says nothing for so long does not answer


@dataclass(slots=True, kw_only=True)
class Received:
    """What a viewer got."""

    seconds: float
    images: int = 0  # of the wall
    bytes: int = 0  # of images and samples
    samples: int = 0

    def words(self) -> str:
        """All of it as rates."""
        words = f"{self.bytes / self.seconds / 1e3:,.0f} kB/s, {self.images / self.seconds:.1f} images/s"
        if not self.samples:
            return words
        return (
            f"{words}, {self.samples / self.seconds / 1e3:,.0f} k samples/s, {self.bytes / self.samples:.1f} bytes each"
        )


@dataclass(frozen=True, slots=True)
class Seen:
    """What the page was told, and when, seconds of this machine's monotonic clock."""

    time: float
    status: dict[str, Any]


def watch(address: str, *, display: str, seconds: float, drawing_s: float = 0.0) -> Received:
    """Be a viewer of the page at `address` for a while; `display`: "images" or "samples"; `drawing_s`: of an image.

    Raises RunError where there is no page.
    """
    try:
        return asyncio.run(_watch(address, display, seconds, drawing_s))
    except (aiohttp.ClientError, TypeError, ValueError, TimeoutError) as error:
        raise RunError(f"{address}: no page of a wall answers: {error!r}") from error


async def _watch(address: str, display: str, seconds: float, drawing_s: float) -> Received:
    got, left, number = Received(seconds=seconds), 0, 0
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(stream_of(address), max_msg_size=0) as connection,
    ):
        await connection.send_json({"kind": "display", "value": display})
        began = time.monotonic() + SETTLE_S
        while (now := time.monotonic()) < began + seconds:
            message = await _received(connection)
            if message.type is aiohttp.WSMsgType.TEXT:
                said = json.loads(message.data)
                if said["kind"] == "picture":
                    left, number = said["panels"], said["number"]
                continue
            left -= 1
            if now >= began:
                got.bytes += len(message.data)
                got.images += left == 0
                if message.data[:2] == b"WN":
                    got.samples += SAMPLES_COUNTS.unpack_from(zlib.decompress(message.data[SAMPLES_HEADER.size :]))[2]
            if left == 0:
                await asyncio.sleep(drawing_s)
                await connection.send_json({"kind": "shown", "number": number})
    return got


async def _received(connection: aiohttp.ClientWebSocketResponse) -> aiohttp.WSMessage:
    """The next message of a page. Raises ClientConnectionError if that has gone, TimeoutError if none comes."""
    message = await connection.receive(timeout=LOST_S)
    if message.type not in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY):
        raise aiohttp.ClientConnectionError("it has gone")  # a closed connection says so as often as it is asked
    return message


def visit(address: str, commands: Sequence[Mapping[str, object]], *, display: str, seconds: float) -> int:
    """Be a viewer for a while who steers, one command after the other. Returns how many images came.

    Raises RunError where there is no page.
    """
    try:
        return asyncio.run(_visit(address, commands, display, seconds))
    except (aiohttp.ClientError, TypeError, ValueError, TimeoutError) as error:
        raise RunError(f"{address}: no page of a wall answers: {error!r}") from error


async def _visit(address: str, commands: Sequence[Mapping[str, object]], display: str, seconds: float) -> int:
    number = left = images = 0
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(stream_of(address), max_msg_size=0) as connection,
    ):
        await connection.send_json({"kind": "display", "value": display})
        began, sent = time.monotonic(), 0
        while (now := time.monotonic()) < began + seconds:
            if sent < len(commands) and now >= began + seconds * sent / len(commands):
                await connection.send_json(commands[sent])
                sent += 1
            message = await _received(connection)
            if message.type is aiohttp.WSMsgType.TEXT:
                said = json.loads(message.data)
                if said["kind"] == "picture":
                    left, number = said["panels"], said["number"]
                continue
            left -= 1
            if left == 0:
                images += 1
                await connection.send_json({"kind": "shown", "number": number})
    return images


class StatusViewer:
    """A viewer in a thread of its own that keeps each status, and no image; it connects again, as pages do."""

    def __init__(self, address: str) -> None:
        """`address`: of a page. As long as none answers, nothing is seen."""
        self.seen: list[Seen] = []
        self._address, self._loop = address, asyncio.new_event_loop()
        self._watching = self._loop.create_task(self._watch())
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        with contextlib.suppress(RuntimeError):  # it is closed already
            self._loop.call_soon_threadsafe(self._watching.cancel)
        self._thread.join()

    def _run(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._watching)
        self._loop.close()

    async def _watch(self) -> None:
        while True:
            with contextlib.suppress(aiohttp.ClientError, OSError, TypeError, ValueError, KeyError):
                await self._take()
            await asyncio.sleep(AGAIN_S)

    async def _take(self) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(stream_of(self._address), max_msg_size=0, heartbeat=LOST_S) as connection,
        ):
            async for message in connection:  # no image is answered, so that hardly any comes
                if message.type is aiohttp.WSMsgType.TEXT and (said := json.loads(message.data))["kind"] == "status":
                    self.seen.append(Seen(time.monotonic(), said))
