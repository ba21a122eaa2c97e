"""The transport that a configuration names."""

from __future__ import annotations

from wall.transport.base import Hub, Link
from wall.transport.loopback import LoopbackHub, LoopbackLink
from wall.transport.zeromq import ZmqHub, ZmqLink

LOOPBACK = "loopback:"  # how the endpoints of hubs inside one process begin


def open_hub(kind: str, bind: str, *, credit_bytes: int) -> Hub:
    """kind: zmq or loopback. Raises RunError where `bind` is not an address to listen on."""
    return LoopbackHub(credit_bytes=credit_bytes) if kind == "loopback" else ZmqHub(bind, credit_bytes=credit_bytes)


def connect(endpoint: str, *, rank: int) -> Link:
    """A link to the hub of that endpoint, which says of which kind it is."""
    return LoopbackLink(endpoint) if endpoint.startswith(LOOPBACK) else ZmqLink(endpoint, rank=rank)
