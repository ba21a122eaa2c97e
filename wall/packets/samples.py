"""Selective-refresh packets: one batch of samples of one rectangle, traced under one event.

A packet is self-contained and idempotent: it can be lost, repeated or late without harm to the next. decode() gives a
Batch or raises RemoteProtocolError, for any bytes: sizes and checksum are checked before numpy sees a buffer.
"""

from __future__ import annotations

import math
import struct
import zlib

import numpy as np

from wall.core.data import SAMPLE, Batch, Camera, Rect, Samples
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets import compact
from wall.packets.codecs import Codec, compress, expand
from wall.packets.kernels import fixed as kernels
from wall.packets.kernels.compact_write import DEPTH_BITS
from wall.packets.rotations import is_unit, quaternion_of, rotation_of

__all__ = ["BYTES_A_SAMPLE", "HEADER_BYTES", "MAX_SAMPLES", "Codec", "decode", "encode", "is_samples"]

MAGIC, VERSION, KIND_SAMPLES = b"WALL", 2, 1
PLAIN, COMPACT, LIT = 0, 1, 2  # layouts of the body; LIT: compact with normals and lamps
BYTES_A_SAMPLE = 12  # of a plain body, before compression
MAX_SAMPLES = 65536  # of one packet
MAX_EDGE = 4096  # pixels of a rectangle: leaves 2 sub-pixel bits

_HEADER = struct.Struct("<4sBBBBBxHHHBBHHHHQIIdffIIIIId3d4d")
_CHECKSUM = struct.Struct("<I")
HEADER_BYTES = _HEADER.size + _CHECKSUM.size


def is_samples(data: bytes) -> bool:
    """Whether a message claims to be a sample packet."""
    return len(data) > 5 and data[:4] == MAGIC and data[5] == KIND_SAMPLES


def encode(batch: Batch, codec: Codec = Codec.NONE) -> bytes:
    """One packet of a batch; the compact layout for adaptive ones, whose samples may come back in another order.

    `codec` is that of the plain layout: the compact one leaves nothing to compress.

    Raises LocalProtocolError for what the format cannot carry: too many samples, a rectangle with an edge above 4096,
    samples outside it, radiance that is not finite, negative depth, times below 0 or from 1e6 s, a camera that is not
    turned by a rotation, numbers above their field.
    """
    n, rect = len(batch.samples), batch.rect
    where = f"rank {batch.rank} packet {batch.sequence}"
    if n > MAX_SAMPLES or not 0 < rect.width <= MAX_EDGE or not 0 < rect.height <= MAX_EDGE:
        raise LocalProtocolError(
            f"{where}: {n} samples of a {rect.width}x{rect.height} rectangle; "
            f"at most {MAX_SAMPLES} samples, edges of 1 to {MAX_EDGE} pixels"
        )
    if batch.adaptive:
        layout, codec, bits = LIT if batch.relightable else COMPACT, Codec.NONE, DEPTH_BITS
        data, base, span, bad, outside = compact.pack(batch.samples, rect, lit=batch.relightable)
    else:
        layout = PLAIN
        data, base, bits, span, bad, outside = _pack_plain(batch.samples, rect, codec)
    if bad:
        raise LocalProtocolError(f"{where}: {bad} of {n} samples without a finite colour, a depth or a time")
    if outside:
        raise LocalProtocolError(f"{where}: {outside} of {n} samples outside {rect}")
    if not _sane(batch.base_time, span, float(np.float32(batch.blend))):
        raise LocalProtocolError(
            f"{where}: base time {batch.base_time}, blend {batch.blend}; wanted a finite time, a blend in (0, 1]"
        )
    if not all(map(math.isfinite, (batch.scene_time, *batch.camera.position))):
        raise LocalProtocolError(f"{where}: scene time {batch.scene_time}, {batch.camera}; wanted finite numbers")
    try:
        header = _HEADER.pack(
            MAGIC,
            VERSION,
            KIND_SAMPLES,
            codec,
            batch.adaptive,
            layout,
            batch.view,
            batch.panel,
            batch.rank,
            base,
            bits,
            rect.x,
            rect.y,
            rect.width,
            rect.height,
            batch.sequence,
            batch.camera_event,
            batch.scene_event,
            batch.base_time,
            span,
            batch.blend,
            batch.frame,
            batch.frame_samples,
            batch.skipped,
            n,
            len(data),
            batch.scene_time,
            *batch.camera.position,
            *quaternion_of(batch.camera.world_from_wall),
        )
    except struct.error as error:
        raise LocalProtocolError(f"{where}: a number does not fit its field of the header ({error})") from error
    except ValueError as error:
        raise LocalProtocolError(f"{where}: camera's world_from_wall {error}") from error
    return b"".join((header, _CHECKSUM.pack(zlib.crc32(data, zlib.crc32(header))), data))


def decode(data: bytes | memoryview) -> Batch:
    """The batch of a packet. Raises RemoteProtocolError for anything that is not a whole, valid packet."""
    if len(data) < HEADER_BYTES:
        raise RemoteProtocolError(f"a packet of {len(data)} bytes; its header alone has {HEADER_BYTES}")
    fields = _HEADER.unpack_from(data)
    magic, version, kind, codec, adaptive, layout, view, panel, rank, base, bits, x, y, width, height = fields[:15]
    sequence, camera_event, scene_event, base_time, span, blend, frame, frame_samples, skipped, n = fields[15:25]
    length, scene_time, position, quaternion = fields[25], fields[26], fields[27:30], fields[30:]
    where = f"rank {rank} packet {sequence}"
    if magic != MAGIC or version != VERSION or kind != KIND_SAMPLES:
        raise RemoteProtocolError(f"not a sample packet of version {VERSION}: starts with {bytes(data[:6])!r}")
    if length != len(data) - HEADER_BYTES:
        raise RemoteProtocolError(f"{where}: header promises a body of {length} bytes, {len(data) - HEADER_BYTES} came")
    body = memoryview(data)[HEADER_BYTES:]
    (checksum,) = _CHECKSUM.unpack_from(data, _HEADER.size)
    if zlib.crc32(body, zlib.crc32(memoryview(data)[: _HEADER.size])) != checksum:
        raise RemoteProtocolError(f"{where}: checksum does not match")
    edges_fit = 0 < width <= MAX_EDGE and 0 < height <= MAX_EDGE
    if n > MAX_SAMPLES or not edges_fit or not 8 <= bits <= 15 or base > 254:
        raise RemoteProtocolError(f"{where}: {n} samples of {width}x{height}, depth code {base}/{bits}: out of range")
    if not _sane(base_time, span, blend):
        raise RemoteProtocolError(f"{where}: time {base_time}, span {span}, blend {blend}: out of range")
    if adaptive > 1 or not all(map(math.isfinite, (scene_time, *position))) or not is_unit(quaternion):
        raise RemoteProtocolError(
            f"{where}: filter {adaptive}, scene time {scene_time}, pose {position} {quaternion}: out of range"
        )
    rect = Rect(x=x, y=y, width=width, height=height)
    if layout == PLAIN:
        samples = _unpack_plain(expand(body, codec, BYTES_A_SAMPLE * n, where), rect, base, bits, span)
    elif layout in (COMPACT, LIT) and codec == Codec.NONE:
        samples = compact.unpack(body, n, rect=rect, depth_base=base, depth_bits=bits, span=span, lit=layout == LIT)
    else:
        raise RemoteProtocolError(f"{where}: layout {layout} with codec {codec}; known: 0 with any, 1 and 2 with 0")
    if samples is None:
        raise RemoteProtocolError(f"{where}: body is not {n} samples inside its rectangle")
    return Batch(
        view=view,
        panel=panel,
        rect=rect,
        rank=rank,
        sequence=sequence,
        camera_event=camera_event,
        scene_event=scene_event,
        base_time=base_time,
        samples=samples,
        frame=frame,
        frame_samples=frame_samples,
        skipped=skipped,
        blend=blend,
        camera=Camera(position=position, world_from_wall=rotation_of(quaternion)),
        scene_time=scene_time,
        adaptive=bool(adaptive),
        relightable=layout == LIT,
    )


def _pack_plain(samples: Samples, rect: Rect, codec: Codec) -> tuple[bytes, int, int, float, int, int]:
    """Body, depth code's base and bits, span of times, samples that are bad or outside (then the body is empty)."""
    n = len(samples)
    low, high, latest, bad = kernels.depth_range(samples)
    if bad:
        return b"", 0, 0, 0.0, int(bad), 0
    base, bits = _depth_code(int(low), int(high))
    body = np.empty(BYTES_A_SAMPLE * n, np.uint8)
    outside = kernels.pack(
        samples,
        (rect.x, rect.y, rect.width, rect.height),
        subpixel_bits(rect.width),
        subpixel_bits(rect.height),
        base,
        bits,
        np.float32(latest),
        *_planes(body, n),
    )
    return compress(body.data, codec), base, bits, float(latest), 0, int(outside)


def _unpack_plain(data: bytes | memoryview, rect: Rect, base: int, bits: int, span: float) -> Samples | None:
    """The samples of a plain body, None if one lies outside the rectangle."""
    n = len(data) // BYTES_A_SAMPLE
    samples = np.zeros(n, SAMPLE)
    outside = kernels.unpack(
        *_planes(np.frombuffer(data, np.uint8), n),
        (rect.x, rect.y, rect.width, rect.height),
        subpixel_bits(rect.width),
        subpixel_bits(rect.height),
        base,
        bits,
        np.float32(span),
        samples,
    )
    return None if outside else samples


def subpixel_bits(edge: int) -> int:
    """Sub-pixel bits of positions along an edge of so many pixels: what the pixel number leaves of 14 bits."""
    return kernels.POSITION_BITS - max(edge - 1, 0).bit_length()


def _sane(base_time: float, span: float, blend: float) -> bool:
    return math.isfinite(base_time) and 0.0 <= span < kernels.MAX_SPAN_S and 0.0 < blend <= 1.0


def _depth_code(low: int, high: int) -> tuple[int, int]:
    """Exponent of depth code 0, and as many mantissa bits as cover the exponents low to high."""
    if low > high:
        return 0, 15
    return low, min(15, (65534 // (high - low + 1)).bit_length() - 1)


def _planes(body: np.ndarray[tuple[int], np.dtype[np.uint8]], n: int) -> tuple[np.ndarray, ...]:
    """Colour (n,) uint32, then x, y, depth, object (n,) uint16: views of one body."""
    words = body[4 * n :].view(np.uint16)
    return body[: 4 * n].view(np.uint32), words[:n], words[n : 2 * n], words[2 * n : 3 * n], words[3 * n :]
