"""A wall that cannot be meant is refused at its place in the file; one that is only odd is noted."""

from __future__ import annotations

import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.geometry.checks import check_wall
from wall.geometry.expanding import expand

HEAD = "version: 1\nscene: {source: x}\nviews: [{id: main}]\nwall:\n"


def checked(wall: str) -> tuple[str, ...]:
    loaded = loads(HEAD + wall + "\n", name="a.yaml")
    return check_wall(loaded, expand(loaded.config.wall))


def refusal(wall: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        checked(wall)
    return str(caught.value).splitlines()


def panels(*entries: tuple[str, float, str]) -> str:
    """0.4 x 0.3 m, 40 x 30 pixels unless an entry says otherwise: id, x, other keys."""
    lines = []
    for name, x, keys in entries:
        pixels = "" if "pixels" in keys else "pixels: [40, 30], "
        corners = f"{{lower_left: [{x}, 0, 0], lower_right: [{x + 0.4}, 0, 0], upper_left: [{x}, 0.3, 0]}}"
        lines.append(f"    - {{id: {name}, {pixels}corners: {corners}{keys}}}")
    return "  panels:\n" + "\n".join(lines)


def grid(keys: str) -> str:
    return f"  grid: {{columns: 2, rows: 2, pixels: [40, 30], size: [0.4, 0.3]{keys}}}"


@pytest.mark.parametrize(
    ("camera", "key"),
    [
        ("up: [0, 0, 1]", "scene: {up: z}"),
        ("up: [-3, 0, 1]", "scene: {up: -x}"),
        ("up: [0, 0, 1], position: [9, 2, 3], target: [0, 0, 0]", "scene: {up: z}"),
        ("up: [0, 0, 1], position: [5, -6, 3], target: [0.5, 0, 1]", "scene: {up: z}"),  # from the front
        ("up: [0, 1, 0.5]", ""),
        ("up: [0, 0, -1], position: [0, 24, 0.01], target: [0, 0, 0]", ""),  # a map
    ],
)
def test_a_camera_with_another_up_than_y_is_noted_with_the_key_that_turns_models(camera: str, key: str) -> None:
    loaded = loads(HEAD.replace("id: main", f"id: main, camera: {{{camera}}}") + grid("") + "\n", name="a.yaml")
    notes = check_wall(loaded, expand(loaded.config.wall))
    assert ["views[0].camera.up" in note and key in note for note in notes] == [True] * bool(key)


def test_sizes_that_must_be_millimetres_are_noted() -> None:
    [note] = checked("  grid: {columns: 2, rows: 1, pixels: [480, 270], size: [480, 270]}")
    assert note == (
        "a.yaml:5:9: wall.grid: panel r0c0: is 480 x 270 m large, a pixel 1 m: is that millimetres? (so r0c1); "
        "accepted: sizes in metres"
    )
    assert checked(grid("")) == ()


@pytest.mark.parametrize(
    "wall",
    [
        grid(""),
        grid(", bezel: 0.02"),
        grid(", overlap: 0.05, blend: auto"),
        grid(", stereo: side_by_side, pixels: [80, 30]").replace("pixels: [40, 30], ", ""),
        panels(("a", 0.0, ""), ("b", 0.4, "")),
        panels(("a", 0.0, ", stereo: left"), ("b", 0.0, ", stereo: right")),
        "  bezel: skip\n" + grid(", bezel: 0.02"),
    ],
)
def test_wall_as_it_should_be_gives_no_notes(wall: str) -> None:
    assert checked(wall) == ()


def test_pixels_covered_twice_are_refused_with_both_panels_and_what_was_declared() -> None:
    (said,) = refusal(panels(("a", 0.0, ""), ("b", 0.35, "")))

    assert said == (
        "a.yaml:7:7: wall.panels[1]: pixels covered twice: panels a and b share 0.05 x 0.3 m (5 x 30 of b's pixels), "
        "and do not both declare it; accepted: corners that meet, or `overlap` of both where they share light"
    )


def test_overlap_wider_than_declared_is_refused_with_both_widths() -> None:
    sides = ", overlap: {left: 0.03, right: 0.03}"
    (said,) = refusal(panels(("a", 0.0, sides), ("b", 0.35, sides)))

    assert "share 0.05 x 0.3 m (5 x 30 of b's pixels), and declare 0.03 m side by side, 0 m above each other" in said


def test_two_panels_that_fill_the_same_monitor_are_refused() -> None:
    part = ", display: ':0', monitor: HDMI-1, window: {width: 40, height: 30}"
    full = ", display: ':0', monitor: HDMI-1"
    [said] = refusal(panels(("a", 0.0, full), ("b", 0.4, full)))
    assert said.startswith("a.yaml:7:7: wall.panels[1]: monitor HDMI-1 shows panel a, and b would cover it; accepted: ")
    checked(panels(("a", 0.0, full), ("b", 0.4, part)))
    checked(panels(("a", 0.0, full + ", stereo: side_by_side"), ("b", 0.4, part)))
    checked(panels(("a", 0.0, full + ", host: left"), ("b", 0.4, full + ", host: right")))


def test_many_covered_panels_are_not_told_one_by_one() -> None:
    said = refusal(panels(*((f"p{k}", 0.0, "") for k in range(5))))

    assert len(said) == 9
    assert said[-1] == "a.yaml: 2 more pairs of panels cover each other"


def test_all_that_is_wrong_with_a_wall_is_said_at_once() -> None:
    said = refusal(panels(("a", 0.0, ""), ("b", 0.35, ", eye: [0, 0, -1]"), ("c", 0.3, "")))

    assert len(said) == 2
    assert "pixels covered twice: panels a and c" in said[0]
    assert "wall.panels[1].eye = [0, 0, -1]: is 1 m behind panel b" in said[1]


@pytest.mark.parametrize(
    ("wall", "expected"),
    [
        (
            panels(("a", 0.0, ", pixels: [40, 30]"), ("b", 0.4, ", pixels: [80, 30]")),
            "a.yaml:7:7: wall.panels[1]: panel b: pixels are not square: 5 mm wide, 10 mm high",
        ),
        (
            grid(", overlap: 0.05"),
            "a.yaml:5:9: wall.grid: panel r0c1: shares 0.05 x 0.3 m of light with panel r0c0, and not both fade out "
            "(so r1c0, r1c1); accepted: blend: auto",
        ),
        (grid(", blend: auto"), "blend: auto is as wide as the overlap, and there is none (so r0c1, r1c0, r1c1)"),
        (panels(("a", 0.0, ", stereo: left")), "panel a: shows the left eye's image, and no panel the right one's"),
        (panels(("a", 0.0, ", stereo: right")), "panel a: shows the right eye's image, and no panel the left one's"),
        (
            panels(("a", 0.0, ""), ("b", 9.0, "")),
            "panel b: in the wall's image it stands beside the panels before it",
        ),
        (
            panels(
                ("a", 0.0, ", overlap: 0.06, blend: auto"),
                ("b", 0.35, ", overlap: 0.06, blend: auto, pixels: [400, 300]"),
            ),
            "panel b: its pixels lie between those of panel a, whose light it shares",
        ),
    ],
)
def test_what_is_odd_is_noted_at_its_place(wall: str, expected: str) -> None:
    (note,) = checked(wall)

    assert expected in note
    assert note.startswith("a.yaml:")


def test_note_of_many_panels_names_a_few() -> None:
    entries = [(f"p{k}", 0.4 * k, ", pixels: [40, 60]") for k in range(9)]

    (note,) = checked(panels(*entries))

    assert note.endswith("5 mm high (so p1, p2, p3, and 5 more)")


def test_pixels_a_percent_from_square_are_square() -> None:
    assert checked(panels(("a", 0.0, ", pixels: [4000, 3020]"))) == ()
    assert len(checked(panels(("a", 0.0, ", pixels: [4000, 3040]")))) == 1


NEARER = "lower_left: [0.15, 0, 0.5], lower_right: [0.55, 0, 0.5], upper_left: [0.15, 0.3, 0.5]"
CORNER = "lower_left: [0.4, 0, 0], lower_right: [0.4, 0, 0.4], upper_left: [0.4, 0.3, 0]"
TURNED = "lower_left: [0.6, 0, 0], lower_right: [0.8, 0.2, 0], upper_left: [0.45, 0.15, 0]"
COVERING = "lower_left: [0.4, 0, 0], lower_right: [0.6, 0.2, 0], upper_left: [0.25, 0.15, 0]"
REACHING_IN = "lower_left: [0.38, 0, 0], lower_right: [0.38, 0, 0.4], upper_left: [0.38, 0.3, 0]"


@pytest.mark.parametrize(
    ("corners", "share"),
    [
        (NEARER, "19 %"),  # half as far: it hides x 0.15 to 0.3, y 0.075 to 0.225 of its 0.4 x 0.3 m
        (CORNER, ""),
        (TURNED, ""),
        (COVERING, "38 %"),  # of 0.06 m^2 with a tip at (0.4, 0), what is left of that: a triangle of 0.0225
        (REACHING_IN, "24 %"),  # z to 0.1, y a height of 0.3 (1 - z): 0.3 (0.1 - 0.005) of 0.12 m^2
    ],
)
def test_panels_apart_or_turned_that_light_the_same_directions_are_noted(corners: str, share: str) -> None:
    wall = panels(("a", 0.0, ""), ("b", 9.0, ""))
    text = f"{HEAD}{wall}\n".replace("{id: main}", "{id: main, eye: [0.2, 0.15, 1]}")
    text = text.replace("lower_left: [9.0, 0, 0], lower_right: [9.4, 0, 0], upper_left: [9.0, 0.3, 0]", corners)
    loaded = loads(text, name="a.yaml")

    notes = [note for note in check_wall(loaded, expand(loaded.config.wall)) if "lights" in note]

    assert len(notes) == bool(share)
    if share:
        assert f"panel b: lights {share} of its area where the eye also sees panel a, which lies in" in notes[0]
