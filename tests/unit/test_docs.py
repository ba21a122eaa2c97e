"""The documentation's site builds without a broken link, and every `wall` command on its pages is one that there is."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from wall import cli

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md")), *sorted(ROOT.glob("docs/[gtl]*/*.md"))]


def commands(page: Path) -> list[list[str]]:
    """Words of the `wall` commands in a page's shell blocks."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("wall ")]


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda page: page.stem)
def test_every_command_has_options_that_there_are(page: Path) -> None:
    whole = typer.main.get_command(cli.app)
    for words in commands(page):
        command, rest = whole, list(words)
        while hasattr(command, "commands") and not rest[0].startswith("-"):
            command = command.commands[rest.pop(0)]
        if command is not whole:  # else it is --help or the like
            command.make_context(" ".join(words), rest)
        for word in words:
            assert not re.fullmatch(r"configs/[\w/.]+", word) or (ROOT / word).exists(), words


def test_the_site_has_no_broken_link(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, ROOT / "docs/build_site.py", tmp_path],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    reference = (tmp_path / "site/docs/reference/configuration/index.html").read_text(encoding="utf-8")
    assert "images shown a second" in reference
    assert "https://fonts" not in reference, "the site loads something from elsewhere"
