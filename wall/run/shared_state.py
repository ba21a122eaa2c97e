"""Bytes that one process leaves to another, which may find it dead at any moment."""

from __future__ import annotations

import mmap
import struct
import zlib

MOST_BYTES = 1 << 20
_PLACE = struct.Struct("<QII")  # count, bytes, checksum
_SIGN = struct.Struct("<Q")


class SharedState:
    """The newest of some bytes that one process writes, and another one reads once the first is dead.

    They have two places in turn, so that one that was not written to its end leaves the one before.
    """

    def __init__(self) -> None:
        self._sign = 2 * (_PLACE.size + MOST_BYTES)  # where signs of life are counted
        self._memory, self._count = mmap.mmap(-1, self._sign + _SIGN.size), 0

    def write(self, data: bytes) -> bool:
        """Put bytes in place of those before. Returns whether there was room; a sign of life is given anyway."""
        _SIGN.pack_into(self._memory, self._sign, self.signs + 1)
        if len(data) > MOST_BYTES:
            return False
        self._count += 1
        start = (self._count % 2) * (_PLACE.size + MOST_BYTES)
        body = start + _PLACE.size
        self._memory[body : body + len(data)] = data
        _PLACE.pack_into(self._memory, start, self._count, len(data), zlib.crc32(data, self._count))
        return True

    @property
    def signs(self) -> int:
        """How often the writer gave a sign of life."""
        return int(_SIGN.unpack_from(self._memory, self._sign)[0])

    def read(self) -> bytes | None:
        """The newest whole ones; None where there are none. Who reads may write from then on."""
        found = dict[int, bytes]()
        for start in (0, _PLACE.size + MOST_BYTES):
            count, size, check = _PLACE.unpack_from(self._memory, start)
            data = self._memory[start + _PLACE.size : start + _PLACE.size + min(size, MOST_BYTES)]
            if count and zlib.crc32(data, count) == check:
                found[count] = data
        self._count = max(found, default=0)
        return found.get(self._count)
