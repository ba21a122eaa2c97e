"""Ranks that died: each is told of once, and started again where that may be."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from wall.roles.instructions import Died

RESTARTS_WITHIN_S = 60.0  # a rank is started again so often, see TransportConfig.restarts
Start = Callable[[int, int], bool]  # a rank and how often it was started before; returns whether that was tried


class Deaths:
    """What is known of ranks that died, and when each was started again."""

    def __init__(self, start: Start) -> None:
        self._start = start
        self._starts: dict[int, list[float]] = {}  # by rank: when it was started again
        self._told: set[int] = set()  # dead ranks that were told of

    def news(self, dead: Mapping[int, str], most: int, now: float) -> Iterator[Died]:
        """Tell of ranks that are newly dead, or are started again now. `most`: times in RESTARTS_WITHIN_S.

        A rank that died more often stays dead until the first of its newest starts is RESTARTS_WITHIN_S old.
        """
        self._told &= dead.keys()
        for rank, how in dead.items():
            if self._started(rank, most, now):
                self._told.discard(rank)  # its next death is another one
                yield Died(rank, how, again=True)
            elif rank not in self._told:
                self._told.add(rank)
                yield Died(rank, how)

    def _started(self, rank: int, most: int, now: float) -> bool:
        before = self._starts.get(rank, [])
        if sum(now - began < RESTARTS_WITHIN_S for began in before) >= most or not self._start(rank, len(before) + 1):
            return False
        self._starts[rank] = [*before, now]
        return True
