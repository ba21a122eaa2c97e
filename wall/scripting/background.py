"""`wall.run`: a wall that runs beside a script or a notebook, in processes of its own."""

from __future__ import annotations

import contextlib
import io
import json
import os
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.client import Client, connect
from wall.config.yaml_text import write
from wall.core.errors import ConfigError, RunError
from wall.roles.plan import check_files, make_layout
from wall.run.launch import check_folder
from wall.scripting.scene import Scene

STOP_S = 20.0  # for a run to end in order and to write what it has; then it is killed
IMAGE_S = 20.0  # for the first image
ASK_AGAIN_S = 0.05
FIRST_PIXELS = 4  # for each sample of a first image
REGION = re.compile(r"(\d+)x(\d+)\+")  # of pixels, as a renderer's is told
FRAME_HTML = '<iframe src="{}" style="width: 100%; height: 40em; border: 0"></iframe><br><a href="{}">{}</a>'
START = "import sys; sys.path.append(sys.argv[1]); from wall.scripting.hosted import main; main()"


def run(
    config: Scene | str | Path,
    *,
    still: bool = False,
    seconds: float | None = None,
    out: str | Path | None = None,
    record: str | Path | None = None,
    say: Callable[[str], None] | None = None,
) -> Running:
    """Start a wall in the background, and wait until it runs.

    config : a Scene, or what a Scene is made of: a configuration, a model file, the name of a built-in scene
    still : begin paused, at time 0
    seconds : stop after so many; None: when told to
    out : folder of results, as of `wall run --out`; None: one that is removed in the end
    record : folder for the run's events, see `wall replay`
    say : is told each line of progress, in a thread of its own; None: nobody

    >>> with wall.run("configs/demo.yaml") as running:
    ...     with running.client() as client:
    ...         client.set({"exposure": 1})
    ...     image = running.image()

    Its processes end with the `with` block, by `stop()`, when the object is no longer used, and when this process ends,
    in whatever way. Raises ConfigError where the configuration is refused, RunError where the run fails.
    """
    scene = config if isinstance(config, Scene) else Scene(config)
    layout = make_layout(scene.loaded)
    check_files(layout)
    if out is not None:
        check_folder(Path(out))
    return Running(scene, still=still, seconds=seconds, out=out, record=record, say=say)


@dataclass(slots=True, eq=False)
class _Told:
    """What the run's process has told."""

    summary: dict[str, Any] = field(default_factory=dict)
    problems: list[Exception] = field(default_factory=list)
    opened: queue.SimpleQueue[str | None] = field(default_factory=queue.SimpleQueue)  # the page; None: it has ended


def has_samples(status: Mapping[str, Any]) -> bool:
    """Whether every renderer has traced enough for a first image; `status`: as in status.json."""
    renderers = [rank for rank in status["ranks"] if rank["role"] == "renderer"]
    pixels = {rank["rank"]: sum(int(w) * int(h) for w, h in REGION.findall(rank["region"])) for rank in renderers}
    return all(FIRST_PIXELS * status["totals"][rank]["samples"] >= pixels[rank] for rank in pixels)


class Running:
    """A wall that runs in the background. Made by `run`."""

    def __init__(
        self, scene: Scene, *, still: bool, seconds: float | None, out: str | Path | None, record: str | Path | None,
        say: Callable[[str], None] | None,
    ) -> None:  # fmt: skip
        self._own_folder = tempfile.TemporaryDirectory(prefix="wall-") if out is None else None
        self.out = Path(self._own_folder.name if self._own_folder is not None else str(out)).absolute()
        self.address = ""  # of the page
        self._seen = False  # a first image with samples everywhere
        self._told, self._say = _Told(), say
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  (as long as the process)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", START, str(Path(__file__).resolve().parents[2])],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
            start_new_session=True,  # Ctrl-C in a notebook's cell is not for it
        )  # fmt: skip
        self._finalizer = weakref.finalize(self, _end, self._process, patience_s=STOP_S)
        order = {
            "text": write(scene.values), "name": scene.loaded.name, "path": str(scene.loaded.path.absolute()),
            "out": str(self.out), "temporary": out is None, "still": still, "seconds": seconds,
            "record": None if record is None else str(Path(record).absolute()),
        }  # fmt: skip
        try:
            self._start(json.dumps(order))
        except BaseException:
            self._kill()
            raise

    def _start(self, order: str) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended already; its messages say why
            self._process.stdin.write(order.encode() + b"\n")
            self._process.stdin.flush()
        assert self._process.stdout is not None
        listening = (self._process.stdout, self._told, self._say)  # and not this object, which ends when unused
        self._listener = threading.Thread(target=_listen, args=listening, name="wall listener", daemon=True)
        self._listener.start()
        address = self._told.opened.get()
        if address is None:
            self._finish()
            raise RunError("the run ended before it began")
        self.address = address

    def __enter__(self) -> Running:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except RunError:
            if error is None:
                raise

    def __repr__(self) -> str:
        return f"<wall.Running at {self.address or 'no page'}, {'running' if self.alive else 'ended'}>"

    def _repr_html_(self) -> str:
        """The live page, for notebooks of this machine."""
        if not self.alive or not self.address:
            return "<p>This wall has ended, or has no page.</p>"
        return FRAME_HTML.format(*[self.address] * 3)

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def client(self) -> Client:
        """A client that reads and sets parameters; see wall.client. Raises RunError where the run has ended."""
        return connect(self.out)

    def image(self, *, patience_s: float = IMAGE_S) -> NDArray[np.uint8]:
        """The wall's newest image with its bezels: (h, w, 3) uint8 sRGB. Waits for the first one.

        That is one to which every renderer has given a sample for each FIRST_PIXELS pixels; after half of `patience_s`
        it is the newest there is, as it may be that one of them has died.

        Raises RunError where the run has ended, or its graph has no `browser` sink.
        """
        if not self.address:
            raise RunError("this wall has no page to read images from; wanted: a browser among its sinks")
        limit = time.monotonic() + patience_s
        while True:
            try:
                self._seen = self._seen or time.monotonic() > limit - 0.5 * patience_s or self._has_samples(patience_s)
                if self._seen:
                    with urllib.request.urlopen(self.address + "wall.png", timeout=patience_s) as answer:
                        return np.array(Image.open(io.BytesIO(answer.read())).convert("RGB"))
            except urllib.error.HTTPError as error:
                if error.code != 503 or time.monotonic() > limit:
                    raise RunError(f"{self.address}: no image ({error})") from error
            except OSError as error:
                raise RunError(f"{self.address}: no image ({error}); the run has ended") from error
            time.sleep(ASK_AGAIN_S)

    def _has_samples(self, patience_s: float) -> bool:
        """Whether every renderer has traced enough for a first image."""
        with urllib.request.urlopen(self.address + "status.json", timeout=patience_s) as answer:
            return has_samples(json.load(answer))

    def stop(self) -> dict[str, Any]:
        """End the run in order, if it still runs. Returns its summary, as in summary.json; so does a second call.

        Raises RunError if it failed.
        """
        self._finalizer()
        self._finish()
        return self._told.summary

    def _finish(self) -> None:
        """Clean up behind processes that have ended, and raise what they died of."""
        self._process.wait()
        self._listener.join()
        told = self._told
        if not told.problems and not told.summary:
            said = self._last_words()
            told.problems.append(RunError(f"the run's process ended ({self._process.returncode}): {said}"))
        self._clean()
        if told.problems:
            raise told.problems[0]

    def _last_words(self) -> str:
        if self._errors.closed:
            return ""
        self._errors.seek(0)
        return self._errors.read().decode(errors="replace").strip()[-2000:]

    def _kill(self) -> None:
        _end(self._process, patience_s=0.0)
        self._clean()

    def _clean(self) -> None:
        self._finalizer.detach()
        self._errors.close()
        if self._own_folder is not None:
            self._own_folder.cleanup()


def _listen(lines: IO[bytes], told: _Told, say: Callable[[str], None] | None) -> None:
    with lines:
        for line in lines:
            ((key, value),) = json.loads(line).items()
            if key == "page":
                told.opened.put(value)
            elif key == "ended":
                told.summary = value
            elif key in ("refused", "failed"):
                told.problems.append(ConfigError(value) if key == "refused" else RunError(value))
            elif say is not None:
                say(value)
    told.opened.put(None)


def _end(process: subprocess.Popen[bytes], *, patience_s: float) -> None:
    """End a run and all its processes: in order if it has the time, else by force."""
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(patience_s)
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()
