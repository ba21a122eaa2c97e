"""A wall as a user starts it, its page watched, and the processes that it is made of."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from wall.core.errors import RunError
from wall.display.viewer import Seen, StatusViewer
from wall.roles.plan import HEAD
from wall.study.faults.hosts import Hosts
from wall.study.live.runs import IMAGES, OUTPUT, START_S, stop

AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}  # as hosts make everybody
END_S = 15.0  # for a run that is told to end
LEFT_S = 3.0  # after its end nothing may be left for longer
LOOK_S = 0.02
MOST_S = 120.0  # that a wall runs, if nobody ends it


class FaultyWall:
    """A running wall; `end` it, whatever happens."""

    def __init__(
        self, config: Path, folder: Path, out: Path, *, most_s: float = MOST_S, keeps_images: bool = True,
        hosts: Hosts | None = None, ranks: int = 0,
    ) -> None:  # fmt: skip
        """`folder`: for its images and what it prints; `out`: for results; `most_s`: see MOST_S.

        `hosts`: where `ranks` are started by mpirun; None: they are forked. Raises RunError where it does not run.
        """
        self.hosts = hosts
        self._output, self.images = folder / OUTPUT, folder / IMAGES
        command = [sys.executable, "-m", "wall", "run", str(config), "--seconds", f"{most_s:g}", "--out", str(out)]
        command += ["--images", str(self.images)] if keeps_images else []
        if hosts is not None:
            command = hosts.mpirun(ranks, "--with-ft", "ulfm", "-x", "PATH") + command
        no_desktop = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        with self._output.open("w", encoding="utf-8") as output:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, start_new_session=True, env=no_desktop | AS_ROOT,
            )  # fmt: skip
        try:
            self.address = self._wait_for_page()
            self._page = StatusViewer(self.address)
        except BaseException:
            stop(self.process)
            raise

    @property
    def said(self) -> str:
        """What it has printed so far."""
        return self._output.read_text(encoding="utf-8", errors="replace")

    @property
    def seen(self) -> list[Seen]:
        """What its page was told so far."""
        return list(self._page.seen)

    def take_seen(self) -> list[Seen]:
        """The same; of what was returned all but the newest is forgotten."""
        seen = self.seen
        del self._page.seen[: max(0, len(seen) - 1)]
        return seen

    def _wait_for_page(self) -> str:
        limit = time.monotonic() + START_S
        while time.monotonic() < limit and self.process.poll() is None:
            if found := re.search(r"https?://\S+", self.said):
                return found[0] if self.hosts is None else self.hosts.page(found[0])
            time.sleep(LOOK_S)
        raise RunError(f"the wall did not start: {self.said.strip()[-500:]}")

    def clock(self, time: float) -> float:
        """A moment of this process's monotonic clock by the head's."""
        return time if self.hosts is None else time + self.hosts.ahead_s

    def process_of(self, rank: int) -> int:
        """The process of a rank that was not started again: the head forks them in order."""
        if self.hosts is not None:
            return self.hosts.ranks()[rank]
        return processes_of(self.process.pid)[rank]

    def end(self, number: signal.Signals) -> tuple[int | None, int]:
        """Send the head a signal. Returns its exit code, None: it does not end; and the processes left LEFT_S later."""
        self._page.close()
        with contextlib.suppress(ProcessLookupError, KeyError):  # it has ended
            os.kill(self.process.pid if self.hosts is None else self.process_of(HEAD), number)
        code = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self.process.wait(END_S)
        limit = time.monotonic() + LEFT_S
        while (left := len(self._processes())) and time.monotonic() < limit:
            time.sleep(LOOK_S)
        return code, left

    def _processes(self) -> set[int]:
        """Those of it that are left; mpirun's own on other hosts are of other sessions."""
        found = set(processes_of(self.process.pid))
        if self.hosts is not None:
            found.update(*map(self.hosts.processes, self.hosts.names))
        return found

    def close(self) -> None:
        """End every process of it."""
        self._page.close()
        stop(self.process)


def processes_of(session: int) -> list[int]:
    """Living processes of a session, the oldest first."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if entry.name.isdecimal():
                fields = (entry / "stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
                if int(fields[3]) == session and fields[0] != "Z":
                    found.append((int(fields[19]), int(entry.name)))
    return [pid for _, pid in sorted(found)]


class Slowed:
    """While inside, a process runs for one tenth of the time."""

    PERIOD_S = 0.05

    def __init__(self, pid: int) -> None:
        self._pid, self._ending = pid, threading.Event()
        self._thread = threading.Thread(target=self._run, name="slow", daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            while not self._ending.is_set():
                os.kill(self._pid, signal.SIGSTOP)
                self._ending.wait(0.9 * self.PERIOD_S)
                os.kill(self._pid, signal.SIGCONT)
                self._ending.wait(0.1 * self.PERIOD_S)
