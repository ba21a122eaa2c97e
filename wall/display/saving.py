"""Save results again and again while a run goes on, in a thread that takes next to nothing from it."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable

from wall.core.errors import RunError

SAVE_S = 5.0  # between two times: what a run loses at most that is killed
SHARE = 50  # saving takes at most one part in so many of a core's time: large walls are saved less often
NICER = 10  # than its process: what has least priority keeps the interpreter's lock for long where all cores are busy


class Saver:
    """Calls `save` every few seconds, from a thread of its own, until it is closed."""

    def __init__(self, save: Callable[[], None], *, every_s: float = SAVE_S) -> None:
        """`save` may raise RunError where nothing can be written: it is counted, told on stderr, and tried again."""
        self._save, self._every_s = save, every_s
        self.failed = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="saver", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, after what it is writing. May be called twice."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        own = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, own, os.getpriority(os.PRIO_PROCESS, own) + NICER)  # 19 at most
        wait_s, failed_before = self._every_s, False
        while not self._ending.wait(wait_s):
            began = time.monotonic()
            try:
                self._save()
                failed_before = False
            except RunError as error:
                self.failed += 1
                if not failed_before:
                    with contextlib.suppress(OSError, ValueError):  # stderr may be on the same full disk, or closed
                        print(f"warning: {error}; it is tried again while the run goes on", file=sys.stderr, flush=True)
                failed_before = True
            wait_s = max(self._every_s, SHARE * (time.monotonic() - began))
