"""The HTTP server of a run: a thread and an event loop of its own, behind the gate that says who gets in."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Future
from typing import Any

from aiohttp import web

from wall.core.errors import RunError
from wall.display.gate import ANYONE, Access, Gate, tls_of, why_not

KEEP_ALIVE_S = 30.0  # a connection that asks for nothing more
HANDSHAKE_S = 5.0  # of TLS
CLOSE_S = 0.9  # how long `close` waits; of which the server waits for viewers' goodbyes,
LEAVE_S = 0.2  # open requests and unfinished tasks, each at most this long
POLICY = "Content-Security-Policy"
HEADERS = {
    POLICY: "default-src 'self'; img-src 'self' blob: data:; frame-ancestors ",  # and whose
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
NOBODY, THIS_MACHINE = "'none'", "http://localhost:* http://127.0.0.1:*"  # whose pages may hold ours in a frame

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


async def _no_goodbye() -> None:
    pass


class Server:
    """Serves from `start` to `close`."""

    def __init__(self, host: str, port: int, *, access: Access = ANYONE, frames: str = NOBODY) -> None:
        """`frames`: whose pages may hold ours in a frame. Port 0 takes any free one."""
        self.counters = Counter[str]()  # of what was refused; written by the server's thread
        self._host, self._port, self._frames = host, port, frames
        self.gate, self._tls = Gate(host, self.counters, access), tls_of(access.tls)
        self.loop = asyncio.new_event_loop()
        self._stopping = asyncio.Event()
        self._thread: threading.Thread | None = None

    def start(self, routes: Mapping[str, Handler], goodbye: Callable[[], Awaitable[None]] = _no_goodbye) -> str:
        """Serve these paths; returns the address, without a token. Raises RunError where that cannot be.

        `goodbye` is awaited at the end, while connections are still open.
        """
        bound: Future[str] = Future()
        self._thread = threading.Thread(target=self._serve, args=(routes, goodbye, bound), name="server", daemon=True)
        self._thread.start()
        return bound.result()

    def call(self, what: Callable[[], object]) -> None:
        """Let the server's thread call a function soon."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody is there to be told
            self.loop.call_soon_threadsafe(what)

    def close(self) -> None:
        """Stop serving, within a second."""
        self.call(self._stopping.set)
        if self._thread is not None:
            self._thread.join(CLOSE_S)

    # Below, everything runs in the server's thread.

    def _serve(self, routes: Mapping[str, Handler], goodbye: Callable[[], Awaitable[None]], bound: Future[str]) -> None:
        asyncio.set_event_loop(self.loop)
        try:
            self.loop.run_until_complete(self._run(routes, goodbye, bound))
        except Exception as error:
            if bound.done():
                raise
            bound.set_exception(RunError(f"the page cannot be served at {self._host}: {error!r}"))
        finally:
            if left := asyncio.all_tasks(self.loop):  # of viewers that leave at this very moment
                for task in left:
                    task.cancel()
                self.loop.run_until_complete(asyncio.wait(left, timeout=LEAVE_S))
            self.loop.close()

    async def _run(
        self, routes: Mapping[str, Handler], goodbye: Callable[[], Awaitable[None]], bound: Future[str]
    ) -> None:
        app = web.Application(middlewares=[self.gate.guard])
        app.on_response_prepare.append(self._add_headers)
        for path, handler in routes.items():
            app.router.add_get(path, handler)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=LEAVE_S, keepalive_timeout=KEEP_ALIVE_S)
        await runner.setup()
        more: dict[str, Any] = {"ssl_handshake_timeout": HANDSHAKE_S} if self._tls is not None else {}
        assert runner.server is not None
        try:
            server = await self.loop.create_server(runner.server, self._host, self._port, ssl=self._tls, **more)
        except OSError as error:
            await runner.cleanup()
            bound.set_exception(RunError(why_not(self._host, self._port, error)))
            return
        sweeping = asyncio.create_task(self.gate.sweep(runner.server))
        bound.set_result(self._address(*server.sockets[0].getsockname()[:2]))
        await self._stopping.wait()
        sweeping.cancel()
        server.close()
        await goodbye()
        await runner.cleanup()

    def _address(self, host: str, port: int) -> str:
        if host in ("0.0.0.0", "::"):
            host = socket.gethostname()
        scheme = "http" if self._tls is None else "https"
        return f"{scheme}://[{host}]:{port}/" if ":" in host else f"{scheme}://{host}:{port}/"

    async def _add_headers(self, request: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(HEADERS)
        response.headers[POLICY] = HEADERS[POLICY] + self._frames
