"""`wall.run`: walls beside a script or a notebook, which end with it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from running import environment, status, write_config

import wall
from wall.core.errors import ConfigError, RunError

NOTEBOOK = Path(__file__).parents[2] / "docs/examples/live.ipynb"
END_S = 20.0
KILLED = """\
import os, signal, sys
import wall
def say(line):
    print(running_processes(), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
def running_processes():
    return int(open(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read().split()[0])
wall.run(sys.argv[1], say=say)
"""


def in_session(number: int) -> list[int]:
    """Processes of a session that are no zombies."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                state, _, _, session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
            except (FileNotFoundError, ProcessLookupError):
                continue
            if int(session) == number and state != "Z":
                found.append(int(entry.name))
    return found


def test_the_notebook_runs_a_wall_and_leaves_nothing(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    names: dict[str, Any] = {}
    for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            text = "".join(cell["source"]).replace("../../configs/demo.yaml", str(config))
            if "running.stop()" in text:
                running = names["running"]
                session, address, out = os.getsid(running._process.pid), running.address, running.out
                assert len(in_session(session)) >= 2, "no processes of its own"
                with urllib.request.urlopen(address) as page:
                    assert "frame-ancestors http://localhost:*" in page.headers["Content-Security-Policy"]
                assert address in running._repr_html_()
            exec(text, names)
    assert names["image"].shape == (48, 64, 3)
    assert names["value"] == (1.5,)
    assert names["summary"]["samples_traced"] > 0
    assert in_session(session) == []
    assert not running.alive
    assert not out.exists(), "the folder that nobody asked for is left"
    assert running.stop() is names["summary"]
    with pytest.raises(RunError, match="the run has ended"):
        running.image()


def test_a_wall_that_is_stopped_while_it_changes_ends_in_order(tmp_path: Path) -> None:
    """It loads another file though its own page may be framed, and says so while it is told to end."""
    config, other = write_config(tmp_path), tmp_path / "other.yaml"
    other.write_text(config.read_text().replace("refresh_hz: 30", "refresh_hz: 20"))
    running = wall.run(config, out=tmp_path / "out")
    began = time.monotonic()
    with running.client() as client:
        client.load(other)
        client.edit("views.0.sampling.method=framed")
        client.edit("views.0.refresh_hz=25")
    assert status(running.address)["seconds"] > time.monotonic() - began - 1.0, "its time begins anew"
    assert running.stop()["ended"] == "terminated"
    assert not (tmp_path / "out" / "control.json").exists()


def test_a_wall_ends_with_a_process_that_is_killed(tmp_path: Path) -> None:
    child, temporary = [sys.executable, "-c", KILLED, str(write_config(tmp_path))], tmp_path / "temporary"
    temporary.mkdir()
    variables = environment() | {"TMPDIR": str(temporary)}
    done = subprocess.run(child, capture_output=True, text=True, env=variables, timeout=60, check=False)
    assert done.returncode == -9, done.stderr
    session, limit = int(done.stdout), time.monotonic() + END_S
    while in_session(session):
        assert time.monotonic() < limit, "processes are left"
        time.sleep(0.05)
    assert list(temporary.glob("wall-*")) == []


def test_what_is_refused_is_refused_before_anything_starts(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    config.write_text(config.read_text().replace("refresh_hz: 30", "refresh_hz: fast"))
    with pytest.raises(ConfigError, match=r"views\[0\]\.refresh_hz = 'fast': is not a number"):
        wall.run(config)
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file/out: Not a directory; wanted a folder that can be written"):
        wall.run(write_config(tmp_path), out=tmp_path / "file" / "out")
