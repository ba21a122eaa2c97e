"""Which address other hosts can reach us at, when we listen on all of them, and which hosts may."""

from __future__ import annotations

import fcntl
import socket
import struct
from collections.abc import Sequence

_SIOCGIFADDR = 0x8915
WILDCARDS = ("0.0.0.0", "*")


def reachable(bind: str) -> str:
    """The address to tell others: `bind` itself, or for a wildcard the first network interface's IPv4 address.

    Names are not used: a host's own name often resolves to its loopback address. Name the right interface's address in
    `transport.bind` where a host has several.
    """
    if bind not in WILDCARDS:
        return bind
    for _, name in socket.if_nameindex():
        address = _address_of(name)
        if address and not address.startswith("127."):
            return address
    return "127.0.0.1"


def let_in(networks: Sequence[str], bind: str) -> list[str]:
    """All that may connect where these may: they, and this machine, by `bind` or the address of an interface."""
    try:
        own = {socket.gethostbyname(reachable(bind))}
    except OSError:
        own = set()  # listening there will say so
    own |= {address for _, name in socket.if_nameindex() if (address := _address_of(name))}
    return [*networks, "127.0.0.0/8", *(f"{address}/32" for address in own)]


def _address_of(interface: str) -> str | None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            packed = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, struct.pack("256s", interface[:15].encode()))
        except OSError:
            return None  # an interface that has no IPv4 address
    return socket.inet_ntoa(packed[20:24])
