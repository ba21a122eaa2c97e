"""Running walls that adopt another configuration: what they then show is what a new run of it shows."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import (
    PICTURE_S,
    called,
    made_once,
    mpirun,
    page_of,
    panels,
    session_of,
    shown,
    start,
    summary,
    until,
    wall,
    write_config,
)

from wall.client import connect
from wall.core.errors import ConfigError, EditError

SINKS = "sinks: [browser, png]"
INSET = np.s_[1:23, 5:40]  # of the picture of two panels, with a pixel around it


@pytest.fixture
def begun(tmp_path: Path) -> Iterator[list[subprocess.Popen[str]]]:
    """Walls that a test begins; each must end in order."""
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.terminate()
        try:
            process.wait(20)
        finally:
            process.kill()


def of_two_panels(folder: Path, **changes: object) -> Path:
    """A wall with a page."""
    config = write_config(folder, columns=2, **changes)
    text = config.read_text().replace("sinks: [png]", SINKS)
    config.write_text(text + "output: {browser: {load: true}}\n")
    return config


def another(config: Path, folder: Path) -> Path:
    """A configuration of the same displays: nearer, under another sky, with an adaptive inset of a second view."""
    text = config.read_text()
    text = text.replace("source: courtyard", "source: courtyard, sky: {zenith: [0.9, 0.5, 0.1]}")
    text = text.replace("position: [6, 4.5, 10]", "position: [3, 2.5, 5]")
    inset = (
        "  {id: map, viewport: {left: 0.05, top: 0.05, width: 0.25, height: 0.4}, refresh_hz: 5,\n"
        "  camera: {position: [0.01, 12, 0], target: [0, 0, 0]}, sampling: {method: adaptive, samples_per_pixel: 2}}]"
    )
    found = folder / "another.yaml"
    found.write_text(text.replace("}]\nsampling", "},\n" + inset + "\nsampling"))
    return found


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.int16]:
    """What a new run of `another` shows at rest: its panels side by side."""
    return np.concatenate(panels(made_once(tmp_path_factory, "fresh", run_another)), axis=1).astype(np.int16)


def run_another(folder: Path) -> None:
    config = another(of_two_panels(folder), folder)
    done = wall("run", config, "--headless", "--until-complete", "--seconds", 60, "--out", folder)
    assert done.returncode == 0, done.stderr


def of_panels(picture: NDArray[np.int16]) -> NDArray[np.int16]:
    """The picture of two panels without the bezel between."""
    return np.concatenate([picture[:, :64], picture[:, -64:]], axis=1)


def until_alike(address: str, wanted: NDArray[np.int16]) -> None:
    """Wait until panels are as wanted: a byte differs by 1 at most; the adaptive inset, whose samples are drawn anew in
    every run, by an RMSE of 3 (0.6 between runs; one sample of an edge more or less is 9 in its pixel)."""
    limit = time.monotonic() + PICTURE_S
    while True:
        apart = np.abs(of_panels(shown(address)) - wanted)
        inset = np.sqrt(np.square(apart[INSET].astype(float)).mean())
        apart[INSET] = 0
        if apart.max() <= 1 and inset <= 3:
            return
        assert time.monotonic() < limit, (apart.max(), inset)
        time.sleep(0.1)


def test_a_wall_goes_over_to_what_is_loaded_or_saved_and_refuses_what_its_processes_cannot_become(
    tmp_path: Path, begun: list[subprocess.Popen[str]], wanted: NDArray[np.int16]
) -> None:
    config = of_two_panels(tmp_path, compositors=2, restarts=2)
    second = another(config, tmp_path)
    process = start("run", config, "--still", "--watch", "--out", tmp_path / "OUT", "--seconds", 200)
    begun.append(process)
    address = page_of(process)
    first = until(address, shown(address), changes=False)
    with connect(tmp_path / "OUT") as run:
        run.set({"exposure": 0.5, "sky.zenith": (0.1, 0.1, 0.1)})
        run.set({"exposure": 0, "sky.zenith": None})
    done = wall("load", second, "--out", tmp_path / "OUT")
    assert done.returncode == 0, done.stderr
    assert re.search(r": adopted after [\d.]+ s, by edit 3$", " ".join(done.stdout.split()))
    until_alike(address, wanted)

    _, *ranks, _ = session_of(process.pid)  # but the head and the nursery
    before = shown(address)
    for rank in ranks:
        os.kill(rank, signal.SIGKILL)
    with connect(tmp_path / "OUT") as run:
        run.set({"exposure": -9.0})
        until(address, before)
        run.set({"exposure": 0})
    until_alike(address, wanted)

    broken = tmp_path / "broken.yaml"
    for was, becomes, says in (
        ("columns: 2", "columns: 3", "broken.yaml: wants 2 compositors and 3 renderers; this run has 2 and 2"),
        ("source: courtyard", "source: nosuch.glb", "nosuch.glb: there is no such file"),
    ):
        broken.write_text(second.read_text().replace(was, becomes))
        refused = called("load", broken, "--out", tmp_path / "OUT")
        assert refused.returncode == 2, refused.stdout
        assert says in " ".join(refused.stderr.split())
    for way in (tmp_path / "OUT", address):
        with connect(way) as run:
            with pytest.raises(ConfigError, match=r"nosuch.yaml: no such file"):
                run.load(tmp_path / "nosuch.yaml")
            with pytest.raises(EditError, match="version: is missing"):
                run.load("scene: {source: courtyard}\n")
    until_alike(address, wanted)

    changes = ("views-=map", "scene.sky=null", "views.0.camera.position=[6, 4.5, 10]")
    done = called("edit", *changes, "--out", tmp_path / "OUT")
    assert done.returncode == 0, done.stderr
    until_alike(address, of_panels(first))
    with connect(address) as run:
        with pytest.raises(EditError, match="map is not in it; there are: "):
            run.edit("views-=map")
        run.undo()
        until_alike(address, wanted)
        run.load(config)
    until_alike(address, of_panels(first))
    config.write_text(second.read_text())
    until_alike(address, wanted)
    process.terminate()
    said, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    notes = "".join(said.split("\n")).replace("  ", " ")
    assert f"note: {config}: adopted, scene: courtyard" in notes
    assert f"note: {second}: adopted again, scene: courtyard" in notes
    assert summary(tmp_path / "OUT")["configurations"] == 6
    assert summary(tmp_path / "OUT")["restarts"].keys() == {"1", "2", "3"}
    assert summary(tmp_path / "OUT")["dropped"].get("bad_packet", 0) == 0


def test_ranks_of_mpirun_and_a_remote_compositor_go_over_together(
    tmp_path: Path, begun: list[subprocess.Popen[str]], wanted: NDArray[np.int16]
) -> None:
    config = of_two_panels(tmp_path, compositors=2, encrypt="always")
    second = another(config, tmp_path)
    process = start("run", config, "--still", "--out", tmp_path / "OUT", "--seconds", 200, launcher=mpirun(4))
    begun.append(process)
    address = page_of(process)
    shown(address)
    with connect(tmp_path / "OUT") as run:
        run.load(second)
    until_alike(address, wanted)


def test_a_recorded_run_keeps_its_configuration(tmp_path: Path, begun: list[subprocess.Popen[str]]) -> None:
    config, events = of_two_panels(tmp_path), tmp_path / "run.events"
    process = start("run", config, "--out", tmp_path / "OUT", "--seconds", 60, "--record", events)
    begun.append(process)
    page_of(process)  # the wall runs
    with connect(tmp_path / "OUT") as run, pytest.raises(EditError, match="its events are recorded"):
        run.load(config)
