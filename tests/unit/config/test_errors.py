"""What is wrong with a configuration is said with its position, its value, and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.config import loading, yaml_text
from wall.config.loading import default_for_model, load, loads, nearest, shown, with_scene
from wall.core.errors import ConfigError

GOOD = """\
version: 1
scene:
  source: courtyard
wall:
  grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.32, 0.24]}
views:
  - camera: {position: [0, 0, 5], target: [0, 0, 0], fov: 45}
"""
ADDED = len(GOOD.splitlines()) + 1  # the line of what a test appends


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        loads(text, name="a.yaml")
    return str(caught.value)


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


def test_a_wrong_part_of_a_mapping_is_the_only_thing_that_is_said_of_it() -> None:
    data = "data: [{type: points, file: a.csv, radius: {column: t, factor: -1}}]"
    lines = refusal(changed("source: courtyard", data)).splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("a.yaml:3:66: scene.data[0].radius.factor = -1: is too small")


def test_a_number_that_is_out_of_bounds_is_not_said_to_be_no_mapping() -> None:
    data = "data: [{type: points, file: a.csv, radius: -1}]"
    [line] = refusal(changed("source: courtyard", data)).splitlines()
    assert "scene.data[0].radius = -1: is too small; accepted: a number above 0" in line


def test_colours_may_be_codes() -> None:
    """Of sRGB: 188 is half of the light."""
    data = "data: [{type: points, file: a.csv, radius: 1, color: '#ffbc00'}]"
    [points] = loads(changed("source: courtyard", data)).config.scene.data
    assert points.color == pytest.approx((1.0, 0.5, 0.0), abs=0.005)
    [line] = refusal(changed("source: courtyard", "source: courtyard\n  sky: {zenith: 3}")).splitlines()
    assert "scene.sky.zenith = 3" in line
    assert line.endswith("or '#rrggbb' (sRGB, in quotes) (radiance straight up, linear RGB)")
    [line] = refusal(changed("source: courtyard", data.replace("#ffbc00", "red"))).splitlines()
    assert "color = 'red': is no colour; accepted: '#rrggbb' (sRGB), or [red, green, blue], linear" in line


def test_good_text_loads() -> None:
    assert loads(GOOD).config.wall.grid is not None


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "fov: 45",
            "fov: 400",
            "a.yaml:7:59: views[0].camera.fov = 400: is too large; accepted: a number from 1 to 170",
        ),
        ("fov: 45", "fov: .nan", "views[0].camera.fov = nan: is not a finite number; accepted: a number from 1"),
        ("fov: 45", "fov: '45'", "views[0].camera.fov = '45': is not a number"),
        ("fov: 45", "fov: true", "views[0].camera.fov = true: is not a number"),
        (
            "fov: 45",
            "fow: 45",
            "views[0].camera.fow: unknown key; accepted: name, position, target, direction, up, fov, follow; "
            "did you mean fov?",
        ),
        ("columns: 2", "columns: 2.5", "wall.grid.columns = 2.5"),
        (
            "columns: 2",
            "columns: 0",
            "a.yaml:5:19: wall.grid.columns = 0: is too small; accepted: a whole number from 1",
        ),
        ("columns: 2, ", "", "a.yaml:5:3: wall.grid.columns: is missing; accepted: a whole number from 1 to 256"),
        ("columns: 2", f"columns: {10**30}", "a.yaml:5:19: wall.grid.columns: 100000000000... has too many digits"),
        ("[32, 24]", "[32]", "wall.grid.pixels[1]: is missing"),
        ("[32, 24]", "[32, 24, 3]", "wall.grid.pixels = [32, 24, 3]: "),
        ("[32, 24]", "32", "wall.grid.pixels = 32: is not a list; accepted: [number, number]"),
        ("rows: 1", "rows: 1, bezel: 0.4", "wall.grid.bezel = 0.4: is wider than the panel itself"),
        (
            "rows: 1",
            "rows: 1, bezel: wide",
            "is not a mapping; accepted: a number from 0 to 100 or a mapping with left",
        ),
        ("rows: 1", "rows: 1, id: 'p{row}'", "wall.grid.id = 'p{row}': gives two panels the same id"),
        ("rows: 1", "rows: 1, id: '{column}/{row}'", "gives the id '0/0'; accepted: letters"),
        ("source: courtyard", "source: ''", "a.yaml:3:11: scene.source = '': is empty"),
        (
            "source: courtyard",
            "sorce: x",
            "scene.sorce: unknown key; accepted: source, data, up, materials, lights, sky, environment, ground, "
            "animation, integrator, cuts; did you",
        ),
        (
            "source: courtyard",
            "source: courtyard\n  cuts: [{position: [0, 0, 0], normal: [0, 0, 0]}]",
            "a.yaml:4:40: scene.cuts[0].normal = [0, 0, 0]: has no direction; accepted: three numbers that are not all",
        ),
        (
            "source: courtyard",
            f"source: courtyard\n  cuts: [{', '.join(['{position: [0, 0, 0], normal: [0, 1, 0]}'] * 7)}]",
            "a.yaml:4:9: scene.cuts = [{'position': [0, 0, 0], 'normal': [0, 1, 0]}",
        ),
        ("source: courtyard", "source: a\n  source: b", "a.yaml:4:3: scene.source: this key stands on line 3 already"),
        ("target: [0, 0, 0]", "target: [0, 0, 5]", "views[0].camera.target = [0, 0, 5]: is where the eye is"),
        ("position: [0, 0, 5], ", "", "has only one of position and target"),
        ("camera: {", "eye: [0, 0, 1]\n    camera: {", "a.yaml:8:59: views[0].camera.fov = 45: the eye's place"),
        ("version: 1", "version: 2", "a.yaml:1:10: version = 2: this version is not known; accepted: 1"),
        ("version: 1", "version: '1'", "a.yaml:1:10: version = '1': this version is not known"),
        ("version: 1\n", "", "a.yaml:1:1: version: is missing; accepted: version: 1"),
        (
            "  - camera",
            "  - {id: main}\n  - camera",
            "a.yaml:8:5: views[1].id: views[0] has this id already",
        ),
    ],
)
def test_wrong_value_is_refused_with_its_position(old: str, new: str, expected: str) -> None:
    assert expected in refusal(changed(old, new))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("graph: sort-frist", "graph = 'sort-frist': is not one of the choices; accepted: sort-first"),
        ("graph: {preset: sort-first, ranks: 2}", "graph.ranks: unknown key; accepted: preset, ranks_per_panel"),
        ("graph: {nodes: [{op: tiles, id: a, inputs: [b]}]}", "graph.nodes[0].op = 'tiles': is not known; accepted: "),
        ("graph: {nodes: [{id: a}]}", "graph.nodes[0]: op is missing; accepted: "),
        (
            "sampling: {method: hilbrt}",
            "sampling.method = 'hilbrt': is not known; accepted: adaptive, framed, frameless, hilbert, progressive; "
            "did you mean hilbert?",
        ),
        (
            "sampling: {chunk_pixels: 64}",
            "sampling.chunk_pixels: unknown key; accepted: threads, samples_per_batch, seed",
        ),
        (
            "sampling: {samples_per_batch: 16}",
            "sampling.samples_per_batch = 16: is too small; accepted: a whole number from 64 to 65536",
        ),
        ("transport: {codec: lz5}", "transport.codec = 'lz5': is not one of the choices; accepted: none, lz4, zstd"),
        (
            "transport: {ports: 9100-9000}",
            "transport.ports = '9100-9000': is no range of ports; accepted: first-last, such as",
        ),
        ("transport: {ports: 9000-99999}", "transport.ports = '9000-99999': is no range of ports"),
        ("transport: {ports: 9000-9000}", "transport.ports = '9000-9000': is one port; accepted: two or more"),
        (
            "transport: {allow: [10.1.0.0/8]}",
            "transport.allow[0] = '10.1.0.0/8': is no network: 10.1.0.0/8 has host bits",
        ),
        ("transport: {heartbeat_s: 1.5}", "transport.lost_after_s: one late heartbeat (every 1.5 s) would lose a rank"),
        (
            "output: {browser: {port: 70000}}",
            "output.browser.port = 70000: is too large; accepted: a whole number from 0",
        ),
        (
            "outptu: {}",
            "outptu: unknown key; accepted: version, scene, wall, views, sampling, graph, reconstruction, barrier, "
            "transport, output; did you mean output?",
        ),
    ],
)
def test_wrong_part_is_refused_with_its_position(line: str, expected: str) -> None:
    message = refusal(GOOD + line + "\n")

    assert expected in message
    assert message.startswith(f"a.yaml:{ADDED}:")


@pytest.mark.parametrize(
    ("animation", "expected"),
    [
        ("{type: spin, period_s: 1}", "scene.animation[0].object: is missing"),
        ("{type: spni, object: a, period_s: 1}", "scene.animation[0].type = 'spni': is not known; accepted: "),
        ("{type: orbit, center: [0, 0, 0], period_s: 1}", "names neither an object nor a light"),
        ("{type: orbit, object: a, light: 0, center: [0, 0, 0], period_s: 1}", "names both an object and a light"),
        ("{type: orbit, light: 2, center: [0, 0, 0], period_s: 1}", "animation[0].light = 2: there are 1 lights"),
        (
            "{type: orbit, light: 0, center: [0, 0, 0], axis: [0, 0, 0], period_s: 1}",
            "axis = [0, 0, 0]: has no direction",
        ),
        (
            "{type: keyframes, object: a, keyframes: [{time: 1, position: [0, 0, 0]}, {time: 1, position: [0, 0, 0]}]}",
            "keyframes[1].time = 1: does not come after the keyframe before it (1 s)",
        ),
    ],
)
def test_wrong_motion_is_refused(animation: str, expected: str) -> None:
    light = "{type: point, position: [0, 1, 0], intensity: [1, 1, 1]}"
    text = changed("source: courtyard", f"source: courtyard\n  lights: [{light}]\n  animation: [{animation}]")

    assert expected in refusal(text)


@pytest.mark.parametrize(
    ("panels", "expected"),
    [
        ("[0, 0, 0], lower_right: [1, 0, 0], upper_left: [1, 1, 0]", "meet at 45.0 degrees; accepted: a right angle"),
        ("[0, 0, 0], lower_right: [0, 0, 0], upper_left: [0, 1, 0]", "span 0 x 1 m"),
    ],
)
def test_corners_that_are_no_rectangle_are_refused(panels: str, expected: str) -> None:
    panel = f"panels: [{{id: a, pixels: [4, 3], corners: {{lower_left: {panels}}}}}]"
    text = changed("grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.32, 0.24]}", panel)

    assert expected in refusal(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "a.yaml: the file is empty; accepted: version: 1, scene, wall, views"),
        ("# nothing\n", "the file is empty"),
        ("- 1\n", "a.yaml:1:1: this is not a mapping"),
        ("version: 1\n\tscene: 3\n", "a.yaml:2:1: a tab cannot indent YAML; accepted: spaces"),
        (
            "version: 1\nscene: [\n",
            "a.yaml:3:1: not valid YAML: expected a value, but found the end of the file",
        ),
        ("version: 1\nscene: \x01\n", "a.yaml:2:8: the character U+0001 is not allowed"),
        ("--- a\n--- b\n", "expected a single document"),
        ("version: &one 1\n", "a.yaml:1:10: version: anchors and aliases (&one) are not used here"),
        (f"{GOOD}transport: {{bind: 999.1.1.1}}\n", "transport.bind = '999.1.1.1': is no address"),
        ("version: 1\nscene: *gone\n", "a.yaml:2:8: not valid YAML: found undefined alias"),
        ("version: 1\n<<: {a: 1}\n", "a.yaml:2:1: <<: merge keys (<<) are not used here"),
        ("version: 1\n[a, b]: 1\n", "a.yaml:2:1: a key must be one word"),
        ("version: 1\nscene: !!python/object:os.system {}\n", "are not used here; accepted: a plain value"),
        ("- " * 5000, "nested too deeply"),
        ("version: 1\nscene: " + "[" * 40 + "]" * 40, "nested too deeply; accepted: at most 24 levels"),
        ("#" * (1 << 20) + "#", "characters are too many"),
    ],
)
def test_text_that_is_no_plain_yaml_is_refused(text: str, expected: str) -> None:
    assert expected in refusal(text)


def test_text_with_too_many_values_is_refused_where_they_become_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_text._Composer, "most_values", 10)

    assert "a.yaml:10:3: not valid YAML: more than 10 keys and values are too many" in refusal("- 1\n" * 10_000)


def test_many_errors_are_counted_and_only_the_first_ones_explained() -> None:
    lines = refusal(changed("version: 1", "version: 1" + "".join(f"\nkey{k}: 1" for k in range(1000)))).splitlines()

    assert len(lines) == loading.MOST_EXPLAINED + 1
    assert lines[0].startswith("a.yaml:2:1: key0: unknown key")
    assert lines[-1] == f"a.yaml: and {1000 - loading.MOST_EXPLAINED} more"


def test_all_errors_are_reported_at_once_in_the_order_of_the_file() -> None:
    text = changed("columns: 2", "columns: 0").replace("fov: 45", "fov: 400").replace("source:", "sauce:")

    positions = [line.split(": ")[0] for line in refusal(text).splitlines()]

    assert positions == ["a.yaml:3:3", "a.yaml:5:19", "a.yaml:7:59"]


def test_list_whose_entries_are_wrong_is_not_called_short_as_well() -> None:
    message = refusal(changed("fov: 45", "fov: 400"))

    assert len(message.splitlines()) == 1


def test_error_of_a_later_stage_points_into_the_file() -> None:
    loaded = loads(GOOD, name="a.yaml")

    error = loaded.error(("views", 0, "camera", "fov"), "is odd", "even ones")

    assert str(error) == "a.yaml:7:59: views[0].camera.fov = 45: is odd; accepted: even ones"


def test_error_at_a_default_points_to_its_nearest_parent() -> None:
    loaded = loads(GOOD, name="a.yaml")

    assert str(loaded.error(("views", 0, "eye"), "is missing")) == "a.yaml:7:5: views[0].eye: is missing"


def test_missing_file_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    (tmp_path / "demo.yaml").write_text(GOOD)

    with pytest.raises(ConfigError, match=r"dmeo\.yaml: no such file; did you mean demo\.yaml\?"):
        load(tmp_path / "dmeo.yaml")


def test_folder_and_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"version: 1 # caf\xe9\n")

    with pytest.raises(ConfigError, match="this is a folder"):
        load(tmp_path)
    with pytest.raises(ConfigError, match=r"latin\.yaml: byte 16 is not UTF-8 text"):
        load(tmp_path / "latin.yaml")


def test_file_with_a_byte_order_mark_loads(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"\xef\xbb\xbf" + GOOD.encode())

    assert load(tmp_path / "a.yaml").folder == tmp_path


def test_model_alone_gives_the_demo_wall_around_it(tmp_path: Path) -> None:
    loaded = default_for_model(tmp_path / "bunny: 1.ply")

    assert loaded.config.scene.source == "bunny: 1.ply"
    assert loaded.folder == tmp_path
    assert loaded.config.views[0].camera.position is None
    assert loaded.config.wall.grid is not None
    assert loaded.config.wall.grid.columns * loaded.config.wall.grid.rows == 4


@pytest.mark.parametrize("more", ["", "sampling: {threads: 2}\n"])
def test_a_wall_that_names_no_sampler_gets_the_one_with_the_least_error_live(more: str) -> None:
    text = "version: 1\nscene: {source: forest}\nwall: {grid: {columns: 1, rows: 1, pixels: [64, 64], size: [1, 1]}}\n"
    assert loads(text + "views: [{camera: auto}]\n" + more).config.sampling.method == "adaptive"


def test_another_scene_is_framed_automatically_on_the_same_wall(tmp_path: Path) -> None:
    loaded = loads(GOOD)
    model = tmp_path / "m.ply"
    model.write_text("")

    other = with_scene(loaded, model)

    assert other.config.scene.source == str(model)
    assert other.config.views[0].camera.position is None
    assert other.config.views[0].camera.fov == 45
    assert other.config.wall == loaded.config.wall


def test_with_another_scene_a_map_is_still_seen_from_above_and_a_view_still_follows(tmp_path: Path) -> None:
    views = """\
views:
  - {camera: {position: [7, 3, 9], target: [0, 1, 0]}, path: {type: orbit}}
  - {id: map, viewport: {left: 0.6, top: 0, width: 0.4, height: 0.4},
     camera: {position: [0, 24, 0], target: [0, 4, 0], up: [0, 0, -1]}}
  - {id: near, viewport: {left: 0, top: 0, width: 0.4, height: 0.4}, camera: {follow: map, fov: 20}}
"""
    loaded = loads(GOOD[: GOOD.index("views:")] + views)

    main, above, near = with_scene(loaded, "forest").config.views

    assert (main.camera.direction, main.path) == (None, loaded.config.views[0].path)
    assert (above.camera.direction, above.camera.up, above.path) == ((0, -1, 0), (0, 0, -1), None)
    assert near == loaded.config.views[2]


def test_paths_read_as_people_write_them() -> None:
    assert shown(("views", 0, "camera", "fov")) == "views[0].camera.fov"
    assert nearest("pistion", ["position", "target"]) == "; did you mean position?"
    assert nearest("xyz", ["position", "target"]) == ""
