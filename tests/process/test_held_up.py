"""A rank whose loop is held up by its work lives; one that is frozen is missed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from running import as_in_a_terminal, environment, session_of, summary, write_config

pytestmark = pytest.mark.clock
LOST_S = 1.0  # a rank is marked after 0.6 s
FROZEN_S = 1.6
END_LIMIT_S = 60.0

# every batch of rank 1 takes longer than a rank may be silent; as a kernel does, it gives the interpreter's lock back
SLOW = f"""
import sys, time
from itertools import count
from wall.cli import main
from wall.run.tracers import Tracers
step, batches = Tracers._step, count()
def slowly(self, trace):
    time.sleep({1.5 * LOST_S} if self._rank == 1 else 0.0)
    traced = step(self, trace)
    if next(batches) == 10 * (self._rank == 2):
        print("rank", self._rank, "traces", flush=True)
    return traced
Tracers._step = slowly
sys.argv[0] = "wall"
main()
"""


def test_a_rank_whose_batches_take_long_is_not_lost_and_one_that_is_frozen_is(tmp_path: Path) -> None:
    config = write_config(tmp_path, columns=2, path=", path: {type: orbit, period_s: 5}", lost_after_s=LOST_S)
    out = tmp_path / "out"
    run = subprocess.Popen(
        [sys.executable, "-c", SLOW, "run", str(config), "--headless", "--out", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment(), start_new_session=True,
        preexec_fn=as_in_a_terminal,
    )  # fmt: skip
    try:
        assert run.stdout is not None
        waited_for = {"rank 1 traces", "rank 2 traces"}
        while waited_for:
            line = run.stdout.readline()
            assert line, "the run ended before that"
            waited_for.discard(line.strip())
        _, _, frozen = session_of(run.pid)
        os.kill(frozen, signal.SIGSTOP)
        time.sleep(FROZEN_S)
        os.kill(frozen, signal.SIGCONT)
        time.sleep(0.5)  # it is heard again
        os.kill(run.pid, signal.SIGINT)
        output, _ = run.communicate(timeout=END_LIMIT_S)
    finally:
        for pid in session_of(run.pid):
            os.kill(pid, signal.SIGKILL)
        run.wait(10)

    found = summary(out)
    assert run.returncode == 0, output
    assert found["lost"] == {}
    assert "2" in found["silences"]
    assert found["busy_s"]["1"] > LOST_S
    assert found["busy_s"].get("2", 0.0) < FROZEN_S, "a process that stands still is not busy"
    assert found["stale_s"]["2"] > FROZEN_S - 0.6 - 0.3, "marked three heartbeats after it fell silent"
