"""`wall convert`: the YAML passes the project's checks, the report lists every item, refusals name a position."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from wall import cli
from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.geometry.cameras import resolve_view
from wall.importers.command import convert_text, read, table
from wall.importers.formats import FORMATS, detect
from wall.importers.report import NotThisFormat
from wall.roles.plan import make_layout

SCREEN = 'LowerLeft="-1 -1 -1" LowerRight="1 -1 -1" UpperRight="1 1 -1"'
WINDOW = '"size": {"x": 640, "y": 480}'
FOV = '"projection": {"type": "PlanarProjection", "fov": {"hfov": 80, "vfov": 50}}'
PLANE = (
    '"projection": {"type": "ProjectionPlane", "lowerleft": {"x": -1, "y": -1, "z": 0}, '
    '"upperleft": {"x": -1, "y": 1, "z": 0}, "upperright": {"x": 1, "y": 1, "z": 0}}'
)


def sgct(*windows: str, rest: str = "") -> str:
    return f'{{"version": 1, "nodes": [{{"address": "a", "windows": [{", ".join(windows)}]}}]{rest}}}'


WALLS = {  # file name: text, panels, ranks
    "one.pvx": (f'<pvx><Machine Name="a" {SCREEN}/></pvx>', 1, 1),
    "same_place.pvx": (f'<pvx><Machine Name="a" {SCREEN}/><Machine Name="a" {SCREEN}/></pvx>', 2, 2),
    "corner.pvx": (
        f'<pvx><Machine Name="front" {SCREEN}/>'
        '<Machine Name="floor" LowerLeft="-1 -1 0.05" LowerRight="1 -1 0/05" UpperRight="1 -1 -1"/>'
        '<Machine Name="behind" LowerLeft="-1 -1 1" LowerRight="1 -1 1" UpperRight="1 1 1"/>'
        '<Machine Name="nowhere"/></pvx>',
        4,
        4,
    ),
    "side_by_side.pvx": (f'<pvx><Machine StereoType="SplitViewportHorizontal" {SCREEN}/></pvx>', 1, 2),
    "tide.json": (
        '{"surfaces": [{"displayWidth": 1920, "displayHeight": 1200, "screenCountX": 2, "bezelWidth": -60}, '
        '{"displayWidth": 600, "displayHeight": 600}], "processes": [{"host": "a", "screens": ['
        '{"display": ":0.0", "stereo": "left"}, {"display": ":0.1", "stereo": "right"}, '
        '{"i": 1, "stereo": "left"}, {"i": 1, "stereo": "right", "x": 5}, {"surface": 1}]}]}',
        5,
        5,
    ),
    "displaycluster.xml": (
        '<configuration><dimensions numTilesWidth="7" numTilesHeight="3" screenWidth="3840" screenHeight="2160" '
        'mullionWidth="75" mullionHeight="75" fullscreen="1"/></configuration>',
        21,
        21,
    ),
    "wide_mullions.xml": (
        '<configuration><dimensions numTilesWidth="2" numTilesHeight="1" screenWidth="10" screenHeight="10" '
        'mullionWidth="500" mullionHeight="3"/></configuration>',
        2,
        2,
    ),
    "windows.json": (
        sgct(
            f'{{{WINDOW}, "mirrorx": true, "viewports": [{{{FOV}}}]}}',
            f'{{{WINDOW}, "stereo": "top_bottom", "pos": {{"x": -5, "y": 3}}, "viewports": [{{{FOV}}}]}}',
            f'{{{WINDOW}, "monitor": 1, "viewports": [{{"projection": {{"type": "FisheyeProjection"}}}}]}}',
            f"{{{WINDOW}}}",
        ),
        4,
        5,
    ),
    "eye_in_the_plane.json": (sgct(f'{{{WINDOW}, "viewports": [{{{PLANE}, "blendmask": "b.png"}}]}}'), 1, 1),
    "overlap.xml": (
        '<Cluster><Node address="a"><Window><Size x="1400" y="1050"/><Viewport><Viewplane><Pos x="-3" y="0" z="0"/>'
        '<Pos x="-3" y="2" z="0"/><Pos x="3" y="2" z="0"/></Viewplane></Viewport></Window>'
        '<Window><Size x="1400" y="1050"/><Viewport><Viewplane><Pos x="-3" y="0" z="0"/>'
        '<Pos x="-3" y="2" z="0"/><Pos x="-0.5" y="2" z="0"/></Viewplane></Viewport></Window>'
        '<Window><Size x="1400" y="1050"/><Viewport><Viewplane><Pos x="-1.25" y="0" z="0"/>'
        '<Pos x="-1.25" y="2" z="0"/><Pos x="1.3" y="2" z="0"/></Viewplane></Viewport></Window></Node>'
        '<User><Pos x="0" y="1" z="4"/></User></Cluster>',
        3,
        3,
    ),
    "sage2.json": (
        "{resolution: {width: 4098, height: 768}, layout: {rows: 2, columns: 3}, dimensions: {tile_width: 1.2, "
        "tile_borders: [0.01, 0.02, 0.03, 0.04]}, displays: [{row: 0, column: 0}, {row: 1, column: 0, width: 3}]}",
        2,
        8,
    ),
}


def run(*words: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """The exit code of `wall WORDS`."""
    monkeypatch.setattr(sys, "argv", ["wall", *words])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return int(caught.value.code or 0)


@pytest.mark.parametrize("name", WALLS)
def test_the_result_passes_every_check_and_sees_all_panels(name: str) -> None:
    text, panels, ranks = WALLS[name]

    _, made, yaml = convert_text(text, name)

    loaded = loads(yaml)
    layout = make_layout(loaded)
    resolve_view(loaded, layout.wall, np.zeros(3), 1.0)
    assert loaded.config.wall.panels is not None
    assert (made.panels, made.ranks) == (panels, ranks)
    assert (len(loaded.config.wall.panels), len(layout.regions)) == (panels, ranks)


def test_an_equalizer_file_is_told_by_its_suffix_and_by_its_words() -> None:
    text = "#Equalizer 1.1 ascii\nserver\n{\n    config { }\n}\n"

    assert detect(text, "a.eqc") is detect(text, "a.txt") is FORMATS["equalizer"]


@pytest.mark.parametrize("name", WALLS)
def test_the_report_names_lines_of_the_source_and_nothing_twice(name: str) -> None:
    text, _, _ = WALLS[name]

    _, made, _ = convert_text(text, name)

    lines = text.count("\n") + 1
    items = [*made.carried, *made.not_carried]
    assert all(1 <= item.line <= lines and item.what and item.why for item in items)
    named = {item.what for item in made.carried}
    assert len(named) == len(made.carried)


@pytest.mark.parametrize("name", WALLS)
def test_a_format_is_told_by_the_text_alone(name: str) -> None:
    text, _, _ = WALLS[name]

    assert convert_text(text, "unnamed")[0] is convert_text(text, name)[0]


def test_the_command_writes_yaml_that_says_where_it_is_from_and_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "cave.pvx"
    source.write_text(f'<pvx>\n<Machine Name="a"\n Typo="1" {SCREEN}/>\n</pvx>')
    yaml, report = tmp_path / "wall.yaml", tmp_path / "report.json"

    code = run("convert", str(source), "-o", str(yaml), "--report", str(report), monkeypatch=monkeypatch)

    said = capsys.readouterr().out
    assert code == 0
    assert yaml.read_text().startswith("# Converted from cave.pvx (paraview) by `wall convert`.\n")
    assert "# The eye is at the origin" in yaml.read_text()
    told = json.loads(report.read_text())
    assert (told["panels"], told["ranks"]) == (1, 1)
    assert told["not_carried"] == [{"what": "pvx.Machine[0].Typo = '1'", "line": 3, "why": "has no counterpart here"}]
    assert {"what": "pvx.Machine[0].LowerLeft", "line": 3, "why": "corners"} in told["carried"]
    assert "pvx.Machine[0].Typo" in said
    assert "1 panels, 1 ranks" in said


@pytest.mark.parametrize("words", [("-o", "cave.pvx"), ("-o", "wall.yaml", "--report", "./cave.pvx")])
def test_the_file_that_is_read_is_not_written_over(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = f'<pvx>\n<Machine Name="a" {SCREEN}/>\n</pvx>'
    Path("cave.pvx").write_text(text)
    assert run("convert", "cave.pvx", *words, monkeypatch=monkeypatch) == 2
    assert "is the file that is to be converted" in " ".join(capsys.readouterr().err.split())
    assert Path("cave.pvx").read_text() == text
    assert not Path("wall.yaml").exists()


@pytest.mark.parametrize(
    ("name", "data", "words", "says"),
    [
        ("a.txt", b"just words", (), "a.txt:1:1: text that begins with 'just words', suffix .txt: not a wall"),
        ("a.json", b'{"a": 1, "b": 2}', (), "a.json:1:1: a JSON object with a, b, suffix .json: not a wall"),
        ("a.json", b"[1]", (), "a JSON list with nothing in it"),
        ("a.xml", b"<svg/>", (), "a.xml:1:1: XML with <svg>, suffix .xml: not a wall"),
        ("a.xml", b" \n", (), "a.xml:1:1: the file is empty"),
        ("a.json", b'{"nodes": [', (), "a.json:1:12: not valid JSON5"),
        ("a.pvx", b"<pvx>\n<Machine", (), "a.pvx:2:1: not valid XML (unclosed token)"),
        ("a.pvx", b"{}", (), "a.pvx:1:1: not valid XML"),
        ("a.pvx", b"\x7fELF\x00\x01", (), "a.pvx:1:1: this is not text"),
        ("a.pvx", b"<pvx/>", ("--format", "sage2"), "a.pvx:1:1: not valid JSON5"),
        ("a.pvx", b"<pvx/>", ("--format", "sage3"), "--format sage3: is not known; accepted: paraview, tide"),
    ],
)
def test_a_file_that_is_no_wall_is_refused_with_exit_code_2_and_writes_nothing(
    name: str,
    data: bytes,
    words: tuple[str, ...],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(data)

    code = run("convert", name, "-o", "wall.yaml", *words, monkeypatch=monkeypatch)

    assert code == 2
    assert says in capsys.readouterr().err
    assert not Path("wall.yaml").exists()


def test_the_terminal_shows_equal_items_once_and_not_what_is_inside_them() -> None:
    machine = f'<Machine Name="m" Typo="1" {SCREEN}/>\n'
    _, made, _ = convert_text(f'<pvx>\n{machine}{machine}<other a="1"/></pvx>', "w.pvx")

    shown = table(made)

    assert shown is not None
    lines, what = ([*column.cells] for column in shown.columns[:2])
    assert lines == ["2, 3", "4"]
    assert what == ["pvx.Machine[0].Typo = '1' and 1 like it", "pvx.other[0]"]


def test_a_refusal_names_the_formats_that_are_known() -> None:
    with pytest.raises(ConfigError) as caught:
        convert_text("hello", "a.txt")

    assert all(name in str(caught.value) for name in FORMATS)


def test_files_that_are_missing_or_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read(tmp_path / "none.pvx")
    with pytest.raises(ConfigError, match="this is a folder"):
        read(tmp_path)


def test_a_file_that_is_too_large_is_refused_without_being_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "w.pvx"
    with path.open("wb") as file:
        file.truncate(1 << 33)
    monkeypatch.setattr(Path, "open", None)  # nothing may read it
    monkeypatch.setattr(Path, "read_bytes", None)

    with pytest.raises(ConfigError, match=r"w\.pvx: 8589934592 bytes are too many; accepted: at most 4194304"):
        read(path)


def test_the_format_of_many_comments_is_told_at_once() -> None:
    with pytest.raises(NotThisFormat, match="not a wall that is known here"):
        detect("/**/" * 100 + "x", "w.json")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_other_encodings_are_read(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "w.pvx"
    path.write_bytes(f'<pvx><!-- Wände --><Machine Name="a" {SCREEN}/></pvx>'.encode(encoding))

    assert convert_text(read(path), str(path))[1].panels == 1


def test_an_output_that_cannot_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "a.pvx"
    source.write_text(WALLS["one.pvx"][0])

    assert run("convert", str(source), "-o", str(tmp_path / "no" / "wall.yaml"), monkeypatch=monkeypatch) == 2


def test_the_example_of_the_documentation_is_what_comes_out() -> None:
    page = (Path(__file__).parents[3] / "docs" / "guide" / "converting.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    source = next(text for kind, text in blocks if kind == "xml")

    _, made, yaml = convert_text(source, "corner.pvx")

    assert yaml == next(text for kind, text in blocks if kind == "yaml")
    shown = next(text for kind, text in blocks if kind == "json")
    assert all(json.dumps(item) in shown for item in made.as_json()["not_carried"])
    assert f"{made.panels} panels, {made.ranks} ranks; {len(made.carried)} values carried" in page
