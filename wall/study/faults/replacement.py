"""What a page shows of a wall whose head is killed while another one stands by."""

from __future__ import annotations

import contextlib
import http.client
import io
import os
import signal
import time
import urllib.request
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.core.errors import RunError
from wall.run.control_file import read

ANSWER_S = 1.0  # for a page's answer
LOOK_S = 0.02
LIMIT_S = 20.0  # for the page of the next head
Picture = NDArray[np.uint8]  # (h, w, 3)


def replace_head(results: Path, address: str, *, moved_s: float, whole: float) -> tuple[float | None, float | None]:
    """Kill the head of the wall that writes to `results`; the page at `address` is watched.

    Milliseconds until the next head's page answers, and until so large a share `whole` of the pixels that moved in the
    `moved_s` seconds before have changed. None: not within LIMIT_S. Raises RunError where no wall runs there.
    """
    earlier = _picture(address)
    time.sleep(moved_s)
    before, pid = _picture(address), read(results).pid
    if earlier is None or before is None:
        raise RunError(f"{address}: shows no image; wanted: a wall that runs")
    moved = _changed(earlier, before)
    if not moved.any():
        raise RunError(f"{address}: nothing has moved for {moved_s:g} s; wanted: a camera on its way")
    os.kill(pid, signal.SIGKILL)
    killed, answered = time.monotonic(), None
    while time.monotonic() < killed + LIMIT_S:
        now = _picture(address)
        if now is not None and answered is None and _pid(results) not in (None, pid):
            answered = 1e3 * (time.monotonic() - killed)
        if now is not None and answered is not None and _changed(before, now)[moved].mean() >= whole:
            return round(answered, 1), round(1e3 * (time.monotonic() - killed), 1)
        time.sleep(LOOK_S)
    return None if answered is None else round(answered, 1), None


def _changed(before: Picture, now: Picture) -> NDArray[np.bool_]:
    return np.asarray((before != now).any(axis=-1))


def _pid(results: Path) -> int | None:
    with contextlib.suppress(RunError):
        return read(results).pid
    return None


def _picture(address: str) -> Picture | None:
    """What the page shows; None: nobody answers."""
    page, _, token = address.partition("?")
    url = f"{page.rstrip('/')}/wall.png" + (f"?{token}" if token else "")
    try:
        with urllib.request.urlopen(url, timeout=ANSWER_S) as response:
            return np.array(Image.open(io.BytesIO(response.read())).convert("RGB"))
    except (OSError, http.client.HTTPException):
        return None
