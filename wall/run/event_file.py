"""The file in which a renderer keeps all that it decides by, so that a replay decides the same.

A role reads no clock and opens no socket (docs/decisions/0011-roles-without-io.md): what it does follows from what it
is told. So the file holds what it was told, in order, as entries of a tag byte and

    TIME     float64          a reading of the head's clock, seconds
    CORES    float64          how many it had, once; first of all
    MESSAGE  u32, bytes       a message of the manager, as on the wire; the first one: this rank's own Hello
    NO_MORE                   no other message had come
    ANSWER   u8               whether a packet would be sent at once, or go through shared memory
    DROPPED  u16, (u32, bytes) * n   packets that gave way to one that was offered
    BATCH    u32, u32         what was traced: number in the rank, CRC-32 of its bytes; 0: nothing was missing

little-endian, as one zlib stream that is flushed every FLUSH_S: after a crash it can be read up to there.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wall.core.data import Batch
from wall.core.errors import RunError

FLUSH_S = 1.0
LEVEL = 1  # of zlib: readings of a clock hardly shrink
READ_BYTES = 1 << 16
MOST_BYTES = 1 << 26  # of a message or a packet: none is as large
TIME, CORES, MESSAGE, NO_MORE, ANSWER, DROPPED, BATCH = b"TCMNADB"
KINDS = {
    TIME: "a reading of the clock", CORES: "the rank's cores", MESSAGE: "a message", NO_MORE: "no message",
    ANSWER: "an answer about a packet", DROPPED: "packets that were dropped", BATCH: "a batch",
}  # fmt: skip
_TIME, _MESSAGE, _ANSWER = struct.Struct("<Bd"), struct.Struct("<BI"), struct.Struct("<BB")
_DROPPED, _BATCH, _SIZE = struct.Struct("<BH"), struct.Struct("<BII"), struct.Struct("<I")
_OF_BATCH = struct.Struct("<IIqqqdd")


def checksum(traced: bytes | Batch | None) -> int:
    """CRC-32 of a packet, or of a batch that is not encoded: its samples, what they saw and when; 0 for nothing."""
    if traced is None:
        return 0
    if isinstance(traced, bytes):
        return zlib.crc32(traced)
    about = _OF_BATCH.pack(
        traced.view, traced.panel, traced.sequence, traced.camera_event, traced.scene_event, traced.base_time,
        traced.scene_time,
    )  # fmt: skip
    return zlib.crc32(np.ascontiguousarray(traced.samples).view(np.uint8).data, zlib.crc32(about))


class EventFile:
    """Written by one rank, by the thread of its loop. Where the disk is full it says so once, and keeps no more."""

    def __init__(self, path: Path) -> None:
        """Raises RunError where it cannot be written."""
        self._path, self._packer, self._flushed = path, zlib.compressobj(LEVEL), time.monotonic()
        self._entries, self._full = bytearray(), False
        self.note = ""  # for its users, once
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise RunError(f"events cannot be recorded to {path}: {error.strerror or error}") from error

    def time(self, seconds: float) -> None:
        """A reading of the clock."""
        self._entries += _TIME.pack(TIME, seconds)

    def cores(self, count: float) -> None:
        """How many this rank has."""
        self._entries += _TIME.pack(CORES, count)

    def message(self, data: bytes) -> None:
        """A message of the manager."""
        self._entries += _MESSAGE.pack(MESSAGE, len(data)) + data

    def no_more(self) -> None:
        """No other message has come. Once a turn: it also writes what was kept so far, every FLUSH_S."""
        self._entries.append(NO_MORE)
        if time.monotonic() >= self._flushed + FLUSH_S:
            self._write(zlib.Z_SYNC_FLUSH)

    def answer(self, yes: bool) -> None:
        """Whether a packet would be sent, or go through shared memory."""
        self._entries += _ANSWER.pack(ANSWER, yes)

    def dropped(self, packets: list[bytes]) -> None:
        """What gave way to a packet that was offered."""
        self._entries += _DROPPED.pack(DROPPED, len(packets))
        for packet in packets:
            self._entries += _SIZE.pack(len(packet)) + packet

    def batch(self, number: int, traced: bytes | Batch | None) -> None:
        """What a worker has traced."""
        self._entries += _BATCH.pack(BATCH, number, checksum(traced))

    def close(self) -> None:
        """Write the rest."""
        if not self._file.closed:
            self._write(zlib.Z_FINISH)
            self._file.close()

    def _write(self, how: int) -> None:
        data = self._packer.compress(self._entries) + self._packer.flush(how)
        self._entries.clear()
        self._flushed = time.monotonic()
        try:
            while data and not self._full:
                data = data[self._file.write(data) or 0 :]
        except OSError as error:
            self._full = True
            self.note = f"{self._path}: no more events are recorded: {error.strerror or error}"


class EndOfFileError(RunError):
    """Everything that was recorded has been replayed."""


class EventReader:
    """The entries of a file, one after the other. Calls raise EndOfFileError at its end."""

    def __init__(self, path: Path) -> None:
        """Raises RunError where it cannot be read."""
        self._path, self._data, self._at = path, b"", 0
        self.batches, self.seconds = 0, (0.0, 0.0)  # so far: batches; first and newest reading of the clock
        self._parts = self._unpacked()

    def time(self) -> float:
        """The next reading of the clock."""
        (seconds,) = self._next(TIME, struct.Struct("<d"))
        self.seconds = (self.seconds[0] or seconds, seconds)
        return float(seconds)

    def cores(self) -> float:
        """How many the rank had."""
        (count,) = self._next(CORES, struct.Struct("<d"))
        return float(count)

    def message(self) -> bytes | None:
        """The next message; None where no other had come."""
        if self._peek() == NO_MORE:
            self._take(1)
            return None
        (size,) = self._next(MESSAGE, _SIZE)
        return self._take(size)

    def answer(self) -> bool:
        """The next answer about a packet."""
        (yes,) = self._next(ANSWER, struct.Struct("<B"))
        return bool(yes)

    def dropped(self) -> list[bytes]:
        """What gave way to the packet that is offered next."""
        (count,) = self._next(DROPPED, struct.Struct("<H"))
        return [self._take(_SIZE.unpack(self._take(_SIZE.size))[0]) for _ in range(count)]

    def batch(self) -> tuple[int, int]:
        """Number and checksum of the next batch."""
        number, crc = self._next(BATCH, struct.Struct("<II"))
        self.batches += 1
        return number, crc

    def messages(self) -> Iterator[bytes]:
        """All messages from here on, without what lies between; `seconds` goes on with them."""
        try:
            while True:
                kind = self._peek()
                if kind == MESSAGE:
                    yield self.message() or b""
                else:
                    self._skip(kind)
        except EndOfFileError:
            return

    def _skip(self, kind: int) -> None:
        if kind == TIME:
            self.time()
        elif kind == CORES:
            self.cores()
        elif kind == NO_MORE:
            self._take(1)
        elif kind == ANSWER:
            self.answer()
        elif kind == DROPPED:
            self.dropped()
        else:
            self.batch()

    def _next(self, tag: int, body: struct.Struct) -> tuple[Any, ...]:
        found = self._peek()
        if found != tag:
            recorded = KINDS.get(found, f"entry {found}")
            raise RunError(
                f"{self._path}: after batch {self.batches - 1}, the run went on with {recorded}, this replay wants "
                f"{KINDS[tag]}; wanted: the program, the scene and a processor as of the run"
            )
        return body.unpack(self._take(1 + body.size)[1:])

    def _peek(self) -> int:
        self._need(1)
        return self._data[self._at]

    def _take(self, size: int) -> bytes:
        if size > MOST_BYTES:
            raise RunError(f"{self._path}: an entry of {size} bytes; the file is damaged")
        self._need(size)
        self._at += size
        return self._data[self._at - size : self._at]

    def _need(self, size: int) -> None:
        while len(self._data) - self._at < size:
            part = next(self._parts, None)
            if part is None:
                raise EndOfFileError(f"{self._path}: the end")
            self._data, self._at = self._data[self._at :] + part, 0

    def _unpacked(self) -> Iterator[bytes]:
        unpacker = zlib.decompressobj()
        try:
            with self._path.open("rb") as file:
                while data := file.read(READ_BYTES):
                    yield unpacker.decompress(data)
        except OSError as error:
            raise RunError(f"{self._path}: cannot be read ({error.strerror or error})") from error
        except zlib.error as error:
            raise RunError(f"{self._path}: not a file of events, or damaged ({error})") from error
