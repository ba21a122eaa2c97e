"""The transport that a configuration names."""

from __future__ import annotations

from collections.abc import Sequence

from wall.transport.base import Hub, Link
from wall.transport.curve import Keys
from wall.transport.loopback import LoopbackHub, LoopbackLink
from wall.transport.zeromq import ZmqHub, ZmqLink

LOOPBACK = "loopback:"  # how the endpoints of hubs inside one process begin


def open_hub(
    kind: str, bind: str, *, credit_bytes: int, keys: Keys | None = None, ports: tuple[int, int] | None = None,
    allow: Sequence[str] = (),
) -> Hub:  # fmt: skip
    """kind: zmq or loopback. `keys`, `ports`, `allow`: see ZmqHub. Raises RunError where it cannot listen."""
    if kind == "loopback":
        return LoopbackHub(credit_bytes=credit_bytes)
    return ZmqHub(bind, credit_bytes=credit_bytes, keys=keys, ports=ports, allow=allow)


def connect(endpoint: str, *, rank: int, keys: Keys | None = None, to: int = 0) -> Link:
    """A link to the hub of that endpoint, which says of which kind it is. `keys`, `to`: see ZmqLink."""
    return LoopbackLink(endpoint) if endpoint.startswith(LOOPBACK) else ZmqLink(endpoint, rank=rank, keys=keys, to=to)
