"""How a process becomes a rank of a running wall, and leaves it: messages between it and the manager."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinRequest:
    """Another process wants to be a rank. It asks for what that takes first, and when it has that for a place."""

    client: int  # a number of its own, above all ranks
    number: int  # of its requests: one that comes again is answered again
    key: str  # the run's, from its control file
    host: str
    configuration: int = -1  # number of the configuration that it has made; -1: none
    public: str = ""  # its own CURVE key; "" where nothing is encrypted


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinAnswer:
    """What the manager answers to a JoinRequest."""

    client: int  # as they came
    number: int
    refused: str = ""  # why there is no place; "" where there is one
    rank: int = -1  # the place, to which it says Hello at once; -1: it is to make the configuration first
    configuration: int = 0  # number of the run's
    since: int = 0  # its first camera event
    extra: int = 0  # places of renderers beyond the configuration's
    told: str = ""  # JSON of what it takes to make the configuration; "" where it has made that


@dataclass(frozen=True, slots=True, kw_only=True)
class Leave:
    """A rank that has joined ends, and is not waited for. Its last word."""

    rank: int
