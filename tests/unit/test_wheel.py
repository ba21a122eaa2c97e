"""A wheel holds all of the package: page, shaders, style sheets, the configurations."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from pathlib import Path

from wall.commands.inputs import DEMO, EXAMPLES

ROOT = Path(__file__).parents[2]


def test_a_wheel_holds_every_file_of_the_package() -> None:
    """Modules of every folder, as setuptools finds packages; of other files those that package-data names."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    assert settings["packages"]["find"] == {"include": ["wall*"]}, "folders without __init__.py are packages too"
    patterns = settings["package-data"]["*"]
    folders = (ROOT / "wall", ROOT / "wall/configs")  # that is a link, which rglob does not follow
    files = [f for each in folders for f in each.rglob("*") if f.is_file() and "__pycache__" not in f.parts]
    data = [path for path in files if path.suffix != ".py"]
    assert {path.suffix for path in data} >= {".html", ".js", ".css", ".glsl", ".yaml"}
    assert [path for path in data if not any(fnmatch(path.name, pattern) for pattern in patterns)] == []


def test_the_configurations_that_are_packaged_are_those_of_the_clone() -> None:
    assert EXAMPLES.parent == ROOT / "wall"
    assert EXAMPLES.resolve() == ROOT / "configs"
    assert DEMO.is_file()
