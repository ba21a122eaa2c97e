"""The body of a control message that carries a StatisticsImage: fixed struct, then the codes, nothing compressed.

parse_statistics_image() gives a StatisticsImage or raises RemoteProtocolError; statistics_image_body() raises
LocalProtocolError.
"""

from __future__ import annotations

import struct

import numpy as np

from wall.core.data import StatisticsImage
from wall.core.errors import LocalProtocolError, RemoteProtocolError

MAX_SIDE = 4096  # tiles
MAX_RECTS = 65536
_HEAD = struct.Struct("<HHBHHI")


def statistics_image_body(image: StatisticsImage) -> bytes:
    """Struct, then age, density, rects, error_reduction. Raises LocalProtocolError for shapes that do not match."""
    rows, columns = image.age.shape
    n = len(image.rects)
    if image.density.shape != (rows, columns) or image.rects.shape != (n, 4) or image.error_reduction.shape != (n,):
        raise LocalProtocolError(
            f"statistics_image of panel {image.panel}: age {image.age.shape}, density {image.density.shape}, rects "
            f"{image.rects.shape}, error_reduction {image.error_reduction.shape}; wanted twice the same, (n, 4), (n,)"
        )
    head = _HEAD.pack(image.rank, image.panel, image.compared, rows, columns, n)
    arrays = (image.age, image.density, image.rects.astype("<u2"), image.error_reduction)
    return head + b"".join(array.tobytes() for array in arrays)


def parse_statistics_image(body: bytes) -> StatisticsImage:
    """Arrays are read-only views of `body`. Raises RemoteProtocolError for anything that is not a whole body."""
    if len(body) < _HEAD.size:
        raise RemoteProtocolError(f"a statistics_image of {len(body)} bytes; its head alone has {_HEAD.size}")
    rank, panel, compared, rows, columns, n = _HEAD.unpack_from(body)
    fits = rows == columns == 0 if rank else 0 < rows <= MAX_SIDE and 0 < columns <= MAX_SIDE
    if not fits or not 0 < n <= MAX_RECTS or compared > 1:
        raise RemoteProtocolError(
            f"statistics_image of panel {panel}: {rows}x{columns} tiles, {n} rectangles are out of range"
        )
    tiles = rows * columns
    wanted = _HEAD.size + 2 * tiles + 9 * n
    if len(body) != wanted:
        raise RemoteProtocolError(f"statistics_image of panel {panel}: {len(body)} bytes came of {wanted}")
    codes = np.frombuffer(body, np.uint8)
    first = _HEAD.size + 2 * tiles
    return StatisticsImage(
        rank=rank,
        panel=panel,
        compared=bool(compared),
        age=codes[_HEAD.size : _HEAD.size + tiles].reshape(rows, columns),
        density=codes[_HEAD.size + tiles : first].reshape(rows, columns),
        rects=np.frombuffer(body, "<u2", 4 * n, first).reshape(n, 4),
        error_reduction=codes[first + 8 * n :],
    )
