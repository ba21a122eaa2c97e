"""What shaders wrote arrives whole, whatever its size."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from wall.reconstruction.gpu.device import Device
from wall.reconstruction.gpu.readback import COLUMNS, Readback


@pytest.mark.parametrize("shape", [(1,), (7,), (65, 97, 3), (30, 40, 3), (COLUMNS + 1,), (2, 3 * COLUMNS), (16411,)])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.uint32])
def test_words_arrive_in_their_order_and_nothing_beyond_them(
    opengl: Device, random_numbers: np.random.Generator, shape: tuple[int, ...], dtype: type[np.generic]
) -> None:
    """Sizes of a few bytes, of odd bytes, primes beyond a row, several rows; twice, with other values."""
    readback, before = Readback(opengl), 5  # words before those that are read
    for _ in range(2):
        wanted: NDArray[np.generic] = random_numbers.integers(0, 256, shape).astype(dtype)
        words = np.zeros(before + -(-wanted.nbytes // 4) + 3, np.uint32)
        words.view(np.uint8)[4 * before :][: wanted.nbytes] = wanted.reshape(-1).view(np.uint8)
        out = np.zeros((2, *shape), dtype)
        readback.read(opengl.context.buffer(words), out[1], first=before)
        assert_array_equal(out[1], wanted)
        assert not out[0].any()
