"""The list of pixels that have an accumulation: each once, and none without, whatever happens to them."""

from __future__ import annotations

import numpy as np

from wall.core.data import SAMPLE
from wall.core.jit import kernel
from wall.deepbuffer.kernels.accumulation import accumulate, reject_accumulation
from wall.deepbuffer.kernels.columns import AMOUNT, COUNT, NEAREST_OBJECT
from wall.deepbuffer.store import PixelHistory

WIDTH, HEIGHT, OBJECTS = 40, 20, 3


@kernel
def accumulate_all(history, samples, pixels):
    """One sample in each of the pixels (n, 2)."""
    for k in range(samples.shape[0]):
        accumulate(history, pixels[k, 0], pixels[k, 1], samples[k])


def test_list_and_tiles_follow_the_accumulation(random_numbers: np.random.Generator) -> None:
    history = PixelHistory.of(WIDTH, HEIGHT, detects_change=False)
    history.nearest[..., NEAREST_OBJECT] = random_numbers.integers(-1, OBJECTS, (HEIGHT, WIDTH))
    for step in range(40):
        samples = np.zeros(100, SAMPLE)
        samples["radiance"] = random_numbers.random((100, 3))
        accumulate_all(history, samples, random_numbers.integers(0, (HEIGHT, WIDTH), (100, 2)))
        history.rejection[5:9, 5:30, AMOUNT] = random_numbers.choice([0.0, 0.5, 1.0], (4, 25))
        history.contradicted[0, :] = True
        if step % 10 == 9:  # as when a packet was lost
            history.accumulation[2:4] = 0.0
            history.list_accumulated()
        else:
            reject_accumulation(history, random_numbers.integers(0, 2, OBJECTS).astype(np.uint8))
            assert not history.rejection[..., AMOUNT].any()
            assert not history.contradicted.any()
        listed = history.accumulated[: history.listed[0]]
        accumulated = history.accumulation[..., COUNT] > 0
        assert sorted(listed) == np.flatnonzero(accumulated).tolist()
        rows, columns = np.nonzero(accumulated)
        assert history.accumulating[rows // 16, columns // 16].all()
    assert 0 < history.listed[0] < WIDTH * HEIGHT
