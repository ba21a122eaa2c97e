"""README and the other pages name what exists: the nine steps, files, links, configurations."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINES = re.findall(r"^\d\. `(wall/[\w/]+\.py)` `([\w.]+)`", README, re.MULTILINE)
NAMED = re.findall(r"`(wall/[\w/]+\.py)` `([\w.]+)`", README)


def test_one_sample_is_followed_in_nine_steps_and_at_most_nine_files() -> None:
    assert len(LINES) == 9
    assert len({path for path, _ in NAMED}) <= 9


@pytest.mark.parametrize(("path", "name"), NAMED)
def test_each_line_names_a_file_and_a_function_of_it(path: str, name: str) -> None:
    found = importlib.import_module(path.removesuffix(".py").replace("/", "."))
    for part in name.split("."):
        found = getattr(found, part)
    assert callable(found)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_and_files_of_every_page_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#\s]+)", text) if not link.startswith("http")]
    named = re.findall(r"`((?:wall|tests|configs|launch)/[\w/.-]+)`", text)
    assert [link for link in links if not (page.parent / link).exists()] == []
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_every_shipped_configuration_is_explained() -> None:
    shipped = {path.relative_to(ROOT / "configs").as_posix() for path in (ROOT / "configs").rglob("*.yaml")}
    named = set(re.findall(r"`([\w/]+\.yaml)`", README))
    assert shipped <= named


def test_the_refusal_that_readme_shows_is_what_comes() -> None:
    text = (ROOT / "configs/demo.yaml").read_text(encoding="utf-8").replace("refresh_hz: 30", "refresh_hz: fast")
    with pytest.raises(ConfigError) as refused:
        loads(text, name="demo.yaml")
    assert str(refused.value) in README.splitlines()


def test_single_process_is_as_short_as_promised() -> None:
    lines = (ROOT / "wall/run/single_process.py").read_text(encoding="utf-8").splitlines()
    promised = re.search(r"in one process, (\d+) lines", README)
    assert promised is not None
    assert len(lines) <= int(promised[1]) <= 100


def test_no_file_is_longer_than_400_lines() -> None:
    long = [path for path in (ROOT / "wall").rglob("*.py") if len(path.read_text(encoding="utf-8").splitlines()) > 400]
    assert long == []
