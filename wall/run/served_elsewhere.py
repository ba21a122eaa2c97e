"""A page that another compositor than the head serves: what people are told of it, and what `control.json` says."""

from __future__ import annotations

import socket
from collections.abc import Callable
from urllib.parse import urlsplit

from wall.core.errors import RunError
from wall.core.network import is_loopback
from wall.packets.control import Hello

Say = Callable[[str], None]


class ServedElsewhere:
    """Looks who serves the page; used by one thread."""

    def __init__(self, server: Callable[[], Hello | None], say: Say, opened: Say, *, announces: bool) -> None:
        """`server`: who serves it, None as long as nobody has said so.

        `announces`: nobody has been told yet that the wall runs, which `opened` does.
        """
        self._server, self._say, self._opened, self._announces = server, say, opened, announces
        self._known: Hello | None = None
        self.write: Say | None = None  # the address to `control.json`

    def look(self) -> tuple[()]:
        """Tell of a server that is new, or that was started again."""
        server = self._server()
        if server is None or server == self._known or urlsplit(server.page).scheme not in ("http", "https"):
            return ()
        self._known = server
        here = server.host == socket.gethostname()
        if self.write is not None and (here or not is_loopback(urlsplit(server.page).hostname or "")):
            try:
                self.write(server.page)
            except RunError as error:
                self._say(f"note: {error}")
        first, self._announces = self._announces, False
        if first:
            self._opened(server.page if here else "")
        if not first or not here:
            self._say(f"note: {server.host} serves the page at {server.page}")
        if server.watch:
            self._say(f"note: to watch the wall without steering it: {server.watch}")
        return ()
