"""Write an image of any size to a file, one strip in memory at a time: PNG, EXR or TIFF.

PNG and TIFF hold 8-bit sRGB, EXR linear float32. PNG: W3C PNG, 3rd edition; one zlib stream in chunks of a strip each.
TIFF: 6.0 with deflate and horizontal differences, BigTIFF (64-bit offsets) where 4 GiB may not do.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import tifffile
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.core.errors import ConfigError, LocalProtocolError
from wall.display.files import check_target, replaced

Strips: TypeAlias = Iterable[NDArray[Any]]

STRIP_ROWS = 64  # of every strip but the last
LEVEL = 3  # of zlib: a tenth larger than level 6 on a rendered image, at twice its speed
MOST_PIXELS = 2**31 - 1  # on an edge, in all three formats
_TIFF_ROWS = 16  # of a strip in the file: readers that want few rows need not unpack many
_TIFF_BYTES = 2**32 - 2**24  # beyond, offsets of 32 bits may not reach
_UP = 2  # PNG filter type: differences to the row above


def is_linear(path: Path) -> bool:
    """Whether the strips of this file are linear float32, not 8-bit sRGB."""
    return path.suffix.lower() == ".exr"


def check_file(path: Path, width: int, height: int) -> None:
    """Refuse an image that cannot be written, before anything is rendered for it. Raises ConfigError."""
    check_target(path, tuple(_WRITERS))
    if not (1 <= width <= MOST_PIXELS and 1 <= height <= MOST_PIXELS):
        raise ConfigError(f"an image of {width}x{height} pixels: wanted 1 to {MOST_PIXELS} on an edge")


def write_strips(path: Path, strips: Strips, *, width: int, height: int) -> None:
    """Write an image from its strips, top to bottom. The file appears whole or not at all.

    strips : (STRIP_ROWS, width, 3), the last one with what is left; uint8 sRGB, or float32 linear if `is_linear`

    Raises RunError naming the file and the reason when it cannot be written, LocalProtocolError for strips that are
    not as many rows, or not as wide, as was promised.
    """
    check_file(path, width, height)
    with replaced(path) as part:
        checked = _checked(strips, width, height, np.dtype(np.float32 if is_linear(path) else np.uint8))
        _WRITERS[path.suffix.lower()](part, checked, width, height)


def _checked(strips: Strips, width: int, height: int, kind: np.dtype[Any]) -> Iterator[NDArray[Any]]:
    """The same strips, contiguous. Raises LocalProtocolError where they are not the image that was promised."""
    done = 0
    for strip in strips:
        wanted = (min(STRIP_ROWS, height - done), width, 3)
        if strip.shape != wanted or strip.dtype != kind:
            raise LocalProtocolError(f"row {done}: a strip {strip.shape} of {strip.dtype}, wanted {wanted} of {kind}")
        yield np.ascontiguousarray(strip)
        done += len(strip)
    if done != height:
        raise LocalProtocolError(f"strips ended at row {done} of {height}")


def _write_png(path: Path, strips: Iterator[NDArray[np.uint8]], width: int, height: int) -> None:
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        file.write(_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(_chunk(b"sRGB", b"\0"))
        packer = zlib.compressobj(LEVEL)
        above = np.zeros((1, width, 3), np.uint8)
        lines = np.empty((STRIP_ROWS, 1 + 3 * width), np.uint8)
        lines[:, 0] = _UP
        for strip in strips:
            rows = len(strip)
            values = lines[:rows, 1:].reshape(rows, width, 3)
            np.subtract(strip[:1], above, out=values[:1])
            np.subtract(strip[1:], strip[:-1], out=values[1:])
            above = strip[-1:].copy()
            file.write(_chunk(b"IDAT", packer.compress(lines[:rows].data)))
        file.write(_chunk(b"IDAT", packer.flush()))
        file.write(_chunk(b"IEND", b""))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))


def _write_exr(path: Path, strips: Iterator[Float32], width: int, height: int) -> None:
    import OpenEXR  # here, so that walls do not load it

    file = OpenEXR.OutputFile(str(path), OpenEXR.Header(width, height))  # R, G, B of float32, ZIP, rows downwards
    try:
        for strip in strips:
            file.writePixels({name: strip[..., k].tobytes() for k, name in enumerate("RGB")}, len(strip))
    finally:
        file.close()


def _write_tiff(path: Path, strips: Iterator[NDArray[np.uint8]], width: int, height: int) -> None:
    def packed() -> Iterator[bytes]:
        for strip in strips:
            for start in range(0, len(strip), _TIFF_ROWS):
                values = strip[start : start + _TIFF_ROWS].copy()
                values[:, 1:] -= strip[start : start + _TIFF_ROWS, :-1]
                yield zlib.compress(values.data, LEVEL)

    tifffile.imwrite(
        path,
        packed(),
        shape=(height, width, 3),
        dtype=np.uint8,
        photometric="rgb",
        compression="zlib",
        predictor=True,
        rowsperstrip=_TIFF_ROWS,
        bigtiff=3 * width * height > _TIFF_BYTES,
        software="wall",
        metadata=None,
    )


_WRITERS: dict[str, Callable[[Path, Iterator[NDArray[Any]], int, int], None]] = {
    ".png": _write_png,
    ".exr": _write_exr,
    ".tiff": _write_tiff,
    ".tif": _write_tiff,
}
