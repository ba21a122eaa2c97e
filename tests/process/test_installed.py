"""The wheel that pyproject.toml describes, built, installed outside the clone, and used there as a newcomer does."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import RUN_LIMIT_S

ROOT = Path(__file__).parents[2]
PLAIN = {"NUMBA_DISABLE_JIT": "1", "PYTHONWARNINGS": "ignore::RuntimeWarning"}  # compiled, kernels take a minute
NOT_CACHED = "network was disabled"  # what uv says of a backend that it would have to fetch
PURE = {"PYTHONPATH", "PYTHONHOME"}  # what would find the clone, or another Python


def run(command: list[object], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, without the clone in the path of modules."""
    env = {name: value for name, value in os.environ.items() if name not in PURE} | variables
    return subprocess.run(
        [*map(str, command)], cwd=folder, env=env, capture_output=True, text=True, timeout=RUN_LIMIT_S, check=False
    )


def built(folder: Path) -> Path:
    """A wheel of a copy of the clone's package: what older builds left in the clone would come with it.

    By uv with the backend in its cache, as launch/setup.sh leaves it, or by pip with an installed one; never from a
    network. Skips the test where the backend is nowhere.
    """
    source = folder / "source"
    shutil.copytree(ROOT / "wall", source / "wall", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source)
    [wanted] = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    found = next((each.version for each in importlib.metadata.distributions(name="setuptools")), "0")
    uv = shutil.which("uv", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    ways: list[list[object]] = []
    if uv is not None:
        ways.append([uv, "build", "--wheel", "--offline", "--out-dir", folder / "wheel", source])
    if int(found.split(".")[0]) >= int(wanted.removeprefix("setuptools>=")):
        pip = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
        ways.append([*pip, "--wheel-dir", folder / "wheel", source])
    for way in ways:
        done = run(way, folder)
        if done.returncode == 0:
            return next((folder / "wheel").glob("*.whl"))
        assert NOT_CACHED in done.stderr, done.stderr
    pytest.skip(f"no wheel is built: {wanted} is neither installed (setuptools {found}) nor in uv's cache")


def test_a_wheel_renders_and_runs_an_example_outside_the_clone(tmp_path: Path) -> None:
    target, home = tmp_path / "target", tmp_path / "home"
    home.mkdir()
    install = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", target, built(tmp_path)]
    done = run(install, home)
    assert done.returncode == 0, done.stderr
    installed = {"PYTHONPATH": str(target), **PLAIN}
    done = run([sys.executable, "-c", "import wall; print(wall.__file__)"], home, **installed)
    assert done.stdout.strip() == str(target / "wall/__init__.py")

    assert (target / "wall/configs/views/map_inset.yaml").is_file()
    render = [sys.executable, "-m", "wall", "render", "spheres", "--size", "16x12", "--spp", "1", "-o", "spheres.png"]
    done = run(render, home, **installed)
    assert done.returncode == 0, done.stderr
    done = run([sys.executable, ROOT / "docs/examples/render.py", "8x6"], home, **installed)
    assert done.returncode == 0, done.stderr
    for name, shape in {"spheres.png": (12, 16, 3), "courtyard.png": (12, 8, 3)}.items():
        image = np.asarray(Image.open(home / name))
        assert image.shape == shape
        assert image.std() > 10, "something is shown"
