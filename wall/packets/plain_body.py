"""The plain body of sample packets: 8 to 12 bytes a sample, in their order, and a table of object ids above 16 bits.

Depths and objects are sent where something is made of them: which ones a packet has, its header says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Rect, Samples
from wall.packets.kernels import plain_body as kernels

BARE_BYTES = 8  # of a sample before compression: colour, position, time
BYTES_A_DEPTH = BYTES_OF_OBJECT = 2  # more of each sample, where they are sent
BYTES_AN_OBJECT = 4  # of the table
NO_DEPTH_CODE = 0, 15  # base and mantissa bits where no depth is finite, or none is sent
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
    bright: int  # samples whose light is cut off


def pack(samples: Samples, rect: Rect, *, depths: bool, objects: bool) -> PackedPlain:
    """The body of samples (n,) SAMPLE, with their depths and with their objects if they are wanted."""
    n = len(samples)
    low, high, latest, bad, bright = kernels.depth_range(samples)
    if bad:
        return PackedPlain(np.empty(0, np.uint8), 0, 0, 0, 0.0, int(bad), 0, 0)
    base, bits = _depth_code(int(low), int(high)) if depths else NO_DEPTH_CODE
    ids, table = samples["object_id"], np.empty(0, np.uint32)
    if objects and n and ids.max() > LARGEST_DIRECT_ID:
        table, ids = np.unique(ids, return_inverse=True)
    body = np.empty(size_of(n, len(table), depths=depths, objects=objects), np.uint8)
    planes, end = _planes(body, n, depths=depths, objects=objects)
    end[:] = table
    if objects:
        planes.objects[:] = ids
    outside = kernels.pack(samples, rect.numbers, _scales(rect, base, bits, latest), planes)
    return PackedPlain(body, len(table), base, bits, float(latest), 0, int(outside), int(bright))


def size_of(count: int, listed: int, *, depths: bool, objects: bool) -> int:
    """Bytes of a body before compression; `listed`: object ids in its table."""
    return bytes_a_sample(depths=depths, objects=objects) * count + BYTES_AN_OBJECT * listed


def bytes_a_sample(*, depths: bool, objects: bool) -> int:
    """Bytes of a sample before compression."""
    return BARE_BYTES + BYTES_A_DEPTH * depths + BYTES_OF_OBJECT * objects


def unpack(
    data: bytes | memoryview, count: int, *, rect: Rect, depth_base: int, depth_bits: int, span: float, depths: bool,
    objects: bool,
) -> Samples | None:  # fmt: skip
    """The samples of a body of size_of(...) bytes, None if one is outside the rectangle or the table.

    Depths that were not sent are infinite, object ids 0.
    """
    body, samples = np.frombuffer(data, np.uint8), np.zeros(count, SAMPLE)
    planes, table = _planes(body, count, depths=depths, objects=objects)
    scales = _scales(rect, depth_base, depth_bits, np.float32(span))
    if kernels.unpack(planes, rect.numbers, scales, samples):
        return None
    if objects:
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
        return NO_DEPTH_CODE
    return low, min(15, (65534 // (high - low + 1)).bit_length() - 1)


def _scales(rect: Rect, depth_base: int, depth_bits: int, span: np.float32) -> kernels.Scales:
    return kernels.Scales(subpixel_bits(rect.width), subpixel_bits(rect.height), depth_base, depth_bits, span)


def _planes(
    body: NDArray[np.uint8], n: int, *, depths: bool, objects: bool
) -> tuple[kernels.Planes, NDArray[np.uint32]]:
    """Views of a body of n samples, and of the table behind them."""
    end = bytes_a_sample(depths=depths, objects=objects) * n
    words = body[4 * n : end].view("<u2")
    of_depths, of_objects = words[2 * n : (2 + depths) * n], words[(2 + depths) * n :]
    planes = kernels.Planes(body[: 4 * n].view("<u4"), words[:n], words[n : 2 * n], of_depths, of_objects)
    return planes, body[end:].view("<u4")
