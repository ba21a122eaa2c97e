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


INTEGRATORS = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [96, 72], size: [0.4, 0.3]}}
views:
  - {id: main}
  - {id: light, viewport: {left: 0, top: 0, width: 0.4, height: 0.4}, integrator: {method: path, depth: 2}}
  - {id: shape, viewport: {left: 0.6, top: 0, width: 0.4, height: 0.4}, integrator: {method: ambient_occlusion}}
sampling: {method: adaptive}
"""


@pytest.mark.parametrize("config", ["demo.yaml", "graphs/layers.yaml", "graphs/sort_last_tree.yaml"])
def test_ranks_call_no_kernel_with_types_that_warm_up_did_not_call(
    config: str, tmp_path: Path, compiled_only: None
) -> None:
    compiled_by_no_rank(CONFIGS / config, tmp_path)


def test_every_view_s_kernels_are_warm(tmp_path: Path, compiled_only: None) -> None:
    config = tmp_path / "integrators.yaml"
    config.write_text(INTEGRATORS, encoding="utf-8")
    compiled_by_no_rank(config, tmp_path)


def compiled_by_no_rank(config: Path, tmp_path: Path) -> None:
    """Run a configuration in a process of its own, and see that its ranks compile or load nothing."""
    command = [sys.executable, "-c", RUN, str(config), str(tmp_path / "out")]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=2 * RUN_LIMIT_S, env=environment(), check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ["", ""], "compiled, or loaded, by a rank"
