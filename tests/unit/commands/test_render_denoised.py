"""`wall render --denoise`: nearer to the converged image than the noisy one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from wall import cli
from wall.core.errors import ConfigError

pytest.importorskip("pyoidn")


def rendered(path: Path, *options: str) -> Path:
    done = CliRunner().invoke(
        cli.app, ["render", "cornell", "--size", "48x48", "-o", str(path), *options], catch_exceptions=False
    )
    assert done.exit_code == 0, done.output
    return path


def test_the_denoised_image_is_nearer_to_the_converged_one(tmp_path: Path, compiled_only: None) -> None:
    exact = np.load(rendered(tmp_path / "exact.npy", "--spp", "1024", "--seed", "7"))
    noisy, denoised = (
        np.load(rendered(tmp_path / f"{k}.npy", "--spp", "4", *options))
        for k, options in enumerate(([], ["--denoise"]))
    )
    errors = [float(np.sqrt(((np.minimum(each, 1) - np.minimum(exact, 1)) ** 2).mean())) for each in (noisy, denoised)]
    assert errors[1] < 0.6 * errors[0]


def test_frames_are_not_denoised(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--frames with --denoise"):
        CliRunner().invoke(
            cli.app, ["render", "cornell", "--frames", "0:1", "--denoise", "-o", str(tmp_path / "f_####.png")],
            catch_exceptions=False,
        )  # fmt: skip
