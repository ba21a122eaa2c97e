"""The compact body as bytes, between the packet's header and the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.data import SAMPLE, Rect, Samples
from wall.packets.compact_tables import make_tables
from wall.packets.kernels import compact_read as kernels_read
from wall.packets.kernels import compact_write as kernels

LEAST_BITS_A_SAMPLE = 11  # a place, luma, orange, green, depth of a bit each, and six bits of sub-pixels
TABLES = make_tables()


class Packed(NamedTuple):
    body: bytes
    depth_base: int
    span: float  # seconds of the last time code
    bad: int  # samples without a finite colour, a depth or a time
    outside: int  # samples outside the rectangle


def pack(samples: Samples, rect: Rect, *, lit: bool = False) -> Packed:
    """The body of samples (n,) SAMPLE, `lit` with normals and lamps; empty where some are bad or outside."""
    words = np.empty(kernels.WORDS_A_SAMPLE * len(samples) + kernels.WORDS_BESIDE, np.uint32)
    written, base, span, bad, outside = kernels.encode(samples, _numbers(rect), lit, TABLES, words)
    return Packed(words[:written].tobytes(), int(base), float(span), int(bad), int(outside))


def unpack(
    body: memoryview, count: int, *, rect: Rect, depth_base: int, depth_bits: int, span: float, lit: bool = False
) -> Samples | None:
    """(count,) SAMPLE, or None where the body is not that; never allocates much more than the body holds."""
    if len(body) % 4 or LEAST_BITS_A_SAMPLE * count > 8 * len(body):
        return None
    words = np.zeros(len(body) // 4 + 2, np.uint32)
    words[:-2] = np.frombuffer(body, "<u4")
    samples = np.empty(count, SAMPLE)
    read = kernels_read.decode(words, _numbers(rect), depth_base, depth_bits, np.float32(span), lit, TABLES, samples)
    return samples if read >= 0 and (read + 31) // 32 == len(words) - 2 else None


def _numbers(rect: Rect) -> tuple[int, int, int, int]:
    return rect.x, rect.y, rect.width, rect.height
