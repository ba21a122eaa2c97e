"""Addresses: which only this machine can reach, and where it can listen."""

from __future__ import annotations

import errno
import ipaddress
import socket
from contextlib import closing


def is_loopback(host: str) -> bool:
    """Whether nobody but this machine can reach what is bound to `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def why_taken(host: str, port: int) -> str:
    """Why nothing can listen there; "" if it can. Port 0 is any free one."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_STREAM)) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as servers do: what has just ended is free
        try:
            probe.bind(("" if host == "*" else host, port))
            probe.listen(1)
        except OSError as error:
            if error.errno == errno.EACCES:
                return "ports below 1024 are root's (sysctl net.ipv4.ip_unprivileged_port_start)"
            return error.strerror or str(error)
    return ""
