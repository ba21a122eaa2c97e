"""A wheel holds all of the package: page, shaders, style sheets, the demo's configuration."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from pathlib import Path

from wall.commands.inputs import DEMO
from wall.config.loading import load

ROOT = Path(__file__).parents[2]


def test_a_wheel_holds_every_file_of_the_package() -> None:
    """Modules of every folder, as setuptools finds packages; of other files those that package-data names."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    assert settings["packages"]["find"] == {"include": ["wall*"]}, "folders without __init__.py are packages too"
    patterns = settings["package-data"]["*"]
    files = [path for path in (ROOT / "wall").rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    data = [path for path in files if path.suffix != ".py"]
    assert {path.suffix for path in data} >= {".html", ".js", ".css", ".glsl", ".yaml"}
    assert [path for path in data if not any(fnmatch(path.name, pattern) for pattern in patterns)] == []


def test_the_demo_that_is_packaged_is_that_of_the_clone() -> None:
    assert DEMO.is_relative_to(ROOT / "wall")
    assert load(DEMO).config == load(ROOT / "configs/demo.yaml").config
