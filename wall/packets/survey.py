"""The body of a control message that carries a Survey: fixed struct, then the codes, nothing compressed.

parse_survey() gives a Survey or raises RemoteProtocolError; survey_body() raises LocalProtocolError.
"""

from __future__ import annotations

import struct

import numpy as np

from wall.core.data import Survey
from wall.core.errors import LocalProtocolError, RemoteProtocolError

MAX_SIDE = 4096  # tiles
MAX_RECTS = 65536
_HEAD = struct.Struct("<HBHHI")


def survey_body(survey: Survey) -> bytes:
    """Planes age, density, rects, worth behind the struct. Raises LocalProtocolError for shapes that do not match."""
    rows, columns = survey.age.shape
    n = len(survey.rects)
    if survey.density.shape != (rows, columns) or survey.rects.shape != (n, 4) or survey.worth.shape != (n,):
        raise LocalProtocolError(
            f"survey of panel {survey.panel}: age {survey.age.shape}, density {survey.density.shape}, rects "
            f"{survey.rects.shape}, worth {survey.worth.shape}; wanted twice the same, (n, 4), (n,)"
        )
    head = _HEAD.pack(survey.panel, survey.compared, rows, columns, n)
    rects = np.ascontiguousarray(survey.rects, "<u2")
    return b"".join((head, survey.age.tobytes(), survey.density.tobytes(), rects.tobytes(), survey.worth.tobytes()))


def parse_survey(body: bytes) -> Survey:
    """Arrays are read-only views of `body`. Raises RemoteProtocolError for anything that is not a whole body."""
    if len(body) < _HEAD.size:
        raise RemoteProtocolError(f"a survey of {len(body)} bytes; its head alone has {_HEAD.size}")
    panel, compared, rows, columns, n = _HEAD.unpack_from(body)
    if not (0 < rows <= MAX_SIDE and 0 < columns <= MAX_SIDE and n <= MAX_RECTS and compared <= 1):
        raise RemoteProtocolError(f"survey of panel {panel}: {rows}x{columns} tiles, {n} rectangles are out of range")
    tiles = rows * columns
    wanted = _HEAD.size + 2 * tiles + 9 * n
    if len(body) != wanted:
        raise RemoteProtocolError(f"survey of panel {panel}: {len(body)} bytes came of {wanted}")
    codes = np.frombuffer(body, np.uint8)
    first = _HEAD.size + 2 * tiles
    return Survey(
        panel=panel,
        compared=bool(compared),
        age=codes[_HEAD.size : _HEAD.size + tiles].reshape(rows, columns),
        density=codes[_HEAD.size + tiles : first].reshape(rows, columns),
        rects=np.frombuffer(body, "<u2", 4 * n, first).reshape(n, 4),
        worth=codes[first + 8 * n :],
    )
