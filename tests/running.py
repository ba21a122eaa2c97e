"""Start the real `wall` command as a user would, and clean up after it."""

from __future__ import annotations

import fcntl
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from wall import cli

WALL = (sys.executable, "-m", "wall")
PICTURE_S = 20.0  # for something to come, or for a picture to change and stand still
STANDS = 3  # looks in a row, a tenth of a second apart, that show the same
TRACED = 0.9  # of the pixels of a picture that is there: bezels are black, and what no sample has reached yet
RUN_LIMIT_S = 90.0  # a run of a second, on a machine with more ranks than cores and a cold kernel cache

WALL_YAML = """\
version: 1
scene: {{source: {source}}}
wall: {{grid: {{columns: {columns}, rows: {rows}, pixels: [64, 48], size: [0.4, 0.3], bezel: 0.01}}}}
views: [{{id: main, camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}, refresh_hz: 30{path}}}]
sampling: {{method: {method}, threads: {threads}, samples_per_batch: {batch}}}
graph: {{preset: sort-first, ranks_per_panel: {ranks}, compositors: {compositors}, sinks: [png]}}
transport:
  {{kind: {transport}, encrypt: {encrypt}, codec: {codec}, heartbeat_s: 0.2, lost_after_s: {lost_after_s},
   restarts: {restarts}}}
"""


def write_config(folder: Path, **changes: Any) -> Path:
    """A small wall's configuration; keyword arguments replace the defaults."""
    values: dict[str, Any] = {
        "source": "courtyard",
        "columns": 1,
        "rows": 1,
        "path": "",
        "method": "frameless",
        "threads": 1,
        "batch": 256,
        "ranks": 1,
        "compositors": 1,
        "transport": "zmq",
        "encrypt": "auto",
        "codec": "none",
        "restarts": 0,  # a rank that dies stays dead
        "lost_after_s": 10.0,  # a rank that a loaded machine is slow to start, or to run, is not lost
    }
    path = folder / f"wall-{len(list(folder.glob('wall-*.yaml')))}.yaml"
    path.write_text(WALL_YAML.format(**(values | changes)), encoding="utf-8")
    return path


def wall(*arguments: object, launcher: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Run `wall` with these arguments to its end."""
    command = [*launcher, *WALL, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=RUN_LIMIT_S, env=environment(), check=False)


def called(*arguments: object) -> subprocess.CompletedProcess[str]:
    """What `wall` with these arguments says and returns, called in this process: without the second of a start."""
    command, said, errors = ["wall", *map(str, arguments)], io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(errors):
        patch.setattr(sys, "argv", command)
        try:
            cli.main()
        except SystemExit as ended:
            code = ended.code
        else:
            code = 0
    assert isinstance(code, int)
    return subprocess.CompletedProcess(command, code, said.getvalue(), errors.getvalue())


def made_once(folders: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """A folder of this name that `make` has filled: once, whichever of pytest's processes comes first.

    Each of them would make a fixture of its module's tests anew; others wait meanwhile. What is there is only read.
    """
    own = folders.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    folder, done = shared / name, shared / f"{name}.done"
    with open(shared / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            done.touch()
    return folder


def start(*arguments: object, launcher: tuple[str, ...] = (), stdin: IO[str] | None = None) -> subprocess.Popen[str]:
    """Start `wall` in a session of its own, so that all its processes can be found and ended."""
    return subprocess.Popen(
        [*launcher, *WALL, *map(str, arguments)],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(),
        start_new_session=True,
        preexec_fn=as_in_a_terminal,
    )


def session_of(leader: int) -> list[int]:
    """Living processes of the session that `leader` began, the oldest first; their numbers may begin anew."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except (OSError, NotADirectoryError):
            continue
        if entry.name.isdecimal() and int(fields[3]) == leader and fields[0] != "Z":
            found.append((int(fields[19]), int(entry.name)))  # when it was started, in ticks of the kernel
    return [number for _, number in sorted(found)]


def as_in_a_terminal() -> None:
    """Ctrl-C and a hang-up end a process, also where the tests run in the background, which ignores both."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def page_of(process: subprocess.Popen[str]) -> str:
    """The address of a run's page, once the run says it."""
    said = ""
    for line in process.stdout or ():
        said += line
        if found := re.search(r"http://\S+/", line):
            return found[0]
    raise AssertionError(f"the run ended before its page was there: {said}")


def mpirun(ranks: int, *options: str) -> tuple[str, ...]:
    """The launcher of the environment that the tests run in, or of the system."""
    own = Path(sys.executable).with_name("mpirun")
    found = str(own) if own.exists() else shutil.which("mpirun")
    assert found, "mpirun is missing: install the extra `local`"
    return (found, *options, "-n", str(ranks))


def environment() -> dict[str, str]:
    """Lets mpirun start more ranks than cores, and as root, as it must in containers."""
    return os.environ | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "PYTHONUNBUFFERED": "1",
    }


def panels(folder: Path) -> list[NDArray[np.uint8]]:
    """What a run wrote for each panel, in the order of their names."""
    return [np.asarray(Image.open(path)) for path in sorted(folder.glob("panel-*.png"))]


def summary(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return found


def status(address: str) -> dict[str, Any]:
    """What a page says of its run."""
    with urllib.request.urlopen(address + "status.json", timeout=5) as answer:
        found: dict[str, Any] = json.load(answer)
    return found


def shown(address: str) -> NDArray[np.int16]:
    """The wall's picture; waits for the first one, until which the page has none (503)."""
    limit = time.monotonic() + PICTURE_S
    while True:
        try:
            with urllib.request.urlopen(address + "wall.png", timeout=5) as answer:
                return np.asarray(Image.open(io.BytesIO(answer.read())).convert("RGB")).astype(np.int16)
        except urllib.error.HTTPError as error:
            if error.code != 503 or time.monotonic() > limit:
                raise
        time.sleep(0.1)


def comes(condition: Callable[[], bool], what: str, limit_s: float = PICTURE_S) -> None:
    """Wait until a condition holds; `what`: it, in words."""
    limit = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < limit, f"never, for {limit_s} s: {what}"
        time.sleep(0.05)


def until_written(path: Path, words: str, limit_s: float) -> None:
    """Wait until a file that a run writes has these words."""
    comes(lambda: path.exists() and words in path.read_text(encoding="utf-8"), f"{words!r} in {path}", limit_s)


def until(address: str, before: NDArray[np.int16], *, changes: bool = True) -> NDArray[np.int16]:
    """The first picture that stands still, and, if it `changes`, differs from `before`; else it has no black parts."""
    limit, last, same = time.monotonic() + PICTURE_S, before, 0
    while time.monotonic() < limit:
        time.sleep(0.1)
        now = shown(address)
        same = same + 1 if np.array_equal(now, last) else 0
        changed = (np.abs(now - before) > 8).any(-1).mean() > 0.02
        if same >= STANDS and (changed if changes else (now > 0).any(-1).mean() > TRACED):
            return now
        last = now
    pytest.fail("the picture did not change, or never stood still")


def until_like(address: str, wanted: NDArray[np.int16]) -> None:
    """Wait for a picture no byte of which is more than one off. Panels do not change at once on a busy machine."""
    comes(lambda: bool(np.abs(shown(address) - wanted).max() <= 1), "that picture again")
