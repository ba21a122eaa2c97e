"""Ask a wall for something over its page's WebSocket, as a program does: each request has an `id`, and an answer.

A thread with an event loop of its own reads what comes, so that the connection lives while nobody asks.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import threading
from collections.abc import Coroutine, Mapping
from concurrent.futures import Future
from typing import Any, TypeVar
from urllib.parse import urlsplit

import aiohttp

from wall.core.errors import RunError

T = TypeVar("T")
CLOSE_S = 2.0  # for a goodbye
QUIET = {"kind": "display", "value": "nothing"}  # no images and no status, which nobody here looks at
ENDED, TOO_FAST, TOO_LONG, TOO_MANY = 1001, 1008, 1009, 1013  # codes of a close
WHY_CLOSED = {
    ENDED: "the wall has ended",
    TOO_FAST: "it takes no more messages: too many came at once",
    TOO_LONG: "it takes no message of this length",
    TOO_MANY: "too many viewers are there; wanted: that one of them leaves",
}


class PageClient:
    """One connection to one wall's page. Belongs to no thread: any may ask."""

    def __init__(self, address: str, *, patience_s: float) -> None:
        """`address`: of the page, with its token, as the run has printed it.

        Raises RunError where no wall answers there within `patience_s` seconds, or lets nobody in.
        """
        self._where = urlsplit(address)._replace(query="").geturl()  # a token is not for messages
        self._address, self._numbers = stream_of(address), itertools.count(1)
        self._waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._gone = ""  # why the connection is closed
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="wall client", daemon=True)
        self._thread.start()
        try:
            self._session, self._connection = self._do(self._connect(patience_s))
        except BaseException:
            self._end_thread()
            raise
        self._reader = asyncio.run_coroutine_threadsafe(self._read(), self._loop)

    def ask(self, message: Mapping[str, Any], *, patience_s: float) -> dict[str, Any]:
        """The wall's answer to a message of docs/guide/websocket.md, without its `id`.

        Raises RunError where none comes within `patience_s` seconds.
        """
        if not self._thread.is_alive():
            raise RunError(f"{self._where}: this client is closed")
        return self._do(self._ask(message, patience_s))

    def close(self) -> None:
        """Close the connection, within CLOSE_S."""
        if self._thread.is_alive():
            self._do(self._leave())
            self._end_thread()

    def _do(self, what: Coroutine[Any, Any, T]) -> T:
        done: Future[T] = asyncio.run_coroutine_threadsafe(what, self._loop)
        try:
            return done.result()
        except BaseException:
            done.cancel()  # Ctrl-C of who waits
            raise

    def _end_thread(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    # Below, everything runs in the thread of the loop.

    async def _connect(self, patience_s: float) -> tuple[aiohttp.ClientSession, aiohttp.ClientWebSocketResponse]:
        session = aiohttp.ClientSession()
        try:
            async with asyncio.timeout(patience_s):
                connection = await session.ws_connect(self._address, max_msg_size=0)
                message = await connection.receive()
                if message.type is not aiohttp.WSMsgType.TEXT or json.loads(message.data).get("kind") != "layout":
                    raise RunError(f"{self._where}: {self._why(connection, 'what answers there is no wall')}")
                await connection.send_json(QUIET)
        except BaseException as error:
            await session.close()
            if isinstance(error, aiohttp.WSServerHandshakeError):
                raise RunError(f"{self._where}: {_why_not(error.status)}") from error
            if isinstance(error, TimeoutError):
                raise RunError(f"{self._where}: no answer within {patience_s:g} s") from error
            if isinstance(error, aiohttp.ClientError | OSError | ValueError | TypeError):
                why = getattr(error, "strerror", "") or error
                raise RunError(f"{self._where}: no wall answers ({why}); wanted: the address of its page") from error
            raise
        return session, connection

    async def _read(self) -> None:
        """Take answers in until the connection ends."""
        with contextlib.suppress(aiohttp.ClientError, OSError):
            async for message in self._connection:
                if message.type is aiohttp.WSMsgType.TEXT and (said := json.loads(message.data))["kind"] == "answer":
                    self._answered(said)
        self._gone = self._gone or self._why(self._connection, "the connection was lost: the wall has ended, or a wire")
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(RunError(f"{self._where}: {self._gone}"))

    def _answered(self, said: dict[str, Any]) -> None:
        waiting = self._waiting.get(said["id"])
        if waiting is not None and not waiting.done():
            waiting.set_result(said)

    async def _ask(self, message: Mapping[str, Any], patience_s: float) -> dict[str, Any]:
        if self._gone:
            raise RunError(f"{self._where}: {self._gone}")
        number, answer = next(self._numbers), asyncio.Future[dict[str, Any]]()
        self._waiting[number] = answer
        try:
            async with asyncio.timeout(patience_s):
                await self._connection.send_json({**message, "id": number})
                return await answer
        except TimeoutError:
            raise RunError(f"{self._where}: no answer within {patience_s:g} s: the wall does not respond") from None
        except (aiohttp.ClientError, OSError) as error:
            raise RunError(f"{self._where}: {self._gone or error}") from error
        finally:
            del self._waiting[number]

    async def _leave(self) -> None:
        self._gone = self._gone or "this client is closed"
        with contextlib.suppress(aiohttp.ClientError, OSError):  # OSError: a timeout too
            async with asyncio.timeout(CLOSE_S):
                await self._connection.close()
                await asyncio.wrap_future(self._reader)
        await self._session.close()

    def _why(self, connection: aiohttp.ClientWebSocketResponse, otherwise: str) -> str:
        return WHY_CLOSED.get(connection.close_code or 0, otherwise)


def stream_of(address: str) -> str:
    """Where the page at an address gets its images from, with the token that the address may have."""
    parts = urlsplit(address)
    return parts._replace(path=parts.path.rstrip("/") + "/stream").geturl()


def _why_not(status: int) -> str:
    """Why a server did not open a WebSocket, by its HTTP status."""
    if status == aiohttp.web.HTTPForbidden.status_code:
        return "the wall lets nobody in by this token; wanted: the address that the run has printed, with its token"
    return f"what answers there is no wall (HTTP {status}); wanted: the address of its page"
