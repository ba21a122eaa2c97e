"""What one rank of mpirun's does to the others: nothing while a wall runs; before, a refusal ends them all."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import trimesh
from running import environment, mpirun, write_config

pytestmark = pytest.mark.mpi
LIMIT_S = 60.0

ALONE = """
import time
from wall.core.errors import RunError
from wall.run.bootstrap_mpi import MpiBootstrap
launched = MpiBootstrap()
launched.allgather("")
if launched.rank == 2:
    with launched.failing_alone():
        raise RunError("nothing from the head for 60.0 s")
time.sleep(2.0)
print(f"rank {launched.rank} is alive", flush=True)
launched.finish()
"""
REFUSING = """
import sys
from wall.run.bootstrap_mpi import MpiBootstrap
launched = MpiBootstrap()
launched.finish()
try:
    if launched.rank in map(int, sys.argv[1:]):
        print(f"rank {launched.rank} refuses", file=sys.stderr, flush=True)
        sys.exit(2)
    launched.allgather("")
except BaseException:
    launched.refuse()
    raise
"""


def job(text: str, *words: str, options: tuple[str, ...] = ("--with-ft", "ulfm")) -> subprocess.CompletedProcess[str]:
    """Three ranks of a program, started as the scripts start a wall; they end within LIMIT_S."""
    command = [*mpirun(3, *options), sys.executable, "-c", text, *words]
    return subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=LIMIT_S, check=False)


def test_what_goes_wrong_at_one_rank_of_a_running_job_ends_no_other_one() -> None:
    """An exit code would: mpirun ends all ranks then, whether it tolerates deaths or not."""
    done = job(ALONE)
    assert "rank 2 on" in done.stderr
    assert "nothing from the head for 60.0 s" in done.stderr
    assert sorted(done.stdout.splitlines()) == ["rank 0 is alive", "rank 1 is alive"]


@pytest.mark.parametrize("options", [(), ("--with-ft", "ulfm")], ids=["plain", "ulfm"])
@pytest.mark.parametrize("who", [["2"], ["0", "1", "2"]], ids=["one", "all"])
def test_a_refusal_before_a_run_ends_those_that_wait(who: list[str], options: tuple[str, ...]) -> None:
    """With ULFM they waited for it until the start's own limit."""
    done = job(REFUSING, *who, options=options)
    assert done.returncode == 2
    assert [f"rank {rank} refuses" in done.stderr for rank in who] == [True] * len(who)
    assert ("MPI_ABORT" in done.stderr) == (who == ["2"])


def two_folders(folder: Path, **at_the_second: str) -> list[str]:
    """The start of a wall of two ranks in folders of their own, of which the first has a model."""
    command = list[str]()
    for name in ("first", "second"):
        (folder / name).mkdir()
        config = write_config(folder / name, source="ball.obj", **(at_the_second if name == "second" else {}))
        run = [sys.executable, "-m", "wall", "run", config.name, "--headless", "--seconds", "1"]
        command += [":"] * (name == "second") + ["-n", "1", "-wdir", str(folder / name), *run]
    trimesh.creation.icosphere(subdivisions=1).export(folder / "first/ball.obj")
    return [*mpirun(1)[:-2], *command]


def test_a_model_that_one_rank_lacks_is_sent_to_it(tmp_path: Path) -> None:
    command = two_folders(tmp_path)
    done = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=LIMIT_S, check=False)
    said = " ".join((done.stdout + done.stderr).split())
    assert done.returncode == 0, said
    assert "note: ball.obj was sent to" in said
    assert (tmp_path / "second/ball.obj").read_bytes() == (tmp_path / "first/ball.obj").read_bytes()


def test_a_configuration_that_differs_ends_all_and_sends_nothing(tmp_path: Path) -> None:
    command = two_folders(tmp_path, method="framed")
    done = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=LIMIT_S, check=False)
    said = " ".join((done.stdout + done.stderr).split())
    assert done.returncode == 2, said
    assert "configuration wall-0.yaml: differs on" in said
    assert "file ball.obj: is missing on" in said
    assert not (tmp_path / "second/ball.obj").exists()
