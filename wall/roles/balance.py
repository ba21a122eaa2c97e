"""Move the borders between renderers until each has the same to do: what the manager decides with `balance: true`.

Renderers tell what their regions cost them. Every PERIOD_S the rows of a region are scaled to what it costs, so that
borders that move teach how cost is spread within a panel, and the wall is cut anew into strips of equal cost. A slower
machine's rows cost more, so it gets fewer. Nobody waits: a renderer takes its new strip up between two batches, and
samples of the old one stay where they are shown. A renderer that is lost has no strip: the others render its rows. One
that has joined gets some of theirs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import chain, pairwise

import numpy as np

from wall.geometry.strips import Cuts, equal_cost
from wall.packets.control import Assignment, Heartbeat
from wall.roles.plan import Layout

PERIOD_S = 1.0  # between two moves: a renderer needs half of it to measure its new strip
LONGEST_S = 60.0  # likewise: each move after which strips are not more even than before it doubles the wait
EVEN = 0.9  # mean cost by the largest: above, moving gains less than the samplers' starting anew costs
NEWEST_SHARE = 0.35  # of the newest cost in what is believed, as powers: demands of the adaptive sampler fluctuate
LEAST_SHARE = 1e-3  # of the mean cost that a row counts as, so that a strip without cost gets rows


class Balancer:
    """Decides assignments: `on_tick` gives one where borders are to move."""

    def __init__(self, layout: Layout, now: float) -> None:
        assert layout.strips is not None
        self._strips, self._layout, self._ranks = layout.strips, layout, layout.renderers()
        self._own = len(layout.regions) - layout.extra  # renderers of the configuration
        cuts = layout.strips.evenly(self._own)
        self.assignment, self.made = Assignment(number=0, cuts=list(cuts)), 0
        self._rows, self._measured = np.ones(cuts[-1]), False  # what each seems to cost; whether anything is known
        self._due, self._wait_s = now + PERIOD_S, PERIOD_S
        self._evenness = 0.0  # mean cost by the largest, at the last move
        self._numbers: tuple[tuple[int, int], ...] = ()  # of the events at the last look
        self._alive = list(self._ranks)[: self._own]  # those who have a strip

    def on_tick(
        self, beats: Mapping[int, Heartbeat], lost: Collection[int], numbers: tuple[tuple[int, int], ...], now: float
    ) -> Assignment | None:
        """Give an assignment that is better, or None. `numbers`: of the newest events.

        At rest nothing is moved, as samplers would lose what they have accumulated, unless a renderer is lost, which
        is answered at once, or one is back, which waits for its turn.
        """
        alive = [rank for rank in self._ranks if rank not in lost]
        if alive and (set(self._alive) - set(alive) or (alive != self._alive and now >= self._due)):
            self._alive, self._wait_s = alive, min(2.0 * self._wait_s, LONGEST_S)
            self._due = now + self._wait_s
            return self._assign(self._even_cuts())
        if now < self._due:
            return None
        self._due = now + PERIOD_S
        moves, self._numbers = numbers != self._numbers, numbers
        measured = [self._costs(rank, beats.get(rank)) for rank in self._alive]
        if not moves or not all(measured):
            return None
        for top, bottom, cost in chain.from_iterable(measured):
            rows = self._rows[top:bottom]
            rows *= (cost / rows.sum()) ** (NEWEST_SHARE if self._measured else 1.0)
        self._measured = True
        np.maximum(self._rows, LEAST_SHARE * self._rows.mean(), out=self._rows)
        costs = [self._rows[regions[0][0] : regions[-1][1]].sum() for regions in measured]
        evenness, before = sum(costs) / len(costs) / max(costs), self._evenness
        cuts = self._even_cuts()
        if evenness >= EVEN or list(cuts) == self.assignment.cuts:
            self._wait_s = PERIOD_S
            return None
        self._wait_s = PERIOD_S if evenness > before else min(2.0 * self._wait_s, LONGEST_S)
        self._due, self._evenness = now + self._wait_s, evenness
        return self._assign(cuts)

    def count_from(self, number: int, made: int) -> None:
        """Let assignments have larger numbers than those of another balancer, which had `made` so many."""
        self.assignment, self.made = Assignment(number=number, cuts=self.assignment.cuts), made

    def grow(self, layout: Layout) -> None:
        """There are more renderers, which have no strip until they are not lost any more."""
        self._ranks = layout.renderers()

    def hasten(self, now: float) -> None:
        """A renderer has joined: it gets its strip at once."""
        self._due = min(self._due, now)

    def _even_cuts(self) -> Cuts:
        """Cuts between which rows seem to cost the same, for every rank that is not lost."""
        strips = iter(pairwise(self._strips.nearest(equal_cost(self._rows, len(self._alive)))))
        cuts = [0]
        for rank in self._ranks:
            cuts.append(next(strips)[1] if rank in self._alive else cuts[-1])
        while len(cuts) - 1 > self._own and self._ranks[len(cuts) - 2] not in self._alive:
            cuts.pop()  # one that had joined, and is gone
        return tuple(cuts)

    def _assign(self, cuts: Cuts) -> Assignment:
        self._layout, self.made = self._layout.assigned(cuts), self.made + 1
        self.assignment = Assignment(number=self.assignment.number + 1, cuts=list(cuts))
        return self.assignment

    def _costs(self, rank: int, beat: Heartbeat | None) -> list[tuple[int, int, float]]:
        """First row, row behind the last, and cost of a rank's regions; [] while it has not measured them all."""
        if beat is None or beat.assignment != self.assignment.number:
            return []
        regions = self._layout.regions_of(rank)
        if beat.costs.keys() != {str(region.layer) for region in regions}:
            return []
        tops = [self._strips.top(region) for region in regions]
        return [
            (top, top + region.rect.height, float(max(beat.costs[str(region.layer)], 1)))
            for top, region in zip(tops, regions, strict=True)
        ]
