"""A page that another compositor than the head serves: viewers see, ask and steer there, also once it has died."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from running import comes, page_of, shown, start, status, summary, until, until_like, write_config

from wall.client import connect
from wall.core.errors import EditError
from wall.run.control_file import read

GRAPH = """\
graph:
  compositors: 2
  nodes:
    - {id: left, op: samples, panel: r0c0}
    - {id: right, op: samples, panel: r0c1}
    - {id: p0, op: reconstruct, input: left, on: head}
    - {id: p1, op: reconstruct, input: right, on: compositor 1}
    - {id: seen, op: tile, inputs: [p0, p1], on: compositor 1}
    - {id: page, op: sink, kind: browser, input: seen, on: compositor 1}
    - {id: kept, op: tile, inputs: [p0, p1], on: head}
    - {id: files, op: sink, kind: png, input: kept}
"""


def begun(folder: Path, **changes: Any) -> subprocess.Popen[str]:
    """A still wall whose page the head does not serve."""
    config = write_config(folder, columns=2, **changes)
    lines = [GRAPH.rstrip() if line.startswith("graph:") else line for line in config.read_text().splitlines()]
    config.write_text("\n".join(lines) + "\n")
    return start("run", config, "--still", "--out", folder / "OUT", "--seconds", 100)


@pytest.fixture
def running(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Path, str, subprocess.Popen[str]]]:
    """A still wall's folder of results, its page's address, and its process."""
    process = begun(tmp_path, restarts=1, encrypt=request.param)
    yield tmp_path / "OUT", page_of(process), process
    process.terminate()
    try:
        assert process.wait(20) == 0
    finally:
        process.kill()
    ranks = summary(tmp_path / "OUT")["ranks"]
    assert [rank["role"] for rank in ranks] == ["head", "compositor", "renderer", "renderer"]


@pytest.mark.parametrize("running", ["always", "never"], indirect=True)
def test_viewers_see_ask_and_steer_at_another_compositor(
    running: tuple[Path, str, subprocess.Popen[str]],
) -> None:
    out, address, process = running
    first = until(address, shown(address), changes=False)
    comes(lambda: all(rank["alive"] for rank in status(address)["ranks"]), "all ranks in the page's table")
    assert read(out).page == address
    with connect(address) as run:
        assert run.set({"lights.2.irradiance": (0, 0, 9)}) == 1
        blue = until(address, first)
        assert (blue - first)[..., 2].mean() > 5
        with pytest.raises(EditError, match="irradiance = -1: want three numbers"):
            run.set({"lights.2.irradiance": -1})
        assert run.undo() == 2
        until_like(address, first)
        run.orbit(0.5)
        until(address, first)
        run.reset()

    there = status(address)["totals"][1]["process"]
    assert there != process.pid
    os.kill(there, signal.SIGKILL)
    comes(lambda: read(out).page != address, "the address of a page that was started again")
    again = read(out).page
    until_like(again, first)
    with connect(again) as run:
        assert run.set({"lights.2.irradiance": (0, 0, 9)}) == 3, "no answer to a request of the page before"
        until_like(again, blue)
    with connect(out) as run:
        run.edit("views.0.camera.fov=20")
        near = until(again, blue)
    with connect(again) as run:
        run.set({"exposure": 1})
        until(again, near)
    assert status(again)["seconds"] > 2.0, "the run's time goes on"


def test_inside_one_process_such_a_page_is_announced_too(tmp_path: Path) -> None:
    process = begun(tmp_path, transport="loopback")
    try:
        address = page_of(process)
        until(address, shown(address), changes=False)
    finally:
        process.terminate()
        assert process.wait(20) == 0
