"""Curved panels: every pixel on its own line from the eye, flat images that cover them, overlaps along a surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.config.loading import Loaded, loads
from wall.config.yaml_text import write
from wall.core.data import Event, Framelet
from wall.core.errors import ConfigError
from wall.geometry.cameras import PanelView, look_at, resolve_view
from wall.geometry.checks import check_wall
from wall.geometry.expanding import expand, expanded_config, wall_of
from wall.geometry.frusta import project
from wall.geometry.panels import Panel, Wall
from wall.geometry.rects import panel_rect
from wall.geometry.seats import curved_image
from wall.geometry.surfaces import density
from wall.operators.curve import Curve, Positions
from wall.operators.kernels.resample import SUBPIXELS

ROUNDING = 0.51 / SUBPIXELS  # pixels: half a step of positions, and float64
BENT = {"type": "cylinder", "radius": 2.0, "angles": [-15.0, 45.0], "heights": [-0.6, 0.9]}
LEANING = {**BENT, "centre": [0.1, -0.2, 0.3], "axis": [0.1, 1.0, 0.3]}
COLUMN = {"type": "cylinder", "radius": 1.0, "angles": [-25.0, 30.0], "heights": [-0.4, 0.5], "side": "outside"}
DOME = {"type": "dome", "radius": 3.0, "tilt": 15.0, "azimuths": [-60.0, -10.0], "elevations": [20.0, 60.0]}
FLAT = {"lower_left": [0.2, -0.3, -1.0], "lower_right": [0.6, -0.3, -1.0], "upper_left": [0.2, 0.0, -1.0]}
EYES = {"bent": (BENT, [0.3, 0.2, 0.1]), "leaning": (LEANING, [-0.5, 0.1, 0.6]), "column": (COLUMN, [0.5, 0.2, 4.0])}
EYES["dome"] = (DOME, [-0.4, 0.3, 0.5])
CAMERA = look_at((3.0, 2.2, 4.1), (0.0, 0.6, 0.0), (0.1, 1.0, 0.2))
TOLD = (0.21, -0.14, 0.18)  # metres from the view's eye


def panel(surface: dict[str, Any], name: str = "a", **keys: Any) -> dict[str, Any]:
    return {"id": name, "pixels": [50, 36], "surface": surface, **keys}


def loaded_of(panels: list[dict[str, Any]], **view: Any) -> Loaded:
    values = {"version": 1, "scene": {"source": "x"}, "wall": {"panels": panels}, "views": [{"id": "main", **view}]}
    return loads(write(values), name="a.yaml", path=Path("a.yaml"))


def notes(panels: list[dict[str, Any]], **view: Any) -> list[str]:
    loaded = loaded_of(panels, **view)
    return list(check_wall(loaded, wall_of(loaded)))


def refusal(panels: list[dict[str, Any]], **view: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        notes(panels, **view)
    return str(caught.value)


def event(told: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Event:
    camera = CAMERA.tracked(told, 1.0)
    return Event(view=0, camera_event=0, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)


def worst_offset(loaded: Loaded, wall: Wall, shown: Panel, seen: Event) -> float:
    """Flat pixels from where each pixel takes its colour to where a point of the world on its line is in the image.

    The point is found anew: from the eye, which the event tells, through the point of the screen, five times as far.
    """
    view = resolve_view(loaded, wall, (0.0, 0.0, 0.0), 1.0)
    tracked = np.zeros(3) if shown.config.eye is not None else np.array(seen.camera.eye)
    mine, eye = PanelView(view, shown)(seen), view.eye_of(shown)
    assert shown.surface is not None
    (w, h), away = shown.pixels, shown.surface.centres() - (eye + tracked)
    world = mine.camera.origin() + 5.0 * away.reshape(-1, 3) @ mine.camera.rotation().T
    expected = project(shown, eye, mine.camera, world)[0].reshape(h, w, 2)
    found = Positions(curved_image(shown, loaded.config.views)).table(seen) / SUBPIXELS + 0.5
    return float(np.abs(found - expected).max())


@pytest.mark.parametrize("told", [(0.0, 0.0, 0.0), TOLD], ids=["at rest", "tracked"])
@pytest.mark.parametrize(("surface", "eye"), EYES.values(), ids=EYES.keys())
def test_a_pixel_takes_what_is_on_the_line_from_the_eye_through_its_point(
    surface: dict[str, Any], eye: list[float], told: tuple[float, float, float]
) -> None:
    loaded = loaded_of([panel(surface)], eye=eye, tracking={})
    wall = wall_of(loaded)
    assert worst_offset(loaded, wall, wall.panels[0], event(told)) <= ROUNDING


def test_both_eyes_and_a_panel_s_own_eye_have_lines_of_their_own() -> None:
    panels = [panel(BENT, stereo="side_by_side"), panel(BENT, "b", eye=[-0.2, 0.1, -0.3])]
    loaded = loaded_of(panels, eye=[0.3, 0.2, 0.1], eye_separation=0.4)
    wall = wall_of(loaded)
    assert [each.id for each in wall.panels] == ["a.left", "a.right", "b"]
    for each in wall.panels:
        assert worst_offset(loaded, wall, each, event(TOLD)) <= ROUNDING


def test_points_are_where_angles_and_heights_say() -> None:
    corners = {"bent": (2 * np.sin(np.radians(45)), 0.9, -2 * np.cos(np.radians(45)))}
    corners["column"] = (np.sin(np.radians(30)), 0.5, np.cos(np.radians(30)))  # nearest to the viewer
    for name, upper_right in corners.items():
        points, normals = wall_of(loaded_of([panel(EYES[name][0])], eye=EYES[name][1])).panels[0].surface.nodes()  # type: ignore[union-attr]
        assert_allclose(points[0, -1], upper_right, atol=1e-12)
        outwards = points[0, -1] * (1, 0, 1) / np.hypot(*points[0, -1, ::2])
        assert_allclose(normals[0, -1], outwards if name == "column" else -outwards, atol=1e-12)
    zenith = {"type": "dome", "radius": 3.0, "tilt": 30.0, "azimuths": [-40.0, 40.0], "elevations": [40.0, 90.0]}
    points = wall_of(loaded_of([panel(zenith)], eye=[0, 0, 0])).panels[0].surface.nodes()[0]  # type: ignore[union-attr]
    assert_allclose(points[0], np.broadcast_to([0.0, 3 * np.cos(np.pi / 6), -1.5], points[0].shape), atol=1e-12)


@pytest.mark.parametrize(("surface", "eye"), EYES.values(), ids=EYES.keys())
def test_the_flat_image_covers_the_panel_for_every_eye_within_reach(
    surface: dict[str, Any], eye: list[float], random_numbers: np.random.Generator
) -> None:
    loaded = loaded_of([panel(surface)], eye=eye, tracking={"reach": 0.25})
    (shown,) = wall_of(loaded).panels
    positions = Positions(curved_image(shown, loaded.config.views))
    ways = [
        *np.array(np.meshgrid(*[[-0.25, 0.25]] * 3)).reshape(3, -1).T,
        *random_numbers.uniform(-0.25, 0.25, (20, 3)),
    ]
    at = np.array([positions.table(event(tuple(way.tolist()))) for way in ways]) / SUBPIXELS
    assert at.min() >= 0.0
    assert (at.reshape(-1, 2).max(axis=0) <= np.array(shown.pixels) - 1.0).all()
    for axis in range(2):  # and no more than that, but for a pixel at each side
        assert at[..., axis].min() < 2.0
        assert at[..., axis].max() > shown.pixels[axis] - 3.0


def test_the_flat_image_is_about_as_fine_as_the_panel() -> None:
    # 60 degrees seen from the axis: the arc's middle is farther away than its chord, where the image is, by 1 / cos 30;
    # across, the image is a tangent, pi / 6 / tan 30 as fine there as the arc, and 1 / cos^2 30 times that at the edges
    surface = {**BENT, "angles": [-30.0, 30.0]}
    (shown,) = wall_of(loaded_of([panel(surface, pixels=[4000, 3000])], eye=[0.0, 0.15, 0.0])).panels
    assert shown.surface is not None
    least, most = density(shown.surface, shown.plane, shown.screen, np.array([0.0, 0.15, 0.0]))
    assert least == pytest.approx(np.cos(np.pi / 6), rel=0.002)
    assert most == pytest.approx(np.pi / 6 / np.tan(np.pi / 6) / np.cos(np.pi / 6) ** 2, rel=0.02)


def test_a_curved_pixel_is_linear_between_those_of_the_flat_image() -> None:
    """A wave in the flat image, 12 pixels long: off by at most M / 8 across and as much down, M its curvature."""
    surface = {**BENT, "angles": [-45.0, 45.0]}
    loaded = loaded_of([panel(surface, pixels=[200, 100])], eye=[0.3, 0.2, 0.1])
    (shown,) = wall_of(loaded).panels
    positions, k = Positions(curved_image(shown, loaded.config.views)), 2.0 * np.pi / 12.0
    flat = Framelet.blank(panel_rect(shown), frozenset({"colour"}))
    y, x = np.mgrid[:100, :200]
    flat.colour[...] = (0.5 + 0.25 * np.sin(k * x) + 0.25 * np.sin(k * y))[..., None]
    flat.event, bent = event(), Framelet.blank(panel_rect(shown), frozenset({"colour"}))
    Curve(op="curve", id="c", input="p", panel="a").apply([flat], bent, flat.rect, positions)

    at = positions.table(flat.event) / SUBPIXELS
    exact = 0.5 + 0.25 * np.sin(k * at[..., 0]) + 0.25 * np.sin(k * at[..., 1])
    worst = float(np.abs(bent.colour[..., 0] - exact).max())
    bound = 2 * 0.25 * k * k / 8.0
    assert 0.8 * bound < worst <= bound * 1.001  # the bound is reached where both waves have their tops


def test_an_image_that_is_much_coarser_or_finer_is_noted() -> None:
    [note] = notes([panel({**BENT, "angles": [-60.0, 60.0]}, pixels=[100, 36])], eye=[0.0, 0.0, 0.0])
    assert "wall.panels[0]: panel a: its flat image has 0.47 to 2.3 pixels for one of its own" in note
    assert notes([panel(BENT)], eye=[0.3, 0.2, 0.1]) == []


@pytest.mark.parametrize(
    ("keys", "eye", "said"),
    [
        ({}, None, "views[0]: the wall is not flat, so the eye's place is needed; accepted: eye: [x, y, z] in metres"),
        (
            {},
            [0.0, 0.0, -2.5],
            "wall.panels[0]: the eye is 0.683 m behind the plane before this part",
        ),
        ({"side": "outside"}, [0.3, 0.2, 0.1], "wall.panels[0]: the eye is 1.8"),
        (
            {"angles": [-70.0, 70.0]},
            [0.0, 0.0, -0.6],
            "degrees from straight before its flat image; accepted: at most 75",
        ),
        ({"side": "outside"}, [2.0, 0.0, 2.2], "wall.panels[0]: the eye sees the back of a part of it"),
    ],
)
def test_an_eye_that_does_not_see_the_panel_s_front_is_refused(
    keys: dict[str, Any], eye: list[float] | None, said: str
) -> None:
    assert said in refusal([panel({**BENT, **keys})], **({} if eye is None else {"eye": eye}))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"surface": None}, "wall.panels[0]: has neither corners nor a surface; accepted: exactly one of"),
        ({"corners": FLAT}, "wall.panels[0]: has both corners and a surface"),
        ({"bezel": 0.01}, "bezel = 0.01: a curved panel has no frame"),
        ({"row_time": 1e-6}, "rows of a curved panel are not rows of the flat image"),
        ({"surface": {**BENT, "angles": [10.0, -10.0]}}, "angles = [10.0, -10.0]: span -20 degrees"),
        ({"surface": {**BENT, "heights": [1.0, 0.0]}}, "heights = [1.0, 0.0]: do not grow"),
        ({"surface": {**DOME, "elevations": [60.0, 95.0]}}, "elevations"),
    ],
)
def test_what_a_curved_panel_cannot_be_is_refused(keys: dict[str, Any], said: str) -> None:
    values = {k: v for k, v in {**panel(BENT), **keys}.items() if v is not None}
    assert said in refusal([values], eye=[0.0, 0.0, 0.0])


def pair(first: list[float], second: list[float], **keys: Any) -> list[dict[str, Any]]:
    """Two parts of a cylinder, square pixels of 4 cm, 0.02 rad across."""
    sides = ({"right": keys.pop("overlap", 0.0)}, {"left": 0.0})
    sides[1]["left"] = sides[0]["right"]
    parts = [{**BENT, "angles": np.degrees(angles).tolist(), "heights": [-0.6, 0.6]} for angles in (first, second)]
    sizes = [[round((angles[1] - angles[0]) / 0.02), 30] for angles in (first, second)]
    return [
        panel(part, name, **{"overlap": side, "pixels": pixels, **keys})
        for part, name, side, pixels in zip(parts, "ab", sides, sizes, strict=True)
    ]


def test_parts_of_one_cylinder_overlap_along_the_arc() -> None:
    eye = [0.0, 0.0, 0.0]
    assert notes(pair([-0.8, 0.0], [0.0, 0.8]), eye=eye) == []
    assert "panels a and b share 0.4 x 1.2 m (10 x 30 of b's pixels)" in refusal(
        pair([-0.8, 0.1], [-0.1, 0.7]), eye=eye
    )
    ramps = pair([-0.8, 0.1], [-0.1, 0.8], overlap=0.4, blend="auto")
    assert notes(ramps, eye=eye) == []
    shifted = pair([-0.8, 0.1], [-0.09, 0.81], overlap=0.4, blend="auto")
    assert ["its pixels lie between those of panel a" in note for note in notes(shifted, eye=eye)] == [True]
    plain = pair([-0.8, 0.1], [-0.1, 0.8], overlap=0.4)
    assert ["not both fade out" in note for note in notes(plain, eye=eye)] == [True]


def test_what_an_eye_sees_before_or_behind_a_curved_panel_is_noted() -> None:
    flat = {"id": "b", "pixels": [40, 30], "corners": FLAT}
    [note] = notes([panel(BENT), flat], eye=[0.0, 0.0, 0.5])
    assert "panel b: lights 100 % of its area where the eye also sees panel a" in note.replace("\n", " ")
    beside = {key: [x - 1.0, y, z] for key, (x, y, z) in FLAT.items()}
    assert notes([panel(BENT), {**flat, "corners": beside}], eye=[0.0, 0.0, 0.5]) == []
    other = {**BENT, "radius": 3.0, "angles": [40.0, 80.0]}
    [note] = notes([panel(BENT), panel(other, "b")], eye=[0.0, 0.0, 0.0])
    assert "panel b: lights 12 % of its area" in note.replace("\n", " ")  # 5 of 40 degrees


def test_a_curved_wall_spelled_out_is_the_same_wall() -> None:
    loaded = loaded_of([panel(BENT, stereo="top_bottom"), panel(DOME, "b")], eye=[0.0, 0.1, 0.2])
    again = loaded.with_config(loaded.config.model_copy(update={"wall": expanded_config(loaded.config.wall)}))
    for one, other in zip(wall_of(loaded).panels, wall_of(again).panels, strict=True):
        assert (one.id, one.pixels, one.screen) == (other.id, other.pixels, other.screen)
        assert np.array_equal(one.corners, other.corners)


def test_a_curved_panel_without_seats_is_refused() -> None:
    with pytest.raises(ConfigError, match="the eye's place is needed"):
        expand(loaded_of([panel(BENT)]).config.wall)


def test_parts_of_a_cylinder_lie_unrolled_as_they_stand_on_it() -> None:
    """Two rows of three, whose edges meet; of other pixels than each other's they lie side by side."""

    def laid_out(pixels: int) -> list[tuple[int, int]]:
        parts = [
            f"{{id: r{row}c{k}, pixels: [{pixels if k == 2 else 160}, 90], surface: {{type: cylinder, radius: 2.0, "
            f"angles: [{30 * k - 45}, {30 * k - 15}], heights: [{-0.6 * row}, {0.6 - 0.6 * row}]}}}}"
            for row in range(2)
            for k in range(3)
        ]
        text = "version: 1\nscene: {source: courtyard}\nwall: {panels: [" + ", ".join(parts) + "]}\n"
        wall = wall_of(loads(text + "views: [{camera: auto, eye: [0, 0, 0]}]\n"))
        assert len(wall.faces) == 6, "each has an image of its own"
        return [panel.screen for panel in wall.panels]

    rows = [y for _, y in laid_out(160)]
    down = max(rows)
    assert laid_out(160) == [(160 * k, y) for y in (0, down) for k in range(3)]
    assert 88 <= down <= 93, "as high as a part, in pixels that are not quite square"
    assert {y for _, y in laid_out(200)} == {0}
