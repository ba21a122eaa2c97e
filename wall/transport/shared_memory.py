"""Memory that two processes of one machine share, for packets that are too large to send: one writes, the other reads.

It is an anonymous file: it has no name that could outlive the two, whatever ends them. The reader opens it by the
writer's process and descriptor, and checks that it is the one meant. It is a ring whose positions count bytes, as
credit does: what is granted is at most half of it, so that a packet is not overwritten before it was consumed. Should
credit ever err, the two counts at its beginning tell: nothing half-written is ever read, as x86-64 orders stores.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import mmap
import os
import stat
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.core.errors import RemoteProtocolError

REFERENCE = struct.Struct("<16sQQQQ")  # machine, process, descriptor, capacity, token
OTHER_MACHINE = "memory of another machine"
MOST_BYTES = 1 << 28  # of a ring: more than two packets of the largest size
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL  # a reader cannot be sent past its end
_WORDS = 3  # token; bytes whose writing has begun; bytes written: counts since the link began
_START = 64  # bytes before the ring's first: a cache line
_BEGUN, _WRITTEN = 1, 2


def machine_id() -> str:
    """Names this machine since it was started: processes that agree share memory and one monotonic clock."""
    return Path("/proc/sys/kernel/random/boot_id").read_text().strip()


class RingWriter:
    """The writing end, which makes the memory."""

    def __init__(self, capacity: int) -> None:
        """`capacity`: bytes. Raises OSError where there is no such memory, or more is asked for than MOST_BYTES."""
        if not 0 < capacity <= MOST_BYTES:  # nothing else limits it: it would take all of the machine's
            raise OSError(errno.ENOMEM, f"at most {MOST_BYTES} bytes are taken")
        self.capacity, self.token = capacity, int.from_bytes(os.urandom(8), "little")
        self._fd = os.memfd_create("wall", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.posix_fallocate(self._fd, 0, _START + capacity)  # or writing would end this process where memory is full
            fcntl.fcntl(self._fd, fcntl.F_ADD_SEALS, _SEALS)
            memory = np.frombuffer(mmap.mmap(self._fd, _START + capacity), np.uint8)
        except OSError:
            os.close(self._fd)
            raise
        self._counts, self._ring = _parts(memory)
        self._counts[0] = self.token

    @property
    def reference(self) -> bytes:
        """What the reader opens it by."""
        return REFERENCE.pack(_machine(), os.getpid(), self._fd, self.capacity, self.token)

    def write(self, position: int, data: bytes) -> None:
        """Write some bytes, at most `capacity`, at a count that only grows. The last store publishes them."""
        end = position + len(data)
        self._counts[_BEGUN] = end
        start, values = position % self.capacity, np.frombuffer(data, np.uint8)
        first = min(len(values), self.capacity - start)
        self._ring[start : start + first] = values[:first]
        self._ring[: len(values) - first] = values[first:]
        self._counts[_WRITTEN] = end

    def close(self) -> None:
        """Let go of the memory; it lasts until the reader does too. May be called twice."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
            self._counts, self._ring = _parts(np.zeros(_START, np.uint8))


class RingReader:
    """The reading end; it cannot write."""

    def __init__(self, reference: bytes) -> None:
        """`reference`: of a RingWriter. Raises RemoteProtocolError where it leads to no such ring, OSError to nothing.

        Of another machine's the error is OTHER_MACHINE.
        """
        machine, self._process, fd, self.capacity, self.token = REFERENCE.unpack(reference)
        if machine != _machine():
            raise RemoteProtocolError(OTHER_MACHINE)
        size = _START + self.capacity
        if not 0 < self.capacity <= MOST_BYTES or not 0 < self._process < 1 << 31 or fd >= 1 << 31:
            raise RemoteProtocolError(f"shared memory of {self.capacity} bytes of process {self._process}")
        memory = np.frombuffer(_mapped(f"/proc/{self._process}/fd/{fd}", size), np.uint8)
        self._counts, self._ring = _parts(memory)
        if int(self._counts[0]) != self.token:
            raise RemoteProtocolError(f"another memory than the one that process {self._process} spoke of")

    def read(self, position: int, size: int) -> bytes | None:
        """A copy of some bytes. None where they are not written yet, or overwritten by now."""
        end, start = position + size, position % self.capacity
        if size > self.capacity or int(self._counts[_WRITTEN]) < end:
            return None
        first = min(size, self.capacity - start)
        data = self._ring[start : start + first].tobytes()
        if first < size:
            data += self._ring[: size - first].tobytes()
        return data if int(self._counts[_BEGUN]) <= position + self.capacity else None

    @property
    def alive(self) -> bool:
        """Whether the writer's process is there."""
        return Path(f"/proc/{self._process}").exists()


def _machine() -> bytes:
    return bytes.fromhex(machine_id().replace("-", ""))


def _mapped(path: str, size: int) -> mmap.mmap:
    """A sealed anonymous file of some size, mapped to be read. Nothing else is opened: a device might act on it."""
    wanted = RemoteProtocolError(f"{path}: not an anonymous file of {size} bytes")
    about = os.stat(path)
    if not stat.S_ISREG(about.st_mode) or about.st_size != size:
        raise wanted
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        with contextlib.suppress(OSError):  # of another kind of file, which has no seals
            if fcntl.fcntl(fd, fcntl.F_GET_SEALS) == _SEALS and os.fstat(fd).st_size == size:
                return mmap.mmap(fd, size, prot=mmap.PROT_READ)
    finally:
        os.close(fd)
    raise wanted


def _parts(memory: NDArray[np.uint8]) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]:
    """The counts and the ring."""
    return memory[: 8 * _WORDS].view(np.uint64), memory[_START:]
