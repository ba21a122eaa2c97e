"""A process that becomes a rank of a running wall: what the head tells it, and how it begins by that."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wall.config.loading import dump, loads
from wall.core.errors import ConfigError
from wall.packets.joining import JoinAnswer
from wall.roles.instructions import Invitation
from wall.roles.joining import grown
from wall.roles.plan import Layout, Plan, make_layout
from wall.run.same_files import differences, fingerprints
from wall.transport.curve import KeyPair, Keys
from wall.transport.shared_memory import machine_id

RETRY_S = 2.0  # after files could not be read


class Inviter:
    """At the head: makes, in a thread, what processes are told that want to join; of each configuration once."""

    def __init__(self, machines: Sequence[str], keys: Keys | None, *, headless: bool) -> None:
        """`machines`: of every rank of the configuration, as plans are made by."""
        self._machines, self._headless = list(machines), headless
        self._keys = [] if keys is None else list(keys.ranks)
        self._begun, self._again = -1, math.inf  # configuration; when its files are to be read again
        self._news: deque[Invitation] = deque()

    def look(self, plan: Plan) -> Iterator[Invitation]:
        """What was made since this was asked last; `plan`: what runs."""
        if plan.number != self._begun or time.monotonic() >= self._again:
            self._begun, self._again = plan.number, math.inf
            threading.Thread(target=self._make, args=(plan,), name="inviter", daemon=True).start()
        while self._news:
            yield self._news.popleft()

    def _make(self, plan: Plan) -> None:
        """Reading files takes long where models are large, and they may be others later."""
        try:
            self._news.append(self._invitation(plan))
        except OSError:  # no more files may be opened, or one has gone: until it is back nobody can join
            self._again = time.monotonic() + RETRY_S

    def _invitation(self, plan: Plan) -> Invitation:
        loaded = plan.layout.loaded
        told = {
            "text": dump(loaded.config),
            "name": loaded.name,
            "path": str(Path(loaded.path).absolute()),
            "prints": fingerprints(plan.layout),
            "host": socket.gethostname(),
            "machine": machine_id(),
            "machines": self._machines,
            "at_renderers": [[k.index, k.compositor] for k in plan.layout.graph.layers if k.at_renderer],
            "keys": self._keys,
            "headless": self._headless,
        }
        return Invitation(plan.number, json.dumps(told))


class Told:
    """What a process was told by an Invitation."""

    def __init__(self, answer: JoinAnswer) -> None:
        self.number = answer.configuration
        self._values: dict[str, Any] = json.loads(answer.told)
        self.machines: list[str] = self._values["machines"]
        self.headless: bool = self._values["headless"]

    def layout(self) -> Layout:
        """The run's layout, of this host's files. Raises ConfigError where they are others than the head's."""
        values = self._values
        layout = make_layout(loads(values["text"], name=values["name"], path=Path(values["path"])))
        hosts, who = [values["host"], socket.gethostname()], ("rank 0", "this process")
        if found := differences([values["prints"], fingerprints(layout)], hosts, who):
            raise ConfigError("\n".join(found))
        at_renderers = dict(values["at_renderers"])  # whatever GPU there is here
        return replace(layout, graph=layout.graph.reconstructed_at(at_renderers))

    def bootstrap(self, answer: JoinAnswer, plan: Plan, own: KeyPair | None, endpoint: str) -> JoinedBootstrap:
        """How this process begins as the rank that it has got; `endpoint`: of the manager."""
        keys = None if own is None else Keys(own, tuple(self._values["keys"]))
        address = json.dumps({"manager": endpoint, "machine": self._values["machine"]})
        return JoinedBootstrap(answer.rank, plan.layout.size, keys, address)


class JoinedBootstrap:
    """A process that was given a place; nobody watches it but by its heartbeats."""

    killed_soon = False

    def __init__(self, rank: int, size: int, keys: Keys | None, address: str) -> None:
        self.rank, self.size, self.keys, self._address = rank, size, keys, address
        self.key = "" if keys is None else keys.own.public

    def broadcast(self, text: str) -> str:
        """What rank 0 has told."""
        return self._address

    def dead(self) -> dict[int, str]:
        """None that it knows of."""
        return {}

    def start_again(self, rank: int, text: str) -> bool:
        """It starts nobody."""
        return False

    def finish(self, *, told: bool = True) -> None:
        """It has started nobody."""


def as_given(plan: Plan, answer: JoinAnswer) -> Plan:
    """The plan with the places that the run has by now."""
    layout = grown(plan.layout, answer.extra)
    return replace(plan, layout=layout, number=answer.configuration, since=answer.since)
