"""The head's process of a wall in the background: it does what a line on standard input says, until that closes.

Standard input closes when the process that asked for the wall closes it, or ends in whatever way. What happens is told
on standard output, a JSON object a line, each of one key: `said`, `page` (the address), `refused`, `failed`, `ended`.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import sys
import threading
from pathlib import Path
from typing import Any, TextIO

from wall.config.framed_page import with_page
from wall.config.loading import loads
from wall.core.errors import ConfigError, WallError
from wall.run import launch

BAD_LUCK = (WallError, OSError)


def main() -> None:
    """Read the order, run the wall, tell how it ended."""
    order = json.loads(_first_line())
    tell_to = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what libraries print is no message
    try:
        _run(order, tell_to)
    except ConfigError as error:
        _tell(tell_to, "refused", str(error))
    except BAD_LUCK as error:
        _tell(tell_to, "failed", str(error))
    finally:
        _clean(order)


def _run(order: dict[str, Any], tell_to: TextIO) -> None:
    loaded = with_page(loads(order["text"], name=order["name"], path=Path(order["path"])))
    record = None if order["record"] is None else Path(order["record"])
    options = launch.Options(out=Path(order["out"]), seconds=order["seconds"], still=order["still"], record=record)

    runs = threading.Event()

    def say(line: str) -> None:
        _tell(tell_to, "said", line)
        if not runs.is_set() and select.select([0], [], [], 0.0)[0]:  # nothing more is written there: it is closed
            _clean(order)
            os._exit(1)

    def opened(address: str) -> None:
        runs.set()  # from now on it ends in order
        threading.Thread(target=_end_when_closed, name="standard input", daemon=True).start()
        _tell(tell_to, "page", address)

    outcome = launch.run(loaded, options, say, opened)
    if outcome is not None:
        _tell(tell_to, "ended", outcome.summary)
        if outcome.failed:
            _tell(tell_to, "failed", outcome.failed)


def _clean(order: dict[str, Any]) -> None:
    """Remove a folder of results that nobody asked for: who ordered the wall may be gone."""
    if order["temporary"]:
        shutil.rmtree(order["out"], ignore_errors=True)


def _first_line() -> str:
    """The first line of standard input, and not a byte more."""
    line = bytearray()
    while (byte := os.read(0, 1)) not in (b"", b"\n"):
        line += byte
    return line.decode()


def _end_when_closed() -> None:
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def _tell(to: TextIO, key: str, value: object) -> None:
    try:
        print(json.dumps({key: value}), file=to, flush=True)
    except BrokenPipeError:  # nobody listens any more
        sys.stderr.write(f"{key}: {value}\n")
