"""The plain body of sample packets: 12 bytes a sample, in their order, and a table where object ids exceed 16 bits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Rect, Samples
from wall.packets.kernels import plain_body as kernels

BYTES_A_SAMPLE = 12  # before compression
BYTES_AN_OBJECT = 4  # of the table
LARGEST_DIRECT_ID = 0xFFFF  # a packet without larger ids has no table


class PackedPlain(NamedTuple):
    """A plain body before compression, with the header's numbers that say how to read it."""

    body: NDArray[np.uint8]
    objects: int  # in the table
    depth_base: int
    depth_bits: int
    span: float  # seconds of the last time code
    bad: int  # samples without a finite colour, a depth or a time: the body is empty
    outside: int  # samples outside the rectangle


def pack(samples: Samples, rect: Rect) -> PackedPlain:
    """The body of samples (n,) SAMPLE."""
    n = len(samples)
    low, high, latest, bad = kernels.depth_range(samples)
    if bad:
        return PackedPlain(np.empty(0, np.uint8), 0, 0, 0, 0.0, int(bad), 0)
    base, bits = _depth_code(int(low), int(high))
    ids, table = samples["object_id"], np.empty(0, np.uint32)
    if n and ids.max() > LARGEST_DIRECT_ID:
        table, ids = np.unique(ids, return_inverse=True)
    body = np.empty(BYTES_A_SAMPLE * n + BYTES_AN_OBJECT * len(table), np.uint8)
    body[BYTES_A_SAMPLE * n :] = table.astype("<u4").view(np.uint8)
    planes = _planes(body, n)
    planes.objects[:] = ids
    outside = kernels.pack(samples, rect.numbers, _scales(rect, base, bits, latest), planes)
    return PackedPlain(body, len(table), base, bits, float(latest), 0, int(outside))


def size_of(count: int, objects: int) -> int:
    """Bytes of a body before compression."""
    return BYTES_A_SAMPLE * count + BYTES_AN_OBJECT * objects


def unpack(
    data: bytes | memoryview, count: int, *, rect: Rect, depth_base: int, depth_bits: int, span: float
) -> Samples | None:
    """The samples of a body of size_of(count, objects) bytes, None if one is outside the rectangle or the table."""
    body, samples = np.frombuffer(data, np.uint8), np.zeros(count, SAMPLE)
    planes, table = _planes(body, count), body[BYTES_A_SAMPLE * count :].view("<u4")
    scales = _scales(rect, depth_base, depth_bits, np.float32(span))
    if kernels.unpack(planes, rect.numbers, scales, samples):
        return None
    if len(table) and count and planes.objects.max() >= len(table):
        return None
    samples["object_id"] = table[planes.objects] if len(table) else planes.objects
    return samples


def subpixel_bits(edge: int) -> int:
    """Sub-pixel bits of positions along an edge of so many pixels: what the pixel number leaves of 14 bits."""
    return kernels.POSITION_BITS - max(edge - 1, 0).bit_length()


def _depth_code(low: int, high: int) -> tuple[int, int]:
    """Exponent of depth code 0, and as many mantissa bits as cover the exponents low to high."""
    if low > high:
        return 0, 15
    return low, min(15, (65534 // (high - low + 1)).bit_length() - 1)


def _scales(rect: Rect, depth_base: int, depth_bits: int, span: np.float32) -> kernels.Scales:
    return kernels.Scales(subpixel_bits(rect.width), subpixel_bits(rect.height), depth_base, depth_bits, span)


def _planes(body: NDArray[np.uint8], n: int) -> kernels.Planes:
    words = body[4 * n : BYTES_A_SAMPLE * n].view("<u2")
    return kernels.Planes(body[: 4 * n].view("<u4"), words[:n], words[n : 2 * n], words[2 * n : 3 * n], words[3 * n :])
