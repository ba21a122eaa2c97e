"""Runs where there is little room: a panel of three pixels, a process that may open few files."""

from __future__ import annotations

import resource
import subprocess
import time
from pathlib import Path

from running import WALL, environment, panels, summary, wall, write_config

FEW_FILES = 30
END_LIMIT_S = 60.0


def test_a_panel_three_pixels_wide_is_shown(tmp_path: Path) -> None:
    config, out = write_config(tmp_path), tmp_path / "out"
    config.write_text(
        config.read_text().replace("pixels: [64, 48], size: [0.4, 0.3]", "pixels: [3, 48], size: [0.02, 0.3]")
    )

    done = wall("run", config, "--headless", "--still", "--until-complete", "--out", out)

    assert done.returncode == 0, done.stdout + done.stderr
    assert summary(out)["ended"] == "complete"
    (image,) = panels(out)
    assert image.shape[:2] == (48, 3)
    assert image.std() > 10


def test_a_run_that_may_open_too_few_files_says_so_and_ends(tmp_path: Path) -> None:
    config, out = write_config(tmp_path), tmp_path / "out"
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    began = time.monotonic()
    done = subprocess.run(
        [*WALL, "run", str(config), "--headless", "--seconds", "1", "--out", str(out)],
        capture_output=True, text=True, timeout=END_LIMIT_S, env=environment(), check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (FEW_FILES, most)),
    )  # fmt: skip
    assert done.returncode == 1, done.stdout + done.stderr
    said = " ".join(done.stderr.split())
    last = said.rpartition("processes ")[2]
    assert "Too many open files" in last, "of a socket, or of whatever comes first"
    assert last.endswith("; wanted: more open files (ulimit -n)")
    assert "Traceback" not in said
    assert "rank 1" not in said, "nor do others tell what follows from it"
    assert "running (Ctrl-C" not in said
    assert time.monotonic() - began < END_LIMIT_S
