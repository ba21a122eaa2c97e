"""Processes that become renderers of a running wall, in the hardest run: under MPI, encrypted, with balance."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from running import WALL, called, environment, mpirun, page_of, session_of, shown, start, status, summary, write_config

from wall.client import connect
from wall.run.warm_up import LONGEST_OTHERS_S

PATIENCE_S = 60.0
JOINS_S = LONGEST_OTHERS_S + PATIENCE_S  # who joins may wait for others that compile
Ranks = list[dict[str, Any]]


@pytest.fixture
def begun() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts processes, all of which end with the test."""
    processes: list[subprocess.Popen[str]] = []

    def begin(*arguments: object, **options: Any) -> subprocess.Popen[str]:
        processes.append(start(*arguments, **options))
        return processes[-1]

    yield begin
    for process in reversed(processes):
        process.terminate()
        try:
            process.wait(20)
        finally:
            process.kill()


def until_ranks(address: str, wanted: Callable[[Ranks], bool], *, joins: subprocess.Popen[str] | None = None) -> Ranks:
    """The table of ranks, once it is as wanted; `joins`: a process that must not end before."""
    limit = time.monotonic() + (PATIENCE_S if joins is None else JOINS_S)
    while True:
        ranks: Ranks = status(address)["ranks"]
        if wanted(ranks):
            return ranks
        assert joins is None or joins.poll() is None, joins.communicate()[0]
        assert time.monotonic() < limit, [(rank["alive"], rank["region"]) for rank in ranks]
        time.sleep(0.05)


def pid_of(run: subprocess.Popen[str], rank: int) -> int:
    for pid in session_of(run.pid):
        if f"OMPI_COMM_WORLD_RANK={rank}".encode() in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"):
            return pid
    raise AssertionError(f"there is no rank {rank}")


def traces(rank: dict[str, Any]) -> bool:
    return bool(rank["alive"] and rank["region"] and rank["samples_per_s"] > 0)


@pytest.mark.mpi
def test_processes_join_a_run_of_mpirun_in_a_dead_rank_s_place_and_beside_the_others_and_leave_it(
    tmp_path: Path, begun: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, columns=2, encrypt="always", lost_after_s=1.0)
    text = config.read_text().replace("sinks: [png]", "balance: true, sinks: [browser, png]")
    config.write_text(text)
    out = tmp_path / "OUT"
    run = begun("run", config, "--out", out, "--seconds", 2 * JOINS_S + 300, launcher=mpirun(3, "--with-ft", "ulfm"))
    address = page_of(run)
    shown(address)
    control = out / "control.json"
    assert stat.S_IMODE(control.stat().st_mode) == 0o600

    os.kill(pid_of(run, 2), signal.SIGKILL)
    until_ranks(address, lambda ranks: not ranks[2]["alive"] and not ranks[2]["region"])
    first = begun("join", out)
    until_ranks(address, lambda ranks: len(ranks) == 3 and traces(ranks[2]), joins=first)

    with open(control) as given:
        second = begun("join", "-", stdin=given)
    rendered = until_ranks(address, lambda ranks: len(ranks) == 4 and all(map(traces, ranks[1:])), joins=second)
    assert "" not in [rank["region"] for rank in rendered[1:]]

    second.send_signal(signal.SIGINT)
    until_ranks(address, lambda ranks: len(ranks) == 3 and all(map(traces, ranks[1:])))
    said, _ = second.communicate(timeout=10)
    assert (second.returncode, said.split("\n")[-2]) == (0, "left: interrupted")
    before = shown(address)
    with connect(out) as way:
        way.set({f"sky.{part}": (0.0, 0.0, 0.0) for part in ("zenith", "horizon", "ground")})
    limit = time.monotonic() + PATIENCE_S
    while (dark := shown(address))[2, 2].any() or dark[2, -3].any():
        assert time.monotonic() < limit, "a part of the wall is traced by nobody"
    assert before[2, 2].any()
    assert before[2, -3].any()

    os.kill(pid_of(run, 0), signal.SIGTERM)  # mpirun would kill it before it could tell the others
    said, _ = first.communicate(timeout=10)
    assert (first.returncode, said.split("\n")[-2]) == (0, "the wall has ended")
    run.communicate(timeout=20)
    found = summary(out)
    assert found["lost"] == {}, "its place was taken"
    assert found["restarts"].keys() == {"2"}
    assert found["dropped"].get("bad_packet", 0) == found["dropped"].get("stranger", 0) == 0
    assert all(rank["samples_traced"] > 0 for rank in found["ranks"][1:])


def test_who_has_the_wrong_key_or_no_wall_is_refused(tmp_path: Path) -> None:
    done = called("join", tmp_path)
    assert done.returncode == 1
    assert "control.json: no such file" in " ".join(done.stderr.split())
    done = subprocess.run(
        [*WALL, "join", "-"], input="{}", capture_output=True, text=True, timeout=60,
        env=environment(), check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert "the standard input: does not say how to reach a wall" in " ".join(done.stderr.split())
