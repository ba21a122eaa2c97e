"""`wall set` at a wall of real processes: the picture changes, refusals change nothing, nobody waits for ever."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import called, page_of, shown, start, until, until_like, wall, write_config
from typer.testing import CliRunner

from wall import cli
from wall.client import connect
from wall.core.errors import EditError, RunError
from wall.packets.control import WindowInput, serialise
from wall.run.control_file import read
from wall.transport.curve import Keys
from wall.transport.zeromq import ZmqLink

NOTEBOOK = Path(__file__).parents[2] / "docs/examples/client.ipynb"
LIGHT = {"lights.2.direction", "lights.2.irradiance"}


@pytest.fixture
def running(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Path, str]]:
    """A still wall's folder of results, and its page's address."""
    config = write_config(tmp_path, columns=2, encrypt=getattr(request, "param", "auto"))
    config.write_text(config.read_text().replace("sinks: [png]", "sinks: [browser, png]"))
    process = start("run", config, "--still", "--out", tmp_path / "OUT", "--seconds", 100)
    yield tmp_path / "OUT", page_of(process)
    process.terminate()
    try:
        assert process.wait(20) == 0
    finally:
        process.kill()


def test_an_edit_changes_the_picture_and_a_refused_one_nothing(running: tuple[Path, str]) -> None:
    out, address = running
    first = until(address, shown(address), changes=False)
    done = wall("set", "lights.2.irradiance=0,0,9", "exposure=1", "--out", out)
    assert (done.returncode, done.stdout) == (0, "set by edit 1\n"), done.stderr
    blue = until(address, first)
    lit = (blue - first)[..., 2].mean()
    assert lit > 5

    refused = wall("set", "exposure=0", "lights.2.irradiance=-1", "--out", out)
    assert refused.returncode == 2
    assert "lights.2.irradiance = -1.0: want three numbers" in " ".join(refused.stderr.split())
    listed = called("set", "--list", "--out", out)
    rows = {line.split()[0]: line for line in listed.stdout.splitlines() if line.split()}
    assert rows["exposure"].split()[1] == "1"
    assert rows["lights.2.irradiance"].split()[1] == "0,0,9"
    assert not any(name.startswith("objects.") for name in rows)
    objects = called("set", "--list", "objects.*.visible", "--out", out)
    assert "objects.floor.visible" in objects.stdout
    some = called("set", "--list", "lights.2.*", "exposure", "--out", out)
    assert [line.split()[0] for line in some.stdout.splitlines()] == ["exposure", *sorted(rows.keys() & LIGHT)]
    none = called("set", "--list", "nothing", "--out", out)
    assert (none.returncode, "no parameter is named like nothing" in none.stderr) == (2, True)
    assert np.array_equal(shown(address), blue)

    done = called("set", "--undo", 1, "--out", out)
    assert (done.returncode, done.stdout) == (0, "set by edit 2\n"), done.stderr
    until_like(address, first)


def end_the_run(out: Path) -> None:
    """Try to, as those can who reach the manager's port and know no secret."""
    control = read(out)
    (other,) = Keys.of_all(1)
    for keys in (None, replace(other, ranks=(control.head,))):
        with closing(ZmqLink(control.endpoint, rank=0, keys=keys)) as link:
            for rank in range(3):
                link.send(serialise(WindowInput(rank=rank, escape="a stranger's")))


@pytest.mark.parametrize("running", ["always"], indirect=True)
def test_python_reads_parameters_sets_them_and_takes_them_back(
    running: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, address = running
    end_the_run(out)
    first = until(address, shown(address), changes=False)
    for edit, way in ((1, out), (3, address)):
        with connect(way) as run:
            before = run.parameters("lights.2.*", "exposure")
            assert before.keys() == LIGHT | {"exposure"}
            assert run.set({"lights.2.irradiance": (0, 0, 9), "exposure": 1}) == edit
            blue = until(address, first)
            assert (blue - first)[..., 2].mean() > 5
            assert run.parameters("lights.2.irradiance")["lights.2.irradiance"].value == (0.0, 0.0, 9.0)
            with pytest.raises(EditError, match="irradiance = -1: want three numbers"):
                run.set({"exposure": 0, "lights.2.irradiance": -1})
            with pytest.raises(EditError, match="exposure = nan: want a finite number"):
                run.set({"exposure": math.nan})
            with pytest.raises(EditError, match="seek = inf: want a finite number"):
                run.seek(math.inf)
            assert run.undo() == edit + 1
            assert run.parameters("lights.2.*", "exposure") == before
            until_like(address, first)
            run.orbit(0.5)
            until(address, first)
            run.reset()
            until_like(address, first)
        with pytest.raises(RunError, match="this client is closed"):
            run.undo()

    monkeypatch.chdir(out.parent)  # where the example's notebook looks for OUT
    names: dict[str, object] = {}
    for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    with connect(out) as run:
        assert run.parameters("exposure")["exposure"].value == (0.0,), "its last cell takes back what it set"


def test_a_wrong_key_and_a_wall_that_has_gone_are_told(running: tuple[Path, str]) -> None:
    out, _ = running
    path = out / "control.json"
    assert path.stat().st_mode & 0o077 == 0
    values = json.loads(path.read_text())
    forged, silent = out / "forged", out / "silent"
    for folder, change in ((forged, {"key": "0" * 32}), (silent, {"endpoint": "tcp://127.0.0.1:9", "pid": 4242})):
        folder.mkdir()
        (folder / "control.json").write_text(json.dumps(values | change))
    denied = wall("set", "exposure=1", "--out", forged)
    assert denied.returncode == 2
    assert "the key is not this run's" in denied.stderr
    gone = called("set", "exposure=1", "--out", silent)
    assert gone.returncode == 1
    assert "no answer from tcp://127.0.0.1:9 within 5 s" in " ".join(gone.stderr.split())


def test_without_a_wall_it_is_said_where_one_was_looked_for(tmp_path: Path) -> None:
    done = wall("set", "exposure=1", "--out", tmp_path)
    assert done.returncode == 1
    assert "control.json: no such file" in " ".join(done.stderr.split())
    (tmp_path / "control.json").write_text("{}")
    done = called("set", "exposure=1", "--out", tmp_path)
    assert done.returncode == 1
    assert "does not say how to reach a wall" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    "text", ["exposure", "=1", "exposure=", "exposure=1,,2", "exposure=nan", "exposure=1 exposure=2"]
)
def test_what_is_no_assignment_is_refused_before_any_wall_is_asked(tmp_path: Path, text: str) -> None:
    called = CliRunner().invoke(cli.app, ["set", *text.split(), "--out", str(tmp_path)])
    assert isinstance(called.exception, EditError)
    assert "want" in str(called.exception)


def test_the_control_file_goes_with_the_wall(tmp_path: Path) -> None:
    done = wall("run", write_config(tmp_path), "--headless", "--seconds", 1, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "out" / "control.json").exists()


def test_help_says_how() -> None:
    called = CliRunner().invoke(cli.app, ["set", "--help"])
    assert called.exit_code == 0
    assert "NAME=VALUE" in called.output
