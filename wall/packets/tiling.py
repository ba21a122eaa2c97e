"""Tiling packets: how a sampler has cut its rectangle, and what it knows of each tile; travels beside the samples.

Self-contained and idempotent like sample packets: a newer one of the same rank replaces an older one. decode_tiling()
gives a Tiling or raises RemoteProtocolError, for any bytes.
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Rect, Tiling
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets.kernels import bit_planes as kernels

MAGIC, VERSION, KIND_TILING = b"WALL", 2, 9
MAX_TILES = 65536
MAX_EDGE = 4096  # pixels, as of sample packets
STEPS_AN_OCTAVE = 8
LEAST_LOG2 = -20  # of code 1; 0 is 0
MEASURES = ("spatial", "temporal", "density")
CODE_MEAN, EDGE_MEAN = 4, 16  # of Rice codes, before the first
_HEADER = struct.Struct("<4sBBHHHHHHHHQIIdII")
_CHECKSUM = struct.Struct("<I")
HEADER_BYTES = _HEADER.size + _CHECKSUM.size

Numbers = NDArray[np.int64]


def is_tiling(data: bytes) -> bool:
    """Whether a message claims to be a tiling packet."""
    return len(data) > 5 and data[:4] == MAGIC and data[5] == KIND_TILING


def encode_tiling(tiling: Tiling) -> bytes:
    """One packet. A grid's tiles are not listed. Raises LocalProtocolError for what the format cannot carry."""
    rect, n = tiling.rect, len(tiling.rects)
    where = f"rank {tiling.rank} tiling {tiling.sequence}"
    if n > MAX_TILES or not 0 < rect.width <= MAX_EDGE or not 0 < rect.height <= MAX_EDGE:
        raise LocalProtocolError(f"{where}: {n} tiles of {rect}; at most {MAX_TILES}, edges of 1 to {MAX_EDGE} pixels")
    if not math.isfinite(tiling.base_time):
        raise LocalProtocolError(f"{where}: base time {tiling.base_time}; wanted a finite one")
    rects = np.asarray(tiling.rects, np.int64).reshape(n, 4)
    if not _inside(rects, rect):
        raise LocalProtocolError(f"{where}: a tile is empty or reaches out of {rect}")
    edge = _grid_edge(rects, rect)
    planes = [] if edge else [_differences(rects[:, k]) for k in range(4)]
    for name in MEASURES:
        values = np.asarray(getattr(tiling, name), np.float32)
        if values.shape != (n,) or not (np.isfinite(values) & (values >= 0)).all():
            raise LocalProtocolError(f"{where}: {name} {values.shape}; wanted {n} finite numbers, none below 0")
        planes.append(_differences(log_codes(values)))
    body = _written(planes)
    try:
        header = _HEADER.pack(
            MAGIC, VERSION, KIND_TILING, tiling.view, tiling.panel, tiling.rank, edge, rect.x, rect.y, rect.width,
            rect.height, tiling.sequence, tiling.camera_event, tiling.scene_event, tiling.base_time, n, len(body),
        )  # fmt: skip
    except struct.error as error:
        raise LocalProtocolError(f"{where}: a number does not fit its field of the header ({error})") from error
    return b"".join((header, _CHECKSUM.pack(zlib.crc32(body, zlib.crc32(header))), body))


def decode_tiling(data: bytes | memoryview) -> Tiling:
    """The tiling of a packet. Raises RemoteProtocolError for anything that is not a whole, valid packet."""
    if len(data) < HEADER_BYTES:
        raise RemoteProtocolError(f"a packet of {len(data)} bytes; its header alone has {HEADER_BYTES}")
    magic, version, kind, view, panel, rank, edge, x, y, width, height, sequence, *rest = _HEADER.unpack_from(data)
    camera_event, scene_event, base_time, n, length = rest
    where = f"rank {rank} tiling {sequence}"
    if magic != MAGIC or version != VERSION or kind != KIND_TILING:
        raise RemoteProtocolError(f"not a tiling packet of version {VERSION}: starts with {bytes(data[:6])!r}")
    body = memoryview(data)[HEADER_BYTES:]
    if length != len(body):
        raise RemoteProtocolError(f"{where}: header promises a body of {length} bytes, {len(body)} came")
    (checksum,) = _CHECKSUM.unpack_from(data, _HEADER.size)
    if zlib.crc32(body, zlib.crc32(memoryview(data)[: _HEADER.size])) != checksum:
        raise RemoteProtocolError(f"{where}: checksum does not match")
    count, rect = len(MEASURES) + (0 if edge else 4), Rect(x=x, y=y, width=width, height=height)
    edges_fit = 0 < width <= MAX_EDGE and 0 < height <= MAX_EDGE
    if n > MAX_TILES or not edges_fit or len(body) % 4 or n * count > 8 * length or not math.isfinite(base_time):
        raise RemoteProtocolError(f"{where}: {n} tiles of {width}x{height} in {length} bytes at {base_time}")
    planes = _read(body, n, count)
    if planes is None or any(((codes < 0) | (codes > 255)).any() for codes in planes[-len(MEASURES) :]):
        raise RemoteProtocolError(f"{where}: body is not {n} tiles")
    if edge and n != -(-width // edge) * -(-height // edge):
        raise RemoteProtocolError(f"{where}: {n} tiles are no grid of {edge} pixels over {width}x{height}")
    rects = grid(rect, edge) if edge else np.stack(planes[:4], axis=1)
    if not _inside(rects, rect):
        raise RemoteProtocolError(f"{where}: a tile is empty or reaches out of its rectangle")
    spatial, temporal, density = (values_of(codes) for codes in planes[-len(MEASURES) :])
    return Tiling(
        view=view, panel=panel, rect=rect, rank=rank, sequence=sequence, camera_event=camera_event,
        scene_event=scene_event, base_time=base_time, rects=rects.astype(np.uint16), spatial=spatial,
        temporal=temporal, density=density,
    )  # fmt: skip


def grid(rect: Rect, edge: int) -> Numbers:
    """(n, 4) x, y, width, height of square tiles, row by row from the upper left corner, cut off at the others."""
    across, down = np.meshgrid(np.arange(0, rect.width, edge), np.arange(0, rect.height, edge))
    x, y = across.ravel(), down.ravel()
    sides = (np.minimum(edge, rect.width - x), np.minimum(edge, rect.height - y))
    return np.stack([x + rect.x, y + rect.y, *sides], axis=1).astype(np.int64)


def log_codes(values: Float32) -> Numbers:
    """(n,) codes 0 to 255 of values (n,) from 0 on: eight steps an octave; what is nearer to 0 than to code 1 is 0."""
    with np.errstate(divide="ignore"):
        codes = np.floor((np.log2(np.float64(values)) - LEAST_LOG2) * STEPS_AN_OCTAVE + 1.5)
    return np.where(values < 0.5 * 2.0**LEAST_LOG2, 0.0, np.clip(codes, 1.0, 255.0)).astype(np.int64)


def values_of(codes: Numbers) -> Float32:
    """The inverse of log_codes()."""
    values = 2.0 ** (LEAST_LOG2 + (codes - 1) / STEPS_AN_OCTAVE)
    return np.where(codes == 0, 0.0, values).astype(np.float32)


def _grid_edge(rects: Numbers, rect: Rect) -> int:
    """The edge of the grid that these tiles are, or 0."""
    edge = int(rects[0, 2:].max()) if len(rects) else 0
    if edge == 0 or len(rects) != -(-rect.width // edge) * -(-rect.height // edge):
        return 0
    return edge if np.array_equal(rects, grid(rect, edge)) else 0


def _inside(rects: Numbers, rect: Rect) -> bool:
    low = rects[:, :2] - (rect.x, rect.y)
    high = low + rects[:, 2:]
    fits = (rects >= (0, 0, 1, 1)) & (rects < 65536)
    return bool(fits.all() and (low >= 0).all() and (high <= (rect.width, rect.height)).all())


def _differences(numbers: Numbers) -> Numbers:
    """To the number before, folded: 0, -1, 1, -2 ... as 0, 1, 2, 3."""
    signed = np.diff(numbers, prepend=0)
    return (signed << 1) ^ (signed >> 63)


def _written(planes: list[Numbers]) -> bytes:
    words = np.zeros(2 * sum(map(len, planes)) + 2, np.uint32)
    at = np.zeros(3, np.int64)
    for plane, mean in zip(planes, _means(len(planes)), strict=True):
        kernels.put_plane(plane, mean, words, at)
    words[at[2]] = at[0]
    return words[: at[2] + (at[1] > 0)].tobytes()


def _read(body: memoryview, n: int, count: int) -> list[Numbers] | None:
    """`count` planes of n numbers, differences undone; None if that is not what the body holds."""
    words: Any = np.concatenate([np.frombuffer(body, "<u4"), np.zeros(2, np.uint32)])
    position, planes = np.int64(0), []
    for mean in _means(count):
        folded = np.empty(n, np.int64)
        position = kernels.get_plane(folded, mean, words, position)
        planes.append(np.cumsum((folded >> 1) ^ -(folded & 1)))
    return planes if (position + 31) // 32 == len(words) - 2 else None


def _means(count: int) -> list[int]:
    return [EDGE_MEAN] * (count - len(MEASURES)) + [CODE_MEAN] * len(MEASURES)
