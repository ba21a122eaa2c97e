"""Bytes with a few of them changed."""

from __future__ import annotations

import numpy as np


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """A few bytes changed, cut, doubled or inserted."""
    changed = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        at, what = int(rng.integers(0, len(changed) + 1)), rng.integers(0, 4)
        if what == 0 and at < len(changed):
            changed[at] = rng.choice([0, 1, 127, 128, 255, int(rng.integers(0, 256))])
        elif what == 1:
            changed[at : at + int(rng.integers(1, 9))] = b""
        elif what == 2:
            changed[at:at] = rng.bytes(int(rng.integers(1, 9)))
        else:
            changed[at:at] = changed[at : at + int(rng.integers(1, 17))]
    return bytes(changed)
