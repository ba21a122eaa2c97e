"""Who may connect to a hub, and as whom: CURVE keys of a run, and the check of keys. Imports zmq, as zeromq.py does.

Each rank has a pair of keys. A link proves its own with each connection, and wants that of the hub that it means. A hub
lets in the keys of its run alone, and marks every message with the rank whose key it came by. A process that takes the
place of a rank while the wall runs has keys of its own, which hubs are told.
"""

from __future__ import annotations

import hashlib
import struct
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import zmq
from zmq.utils import z85

from wall.core.errors import RunError
from wall.transport.base import GUEST

DOMAIN = b"wall"
KEY_CHARACTERS, KEY_BYTES = 40, 32
_ZAP = "inproc://zeromq.zap.01"  # where libzmq asks, https://rfc.zeromq.org/spec/27/


@dataclass(frozen=True, slots=True)
class KeyPair:
    """Two CURVE keys as Z85 text, 40 characters each."""

    public: str
    secret: str = field(repr=False)

    @classmethod
    def new(cls) -> KeyPair:
        """Keys that nobody can guess. Raises RunError where this ZeroMQ has no CURVE."""
        if not zmq.has("curve"):
            raise RunError("transport.encrypt: this ZeroMQ has no CURVE; wanted the wheel of pyzmq, or encrypt: never")
        public, secret = zmq.curve_keypair()
        return cls(public.decode(), secret.decode())

    @classmethod
    def of_guests(cls, key: str) -> KeyPair:
        """The keys of all processes beside a run, which know the key of its requests."""
        secret = z85.encode(hashlib.blake2b(key.encode(), digest_size=32, person=b"wall guests").digest())
        return cls(zmq.curve_public(secret).decode(), secret.decode())


@dataclass(frozen=True, slots=True)
class Keys:
    """What one process proves itself with, and how it knows others."""

    own: KeyPair
    ranks: tuple[str, ...]  # public keys, by rank
    guests: str = ""  # public key of processes beside the run, at hubs that let them in

    @classmethod
    def of_all(cls, size: int) -> list[Keys]:
        """Those of each rank of a run."""
        pairs = [KeyPair.new() for _ in range(size)]
        return [cls(pair, tuple(each.public for each in pairs)) for pair in pairs]

    @classmethod
    def of_guest(cls, key: str, head: str) -> Keys:
        """Those of a process beside the run; `head`: the public key of rank 0."""
        return cls(KeyPair.of_guests(key), (head,))

    def renumbered(self, rank_of: Sequence[int]) -> Keys:
        """The same, where process p is rank rank_of[p]."""
        by_rank = sorted(zip(rank_of, self.ranks, strict=True))
        return replace(self, ranks=tuple(key for _, key in by_rank))

    def with_guests(self, key: str) -> Keys:
        """The same, at a hub that lets in those who know the key of requests."""
        return replace(self, guests=KeyPair.of_guests(key).public)

    def lock(self, socket: zmq.Socket[bytes]) -> None:
        """Let a hub's socket, not yet bound, take connections of this run alone, see Gatekeeper."""
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self.own.secret.encode())
        socket.setsockopt(zmq.ZAP_DOMAIN, DOMAIN)
        socket.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)  # without a gatekeeper nobody gets in

    def unlock(self, socket: zmq.Socket[bytes], to: int) -> None:
        """Let a link's socket, not yet connected, talk to the hub of a rank and no other."""
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self.own.public.encode())
        socket.setsockopt(zmq.CURVE_SECRETKEY, self.own.secret.encode())
        socket.setsockopt(zmq.CURVE_SERVERKEY, self.ranks[to].encode())


def is_key(text: str) -> bool:
    """Whether a text can be a public key."""
    try:
        return len(text) == KEY_CHARACTERS and len(z85.decode(text)) == KEY_BYTES
    except (KeyError, ValueError, struct.error):
        return False


class Gatekeeper(threading.Thread):
    """Answers libzmq's question who may connect, for all sockets of a context; ends with the context.

    The answer names the rank of a key, or GUEST. libzmq gives that name to each message that comes by
    the connection, see `holder`.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], keys: Keys) -> None:
        super().__init__(name="gatekeeper", daemon=True)
        self._holders = {z85.decode(key): b"%d" % rank for rank, key in enumerate(keys.ranks) if key}
        if keys.guests:
            self._holders[z85.decode(keys.guests)] = b"%d" % GUEST
        self._socket = context.socket(zmq.REP)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.bind(_ZAP)
        self.start()

    def admit(self, rank: int, key: str) -> None:
        """From now on a rank has this key in place of another. Called by the hub's thread."""
        name, own = b"%d" % rank, z85.decode(key)
        if self._holders.get(own) != name:
            self._holders = {k: who for k, who in self._holders.items() if who != name} | {own: name}

    def run(self) -> None:
        """Answer until the context ends. Who is not known may be so later: its connection tries again."""
        try:
            while True:
                version, request, _, _, _, mechanism, *credentials = self._socket.recv_multipart()
                known = mechanism == b"CURVE" and len(credentials) == 1
                holder = self._holders.get(credentials[0]) if known else None
                status = b"300" if holder is None else b"200"
                self._socket.send_multipart((version, request, status, b"", holder or b"", b""))
        except zmq.ContextTerminated:
            self._socket.close()


def holder(frame: zmq.Frame) -> int:
    """The rank, or GUEST, by whose key a message came; of any of its parts."""
    return int(frame.get("User-Id"))
