"""The compact body of sample packets: columns of differences, byte by byte, compressed by zstd.

The bytes before compression: a byte for every column, how many bytes its numbers have (0: all are 0); then all lowest
bytes of the first column, all second ones and so on. The columns are the packet's objects, two numbers each (id less
the one before, number of samples), then those of kernels.compact_body, a number a sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Rect, Samples
from wall.packets.codecs import Codec, compress, expand_at_most
from wall.packets.colour_curve import make_colour_curve
from wall.packets.kernels import byte_planes as kernels_bytes
from wall.packets.kernels import compact_body as kernels

WIDEST = 4  # bytes of a number
OBJECT_COLUMNS = 2
CURVE = make_colour_curve()


class PackedCompact(NamedTuple):
    """A compact body, with the header's numbers that say how to read it."""

    body: bytes
    objects: int
    depth_base: int
    span: float  # seconds of the last time code
    bad: int  # samples without a finite colour, a depth or a time: the body is empty
    outside: int  # samples outside the rectangle: likewise
    bright: int  # samples whose light is cut off


def pack(samples: Samples, rect: Rect, *, relightable: bool, noisy: bool) -> PackedCompact:
    """The body of samples (n,) SAMPLE; `relightable` with normals and light visibility masks, `noisy` with albedos."""
    n = len(samples)
    columns = np.empty((_columns(relightable or noisy), n), np.int32)
    objects = np.empty((OBJECT_COLUMNS, n), np.uint32)
    known, base, span, bad, outside, bright = kernels.encode(samples, rect.numbers, CURVE, noisy, columns, objects)
    body = b"" if bad or outside else _compressed([*objects[:, :known], *columns.view(np.uint32)])
    return PackedCompact(body, int(known), int(base), float(span), int(bad), int(outside), int(bright))


def unpack(
    body: memoryview, count: int, objects: int, *, rect: Rect, depth_code: tuple[int, int], span: float,
    relightable: bool, noisy: bool, where: str,
) -> Samples | None:  # fmt: skip
    """(count,) SAMPLE by object and position, None if the body is not that. `depth_code`: base, mantissa bits.

    Raises RemoteProtocolError if it does not decompress to a size that such a body may have.
    """
    lengths = [objects] * OBJECT_COLUMNS + [count] * _columns(relightable or noisy)
    data = np.frombuffer(expand_at_most(body, len(lengths) + WIDEST * sum(lengths), where), np.uint8)
    widths = data[: len(lengths)].tolist()
    size = len(lengths) + sum(width * length for width, length in zip(widths, lengths, strict=False))
    if len(widths) < len(lengths) or max(widths) > WIDEST or len(data) != size:
        return None
    columns, at = [], len(lengths)
    for width, length in zip(widths, lengths, strict=True):
        planes = np.zeros((WIDEST, length), np.uint8)
        planes[:width] = data[at : at + width * length].reshape(width, length)
        columns.append(planes)
        at += width * length
    named, read = _together(columns[:OBJECT_COLUMNS], objects), _together(columns[OBJECT_COLUMNS:], count)
    samples = np.empty(count, SAMPLE)
    whole = kernels.decode(read, named, rect.numbers, depth_code, np.float32(span), CURVE, noisy, samples)
    return samples if whole else None


def _compressed(columns: list[NDArray[np.uint32]]) -> bytes:
    widths, parts = [], []
    for column in columns:
        planes = np.empty((WIDEST, len(column)), np.uint8)
        widths.append((int(kernels_bytes.apart(column, planes)).bit_length() + 7) // 8)
        parts.append(planes[: widths[-1]].data)
    return compress(memoryview(b"".join([bytes(widths), *parts])), Codec.ZSTD)


def _together(columns: list[NDArray[np.uint8]], length: int) -> NDArray[np.uint32]:
    numbers = np.empty((len(columns), length), np.uint32)
    for planes, row in zip(columns, numbers, strict=True):
        kernels_bytes.together(planes, row)
    return numbers


def _columns(described: bool) -> int:
    return kernels.SURFACE_COLUMNS if described else kernels.COLUMNS
