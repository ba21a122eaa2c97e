"""Whether anybody listens at an endpoint: tells the end of the head from a cut network and from a head that is held up.

A machine whose process has ended refuses connections to its port. One that is not reached answers nothing, and of a
process that stands still the kernel takes the connection.
"""

from __future__ import annotations

import errno
import select
import socket

ASK_S = 0.5  # between two questions, and for the answer to one
REFUSALS = 2  # in a row: nobody listens there


class Probe:
    """Asks, without ever waiting. Where an endpoint has no address of IPv4, somebody listens there."""

    def __init__(self, endpoint: str) -> None:
        self._address = _address_of(endpoint)
        self._socket: socket.socket | None = None
        self._due, self._refused = 0.0, 0

    def refused(self, now: float) -> bool:
        """Whether connections are refused; asks again if that is due. `now`: monotonic seconds."""
        if self._socket is not None and _writable(self._socket):
            self._take(self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR))
        elif now >= self._due:
            self._due = now + ASK_S
            self._ask()
        return self._refused >= REFUSALS

    def close(self) -> None:
        """Drop a question that is not answered. May be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _ask(self) -> None:
        if self._socket is not None:  # not answered in time
            self._take(errno.ETIMEDOUT)
        if self._address is None:
            return
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        code = self._socket.connect_ex(self._address)
        if code != errno.EINPROGRESS:
            self._take(code)

    def _take(self, code: int) -> None:
        self._refused = self._refused + 1 if code == errno.ECONNREFUSED else 0
        self.close()


def _writable(asked: socket.socket) -> bool:
    """Whether it is connected, or refused; select would not take descriptors from 1,024 on."""
    poll = select.poll()
    poll.register(asked, select.POLLOUT)
    return bool(poll.poll(0))


def _address_of(endpoint: str) -> tuple[str, int] | None:
    """A name is looked up now: that takes long where the network is cut."""
    if not endpoint.startswith("tcp://"):
        return None
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    try:
        return socket.gethostbyname(host), int(port)
    except OSError:
        return None
