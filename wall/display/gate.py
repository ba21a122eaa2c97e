"""Whom the page's server lets in: by the address that is asked for, by token, and how many at once.

Off loopback whoever asks has to bring a token, which is in the address that the run prints: one lets steer, the other
only watch. The page keeps it in a cookie, so that it does not stay in the address bar.
"""

from __future__ import annotations

import asyncio
import errno
import re
import secrets
import socket
import ssl
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aiohttp import web

from wall.core.errors import RunError
from wall.core.files import read_file
from wall.core.network import is_loopback
from wall.display.steering import host_is_ours, origin_is_ours

TOKEN_BYTES = 16
OWN_TOKEN = re.compile("[A-Za-z0-9_-]{16,128}")  # what a file may hold as one
FIRST_REQUEST_S = 5.0  # for a connection to ask for something that it may have
MAX_SILENT = 64  # connections that have not done so yet; the oldest beyond are closed
SWEEP_S = 0.25
MOST_TOKEN_BYTES = 1024  # of a file
RATE, BURST = 500.0, 1000.0  # messages a second of one viewer, and at once: a page sends 100; long ones are several


@dataclass(frozen=True, slots=True)
class Access:
    """Who gets in at the page and at metrics."""

    tokens: bool = False  # whether they are asked for
    steer_token: str = ""  # lets steer, the next lets watch; "": a new one does
    watch_token: str = ""
    tls: tuple[Path, Path] | None = None  # see tls_of


ANYONE = Access()


class Gate:
    """Belongs to the server's thread."""

    def __init__(self, host: str, counters: Counter[str], access: Access = ANYONE) -> None:
        """`host`: the address that the server is bound to."""
        self._host, self._counters = host, counters
        self._names = _own_names(host)
        given = access.steer_token, access.watch_token
        self._steer, self._watch = ((each or secrets.token_urlsafe(TOKEN_BYTES)) * access.tokens for each in given)
        self._silent: dict[Any, float] = {}  # since when, by connection
        self._spoke: set[Any] = set()  # connections

    @property
    def tokens(self) -> tuple[str, str]:
        """What lets steer, and watch; "" without tokens."""
        return self._steer, self._watch

    @property
    def queries(self) -> tuple[str, str]:
        """What addresses end with that let steer, and watch; "" without tokens."""
        return (f"?token={self._steer}", f"?token={self._watch}") if self._steer else ("", "")

    @web.middleware
    async def guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse what does not ask for us, comes from another site's page, or lacks the token."""
        refused = self._refusal(request)
        if refused:
            answer = web.Response(status=web.HTTPForbidden.status_code, text=refused)
            answer.force_close()
            return answer
        self._spoke.add(request.protocol)
        if request.path == "/" and (token := request.query.get("token")) and self._steer:
            opened = web.Response(status=web.HTTPSeeOther.status_code, headers={"Location": "/"})
            secure = request.transport is not None and request.transport.get_extra_info("ssl_object") is not None
            opened.set_cookie(_cookie(request), token, httponly=True, samesite="Lax", secure=secure)
            return opened
        response: web.StreamResponse = await handler(request)
        return response

    def _refusal(self, request: web.Request) -> str:
        """Why a request gets nothing; "" for one that is good."""
        host, page = request.headers.get("Host", ""), request.path == "/"
        why = ""
        if not host_is_ours(host, self._host, self._names):
            why = "this address is not mine; open the one that was printed\n"
        elif not page and request.headers.get("Sec-Fetch-Site") == "cross-site":
            why = "other sites' pages may not use this one\n"
        elif request.path == "/stream" and not origin_is_ours(request.headers.get("Origin"), host):
            why = "other sites' pages may not steer this wall\n"
        if why:
            self._counters["browser_foreign_request"] += 1
            return why
        if self.steers(request) or _same(_token_of(request), self._watch):
            return ""
        self._counters["browser_no_token"] += 1
        return "this page needs a token; open the address that the run has printed, or a new one after a new start\n"

    def steers(self, request: web.Request) -> bool:
        """Whether a request's sender may change anything."""
        return not self._steer or _same(_token_of(request), self._steer)

    async def sweep(self, server: web.Server) -> None:
        """Close connections that say nothing, or too many of them, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            now = loop.time()
            there = server.connections
            self._spoke.intersection_update(there)
            self._silent = {one: self._silent.get(one, now) for one in there if one not in self._spoke}
            oldest_first = sorted(self._silent, key=lambda one: self._silent[one])
            for number, one in enumerate(reversed(oldest_first)):
                if (number >= MAX_SILENT or now - self._silent[one] > FIRST_REQUEST_S) and one.transport is not None:
                    one.transport.abort()
                    self._counters["browser_silent_connection"] += 1
            await asyncio.sleep(SWEEP_S)


class Pace:
    """How many messages one viewer may send."""

    def __init__(self, now: float) -> None:
        self._left, self._at = BURST, now

    def allows(self, now: float, count: int = 1) -> bool:
        """Whether so many more are within RATE and BURST."""
        self._left = min(BURST, self._left + (now - self._at) * RATE) - count
        self._at = now
        return self._left >= 0


def tls_of(files: Sequence[Path] | None) -> ssl.SSLContext | None:
    """What encrypts the page; `files`: certificate and key in PEM. Raises RunError where they do not serve."""
    if files is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    certificate, key = files
    try:
        context.load_cert_chain(certificate, key, password="")  # or it would ask the terminal for one
    except (OSError, ValueError) as error:
        wanted = "wanted: a certificate and its key in PEM, the key without a password"
        raise RunError(f"output.browser.tls: {certificate} with {key}: {error}; {wanted}") from error
    return context


def token_in(path: Path) -> str:
    """The token in a file. Raises RunError where it has none that serves."""
    try:
        token = read_file(path, MOST_TOKEN_BYTES).decode().strip()
    except (OSError, ValueError) as error:
        raise RunError(f"output.browser.watch_token: {path}: {getattr(error, 'strerror', '') or error}") from error
    if not OWN_TOKEN.fullmatch(token):
        wanted = "wanted: 16 to 128 letters, digits, - and _, such as: openssl rand -hex 16"
        raise RunError(f"output.browser.watch_token: {path} holds {len(token)} characters that are no token; {wanted}")
    return token


def why_not(host: str, port: int, error: OSError) -> str:
    """Why a server could not be bound."""
    where = f"the page cannot be served at {host} port {port}"
    if error.errno == errno.EADDRINUSE:
        return f"{where}: another program has this port; wanted a free one, or 0 for any"
    return f"{where}: {error.strerror or error}"


def _cookie(request: web.Request) -> str:
    """Cookies of a host are those of all its ports."""
    name = request.transport.get_extra_info("sockname") if request.transport is not None else None
    return f"wall_{name[1] if name else 0}"


def _token_of(request: web.Request) -> str:
    scheme, _, token = request.headers.get("Authorization", "").partition(" ")
    bearer = token.strip() if scheme.lower() == "bearer" else ""
    return request.query.get("token") or bearer or request.cookies.get(_cookie(request), "")


def _same(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(errors="replace"), other.encode())


def _own_names(host: str) -> frozenset[str]:
    if is_loopback(host):
        return frozenset()  # needs none; asking for the full name can take seconds
    return frozenset({socket.gethostname().lower(), socket.getfqdn().lower()})
