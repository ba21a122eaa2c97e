"""The body of a framelet's part on the wire: which node made it, where, under which camera and scene time, its pixels.

Channels stand one after another, whole; numbers of four bytes go byte by byte (all first bytes, all second ones, ...),
which lz4 then shrinks. Between processes that share memory they are plain: as they are in a framelet. Exact: what comes
out is what went in.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

import lz4.block
import numpy as np
from numpy.typing import NDArray

from wall.core.data import CHANNELS, TRIPLES, Camera, Channels, Event, Framelet, Rect
from wall.core.errors import RemoteProtocolError
from wall.packets.kernels import byte_planes as kernels_bytes

HEAD = struct.Struct("<HHiiIIBBHHqqddI3d9d3f")
MAX_AREA = 1 << 25  # pixels: 8K UHD
MAX_RAW = 1 << 23  # bytes of one part before compression: it fits a message, whatever they are
LZ4_LARGEST_RATIO = 255  # lz4 cannot expand more: a few bytes cannot ask for a large buffer
ENCODED, COMPARED, POSED, PLAIN = 1, 2, 4, 8  # flags
FLAGS_OFFSET = 21  # in HEAD


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameletPart:
    """A rectangle of a node's framelet, as another process has it now."""

    step: int  # index in Graph.steps of the node
    view: int = 0  # whose event it shows
    rect: Rect  # of the frame
    channels: Channels
    encoded: bool
    compared: bool  # of the second image, while two samplers are compared
    event: Event | None  # what it shows; only its numbers, camera and scene time travel
    refreshed_at: float  # seconds of the head's clock; see Framelet.time_origin
    data: bytes | memoryview
    plain: bool = False  # the data are the channels' own bytes, uncompressed
    index: int = 0  # of `count` parts that belong together: all of them show one moment
    count: int = 1

    @classmethod
    def of(
        cls, step: int, framelet: Framelet, rect: Rect, *, compared: bool = False, plain: bool = False
    ) -> FrameletPart:
        """The pixels of `rect`, which lies inside the framelet.

        They are compressed, or `plain`: then they may be the framelet's own, so serialise the part before they change.
        """
        rows = rect.inside(framelet.rect)
        channels = [framelet.channel(name)[rows] for name in CHANNELS if name in framelet.channels]
        data: bytes | memoryview
        if plain:
            whole = [np.ascontiguousarray(channel).data.cast("B") for channel in channels]
            data = whole[0] if len(whole) == 1 else b"".join(whole)
        else:
            data = bytes(lz4.block.compress(b"".join(map(_bytes, channels)), store_size=False))
        return cls(
            step=step, view=framelet.event.view if framelet.event is not None else 0, rect=rect,
            channels=framelet.channels, encoded=framelet.encoded, compared=compared,
            event=framelet.event, refreshed_at=framelet.refreshed_at, data=data, plain=plain,
        )  # fmt: skip

    def check(self, out: Framelet) -> None:
        """Raise RemoteProtocolError if the part does not fit `out`: its rectangle, channels or encoding."""
        if not out.rect.contains(self.rect) or self.channels != out.channels or self.encoded != out.encoded:
            raise RemoteProtocolError(
                f"framelet part {self.rect} with {', '.join(sorted(self.channels))}; wanted: inside {out.rect}, "
                f"with {', '.join(sorted(out.channels))}"
            )

    def unpacked(self) -> FrameletPart:
        """The same with plain data, which always fit. Raises RemoteProtocolError where they are not its pixels."""
        if self.plain:
            return self
        pixels = Framelet.blank(self.rect, self.channels, encoded=self.encoded)
        self.write(pixels)
        return replace(self, data=FrameletPart.of(self.step, pixels, self.rect, plain=True).data, plain=True)

    def write(self, out: Framelet) -> None:
        """Write the pixels to `out`. Raises RemoteProtocolError where they do not fit it."""
        self.check(out)
        raw, start, rows = self._raw(), 0, self.rect.inside(out.rect)
        for name in CHANNELS:
            if name in self.channels:
                here = out.channel(name)[rows]
                data = raw[start : start + here.nbytes]
                values = data.view(here.dtype).reshape(here.shape)
                here[...] = values if self.plain else _values(data, here.shape, here.dtype)
                start += here.nbytes

    def _raw(self) -> NDArray[np.uint8]:
        size = bytes_a_pixel(self.channels, encoded=self.encoded) * self.rect.area
        try:
            raw = self.data if self.plain else lz4.block.decompress(self.data, uncompressed_size=size)
        except (lz4.block.LZ4BlockError, ValueError, MemoryError) as error:
            raise RemoteProtocolError(f"framelet of step {self.step}: does not decompress ({error})") from error
        if len(raw) != size:
            raise RemoteProtocolError(f"framelet of step {self.step}: {len(raw)} bytes, {size} wanted")
        return np.frombuffer(raw, np.uint8)


def bytes_a_pixel(channels: Channels, *, encoded: bool) -> int:
    """Bytes of a pixel's channels before compression."""
    rest = channels - {"colour"}
    return (3 if encoded else 12) + 4 * len(rest - TRIPLES) + 12 * len(rest & TRIPLES)


def bands(rect: Rect, channels: Channels, *, encoded: bool) -> list[Rect]:
    """Cut a rectangle so that each part is at most MAX_RAW bytes."""
    rows = max(1, MAX_RAW // (bytes_a_pixel(channels, encoded=encoded) * rect.width))
    return [
        Rect(x=rect.x, y=y, width=rect.width, height=min(rows, rect.bottom - y))
        for y in range(rect.y, rect.bottom, rows)
    ]


def part_head(part: FrameletPart) -> bytes:
    """The bytes before a part's data. Raises struct.error where a number does not fit its field."""
    event, r = part.event, part.rect
    channels = sum(1 << k for k, name in enumerate(CHANNELS) if name in part.channels)
    flags = ENCODED * part.encoded | COMPARED * part.compared | POSED * (event is not None) | PLAIN * part.plain
    pose = pose_numbers(event.camera) if event else (0.0,) * 15
    numbers = (event.camera_event, event.scene_event, event.scene_time) if event else (0, 0, 0.0)
    return HEAD.pack(
        part.step, part.view, r.x, r.y, r.width, r.height, channels, flags, part.index, part.count, *numbers,
        part.refreshed_at, len(part.data), *pose,
    )  # fmt: skip


def pose_numbers(camera: Camera) -> tuple[float, ...]:
    """The 15 numbers of a camera: position, rotation, tracked eye."""
    return (*camera.position, *camera.world_from_wall, *camera.eye)


def camera_of(numbers: Sequence[float]) -> Camera:
    """The camera of its 15 numbers."""
    x, y, z, *turn = numbers[:12]
    across, up, towards = numbers[12:]
    return Camera(position=(x, y, z), world_from_wall=tuple(turn), eye=(across, up, towards))


def is_plain(head: bytes) -> bool:
    """Whether the data behind a head are plain pixels, which the message's checksum leaves out: memory carries them."""
    return len(head) == HEAD.size and bool(head[FLAGS_OFFSET] & PLAIN)


def parse_part(head: bytes, data: bytes | memoryview) -> FrameletPart:
    """The part of a head and its data. Raises RemoteProtocolError for anything that no part has."""
    if len(head) != HEAD.size:
        raise RemoteProtocolError(f"a framelet of {len(head)} bytes; its head alone has {HEAD.size}")
    step, view, x, y, width, height, mask, flags, index, count, *numbers = HEAD.unpack(head)
    camera_event, scene_event, scene_time, refreshed_at, length, *pose = numbers
    if length != len(data):
        raise RemoteProtocolError(f"framelet of step {step}: {len(data)} bytes came of {length}")
    if index >= count:
        raise RemoteProtocolError(f"framelet of step {step}: part {index} of {count}")
    if not mask & 1 or mask >= 1 << len(CHANNELS) or flags > ENCODED | COMPARED | POSED | PLAIN:
        raise RemoteProtocolError(f"framelet of step {step}: channels {mask:#x} or flags {flags:#x} are not known")
    if not all(map(math.isfinite, (scene_time, refreshed_at, *pose))):
        raise RemoteProtocolError(f"framelet of step {step}: a number is not finite")
    channels = frozenset(name for k, name in enumerate(CHANNELS) if mask >> k & 1)
    encoded = bool(flags & ENCODED)
    plain, size = bool(flags & PLAIN), bytes_a_pixel(channels, encoded=encoded) * width * height
    fits = length == size if plain else size <= LZ4_LARGEST_RATIO * length
    if not 0 < width * height <= MAX_AREA or max(abs(x), abs(y)) > 1 << 24 or not fits:
        raise RemoteProtocolError(f"framelet of step {step}: {width}x{height} with {length} bytes is out of range")
    event = None
    if flags & POSED:
        camera = camera_of(pose)
        event = Event(
            view=view, camera_event=camera_event, scene_event=scene_event, scene_time=scene_time,
            input_time=refreshed_at, camera=camera,
        )  # fmt: skip
    return FrameletPart(
        step=step, view=view, rect=Rect(x=x, y=y, width=width, height=height), channels=channels,
        encoded=encoded, compared=bool(flags & COMPARED), event=event, refreshed_at=refreshed_at,
        data=data, plain=plain, index=index, count=count,
    )  # fmt: skip


def _bytes(pixels: NDArray[np.generic]) -> bytes:
    if pixels.dtype == np.uint8:
        return pixels.tobytes()
    numbers = np.ascontiguousarray(pixels).reshape(-1).view(np.uint32)
    planes = np.empty((4, len(numbers)), np.uint8)
    kernels_bytes.apart(numbers, planes)
    return planes.tobytes()


def _values(raw: NDArray[np.uint8], shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> NDArray[np.generic]:
    if dtype == np.uint8:
        return raw.reshape(shape)
    numbers = np.empty(raw.size // 4, np.uint32)
    kernels_bytes.together(raw.reshape(4, -1), numbers)
    return numbers.view(dtype).reshape(shape)
