"""SGCT's JSON and its earlier XML: nodes, windows, viewports and their projections."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from wall.importers.report import Conversion, NotThisFormat
from wall.importers.sgct import convert

PLANE = {
    "type": "ProjectionPlane",
    "lowerleft": {"x": -1.5, "y": -1, "z": 0},
    "upperleft": {"x": -1.5, "y": 1, "z": 0},
    "upperright": {"x": 1.5, "y": 1, "z": 0},
}
XML = """<?xml version="1.0" ?>
<Cluster masterAddress="10.0.0.1" externalControlPort="20500">
  <Node address="10.0.0.2" port="20400" swapLock="false">
    <Window fullScreen="false" numberOfSamples="4" monitor="1">
      <Stereo type="side_by_side" />
      <Size x="1400" y="1050" />
      <Pos x="100" y="50" />
      <Viewport>
        <Viewplane>
          <Pos x="-1.5" y="-1" z="0" />
          <Pos x="-1.5" y="1" z="0" />
          <Pos x="1.5" y="1" z="0" />
        </Viewplane>
      </Viewport>
    </Window>
    <Window fullScreen="true">
      <Size x="640" y="480" />
      <Viewport>
        <PlanarProjection>
          <FOV left="45" right="45" up="45" down="0" />
          <Orientation heading="90.0" pitch="0.0" roll="0.0" />
        </PlanarProjection>
      </Viewport>
    </Window>
  </Node>
  <User eyeSeparation="0.065"><Pos x="0.0" y="0.5" z="4.0" /></User>
</Cluster>
"""


def converted(*windows: dict[str, Any], **top: Any) -> Conversion:
    nodes = [{"address": "host1", "port": 20401, "windows": list(windows)}]
    document = {"version": 1, "masteraddress": "host1", "nodes": nodes} | top
    return convert(json.dumps(document), "s.json")


def window(projection: dict[str, Any] | None = None, /, **given: Any) -> dict[str, Any]:
    viewport = {} if projection is None else {"projection": projection}
    return {"size": {"x": 640, "y": 480}, "viewports": [viewport]} | given


def panel(projection: dict[str, Any] | None = None, /, users: list[Any] | None = None, **given: Any) -> dict[str, Any]:
    found: dict[str, Any] = converted(window(projection, **given), users=users or []).values["wall"]["panels"][0]
    return found


def planar(fov: dict[str, float], **given: Any) -> dict[str, Any]:
    return {"type": "PlanarProjection", "fov": fov} | given


def angles(corners: dict[str, list[float]], eye: np.ndarray) -> tuple[float, float]:
    """Horizontal and vertical field of view of a panel from an eye before its middle, degrees."""
    low, right, high = (np.array(corners[key]) for key in ("lower_left", "lower_right", "upper_left"))
    middle = (right + high) / 2
    distance = np.linalg.norm(middle - eye)
    across, up = np.linalg.norm(right - low) / 2, np.linalg.norm(high - low) / 2
    return 2 * math.degrees(math.atan(across / distance)), 2 * math.degrees(math.atan(up / distance))


def test_corners_of_a_projection_plane_are_used_as_they_are() -> None:
    corners = panel(PLANE, users=[{"pos": {"x": 0, "y": 0, "z": 4}}])["corners"]

    assert corners == {"lower_left": [-1.5, -1, 0], "lower_right": [1.5, -1, 0], "upper_left": [-1.5, 1, 0]}


def test_a_planar_projection_has_its_field_of_view_from_the_users_eye() -> None:
    users = [{"eyeseparation": 0.06, "pos": {"x": 0, "y": 0, "z": 4.0}}]

    made = converted(window(planar({"hfov": 80, "vfov": 50})), users=users)

    corners = made.values["wall"]["panels"][0]["corners"]
    assert angles(corners, np.array([0, 0, 4.0])) == pytest.approx((80, 50), abs=1e-6)
    assert corners["lower_left"][2] == pytest.approx(3.0)  # 1 m before the eye
    assert made.values["views"][0]["eye"] == [0, 0, 4]
    assert made.values["views"][0]["eye_separation"] == 0.06


def test_a_distance_and_an_offset_move_the_plane() -> None:
    corners = panel(planar({"hfov": 90, "vfov": 90}, distance=2.0, offset={"x": 0.5, "y": 0, "z": -1}))["corners"]

    assert corners["lower_left"] == [-1.5, -2, -3]
    assert corners["lower_right"] == [2.5, -2, -3]


def test_angles_to_each_side_give_an_asymmetric_panel() -> None:
    corners = panel(planar({"left": 45, "right": 0, "up": 45, "down": -30}))["corners"]

    assert corners["lower_left"] == pytest.approx([-1, math.tan(math.radians(30)), -1])
    assert corners["lower_right"] == pytest.approx([0, math.tan(math.radians(30)), -1])
    assert corners["upper_left"] == pytest.approx([-1, 1, -1])


@pytest.mark.parametrize(
    ("turn", "middle"),
    [
        ({"yaw": 90, "pitch": 0, "roll": 0}, (1, 0, 0)),  # to the right
        ({"yaw": 0, "pitch": 90, "roll": 0}, (0, 1, 0)),  # up
        ({"yaw": 90, "pitch": 45, "roll": 30}, (math.sqrt(0.5), math.sqrt(0.5), 0)),  # pitch goes before yaw
        ({"x": 0, "y": -math.sqrt(0.5), "z": 0, "w": math.sqrt(0.5)}, (1, 0, 0)),  # -90 degrees about y
        ({"x": 0, "y": 0, "z": 0, "w": 0}, (0, 0, -1)),  # no rotation at all
    ],
)
def test_yaw_turns_right_and_pitch_up(turn: dict[str, float], middle: tuple[float, float, float]) -> None:
    corners = panel(planar({"hfov": 20, "vfov": 20}, orientation=turn))["corners"]

    found = (np.array(corners["lower_right"]) + np.array(corners["upper_left"])) / 2
    np.testing.assert_allclose(found, middle, atol=1e-8)


def test_roll_turns_the_image_to_the_right() -> None:
    corners = panel(planar({"hfov": 90, "vfov": 20}, orientation={"yaw": 0, "pitch": 0, "roll": 90}))["corners"]

    across = np.array(corners["lower_right"]) - np.array(corners["lower_left"])
    np.testing.assert_allclose(across, [0, -2, 0], atol=1e-8)  # what was right is down


def test_a_wider_field_of_view_than_flat_images_have_ends_there_and_is_listed() -> None:
    made = converted(window(planar({"hfov": 200, "vfov": 50})))

    assert angles(made.values["wall"]["panels"][0]["corners"], np.zeros(3))[0] == pytest.approx(170)
    assert any("at most 85 degrees" in item.why for item in made.not_carried)


@pytest.mark.parametrize(
    ("projection", "degrees"),
    [
        ({"type": "FisheyeProjection", "fov": 100, "quality": "1k"}, 100),
        ({"type": "FisheyeProjection", "fov": 180}, 120),
        ({"type": "CylindricalProjection", "radius": 5}, 90),
        ({"type": "EquirectangularProjection"}, 90),
        ({"type": "CubemapProjection", "channels": {"right": True}}, 90),
        ({"type": "SphericalMirrorProjection", "geometry": {"left": "a.obj"}}, 90),
        ({"type": "SpoutOutputProjection", "mapping": "fisheye"}, 90),
        ({"type": "ProjectionPlane"}, 90),
        ({"type": "PlanarProjection"}, 90),
        ({"type": "PlanarProjection", "fov": {"hfov": 0, "vfov": 1}}, 90),
        ({}, 90),
    ],
)
def test_a_projection_that_is_not_rendered_becomes_a_flat_panel_and_is_listed(
    projection: dict[str, Any], degrees: float
) -> None:
    made = converted(window(projection))

    across, _ = angles(made.values["wall"]["panels"][0]["corners"], np.zeros(3))
    assert across == pytest.approx(degrees)
    listed = [item for item in made.not_carried if item.what == "nodes[0].windows[0].viewports[0].projection"]
    assert len(listed) == 1
    assert "flat panel of" in listed[0].why
    inside = [item for item in made.not_carried if item.what.startswith(f"{listed[0].what}.")]
    assert len(inside) >= len([value for value in projection.values() if not isinstance(value, dict)])


def test_viewports_are_panels_with_their_part_of_the_windows_pixels() -> None:
    lower_right = {"pos": {"x": 0.5, "y": 0}, "size": {"x": 0.5, "y": 0.25}, "projection": PLANE, "eye": "left"}
    upper = {"pos": {"x": 0, "y": 0.25}, "size": {"x": 1, "y": 0.75}, "projection": PLANE}

    made = converted({"size": {"x": 640, "y": 480}, "pos": {"x": 10, "y": 20}, "viewports": [lower_right, upper]})

    first, second = made.values["wall"]["panels"]
    assert (first["id"], second["id"]) == ("n0w0-v0", "n0w0-v1")
    assert first["window"] == {"x": 330, "y": 380, "width": 320, "height": 120}  # 20 + 480 - 120 from the top
    assert second["window"] == {"x": 10, "y": 20, "width": 640, "height": 360}
    assert (first["pixels"], first["stereo"]) == ([320, 120], "left")


def test_nodes_give_hosts_and_windows_monitors() -> None:
    found = panel(PLANE, monitor=2, fullscreen=True)

    assert (found["host"], found["monitor"]) == ("host1", 2)
    assert "window" not in found


@pytest.mark.parametrize(
    ("stereo", "wanted", "listed"),
    [
        ("none", "mono", 0),
        ("side_by_side", "side_by_side", 0),
        ("top_bottom_inverted", "top_bottom", 1),
        ("active", "mono", 1),
        ("anaglyph_wimmer", "mono", 1),
    ],
)
def test_stereo_is_carried_where_it_is_supported(stereo: str, wanted: str, listed: int) -> None:
    made = converted(window(PLANE, stereo=stereo))

    assert made.values["wall"]["panels"][0].get("stereo", "mono") == wanted
    assert len([item for item in made.not_carried if "stereo" in item.what]) == listed


def test_a_mirrored_window_is_a_warp() -> None:
    assert panel(PLANE, mirrorx=True)["warp"]["points"] == [[1, 0], [0, 0], [1, 1], [0, 1]]
    assert panel(PLANE, mirrory=True)["warp"]["points"] == [[0, 1], [1, 1], [0, 0], [1, 0]]
    assert "warp" not in panel(PLANE, mirrorx=False)


def test_another_users_viewport_has_an_eye_of_its_own() -> None:
    users = [{"pos": {"x": 0, "y": 0, "z": 4}}, {"name": "second", "pos": {"x": 1, "y": 0, "z": 4}}]
    viewports = [{"projection": PLANE}, {"projection": PLANE, "user": "second"}, {"projection": PLANE, "user": "who"}]

    made = converted(window(viewports=viewports), users=users)

    first, second, third = made.values["wall"]["panels"]
    assert second["eye"] == [1, 0, 4]
    assert "eye" not in first
    assert "eye" not in third
    assert any(item.why.startswith("no user has this name") for item in made.not_carried)


def test_options_that_are_off_are_carried_and_those_that_are_on_listed() -> None:
    users = [{"pos": {"x": 0, "y": 0, "z": 4}}]

    made = converted(window(PLANE, fxaa=False, msaa=4, border=True, draw3d=False), firmsync=False, users=users)

    assert {"nodes[0].windows[0].fxaa", "firmsync"} <= {item.what for item in made.carried}
    assert [item.what for item in made.not_carried] == [
        "masteraddress = 'host1'",
        "nodes[0].port = 20401",
        "nodes[0].windows[0].msaa = 4",
        "nodes[0].windows[0].border = true",
        "nodes[0].windows[0].draw3d = false",
    ]


def test_a_scene_that_is_moved_is_listed_and_one_that_is_not_is_carried() -> None:
    still = {"offset": {"x": 0, "y": 0, "z": 0}, "scale": 1}

    assert "scene" in {item.what for item in converted(window(PLANE), scene=still).carried}
    assert "scene" in {item.what for item in converted(window(PLANE), scene=still | {"scale": 2}).not_carried}


def test_the_refresh_rate_is_the_views() -> None:
    made = converted(window(PLANE), settings={"display": {"refreshrate": 50, "swapinterval": 1}})

    assert made.values["views"][0]["refresh_hz"] == 50
    assert "settings.display.swapinterval = 1" in {item.what for item in made.not_carried}


def test_earlier_xml_reads_like_the_json_with_its_own_lines() -> None:
    made = convert(XML, "s.xml")

    plane, right = made.values["wall"]["panels"]
    assert plane["corners"]["lower_right"] == [1.5, -1, 0]
    assert (plane["host"], plane["monitor"], plane["stereo"]) == ("10.0.0.2", 1, "side_by_side")
    assert plane["window"] == {"x": 100, "y": 50, "width": 1400, "height": 1050}
    # one metre to the right of the eye at (0, 0.5, 4), from 0 to 45 degrees up
    assert right["corners"]["lower_left"] == pytest.approx([1, 0.5, 3])
    assert right["corners"]["lower_right"] == pytest.approx([1, 0.5, 5])
    assert right["corners"]["upper_left"] == pytest.approx([1, 1.5, 3])
    assert (2, "Cluster.masterAddress = '10.0.0.1'") in {(item.line, item.what) for item in made.not_carried}
    assert (4, "Cluster.Node[0].Window[0].numberOfSamples = '4'") in {(i.line, i.what) for i in made.not_carried}


@pytest.mark.parametrize("around", ["{}", "<Viewport mask='b.png'>{}</Viewport>"])
def test_in_the_oldest_xml_a_window_has_its_viewplane_beside_it(around: str) -> None:
    plane = '<Viewplane><Pos x="-1" y="0" z="0"/><Pos x="-1" y="1" z="0"/><Pos x="1" y="1" z="0"/></Viewplane>'
    window = '<Window fullscreen="true"><Size x="728" y="210"/></Window>'
    user = '<User><Pos x="0" y="0" z="3"/></User>'
    scene = '<Scene><Scale value="1.0"/><Offset x="0" y="0" z="0"/></Scene>'

    made = convert(
        f'<Cluster>{scene}<Node ip="10.0.0.1">{window}{around.format(plane)}</Node>{user}</Cluster>', "s.xml"
    )

    found = made.values["wall"]["panels"][0]
    assert found["corners"] == {"lower_left": [-1, 0, 0], "lower_right": [1, 0, 0], "upper_left": [-1, 1, 0]}
    assert (found["host"], found["pixels"]) == ("10.0.0.1", [728, 210])
    assert {item.what.split(" = ")[0] for item in made.not_carried} <= {"Cluster.Node[0].Viewport[0].mask"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"version": 1}', "s.json:1:1: the file: has no nodes"),
        ('{"nodes": [{"address": "a"}]}', "s.json:1:2: nodes: have no windows"),
        ('{"nodes": [{"windows": [{"size": {"x": 0, "y": 4}}]}]}', "size: is 0 x 4; accepted: pixels above 0"),
        ("<Clutter/>", "s.json:1:1: the first element is <Clutter>; accepted: <Cluster>"),
    ],
)
def test_a_file_without_windows_is_refused_with_the_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        convert(text, "s.json")

    assert says in str(caught.value)
