"""A/B comparison of two samplers on one budget: batches alternate so that both trace equally many rays."""

from __future__ import annotations

from wall.core.data import Event, Samples
from wall.sampling.base import Sampler, Targets


class SplitSampler:
    """A Sampler made of two: the one with fewer rays chooses next. A sampler that chooses none gains no credit."""

    def __init__(self, first: Sampler, second: Sampler) -> None:
        self.sides = (first, second)
        self.rays = [0, 0]  # of each side, or what it passed over
        self.turn = 0  # the side of the newest batch
        self.coherent = first.coherent

    def choose(self, newest: Event) -> Targets | None:
        """The next batch of the side that has fewer rays, else of the other; None where neither has any."""
        next_side = int(self.rays[1] < self.rays[0])
        for side in (next_side, 1 - next_side):
            targets = self.sides[side].choose(newest)
            if targets is not None:
                self.turn, self.coherent = side, self.sides[side].coherent
                self.rays[side] += len(targets.xy)
                return targets
            self.rays[side] = max(self.rays)
        return None

    def observe(self, samples: Samples, base_time: float) -> None:
        """Tell the side of the newest batch."""
        self.sides[self.turn].observe(samples, base_time)

    def forget(self, samples: Samples, base_time: float) -> None:
        """Tell both sides, since which one chose them is not known here; `sides[k].forget` is exact."""
        for side in self.sides:
            side.forget(samples, base_time)

    def restart(self) -> None:
        """Restart both."""
        for side in self.sides:
            side.restart()
