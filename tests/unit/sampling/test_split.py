"""Two samplers on one budget: equal rays, whatever their batches; nothing is saved up; all of it when one is done."""

from __future__ import annotations

import numpy as np
from small_scenes import view

from wall.core.data import SAMPLE, Event, Samples
from wall.sampling.base import Targets
from wall.sampling.split import SplitSampler

EVENT = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(32, 24)).event


class Rays:
    """A sampler of batches of one size, until `left` are gone."""

    def __init__(self, batch: int, left: int = 10**9, *, coherent: bool = False) -> None:
        self.batch, self.left, self.coherent = batch, left, coherent
        self.traced, self.seen, self.lost = 0, 0, 0

    def choose(self, newest: Event) -> Targets | None:
        if self.left <= 0:
            return None
        self.left -= self.batch
        self.traced += self.batch
        return Targets(xy=np.zeros((self.batch, 2), np.float32), event=newest)

    def observe(self, samples: Samples, base_time: float) -> None:
        self.seen += len(samples)

    def forget(self, samples: Samples, base_time: float) -> None:
        self.lost += len(samples)

    def restart(self) -> None:
        self.left = 10**9


def test_rays_are_shared_equally_whatever_the_batches() -> None:
    small, large = Rays(16), Rays(100)
    split = SplitSampler(small, large)
    for _ in range(400):
        assert split.choose(EVENT) is not None
        assert abs(small.traced - large.traced) <= 100


def test_samples_are_observed_by_the_one_that_chose_them() -> None:
    first, second = Rays(16, coherent=True), Rays(32)
    split = SplitSampler(first, second)
    for _ in range(9):
        targets = split.choose(EVENT)
        assert targets is not None
        assert split.coherent == split.sides[split.turn].coherent
        split.observe(np.zeros(len(targets.xy), SAMPLE), 0.0)
    assert (first.seen, second.seen) == (first.traced, second.traced)


def test_one_that_is_done_leaves_everything_to_the_other_and_saves_nothing_up() -> None:
    done, busy = Rays(16, left=16), Rays(16)
    split = SplitSampler(done, busy)
    for _ in range(50):
        split.choose(EVENT)
    assert (done.traced, busy.traced) == (16, 49 * 16)

    done.restart()
    for _ in range(20):
        split.choose(EVENT)
    assert abs((busy.traced - 49 * 16) - (done.traced - 16)) <= 2 * 16, "no backlog but a batch"


def test_two_that_are_done_are_done() -> None:
    split = SplitSampler(Rays(16, left=0), Rays(16, left=0))
    assert split.choose(EVENT) is None
