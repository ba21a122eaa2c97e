"""What memory this machine has left, and the refusal of a wall that needs more."""

from __future__ import annotations

import socket
from collections.abc import Sequence

from wall.core.errors import ConfigError
from wall.core.system import available_bytes
from wall.roles.memory import HostMemory, memory_on_host
from wall.roles.plan import Layout, Plan
from wall.run.hosts import same_machine
from wall.run.usage import memory

GB, MB = 1e9, 1e6
SURELY = 1.25  # times what is left: by so much what is worked out may be too much, see docs/guide/configuration.md
FEWER_PIXELS = "fewer pixels, or fewer sampling.samples_per_pixel"
REMEDIES = {
    "images": f"{FEWER_PIXELS}, or more ranks on more machines",
    "framelets": "fewer pixels, or more compositors on more machines",
    "sampling": "fewer pixels, sampling.threads or objects",
    "shared": "fewer pixels, or fewer transport.credit_bytes",
    "scene": "a smaller model or smaller textures",
    "programs": "fewer ranks on this machine",
}


def check_memory(plan: Plan, ranks: Sequence[int], *, forked: bool, available: int | None, host: str) -> HostMemory:
    """What ranks need on a machine. Raises ConfigError where that is more than it has left; None: it is not told.

    `forked`: see memory_on_host; `available`: bytes, those that these ranks have taken already among them.
    """
    needed = memory_on_host(plan, ranks, forked=forked)
    if available is not None and needed.total > SURELY * available:
        raise ConfigError(f"{plan.layout.loaded.path}: {too_much(needed, available, host)}")
    return needed


def check_started(plan: Plan, ranks: Sequence[int], *, forked: bool, host: str) -> None:
    """Refuse to go on where ranks need more than is left on this machine; they have loaded the scene.

    Raises ConfigError.
    """
    left, taken = available_bytes(), memory() * (1 if forked else len(ranks))
    check_memory(plan, ranks, forked=forked, available=None if left is None else left + taken, host=host)


def check_next(plan: Plan, machines: Sequence[str], left: int | None) -> None:
    """Refuse a configuration that a running wall is to adopt: both need memory until then, and each rank has a scene
    of its own.

    machines : of every rank, "" all here
    left : available_bytes before any rank had loaded the scene

    Raises ConfigError.
    """
    host = socket.gethostname()
    ranks = [rank for rank, machine in enumerate(machines) if machine in ("", host)]
    if left is not None and ranks:
        running = memory_on_host(plan, ranks, forked=False).programs
        check_memory(plan, ranks, forked=False, available=left + running, host=host)


def too_much(needed: HostMemory, available: int, host: str) -> str:
    """Who needs how much where, and what to lower."""
    parts = parts_of(needed)
    most = max(parts, key=lambda name: parts[name])
    numbers = [rank.rank for rank in needed.ranks]
    who = f"rank {numbers[0]} needs" if len(numbers) == 1 else f"{len(numbers)} ranks need"
    return (
        f"{who} {needed.total / GB:.2f} GB of memory on {host}, {parts[most] / GB:.2f} of it for {most}, and "
        f"{available / GB:.2f} are left there; wanted: {REMEDIES[most]}"
    )


def parts_of(needed: HostMemory) -> dict[str, int]:
    """Bytes by what they are for."""
    of_ranks = ("images", "framelets", "sampling", "shared")
    found = {name: sum(getattr(rank, name) for rank in needed.ranks) for name in of_ranks}
    return {**found, "scene": needed.scene, "programs": needed.programs}


def ranks_here(layout: Layout, host: str) -> list[int]:
    """The ranks that a configuration does not place on other machines."""
    return [rank for rank in range(layout.size) if same_machine(layout.graph.hosts.get(rank, host), host)]
