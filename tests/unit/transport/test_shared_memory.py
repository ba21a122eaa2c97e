"""Memory of two processes: what is read is what was written whole, whoever stops where; nothing of it stays."""

from __future__ import annotations

import errno
import fcntl
import gc
import multiprocessing
import os
import signal
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.errors import RemoteProtocolError
from wall.transport import shared_memory
from wall.transport.shared_memory import MOST_BYTES, OTHER_MACHINE, REFERENCE, RingReader, RingWriter

CAPACITY = 1000
ROUNDS = 60  # in which a writer is stopped somewhere
SIZE = 50_000  # bytes of its packets: most stops fall inside one


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def ring(closing: ExitStack, capacity: int = CAPACITY) -> tuple[RingWriter, RingReader]:
    writer = RingWriter(capacity)
    closing.callback(writer.close)
    return writer, RingReader(writer.reference)


def mappings() -> list[str]:
    return [line for line in Path("/proc/self/maps").read_text().splitlines() if "/memfd:wall" in line]


def descriptors() -> int:
    """Open anonymous files of this process."""
    links = (Path(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd"))
    return sum(str(link.readlink()).startswith("/memfd:wall") for link in links if link.is_symlink())


@given(sizes=st.lists(st.integers(0, CAPACITY), max_size=30), start=st.integers(0, 1 << 40))
@settings(max_examples=50, deadline=None)
def test_packets_come_whole_wherever_the_ring_ends(sizes: list[int], start: int) -> None:
    with ExitStack() as closing:
        writer, reader = ring(closing)
        position = start
        for k, size in enumerate(sizes):
            data = np.random.default_rng(k).bytes(size)
            writer.write(position, data)
            assert reader.read(position, size) == data
            position += size


def test_nothing_is_read_before_it_is_written_nor_after_it_is_overwritten(closing: ExitStack) -> None:
    writer, reader = ring(closing)
    assert reader.read(0, 1) is None
    writer.write(0, b"a" * 600)
    assert reader.read(0, 601) is None
    assert reader.read(600, 600) is None
    assert reader.read(0, CAPACITY + 1) is None
    writer.write(600, b"b" * 400)
    assert reader.read(0, 600) == b"a" * 600, "the ring is full"
    writer.write(1000, b"c")
    assert reader.read(0, 600) is None
    assert reader.read(1, 599) == b"a" * 599
    assert reader.read(600, 400) == b"b" * 400


class StoppedError(Exception):
    """The writer got no further."""


class HalfWritten:
    """A ring whose writer stops after half of the bytes."""

    def __init__(self, ring: np.ndarray[Any, Any]) -> None:
        self.ring = ring

    def __setitem__(self, where: slice, values: np.ndarray[Any, Any]) -> None:
        half = len(values) // 2
        self.ring[where.start : where.start + half] = values[:half]
        raise StoppedError


def test_a_writer_that_is_stopped_half_way_shows_nothing_of_it(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = ring(closing)
    writer.write(0, b"a" * 500)
    writer.write(500, b"b" * 500)
    with monkeypatch.context() as patch:
        patch.setattr(writer, "_ring", HalfWritten(writer._ring))
        with pytest.raises(StoppedError):
            writer.write(1000, b"c" * 400)
    assert reader.read(1000, 400) is None
    assert reader.read(0, 500) is None, "200 of its bytes are c"
    assert reader.read(400, 100) == b"a" * 100
    assert reader.read(500, 500) == b"b" * 500
    writer.write(1000, b"c" * 400)  # it goes on
    assert reader.read(1000, 400) == b"c" * 400


def test_a_reader_that_is_overtaken_while_it_copies_gives_nothing(
    closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = ring(closing)
    writer.write(0, b"a" * 600)

    class Overtaken:
        """Between looking and copying, the writer comes round."""

        def __getitem__(self, where: slice) -> np.ndarray[Any, Any]:
            writer.write(600, b"b" * 500)
            return whole[where]

    whole = reader._ring
    monkeypatch.setattr(reader, "_ring", Overtaken())
    assert reader.read(0, 600) is None
    monkeypatch.setattr(reader, "_ring", whole)
    assert reader.read(600, 500) == b"b" * 500


def writes_for_ever(told: Connection) -> None:
    """Packets of one byte's value each, without credit."""
    writer, position = RingWriter(3 * SIZE), 0
    told.send(writer.reference)
    while True:
        writer.write(position, bytes([position // SIZE % 251]) * SIZE)
        position += SIZE


def begun(target: Callable[[Connection], None], closing: ExitStack) -> tuple[int, RingReader]:
    """A process that writes, and a reader of its memory."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=target, args=(there,))
    child.start()
    closing.callback(child.join)
    closing.callback(child.kill)
    reference = here.recv()
    assert child.pid is not None
    return child.pid, RingReader(reference)


def test_a_process_that_is_stopped_anywhere_never_shows_two_packets_in_one(closing: ExitStack) -> None:
    pid, reader = begun(writes_for_ever, closing)
    came, seen = 0, 0
    for _ in range(ROUNDS):
        while int(reader._counts[2]) < seen + 4 * SIZE:  # the limit on the whole test stops one that waits for ever
            time.sleep(1e-4)
        os.kill(pid, signal.SIGSTOP)
        os.waitpid(pid, os.WUNTRACED)
        begun_at, written = (int(count) for count in reader._counts[1:3])
        seen = written
        for number in range(max(0, written // SIZE - 4), written // SIZE + 2):
            data = reader.read(number * SIZE, SIZE)
            assert data is None or data == bytes([number % 251]) * SIZE
            assert data is not None or number * SIZE + SIZE > written or begun_at > number * SIZE + 3 * SIZE
            came += data is not None
        os.kill(pid, signal.SIGCONT)
        for _ in range(20):  # while it runs
            number = int(reader._counts[2]) // SIZE - 1
            data = reader.read(number * SIZE, SIZE) if number >= 0 else None
            assert data is None or data == bytes([number % 251]) * SIZE
    assert came >= 2 * ROUNDS  # of the three that the ring holds, one may be in the making


def writes_once(told: Connection) -> None:
    writer = RingWriter(CAPACITY)
    writer.write(0, b"last words")
    told.send(writer.reference)
    signal.pause()


def names() -> set[str]:
    """Of shared memory; those of Open MPI and Chromium are of tests that run meanwhile."""
    return {name for name in os.listdir("/dev/shm") if not name.startswith(("sm_segment.", ".org.chromium."))}


def test_a_killed_writer_leaves_nothing_and_its_reader_goes_on(closing: ExitStack) -> None:
    gc.collect()  # rings of earlier tests
    named, before = names(), mappings()
    pid, reader = begun(writes_once, closing)
    assert reader.alive
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    assert not reader.alive
    assert reader.read(0, 10) == b"last words"
    assert reader.read(10, 1) is None
    assert len(mappings()) == len(before) + 1
    del reader
    assert mappings() == before
    assert names() <= named


def test_closing_lets_go_of_memory_and_descriptors() -> None:
    before = descriptors(), mappings()
    writer = RingWriter(CAPACITY)
    reader = RingReader(writer.reference)
    writer.write(0, b"word")
    writer.close()
    writer.close()
    assert reader.read(0, 4) == b"word"
    del reader
    assert (descriptors(), mappings()) == before


def test_a_reader_cannot_write_and_a_writer_cannot_cut_what_is_read(closing: ExitStack) -> None:
    writer, reader = ring(closing)
    with pytest.raises(ValueError, match="read-only"):
        reader._ring[0] = 1
    with pytest.raises(PermissionError):
        os.ftruncate(writer._fd, 0)


def test_full_memory_is_an_error_before_anything_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(fd: int, offset: int, length: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    before = descriptors()
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match="No space left"):
        RingWriter(CAPACITY)
    assert descriptors() == before


def test_a_ring_cannot_take_all_of_a_machine_s_memory() -> None:
    with pytest.raises(OSError, match="at most 268435456 bytes are taken"):
        RingWriter(MOST_BYTES + 1)


def reference(**changes: int | bytes) -> bytes:
    names = ("machine", "process", "descriptor", "capacity", "token")
    values = dict(zip(names, (shared_memory._machine(), os.getpid(), 0, CAPACITY, 7), strict=True)) | changes
    return REFERENCE.pack(*values.values())


@given(
    process=st.one_of(st.just(os.getpid()), st.integers(0, 2**64 - 1)),
    descriptor=st.one_of(st.integers(0, 30), st.integers(0, 2**64 - 1)),
    capacity=st.one_of(st.just(CAPACITY), st.integers(0, 2**64 - 1)),
)
@settings(max_examples=200, deadline=None)
def test_a_reference_to_anything_else_is_refused(process: int, descriptor: int, capacity: int) -> None:
    with pytest.raises((RemoteProtocolError, OSError)):
        RingReader(reference(process=process, descriptor=descriptor, capacity=capacity))


def test_memory_of_another_machine_is_not_looked_for(closing: ExitStack) -> None:
    writer, _ = ring(closing)
    with pytest.raises(RemoteProtocolError, match=OTHER_MACHINE):
        RingReader(bytes(16) + writer.reference[16:])


def test_only_a_sealed_file_of_that_size_and_token_is_mapped(closing: ExitStack, tmp_path: Path) -> None:
    writer, _ = ring(closing)
    size = 64 + CAPACITY
    (tmp_path / "file").write_bytes(bytes(size))
    opened = os.open(tmp_path / "file", os.O_RDWR)
    loose = os.memfd_create("loose", os.MFD_ALLOW_SEALING)
    os.ftruncate(loose, size)
    growing = os.memfd_create("growing", os.MFD_ALLOW_SEALING)
    os.ftruncate(growing, size)
    fcntl.fcntl(growing, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK)
    pipe = os.pipe()
    for fd in (opened, loose, growing, *pipe):
        closing.callback(os.close, fd)
        with pytest.raises(RemoteProtocolError, match="not an anonymous file"):
            RingReader(reference(descriptor=fd))
    _, process, fd, capacity, token = REFERENCE.unpack(writer.reference)
    with pytest.raises(RemoteProtocolError, match="another memory"):
        RingReader(reference(process=process, descriptor=fd, capacity=capacity, token=token ^ 1))
    with pytest.raises(RemoteProtocolError, match="not an anonymous file"):
        RingReader(reference(process=process, descriptor=fd, capacity=capacity + 1, token=token))
    assert struct.calcsize(REFERENCE.format) == REFERENCE.size == 48
