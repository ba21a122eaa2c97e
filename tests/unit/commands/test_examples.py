"""The configurations that come with the program: listed, and copied to where the guide's commands work as written."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wall.cli import app
from wall.commands.examples import copy_examples, examples
from wall.commands.inputs import EXAMPLES
from wall.config.loading import load
from wall.core.errors import ConfigError, RunError


def test_each_is_listed_with_a_sentence_of_its_own() -> None:
    listed = dict(examples())
    assert listed.keys() == {str(path.relative_to(EXAMPLES)) for path in EXAMPLES.rglob("*.yaml")}
    assert len(set(listed.values())) == len(listed)
    assert all(20 < len(about) < 300 and about.count("(") == about.count(")") for about in listed.values()), listed
    assert listed["sampler_hilbert.yaml"].startswith("Frameless rendering after Parker et al. (1999): chunks of")
    said = CliRunner().invoke(app, ["examples"]).output
    assert listed["one_panel.yaml"] == "The smallest wall: one panel, one renderer (mpirun -n 2)."
    assert "one_panel.yaml" in said


def test_a_copy_is_all_of_them_and_is_never_written_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("configs/demo.yaml", "configs/views/map_inset.yaml"):
        with pytest.raises(ConfigError, match="wall examples configs copies those that come with the program"):
            load(name)
    done = CliRunner().invoke(app, ["examples", "configs"])
    assert done.exit_code == 0, done.output
    here = {path.relative_to("configs"): path.read_bytes() for path in Path("configs").rglob("*") if path.is_file()}
    assert here == {path.relative_to(EXAMPLES): path.read_bytes() for path in EXAMPLES.rglob("*") if path.is_file()}
    assert load("configs/demo.yaml").config == load(EXAMPLES / "demo.yaml").config
    for path in Path("configs").rglob("*.yaml"):
        for named in re.findall(r"\bfile: ([\w./*-]+\.\w+)", path.read_text(encoding="utf-8")):
            assert list(path.parent.glob(named)), f"{path} names {named}, which is not copied"
    Path("configs/demo.yaml").write_text("mine", encoding="utf-8")
    Path("configs/balance.yaml").unlink()
    done = CliRunner().invoke(app, ["examples", "configs"])
    assert done.exit_code != 0
    assert not Path("configs/balance.yaml").exists(), "nothing is written"
    assert Path("configs/demo.yaml").read_text(encoding="utf-8") == "mine"


def test_a_copy_may_lie_among_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = tmp_path / "configs"
    shutil.copytree(EXAMPLES / "views", there / "views")
    (there / "views" / "moments.yaml").chmod(0o444)
    monkeypatch.setattr("wall.commands.examples.EXAMPLES", there)
    before = sorted(there.rglob("*.yaml"))
    assert copy_examples(there / "views" / "mine") == len(before)
    mine = there / "views" / "mine" / "views"
    assert sorted(mine.iterdir()) == [mine / path.name for path in before]
    (mine / "moments.yaml").write_text("one's own to change", encoding="utf-8")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match=r"file/configs: cannot be written \(Not a directory\)"):
        copy_examples(tmp_path / "file" / "configs")
