"""Which launched process gets which rank of the wall, when the configuration names machines.

A launcher numbers processes as its host file happens to list machines; windows must be where the displays hang.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wall.core.errors import ConfigError
from wall.run.bootstrap import Bootstrap


def assign(wanted: Mapping[int, str], machines: Sequence[str], *, config: str) -> tuple[int, ...]:
    """The wall's rank of every launched process; the first stays the head.

    Parameters
    ----------
    wanted : machine by rank of the wall, for ranks that have a wish
    machines : of every launched process
    config : name of the file, for the error

    All on one machine is a simulation: wishes are void. Raises ConfigError where a machine runs too few processes.
    """
    if len(set(machines)) == 1:
        return tuple(range(len(machines)))
    if (head := wanted.get(0)) is not None and not same_machine(head, machines[0]):
        raise ConfigError(
            f"{config}: the head is wanted on {head}, and process 0 runs on {machines[0]}; name {head} first"
        )
    rank_of: dict[int, int] = {0: 0}  # launched process -> rank
    for rank, host in sorted(wanted.items()):
        if rank == 0:
            continue
        process = next((p for p, m in enumerate(machines) if p not in rank_of and same_machine(host, m)), None)
        if process is None:
            counts = ", ".join(f"{machines.count(m)} on {m}" for m in dict.fromkeys(machines))
            raise ConfigError(
                f"{config}: rank {rank} is wanted on {host}, where no process is left; launched: {counts} "
                "(the first is the head)"
            )
        rank_of[process] = rank
    rest = (rank for rank in range(len(machines)) if rank not in rank_of.values())
    return tuple(rank_of[p] if p in rank_of else next(rest) for p in range(len(machines)))


def same_machine(a: str, b: str) -> bool:
    """Whether two names are of one machine; one of them may lack its domain."""
    short = "." not in a or "." not in b
    return a.split(".")[0] == b.split(".")[0] if short else a == b


class Renumbered:
    """A Bootstrap under the wall's rank numbers."""

    def __init__(self, bootstrap: Bootstrap, rank_of: Sequence[int]) -> None:
        """rank_of : of every launched process, see assign"""
        self._bootstrap, self._rank_of = bootstrap, rank_of
        self.rank, self.size = rank_of[bootstrap.rank], bootstrap.size
        self.killed_soon = bootstrap.killed_soon
        self.keys = None if bootstrap.keys is None else bootstrap.keys.renumbered(rank_of)

    def broadcast(self, text: str) -> str:
        """Rank 0's text at every rank; the first launched process stays rank 0."""
        return self._bootstrap.broadcast(text)

    def dead(self) -> dict[int, str]:
        """Ranks of the wall that have ended badly: how."""
        return {self._rank_of[process]: how for process, how in self._bootstrap.dead().items()}

    def start_again(self, rank: int, text: str) -> bool:
        """Start a rank that is dead once more; it gets `text` as a broadcast. Returns whether that can be tried."""
        return self._bootstrap.start_again(self._rank_of.index(rank), text)

    def finish(self, *, told: bool = True) -> None:
        """End what was started."""
        self._bootstrap.finish(told=told)
