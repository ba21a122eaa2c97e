"""Two samplers on one budget, to be compared: batches alternate so that both have traced equally many rays."""

from __future__ import annotations

from wall.core.data import Event, Float32, Samples
from wall.sampling.base import Sampler, Targets


class SplitSampler:
    """A Sampler made of two. Whoever has fewer rays is next; what it does not want now it cannot save up."""

    def __init__(self, first: Sampler, second: Sampler) -> None:
        self.sides = (first, second)
        self.rays = [0, 0]
        self.turn = 0  # whose the newest batch is
        self.coherent = first.coherent

    def choose(self, newest: Event) -> Targets | None:
        poorer = int(self.rays[1] < self.rays[0])
        for side in (poorer, 1 - poorer):
            targets = self.sides[side].choose(newest)
            if targets is not None:
                self.turn, self.coherent = side, self.sides[side].coherent
                self.rays[side] += len(targets.xy)
                return targets
            self.rays[side] = max(self.rays)
        return None

    def observe(self, samples: Samples) -> None:
        self.sides[self.turn].observe(samples)

    def forget(self, xy: Float32) -> None:
        """Whose they were is not known here: both lose them. `sides[k].forget` is exact."""
        for side in self.sides:
            side.forget(xy)

    def restart(self) -> None:
        for side in self.sides:
            side.restart()
