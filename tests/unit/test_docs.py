"""The documentation's site builds without a broken link, and every `wall` command on its pages is one that there is."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from wall import cli

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md")), *sorted(ROOT.glob("docs/[gtl]*/*.md"))]


WALL = typer.main.get_command(cli.app)
SHELLS = ("sh", "bash", "")
STARTERS = ("mpirun", "srun", "sbatch", "timeout", "nice")  # commands that may start `wall`


def parts_of(page: Path) -> list[tuple[str, str]]:
    """A page's blocks, each with its language, "" if it names none; and what is between them, as `text`."""
    parts = re.split(r"^```(.*)\n", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    opened = zip(parts[1::4], parts[2::4], strict=True)  # every second fence closes, and names no language
    return [("text", text) for text in parts[::4]] + list(opened)


def shell_lines(page: Path) -> list[list[str]]:
    """Words of the lines of a page's blocks that a shell is to run: of shell blocks, and of those of no language."""
    lines = "".join(body for lang, body in parts_of(page) if lang in SHELLS).replace("\\\n", " ").splitlines()
    known = re.compile(rf"(\w+=\S+ )*(wall|cp|{'|'.join(STARTERS)}) ")
    return [shlex.split(line, comments=True) for line in lines if known.match(line)]


def commands(page: Path) -> list[list[str]]:
    """Words of the `wall` commands in a page's blocks, also behind mpirun and the like."""
    return [words[words.index("wall") + 1 :] for words in shell_lines(page) if "wall" in words]


def found_in(words: list[str]) -> tuple[Any, list[str]]:
    """The command that words name, and the words after its name."""
    command: Any
    command, rest = WALL, list(words)
    while hasattr(command, "commands") and rest and rest[0] in command.commands:
        command = command.commands[rest.pop(0)]
    return command, rest


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda page: page.stem)
def test_every_command_has_options_that_there_are(page: Path) -> None:
    for words in commands(page):
        command, rest = found_in(words)
        if not hasattr(command, "commands"):  # else it is --help or the like
            command.make_context(" ".join(words), rest)
        for word in words:
            assert not re.fullmatch(r"configs/[\w/.]+", word) or (ROOT / word).exists(), words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_in_sentences_are_there_with_their_options(page: Path) -> None:
    prose = "".join(text for kind, text in parts_of(page) if kind == "text")
    for text in re.findall(r"`wall ([^`\n]+)`", prose):
        command, rest = found_in(text.replace("\\|", "|").split())
        known = {"--help", "-h"} | {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
        options = {word.partition("=")[0].rstrip(",;:.)") for word in rest if re.match(r"--?[a-z]", word)}
        assert options <= known, text


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/tutorials/*.md")), ids=lambda page: page.stem)
def test_the_files_of_a_tutorial_are_made_checked_and_drawn(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a page says is run, but for what needs displays, a cluster, minutes, or a file of the reader's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    for language, text in parts_of(page):
        if language == "yaml" and text.startswith("version:"):
            Path("wall.yaml").write_text(text, encoding="utf-8")
    ran = 0
    for words in shell_lines(page):
        if words[0] == "cp":
            shutil.copy(*words[1:])
        elif words[:2] in (["wall", "check"], ["wall", "draw"], ["wall", "--version"]):
            done = CliRunner().invoke(cli.app, words[1:])
            assert done.exit_code == 0, f"{' '.join(words)}: {done.output} {done.exception}"
            ran += 1
        elif words[:2] == ["wall", "run"]:
            assert Path(words[2]).exists(), words
    assert ran > 0


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
