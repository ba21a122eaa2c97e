"""Sample packets: one batch of samples of one rectangle, traced under one event.

A packet is self-contained and idempotent: it can be lost, repeated or late without harm to the next. decode() gives a
Batch or raises RemoteProtocolError, for any bytes: sizes and checksum are checked before numpy sees a buffer.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections import Counter
from enum import IntFlag

import numpy as np

from wall.core.data import NO_EDITS, Batch, Camera, Edits, Rect
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets import compact_body, plain_body
from wall.packets.codecs import Codec, compress, expand
from wall.packets.kernels.compact_body import DEPTH_BITS
from wall.packets.kernels.plain_body import MAX_SPAN_S
from wall.packets.rotations import is_unit, quaternion_of, rotation_of

__all__ = ["HEADER_BYTES", "MAX_SAMPLES", "Codec", "decode", "encode", "is_samples"]

MAGIC, VERSION, KIND_SAMPLES = b"WALL", 8, 1
PLAIN, COMPACT = 0, 1  # layouts of the body
MAX_SAMPLES = 65536  # of one packet
MAX_NUMBER = (1 << 60) - 1  # of events, frames and edits: no run ever counts as far, and sums of them fit 64 bits
MAX_EDGE = 4096  # pixels of a rectangle: leaves 2 sub-pixel bits of 14
LARGEST_DEPTH_BASE, DEPTH_BITS_RANGE = 254, (8, 15)  # float32 exponent, mantissa bits

_HEADER = struct.Struct("<4sBBBBHHHHBBHHHHQQQdffQIIIIId3d4d3fQ")
_CHECKSUM = struct.Struct("<I")
RANK_AT = 14  # offset in the header
HEADER_BYTES = _HEADER.size + _CHECKSUM.size


class Channel(IntFlag):
    """What a packet says of each of its samples; bits of the header. New channels take the next bits."""

    POSITION = 1
    RADIANCE = 2
    DEPTH = 4
    TIME = 8
    OBJECT_ID = 16
    CHANGE = 32
    NORMAL = 64
    LIGHT_VISIBILITY = 128
    ALBEDO = 256
    FORESEEN = 512  # nothing more of each: all of them were traced where the camera was expected


ALWAYS = Channel.POSITION | Channel.RADIANCE | Channel.TIME
WITH_SURFACE = ALWAYS | Channel.DEPTH | Channel.OBJECT_ID
ADAPTIVE = WITH_SURFACE | Channel.CHANGE
RELIGHTABLE = ADAPTIVE | Channel.NORMAL | Channel.LIGHT_VISIBILITY
NOISY = ADAPTIVE | Channel.NORMAL | Channel.ALBEDO
KNOWN = RELIGHTABLE | NOISY | Channel.FORESEEN
OPTIONAL_OF_PLAIN = Channel.DEPTH | Channel.OBJECT_ID | Channel.FORESEEN
TOO_BRIGHT = "too_bright"  # counts samples whose light is above LARGEST_COLOUR and cut off there


def is_samples(data: bytes) -> bool:
    """Whether a message claims to be a sample packet."""
    return len(data) > 5 and data[:4] == MAGIC and data[5] == KIND_SAMPLES


def sender_of(data: bytes) -> int | None:
    """The rank that a sample packet names; None for other messages, and for what is too short."""
    return int.from_bytes(data[RANK_AT : RANK_AT + 2], "little") if is_samples(data) and len(data) > RANK_AT else None


def encode(batch: Batch, codec: Codec = Codec.NONE, counters: Counter[str] | None = None) -> bytes:
    """One packet of a batch; the compact layout for adaptive ones, whose samples may come back in another order.

    `codec` is that of the plain layout: the compact one is always compressed by zstd. `counters`: TOO_BRIGHT is added.

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
        layout, codec, bits = COMPACT, Codec.ZSTD, DEPTH_BITS
        channels = NOISY if batch.noisy else RELIGHTABLE if batch.relightable else ADAPTIVE
        data, objects, base, span, bad, outside, bright = compact_body.pack(
            batch.samples, rect, relightable=batch.relightable, noisy=batch.noisy
        )
    else:
        layout, channels = PLAIN, _plain_channels(batch)
        raw, objects, base, bits, span, bad, outside, bright = plain_body.pack(
            batch.samples, rect, depths=batch.depths, objects=batch.objects
        )
        data = b"" if bad or outside else compress(raw.data, codec)
    if bad:
        raise LocalProtocolError(f"{where}: {bad} of {n} samples without a finite colour, a depth or a time")
    if outside:
        raise LocalProtocolError(f"{where}: {outside} of {n} samples outside {rect}")
    if not _sane(batch.base_time, span, float(np.float32(batch.blend))):
        raise LocalProtocolError(
            f"{where}: base time {batch.base_time}, blend {batch.blend}; wanted a finite time, a blend in (0, 1]"
        )
    counts = batch.camera_event, batch.scene_event, batch.frame, batch.edits.number
    if not 0 <= min(counts) <= max(counts) <= MAX_NUMBER:
        raise LocalProtocolError(f"{where}: event, frame, edit {counts}: a number does not fit its field of the header")
    if not all(map(math.isfinite, (batch.scene_time, *batch.camera.position, *batch.camera.eye))):
        raise LocalProtocolError(f"{where}: scene time {batch.scene_time}, {batch.camera}; wanted finite numbers")
    try:
        header = _HEADER.pack(
            MAGIC, VERSION, KIND_SAMPLES, codec, layout, channels, batch.view, batch.panel, batch.rank, base, bits,
            rect.x, rect.y, rect.width, rect.height, batch.sequence, batch.camera_event, batch.scene_event,
            batch.base_time, span, batch.blend, batch.frame, batch.frame_samples, batch.skipped, n, objects,
            len(data), batch.scene_time, *batch.camera.position, *quaternion_of(batch.camera.world_from_wall),
            *batch.camera.eye, batch.edits.number,
        )  # fmt: skip
    except struct.error as error:
        raise LocalProtocolError(f"{where}: a number does not fit its field of the header ({error})") from error
    except ValueError as error:
        raise LocalProtocolError(f"{where}: camera's world_from_wall {error}") from error
    if counters is not None:
        counters[TOO_BRIGHT] += bright
    return b"".join((header, _CHECKSUM.pack(zlib.crc32(data, zlib.crc32(header))), data))


def decode(data: bytes | memoryview) -> Batch:
    """The batch of a packet. Raises RemoteProtocolError for anything that is not a whole, valid packet."""
    if len(data) < HEADER_BYTES:
        raise RemoteProtocolError(f"a packet of {len(data)} bytes; its header alone has {HEADER_BYTES}")
    fields = _HEADER.unpack_from(data)
    magic, version, kind, codec, layout, channels, view, panel, rank, base, bits, x, y, width, height = fields[:15]
    sequence, camera_event, scene_event, base_time, span, blend, frame, frame_samples, skipped, n = fields[15:25]
    objects, length, scene_time, position, quaternion, edit = *fields[25:28], fields[28:31], fields[31:35], fields[38]
    eye, where = fields[35:38], f"rank {rank} packet {sequence}"
    if magic != MAGIC or version != VERSION or kind != KIND_SAMPLES:
        raise RemoteProtocolError(f"not a sample packet of version {VERSION}: starts with {bytes(data[:6])!r}")
    if length != len(data) - HEADER_BYTES:
        raise RemoteProtocolError(f"{where}: header promises a body of {length} bytes, {len(data) - HEADER_BYTES} came")
    body = memoryview(data)[HEADER_BYTES:]
    (checksum,) = _CHECKSUM.unpack_from(data, _HEADER.size)
    if zlib.crc32(body, zlib.crc32(memoryview(data)[: _HEADER.size])) != checksum:
        raise RemoteProtocolError(f"{where}: checksum does not match")
    edges_fit = 0 < width <= MAX_EDGE and 0 < height <= MAX_EDGE
    depth_fits = base <= LARGEST_DEPTH_BASE and DEPTH_BITS_RANGE[0] <= bits <= DEPTH_BITS_RANGE[1]
    if n > MAX_SAMPLES or objects > n or not edges_fit or not depth_fits:
        raise RemoteProtocolError(
            f"{where}: {n} samples of {objects} objects in {width}x{height}, depth code {base}/{bits}: out of range"
        )
    if not _sane(base_time, span, blend):
        raise RemoteProtocolError(f"{where}: time {base_time}, span {span}, blend {blend}: out of range")
    if max(camera_event, scene_event, frame, edit) > MAX_NUMBER:
        raise RemoteProtocolError(
            f"{where}: event {camera_event}/{scene_event}, frame {frame}, edit {edit}: above {MAX_NUMBER}"
        )
    if not all(map(math.isfinite, (scene_time, *position, *eye))) or not is_unit(quaternion):
        raise RemoteProtocolError(f"{where}: scene time {scene_time}, pose {position} {quaternion} {eye}: out of range")
    if not _fits(layout, channels):
        raise RemoteProtocolError(
            f"{where}: channels {channels:#x} in layout {layout}, bits {channels & ~int(KNOWN):#x} of them not known; "
            f"wanted {int(ALWAYS):#x} and any of {int(OPTIONAL_OF_PLAIN):#x} in layout 0, "
            f"{int(ADAPTIVE):#x}, {int(RELIGHTABLE):#x} or {int(NOISY):#x} in 1"
        )
    depths, named = bool(channels & Channel.DEPTH), bool(channels & Channel.OBJECT_ID)
    if objects and not named:
        raise RemoteProtocolError(f"{where}: a table of {objects} objects without the channel of objects")
    if layout == COMPACT and codec != Codec.ZSTD:
        raise RemoteProtocolError(f"{where}: layout {layout} with codec {codec}; wanted 2, zstd")
    rect = Rect(x=x, y=y, width=width, height=height)
    if layout == PLAIN:
        raw = expand(body, codec, plain_body.size_of(n, objects, depths=depths, objects=named), where)
        samples = plain_body.unpack(
            raw, n, rect=rect, depth_base=base, depth_bits=bits, span=span, depths=depths, objects=named
        )
    else:
        samples = compact_body.unpack(
            body, n, objects, rect=rect, depth_code=(base, bits), span=span, relightable=channels == RELIGHTABLE,
            noisy=channels == NOISY, where=where,
        )  # fmt: skip
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
        camera=Camera(position=position, world_from_wall=rotation_of(quaternion), eye=eye),
        scene_time=scene_time,
        adaptive=layout == COMPACT,
        relightable=channels == RELIGHTABLE,
        noisy=channels == NOISY,
        depths=depths,
        objects=named,
        foreseen=bool(channels & Channel.FORESEEN),
        edits=Edits(edit) if edit else NO_EDITS,
    )


def _plain_channels(batch: Batch) -> Channel:
    """What a plain packet of a batch says of each sample."""
    of_each = ((Channel.DEPTH, batch.depths), (Channel.OBJECT_ID, batch.objects), (Channel.FORESEEN, batch.foreseen))
    channels = ALWAYS
    for channel, sent in of_each:
        channels |= channel if sent else Channel(0)
    return channels


def _fits(layout: int, channels: int) -> bool:
    """Whether a body of that layout may have these channels."""
    if layout == PLAIN:
        return channels & ~int(OPTIONAL_OF_PLAIN) == ALWAYS  # an IntFlag's own complement lacks bits not known
    return layout == COMPACT and channels in (ADAPTIVE, RELIGHTABLE, NOISY)


def _sane(base_time: float, span: float, blend: float) -> bool:
    return math.isfinite(base_time) and 0.0 <= span < MAX_SPAN_S and 0.0 < blend <= 1.0
