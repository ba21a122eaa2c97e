"""Serve `/metrics` and `/status.json` at a port of their own: also for runs without a page."""

from __future__ import annotations

from aiohttp import web

from wall.display.base import Status
from wall.display.gate import ANYONE, Access
from wall.display.metrics import CONTENT_TYPE, PageCounts, metrics_text, whole_status_message
from wall.display.server import Server


class MetricsServer:
    """Serves from construction to `close`; behind the gate of the page."""

    def __init__(self, host: str, port: int, *, access: Access = ANYONE) -> None:
        """See Browser. Raises RunError naming what cannot be had."""
        self._status: Status | None = None
        self._server = Server(host, port, access=access)
        where = self._server.start({"/metrics": self._metrics, "/status.json": self._status_json})
        self.tokens = self._server.gate.tokens
        self.address = f"{where}metrics{self._server.gate.queries[1]}"

    def tell(self, status: Status) -> None:
        """Serve this one from now on."""
        self._status = status

    def close(self) -> None:
        """Stop serving, within a second."""
        self._server.close()

    async def _metrics(self, request: web.Request) -> web.Response:
        return web.Response(text=metrics_text(self._status, self._counts()), headers={"Content-Type": CONTENT_TYPE})

    async def _status_json(self, request: web.Request) -> web.Response:
        if self._status is None:
            raise web.HTTPServiceUnavailable(text="no image yet\n")
        return web.Response(text=whole_status_message(self._status, self._counts()), content_type="application/json")

    def _counts(self) -> PageCounts:
        return PageCounts(dropped=dict(self._server.counters))
