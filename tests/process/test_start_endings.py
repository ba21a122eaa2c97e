"""Runs that end before they have begun: told to, or refused; nothing stays behind."""

from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path

import pytest
from running import comes, mpirun, session_of, start, wall, write_config

pytestmark = pytest.mark.clock
START_LIMIT_S, STOP_LIMIT_S = 60.0, 15.0  # of a machine with much else to do


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_ranks_are_being_forked_ends_the_run(tmp_path: Path, number: signal.Signals) -> None:
    """Nothing is rendered yet, so nothing is kept; what is forked after the signal ends, too."""
    run = start("run", write_config(tmp_path, columns=12), "--headless", "--out", tmp_path / "out")
    try:
        limit = time.monotonic() + START_LIMIT_S
        while len(session_of(run.pid)) < 3:  # the head, and the first ranks of twelve
            assert time.monotonic() < limit
            time.sleep(0.001)

        os.kill(run.pid, number)
        said = run.communicate(timeout=STOP_LIMIT_S)[0]

        assert run.returncode != 0
        assert "Traceback" not in said
        comes(lambda: not session_of(run.pid), "the end of all ranks")
    finally:
        for pid in session_of(run.pid):
            os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize("options", [(), ("--with-ft", "ulfm")], ids=["plain", "ulfm"])
def test_an_error_at_the_start_ends_a_job_of_mpi(tmp_path: Path, options: tuple[str, ...]) -> None:
    """MPI_Finalize waits for ranks that wait for the one that failed: the job held its nodes for ever."""
    config = write_config(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        page = f"output: {{browser: {{port: {taken.getsockname()[1]}}}}}\n"
        config.write_text(config.read_text().replace("[png]", "[browser]") + page)
        began = time.monotonic()
        run = wall("run", config, "--seconds", 1, "--out", tmp_path / "OUT", launcher=mpirun(2, *options))
    assert run.returncode != 0
    assert "another program has this port" in run.stderr + run.stdout, run.stdout + run.stderr
    assert time.monotonic() - began < START_LIMIT_S


@pytest.mark.mpi
def test_wrong_number_of_ranks_is_refused_with_the_right_one(tmp_path: Path) -> None:
    config = write_config(tmp_path, columns=2)

    done = wall("run", config, "--headless", launcher=mpirun(2))

    assert done.returncode == 2
    assert "2 ranks were launched, the configuration needs 3: 1 head + 2 renderers" in done.stderr
    assert "mpirun --with-ft ulfm -x PATH -n 3" in done.stderr
    assert done.stderr.count("ranks were launched") == 1
