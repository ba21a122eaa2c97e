"""A head that is killed is replaced: page, camera and edits stay, and the renderers go on."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from running import comes, mpirun, page_of, session_of, shown, start, summary, until, until_written, write_config

from wall.client import connect

pytestmark = pytest.mark.clock
PATIENCE_S = 20.0  # of a busy machine; 5 s are wanted
REST_S = 1.0  # a busy machine has no new sample to show for shorter times


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path / "out"
    for pid in session_of(json.loads((tmp_path / "leader").read_text())):
        os.kill(pid, signal.SIGKILL)


def control_of(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "control.json").read_text(encoding="utf-8"))
    return found


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def answers(address: str) -> bool:
    with contextlib.suppress(urllib.error.URLError, ConnectionError):
        shown(address)
        return True
    return False


def at_rest(address: str) -> NDArray[np.int16]:
    """The picture once it has stood still for REST_S."""
    picture, since = shown(address), time.monotonic()

    def rests() -> bool:
        nonlocal picture, since
        now = shown(address)
        if not np.array_equal(now, picture):
            picture, since = now, time.monotonic()
        return time.monotonic() - since >= REST_S

    comes(rests, f"a picture that stands still for {REST_S} s")
    return picture


def until_shown(address: str, picture: NDArray[np.int16]) -> None:
    comes(lambda: np.array_equal(shown(address), picture), "that picture again")


@pytest.mark.parametrize(
    "launcher", [pytest.param((), id="local"), pytest.param(mpirun(2), id="mpirun", marks=pytest.mark.mpi)]
)
def test_a_wall_goes_on_when_its_head_is_killed(
    tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch, launcher: tuple[str, ...]
) -> None:
    config = write_config(tmp_path, encrypt="always", restarts=1)
    text = config.read_text().replace("transport:\n  {", "transport:\n  {standby: true, ")
    page = "output: {browser: {token: always}}\n"
    config.write_text(text.replace("[png]", "[browser, png]") + page)
    run = start("run", config, "--still", "--out", out, launcher=launcher)
    (tmp_path / "leader").write_text(str(run.pid))
    address = page_of(run)
    until_written(out / "control.json", "page", PATIENCE_S)
    before = control_of(out)
    opener = urllib.request.build_opener()
    opener.addheaders = [("Authorization", f"Bearer {before['page'].partition('=')[2]}")]
    monkeypatch.setattr(urllib.request, "_opener", opener)
    until(address, np.zeros(1), changes=False)
    first = at_rest(address)
    with connect(out) as wall:
        wall.set({"sky.zenith": [0.9, 0.1, 0.1]})
        wall.zoom(0.1)
        until(address, first)
        near = at_rest(address)
        stand, renderer, _ = session_of(run.pid)[bool(launcher) :]
        assert parent_of(before["pid"]) == stand

        os.kill(before["pid"], signal.SIGKILL)
        comes(lambda: answers(address), "the page again")
        until_shown(address, near)  # the camera, and what was set
        after = control_of(out)
        assert after == before | {"pid": after["pid"]}
        assert after["pid"] != before["pid"]
        wall.reset()  # by the same key
        until(address, near)

        if not launcher:  # mpirun starts no rank again
            os.kill(renderer, signal.SIGKILL)
            until_written(out / "log" / "rank-1.jsonl", "started again", PATIENCE_S)
        wall.set({"sky.zenith": None})
        until_shown(address, first)

    run.send_signal(signal.SIGTERM)
    said, _ = run.communicate(timeout=PATIENCE_S)
    if not launcher:
        assert run.returncode == 0, said
    until_written(out / "summary.json", "terminated", PATIENCE_S)  # under mpirun by a process that outlives it
    found = summary(out)
    assert found["restarts"].pop("0") == ["died (signal 9)"]
    assert list(found["restarts"]) == ([] if launcher else ["1"])
    assert found["lost"] == {}
    comes(lambda: not session_of(run.pid), "the end of all processes")
