"""The scripts for clusters find their clone and the caller's files from any folder."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

LAUNCH = Path(__file__).parents[2] / "launch"
TELLS = '#!/bin/sh\necho "$PWD" "$(command -v wall)" "$@"\n'


def executable(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


@pytest.mark.parametrize("script", ["mpirun-hosts.sh", "slurm.sh"])
def test_a_wall_starts_from_any_folder_with_the_clones_own_programs(tmp_path: Path, script: str) -> None:
    clone, caller, spool, programs = (tmp_path / name for name in ("clone", "caller", "spool", "bin"))
    executable(clone / ".venv/bin/wall", TELLS)
    executable(programs / "mpirun", TELLS)
    executable(programs / "scontrol", f"#!/bin/sh\necho 'JobId=7'\necho '   Command={clone}/launch/{script} w.yaml'\n")
    caller.mkdir()
    spool.mkdir()
    (clone / "launch").mkdir()
    shutil.copy(LAUNCH / script, clone / "launch" / script)
    called, first = clone / "launch" / script, ["hosts.txt", "5"]
    environment = {"PATH": f"{programs}:{os.environ['PATH']}", "MPIRUN_OPTIONS": "--oversubscribe --bind-to none"}
    if script == "slurm.sh":  # Slurm copies it
        called, first = Path(shutil.copy(called, spool / "slurm_script")), []
        environment |= {"SLURM_JOB_ID": "7", "SLURM_NTASKS": "5", "SLURM_SUBMIT_DIR": str(caller)}

    done = subprocess.run(
        ["bash", called, *first, "w.yaml"], cwd=caller, env=environment, capture_output=True, text=True
    )

    where, program, *words = done.stdout.split()
    assert (where, program) == (str(caller), str(clone / ".venv/bin/wall"))
    assert words[-5:] == ["-n", "5", "wall", "run", "w.yaml"]
    own = ["--use-hwthread-cpus"] if script == "slurm.sh" else []  # Slurm counts those
    assert words[2 : 5 + len(own)] == [*own, "--oversubscribe", "--bind-to", "none"]
