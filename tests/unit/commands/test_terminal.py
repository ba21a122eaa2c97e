"""What commands share: what they say of models, and whom errors of a model blame."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.table import Table
from typer.testing import CliRunner

from wall import cli
from wall.commands.terminal import Terminal, load_config, print_notes, readably
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout, make_plan

DEMO = Path(__file__).parents[3] / "configs" / "demo.yaml"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


def test_notes_of_a_model_are_printed_by_rank_0_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "cow.obj"
    path.write_text(OBJ)
    plan = make_plan(make_layout(load_config(path)))
    print_notes(plan)
    assert "note: it has texture coordinates and names no image" in capsys.readouterr().err
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "2")
    print_notes(plan)
    assert capsys.readouterr().err == ""


def test_ranks_but_the_first_repeat_one_line_of_a_refusal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> None:
        raise ConfigError("w.yaml:3:1: one\nw.yaml:4:1: two\nw.yaml:5:1: three")

    for rank, lines in (("0", 3), ("2", 1)):
        monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
        with pytest.raises(SystemExit) as ended:
            readably(refuse)
        assert ended.value.code == 2
        said = capsys.readouterr().err
        assert len(said.splitlines()) == lines
    assert said.startswith("rank 2 on ")
    assert "w.yaml:3:1: one (and more, as rank 0 says)" in said


@pytest.mark.parametrize(("columns", "rows"), [(4, 3), (7, 2), (14, 2), (14, 30)])
def test_no_word_of_a_table_is_broken_on_a_narrow_terminal(columns: int, rows: int) -> None:
    table = Table(title="a table", caption="a note " * 20)
    for k in range(columns):
        table.add_column(f"column{k}")
    for k in range(rows):
        table.add_row(*[f"{k}.{n} reconstruction" for n in range(columns)])
    page = io.StringIO()
    Terminal(file=page, width=80).print(table)
    printed = page.getvalue()
    assert max(map(len, printed.splitlines())) <= 80
    assert "…" not in printed
    assert printed.count("reconstruction") == columns * rows
    assert all(f"column{k}" in printed and f"{rows - 1}.{k}" in printed for k in range(columns))


@pytest.mark.parametrize("as_scene", [True, False])
def test_a_model_that_cannot_be_read_is_blamed_itself(tmp_path: Path, as_scene: bool) -> None:
    path = tmp_path / "bad.ply"
    path.write_text("ply\nformat ascii 1.0\nelement vertex three\nend_header\n")
    loaded = load_config(DEMO, path) if as_scene else load_config(path)
    with pytest.raises(ConfigError) as refused:
        make_plan(make_layout(loaded))
    assert str(refused.value).startswith(f"--scene {path}: " if as_scene else f"{path}: cannot be read as ply")
    assert str(refused.value).count("bad.ply") == 1 + as_scene


def test_the_way_that_is_up_is_told_on_the_command_line(tmp_path: Path) -> None:
    assert load_config(DEMO, tmp_path / "a.obj", up="-z").config.scene.up == "-z"
    with pytest.raises(ConfigError, match="--up q: is no direction; accepted: auto, x, y, z, -x, -y, -z"):
        load_config(DEMO, up="q")


def test_an_integrator_on_the_command_line_is_that_of_every_view(tmp_path: Path) -> None:
    """One of that method keeps its depth; others, of the scene and of views, are replaced."""
    (tmp_path / "a.yaml").write_text(
        """\
version: 1
scene: {source: cornell, integrator: {method: path, depth: 3}}
wall: {grid: {columns: 2, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}
views:
  - {id: main, panels: [r0c0], integrator: {method: direct}}
  - {id: other, panels: [r0c1], integrator: {method: path, depth: 2}}
"""
    )
    for method, depth in (("path", 3), ("direct", None), ("ambient_occlusion", 1)):
        plan = make_plan(make_layout(load_config(tmp_path / "a.yaml", integrator=method)))
        assert plan.scene.path_depth == depth
        assert plan.scenes[1].path_depth == (2 if method == "path" else depth)
        assert (plan.scene.occlusion is not None) == (method == "ambient_occlusion")
    with pytest.raises(ConfigError) as refused:
        load_config(DEMO, integrator="paths")
    assert str(refused.value) == (
        "--integrator paths: is not known; accepted: direct, path, ambient_occlusion; did you mean path?"
    )


@pytest.mark.parametrize("command", [["run", str(DEMO)], ["demo"], ["render", str(DEMO), "-o", "a.png"]])
def test_commands_that_open_models_take_an_integrator(command: list[str]) -> None:
    failed = CliRunner().invoke(cli.app, [*command, "--integrator", "paths"]).exception
    assert isinstance(failed, ConfigError)
    assert str(failed).startswith("--integrator paths: is not known")


def test_a_model_that_is_not_there_is_sought_beside_the_caller_not_beside_the_configuration() -> None:
    with pytest.raises(ConfigError) as refused:
        make_plan(make_layout(load_config(DEMO, Path("nosuch.glb"))))
    assert str(refused.value) == f"--scene nosuch.glb: {Path('nosuch.glb').absolute()}: there is no such file"
