"""What a stranger on the network of a wall takes from its renderers, see stranger.py."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence

from wall.core.errors import RunError
from wall.roles.plan import Layout
from wall.study.faults.hosts import Hosts
from wall.study.faults.walls import FaultyWall
from wall.study.peers.cpu_meter import SYSTEM, USER, stat_of

CONNECTIONS_A_S = 1000.0
TURN_S = 2.0  # that the stranger connects, or rests, by turns: rates of a wall drift
FINDS_S = 30.0  # longest that the first turn takes, in which ports are looked for


def slowed_by_stranger(wall: FaultyWall, layout: Layout, ports: str, *, turns: int) -> tuple[float, float]:
    """Percent of their processor time that renderers lack while a stranger connects CONNECTIONS_A_S times a second to
    the `ports` that the hosts listen on; and how often it did.

    What it takes itself is not among that: hosts of namespaces share this machine's cores with it, so it takes as much
    where it rests. Samples a second are no measure of so little: they change with what is seen.

    Raises RunError where it finds no ports.
    """
    assert wall.hosts is not None
    ranks, busy, rest, made = wall.hosts.ranks(), list[float](), list[float](), 0
    renderers = [ranks[rank] for rank in layout.renderers()]
    with stranger(wall.hosts, ports) as process:
        turn(process, "connect", renderers)
        for _ in range(turns):
            rest.append(turn(process, "rest", renderers)[0])
            taken, connections = turn(process, "connect", renderers)
            busy.append(taken)
            made += connections
    return round(100.0 * (1.0 - sum(busy) / sum(rest)), 1), made / (turns * TURN_S)


def stranger(hosts: Hosts, ports: str) -> subprocess.Popen[str]:
    """The process of a stranger on the hosts' network, quiet until it is told a line."""
    program = [sys.executable, "-m", "wall.study.faults.stranger", ports, f"{CONNECTIONS_A_S:g}", f"{TURN_S:g}"]
    return subprocess.Popen(
        hosts.beside(*program, *hosts.addresses), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def turn(process: subprocess.Popen[str], what: str, watched: Sequence[int]) -> tuple[float, int]:
    """Let the stranger connect, or rest, for a turn. Returns the watched processes' CPU seconds a second, and how many
    connections it made."""
    assert process.stdin is not None
    assert process.stdout is not None
    began, before = time.monotonic(), cpu_seconds(watched)
    process.stdin.write(f"{what}\n")
    process.stdin.flush()
    if not select.select([process.stdout], [], [], FINDS_S)[0]:
        process.kill()
        raise RunError(f"the stranger did not answer within {FINDS_S:g} s")
    told = json.loads(process.stdout.readline() or "{}")
    if not told.get("ports"):
        raise RunError("the stranger found no port of the wall; wanted: some that listen on the hosts' network")
    return (cpu_seconds(watched) - before) / (time.monotonic() - began), told["connections"]


def cpu_seconds(processes: Sequence[int]) -> float:
    """What processes have taken so far, in the user's and the kernel's mode. Raises RunError where one has ended."""
    ticks = 0
    for number in processes:
        if not (fields := stat_of(number)):
            raise RunError(f"process {number} of the wall has ended")
        ticks += int(fields[USER]) + int(fields[SYSTEM])
    return ticks / os.sysconf("SC_CLK_TCK")
