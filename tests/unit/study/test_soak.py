"""What `wall measure soak` makes of what it saw."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from subprocess import PIPE

import pytest

from wall.core.errors import RunError
from wall.study.faults.soak import SETTLE_S, Row, judge, memory_mb

FLAT = [
    Row(
        seconds=60.0 * k, memory_mb=500.0 + k % 3, descriptors=100 + k % 2, processes=5, threads=20, age_s=1.0,
        clock_ms=float(k % 4), dropped={"late": 10 * k}, fault="killed" if k else "",
    )
    for k in range(60)
]  # fmt: skip


def test_a_wall_that_only_fluctuates_passes() -> None:
    verdict = judge(FLAT)
    assert verdict.why == ""
    assert (verdict.growth_percent, verdict.descriptors) == (0.0, 0)


def test_what_grows_drifts_or_is_forgotten_is_named() -> None:
    leaking = [replace(row, memory_mb=500.0 * (1.0 + 1e-3 * k), descriptors=100 + k) for k, row in enumerate(FLAT)]
    verdict = judge(leaking)
    assert verdict.growth_percent == pytest.approx(3.3, abs=0.2)
    assert verdict.descriptors == 34, "of the 50 rows that are judged: from the first 16 to the last 16"
    assert "memory grew by 3." in verdict.why
    assert "34 descriptors more" in verdict.why
    drifting = [replace(row, clock_ms=2.0 * k) for k, row in enumerate(FLAT)]
    assert judge(drifting).why == "the head's clock drifted by 68 ms"
    aging = [replace(row, age_s=0.5 + 0.05 * k) for k, row in enumerate(FLAT)]
    assert judge(aging).why == "the oldest samples became 2.2 times as old"
    forgetful = [*FLAT[:-1], replace(FLAT[-1], dropped={"late": 3})]
    assert judge(forgetful).forgotten == ("late",)


def test_what_grows_before_the_wall_has_settled_is_no_leak() -> None:
    warming = [replace(row, memory_mb=min(500.0, 100.0 + row.seconds / SETTLE_S * 400.0)) for row in FLAT]
    assert judge(warming).why == ""
    with pytest.raises(RunError, match="2 rows are too few"):
        judge(FLAT[:2])


def test_memory_is_that_of_the_process() -> None:
    keeps = "import sys; kept = b'1' * (64 << 20); print(flush=True); sys.stdin.read()"
    plain = "import sys; print(flush=True); sys.stdin.read()"
    got = []
    for program in (keeps, plain):  # processes of their own: what others free meanwhile is not in the difference
        with subprocess.Popen([sys.executable, "-c", program], stdin=PIPE, stdout=PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            got.append(memory_mb(process.pid))
            process.communicate(timeout=30)
    assert got[0] - got[1] == pytest.approx(64.0, abs=4.0)
    assert memory_mb(2**22 + 1) == 0.0
