"""Warm-up compiles each kernel that ranks call, for all types of arguments: no rank compiles, none compiles twice."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.running import RUN_LIMIT_S, environment

CONFIGS = Path(__file__).parents[2] / "configs"

# A run whose ranks are threads of one process; prints the argument types that are new after the ranks started.
RUN = """
import sys
from pathlib import Path
from wall.config.loading import loads
from wall.core.jit import specialisations
from wall.run.head import Options
from wall.run.launch import run

config, out = map(Path, sys.argv[1:])
before = set()


def say(line):
    if line.startswith("starting"):
        before.update(specialisations())


text = config.read_text() + "\\ntransport: {kind: loopback}\\n"
run(loads(text, path=config), Options(out=out, seconds=1.5, headless=True), say, say)
assert before
print(*sorted(specialisations() - before), sep="\\n")
"""


@pytest.mark.parametrize("config", ["demo.yaml", "sampler_framed.yaml", "graphs/sort_last_tree.yaml"])
def test_ranks_call_no_kernel_with_types_that_warm_up_did_not_call(
    config: str, tmp_path: Path, compiled_only: None
) -> None:
    command = [sys.executable, "-c", RUN, str(CONFIGS / config), str(tmp_path / "out")]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=2 * RUN_LIMIT_S, env=environment(), check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ["", ""], "compiled, or loaded, by a rank"
