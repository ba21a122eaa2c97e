"""systemd's units and the Dockerfile start commands that there are, with options that these have."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from wall import cli

ROOT = Path(__file__).parents[2]
UNITS = sorted((ROOT / "launch").glob("*.service"))
CLONE = "/opt/wall"


def parse_wall(words: list[str]) -> None:
    """Let a command's own parser read its words. Raises click's errors."""
    command = typer.main.get_command(cli.app).commands[words[0]]  # type: ignore[attr-defined]
    command.make_context(words[0], words[1:])


def values(unit: Path, key: str) -> list[str]:
    return re.findall(rf"^{key}=(.*)$", unit.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_starts_a_run_that_is_refused_for_nothing_but_its_configuration(unit: Path) -> None:
    [line] = values(unit, "ExecStart")
    program, *words = shlex.split(line.replace("%i", "demo").replace("${RANKS}", "5"))
    own = Path(program).relative_to(CLONE)
    if own.name == "wall":
        assert own == Path(".venv/bin/wall"), "where launch/setup.sh puts it"
        parse_wall(words)
    else:
        assert os.access(ROOT / own, os.X_OK)
        hosts, ranks, *rest = words  # of launch/mpirun-hosts.sh
        assert (Path(hosts).suffix, ranks) == (".hosts", "5")
        parse_wall(["run", *rest])
    assert values(unit, "RestartPreventExitStatus") == ["2"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze (Debian: systemd)")
def test_systemd_finds_no_fault_in_the_units(tmp_path: Path) -> None:
    names = []
    for unit in UNITS:
        text = unit.read_text(encoding="utf-8").replace(CLONE, str(tmp_path)).replace("User=wall\n", "")
        [line] = values(unit, "ExecStart")
        program = tmp_path / Path(line.split()[0]).relative_to(CLONE)
        program.parent.mkdir(parents=True, exist_ok=True)
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
        names.append(tmp_path / unit.name.replace("@", "@demo"))
        names[-1].write_text(text)
    done = subprocess.run(
        ["systemd-analyze", "verify", "--recursive-errors=no", *names], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


def instructions() -> Iterator[tuple[str, str]]:
    """Of the Dockerfile: name and text, lines that go on put together."""
    text = (ROOT / "launch/Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, _, rest = line.partition(" ")
            yield name, rest.strip()


def test_the_image_starts_a_run_whose_results_are_in_a_volume() -> None:
    found = dict(instructions())
    assert json.loads(found["ENTRYPOINT"]) == ["wall"]
    words = json.loads(found["CMD"])
    parse_wall(words)
    assert (ROOT / words[1]).exists()
    assert words[words.index("--out") + 1] in json.loads(found["VOLUME"])
    assert found["ENV"] == f"PATH={found['WORKDIR']}/.venv/bin:$PATH"


def test_the_image_is_set_up_by_the_clones_own_script(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    (clone / ".venv").mkdir(parents=True)
    (clone / "launch").mkdir()
    for name in ("pyproject.toml", "launch/setup.sh", "launch/constraints.txt"):
        shutil.copy(ROOT / name, clone / name)
    wanted = "cat pyproject.toml launch/constraints.txt | cksum > .venv/installed-local"  # as after a set-up
    subprocess.run(["bash", "-c", wanted], cwd=clone, check=True)
    found = list(instructions())
    [shell] = [json.loads(text) for name, text in found if name == "SHELL"]
    [setup] = [text for name, text in found if name == "RUN" and "setup.sh" in text]
    environment = {**os.environ, "PYTHON": "/bin/false"}  # it would have to be asked for anything else

    done = subprocess.run([*shell, setup + "; echo $PATH"], cwd=clone, env=environment, capture_output=True, text=True)

    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{clone}/.venv/bin:")


def test_what_the_image_leaves_out_is_not_needed_there() -> None:
    left_out = (ROOT / "launch/Dockerfile.dockerignore").read_text(encoding="utf-8").split()
    assert {".git", ".venv", "OUT"} <= set(left_out)
    assert not {"wall", "configs", "launch", "pyproject.toml", "README.md"} & set(left_out)
