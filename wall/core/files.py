"""Read files that others name: never a pipe, which may never end, nor a device, nor more than was reckoned with."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

SMALLEST_READ = 1 << 16  # bytes; some files of the kernel say that they have none


def open_file(path: Path) -> BinaryIO:
    """Open a file to read it. Raises OSError, also for what is no regular file."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # opening a pipe would wait for its writer
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return open(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder, wanted a file", str(path))
    raise OSError(errno.EINVAL, "it is a pipe or a device, wanted a file", str(path))


def read_file(path: Path, most_bytes: int) -> bytes:
    """The bytes of a file. Raises OSError, also for what is no regular file and for one of more than `most_bytes`."""
    parts, left = list[bytes](), most_bytes + 1
    with open_file(path) as file:
        step = max(os.fstat(file.fileno()).st_size + 1, SMALLEST_READ)  # a read of so many bytes first takes them all
        while left and (part := file.read(min(step, left))):
            parts.append(part)
            left -= len(part)
    data = b"".join(parts)
    if len(data) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than {most_bytes} bytes", str(path))
    return data
