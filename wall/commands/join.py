"""`wall join`: this process becomes a renderer of a running wall, until that ends or it is told to leave."""

from __future__ import annotations

import socket
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

from wall.client import Client
from wall.packets.joining import JoinAnswer
from wall.roles.instructions import End
from wall.roles.plan import Plan
from wall.run import control_file
from wall.run.cores import usable_cores
from wall.run.endings import EndSignals
from wall.run.joined import Told, as_given
from wall.run.launch import prepare
from wall.run.ranks import serve
from wall.run.succession import Preparer
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import TracerScene
from wall.transport.curve import KeyPair

Say = Callable[[str], None]


def join(control: control_file.Control, say: Say) -> str:
    """Be a renderer of a wall. Returns how that ended.

    Raises RunError where no wall answers, EditError where it has no place, ConfigError where files are others here.
    """
    own = KeyPair.new() if control.head else None
    ends: deque[End] = deque()
    reason = ""

    def leave(why: str) -> None:
        nonlocal reason
        reason = why
        ends.append(End(why))

    signals = EndSignals(leave)
    with Client(control) as client:
        told, answer, plan, scene = _place(client, "" if own is None else own.public, say, signals)
    plan = as_given(plan, answer)
    part = plan.layout.describe(answer.rank) or "what the others leave to it"
    say(f"rank {answer.rank} of the wall of process {control.pid} on {control.host}: {part}")
    threading.Thread(target=_load_rest, args=(plan, scene, told), name="kernels", daemon=True).start()
    try:
        serve(
            plan, scene, told.bootstrap(answer, plan, own, control.endpoint), Preparer(plan, told.machines),
            headless=told.headless, out=Path(), sources=[lambda: [ends.popleft() for _ in range(len(ends))]],
        )  # fmt: skip
    finally:
        signals.restore()
    return f"left: {reason}" if reason else "the wall has ended"


def _load_rest(plan: Plan, scene: TracerScene, told: Told) -> None:
    """Load the kernels of the samplers that viewers may choose, beside what this process traces by then."""
    warm_up(plan, scene, lambda line: None, headless=told.headless, beside=True)


def control_at(address: str) -> control_file.Control:
    """How to reach a wall: by its folder of results, its control file, or - for the text of one. Raises RunError."""
    if address == "-":
        return control_file.parse(sys.stdin.read(), "the standard input")
    path = Path(address)
    return control_file.read(path.parent if path.name == control_file.NAME else path)


def _place(client: Client, public: str, say: Say, signals: EndSignals) -> tuple[Told, JoinAnswer, Plan, TracerScene]:
    """Make what the wall runs, and get a place. From then on `signals` say when to leave."""
    made: tuple[Told, Plan, TracerScene] | None = None
    while True:
        number = made[0].number if made is not None else -1
        if made is not None:
            signals.install()
        answer = client.join(socket.gethostname(), configuration=number, public=public)
        if answer.rank >= 0 and made is not None:
            return made[0], answer, made[1], made[2]
        signals.restore()
        told = Told(answer)
        cores = 1.0 if socket.gethostname() in told.machines else usable_cores()
        # what viewers may choose comes later, see _load_rest
        made = told, *prepare(told.layout(), say, headless=True, cores=cores)
