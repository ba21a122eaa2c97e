"""MPCDI: regions become panels, geometry warps become tables of positions, alpha maps become masks."""

from __future__ import annotations

import io
import os
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wall import cli
from wall.config.loading import load
from wall.core.data import Float64, Rect
from wall.core.errors import ConfigError
from wall.importers import archive as archives
from wall.importers.command import convert_file
from wall.importers.mpcdi_files import read_pfm
from wall.importers.panels import turned
from wall.importers.report import Conversion, NotThisFormat
from wall.operators.blend_mask import read_mask
from wall.operators.warp import read_positions

PIXELS = (24, 15)
FILESET = '<fileset region="{0}"><geometryWarpFile><path>{0}.pfm</path>{1}</geometryWarpFile>{2}</fileset>'


def pfm(vectors: Float64, order: str = "<") -> bytes:
    height, width = vectors.shape[:2]
    head = f"PF\n{width} {height}\n{'-1.0' if order == '<' else '1.0'}\n"
    return head.encode() + vectors.astype(f"{order}f4").tobytes()


def png(values: Float64) -> bytes:
    out = io.BytesIO()
    Image.fromarray(np.round(values * 255.0).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def centres(pixels: tuple[int, int] = PIXELS) -> tuple[Float64, Float64]:
    """(h, w) each: shares from the left and from the top of the centres of pixels."""
    x, y = ((np.arange(n) + 0.5) / n for n in pixels)
    across, down = np.meshgrid(x, y)
    return across, down


def document(profile: str, regions: str, files: str = "", buffer: str = "") -> str:
    return (
        f'<MPCDI profile="{profile}" geometry="1" color="1" version="2.0"><display><buffer id="b" {buffer}>{regions}'
        f"</buffer></display><files>{files}</files></MPCDI>"
    )


def region(name: str, where: str = 'x="0" y="0" xsize="1" ysize="1"', inner: str = "") -> str:
    return f'<region id="{name}" xResolution="24" yResolution="15" {where}>{inner}</region>'


def frustum(yaw: float, pitch: float, roll: float, left: float = -20, right: float = 30) -> str:
    names = ("yaw", "pitch", "roll", "leftAngle", "rightAngle", "downAngle", "upAngle")
    values = (yaw, pitch, roll, left, right, -10, 15)
    inner = "".join(f"<{name}>{value}</{name}>" for name, value in zip(names, values, strict=True))
    return f"<frustum>{inner}</frustum>"


def archive(folder: Path, text: str, **files: bytes) -> Path:
    path = folder / "w.mpcdi"
    with zipfile.ZipFile(path, "w") as out:
        out.writestr("mpcdi.xml", text)
        for name, data in files.items():
            out.writestr(f"data/{name}", data)
    return path


def converted(folder: Path, text: str, **files: bytes) -> Conversion:
    return convert_file(archive(folder, text, **files), folder="w_files")[1]


def table(made: Conversion, panel: int, folder: Path, pixels: tuple[int, int] = PIXELS) -> Float64:
    """(h, w, 2) shares of the panel's image, from the top left."""
    name = made.values["wall"]["panels"][panel]["warp"]["file"]
    (folder / "table.npy").write_bytes(made.files[name])
    return read_positions(folder / "table.npy", pixels)


def corners(made: Conversion, panel: int) -> Float64:
    found = made.values["wall"]["panels"][panel]["corners"]
    return np.array([found["lower_left"], found["lower_right"], found["upper_left"]])


def test_regions_of_a_flat_image_are_panels_that_overlap_with_their_warps_and_masks(tmp_path: Path) -> None:
    x, y = centres()
    warp = np.stack([x + 0.1 * y, 1.0 - y, np.full_like(x, np.nan)], axis=-1)
    warp[3, 4] = np.nan
    kept = png(np.clip(x * 3.0, 0.0, 1.0))
    regions = region("left", 'x="0" y="0" xsize="0.6" ysize="1"') + region(
        "right", 'x="0.4" y="0" xsize="0.6" ysize="1"'
    )
    alpha = "<alphaMap><path>right.png</path><gammaEmbedded>2.2</gammaEmbedded></alphaMap>"
    files = FILESET.format("left", "", "") + FILESET.format("right", "", alpha)
    text = document("2d", regions, files, 'xResolution="40" yResolution="15"')
    made = converted(tmp_path, text, **{"left.pfm": pfm(warp), "RIGHT.PFM": pfm(warp, ">"), "right.png": kept})

    assert (made.panels, made.ranks) == (2, 2)
    left, right = made.values["wall"]["panels"]
    assert left["overlap"] == {"right": pytest.approx(8 * 0.25e-3)}
    assert right["overlap"] == {"left": pytest.approx(8 * 0.25e-3)}
    np.testing.assert_allclose(corners(made, 0)[:, 0] / 0.25e-3, [-20, 4, -20], atol=1e-4)
    np.testing.assert_allclose(corners(made, 1)[:, 1] / 0.25e-3, [-7.5, -7.5, 7.5], atol=1e-4)
    for panel in (0, 1):
        shares = table(made, panel, tmp_path)
        shown = x + 0.1 * y <= 1.0
        shown[3, 4] = False
        np.testing.assert_allclose(shares[shown], np.stack([x + 0.1 * y, y], axis=-1)[shown], atol=1e-6)
        beyond = x + 0.1 * y > 1.002
        assert np.isnan(shares[beyond]).all(), "the region has nothing there"
        assert np.isnan(shares[3, 4]).all()
    assert "blend_mask" not in left
    assert made.files[right["blend_mask"]] == kept
    assert {item.what for item in made.not_carried} == {
        "MPCDI.geometry = '1'",
        "MPCDI.color = '1'",
        "MPCDI.version = '2.0'",
    }


def test_a_coarse_warp_is_linear_between_nodes_from_edge_to_edge() -> None:
    nodes = np.zeros((3, 5, 3))
    nodes[..., 0], nodes[..., 1] = np.linspace(0, 1, 5), np.linspace(1, 0, 3)[:, None]
    x, y = centres()
    np.testing.assert_allclose(read_pfm(pfm(nodes), PIXELS)[..., :2], np.stack([x, 1 - y], axis=-1), atol=1e-7)


def test_a_mask_of_linear_shares_is_made_for_a_projector_s_gamma(tmp_path: Path) -> None:
    shares = np.tile(np.linspace(0.0, 1.0, 24), (15, 1))
    alpha = "<alphaMap><path>a.png</path><gammaEmbedded>1</gammaEmbedded></alphaMap>"
    files = f'<fileset region="a">{alpha}</fileset>'
    made = converted(tmp_path, document("2d", region("a"), files), **{"a.png": png(shares)})
    (tmp_path / "m.png").write_bytes(made.files[made.values["wall"]["panels"][0]["blend_mask"]])
    kept = read_mask(tmp_path / "m.png")
    assert kept.shape == (15, 24, 1)
    np.testing.assert_allclose(kept[..., 0] ** 2.2, np.round(shares * 255) / 255, atol=1e-4)


@pytest.mark.parametrize(
    ("angles", "ahead", "left_rises"),
    [((0, 0, 0), (0, 0, -1), 0.0), ((90, 0, 0), (1, 0, 0), 0.0), ((0, 30, 0), (0, 0.5, -np.sqrt(0.75)), 0.0),
     ((0, 0, 90), (0, 0, -1), 1.0), ((90, 30, 0), (np.sqrt(0.75), 0.5, 0), 0.0)],
)  # fmt: skip
def test_a_projector_turns_as_a_pilot_does(
    angles: tuple[float, float, float], ahead: tuple[float, float, float], left_rises: float
) -> None:
    found = turned(*angles)
    np.testing.assert_allclose(found @ [0, 0, -1], ahead, atol=1e-12)
    assert (found @ [-1, 0, 0])[1] == pytest.approx(left_rises, abs=1e-12)


def test_a_frustum_s_panel_is_seen_under_its_angles(tmp_path: Path) -> None:
    text = document("3d", region("a", inner=frustum(40, -20, 10)) + region("b", inner=frustum(-60, 0, 0, 5, 95)))
    made = converted(tmp_path, text)
    assert [panel["id"] for panel in made.values["wall"]["panels"]] == ["a"], "no image is 95 degrees aside"
    assert any("growing angles" in item.why for item in made.not_carried)
    local = corners(made, 0) @ turned(40, -20, 10)  # its transpose, from the right
    angles = np.degrees(np.arctan2(local[:, :2], -local[:, 2:]))
    np.testing.assert_allclose(angles, [[-20, -10], [30, -10], [-20, 15]], atol=1e-6)
    assert made.values["views"][0]["eye"] == [0, 0, 0]


@pytest.mark.parametrize("origin", ["idealEyePoint", "floorCenter"])
def test_a_pixel_shows_what_is_on_the_line_through_the_point_that_it_lights(tmp_path: Path, origin: str) -> None:
    """A bent screen that leans, in millimetres, z up."""
    x, y = centres()
    angle = np.radians(-20 + 70 * x)
    points = np.stack([2.0 * np.sin(angle), 2.4 * np.cos(angle) + 0.2 * y, 1.2 - 1.9 * y + 0.1 * x], axis=-1)
    points[0, 0] = np.nan
    axes = {"pitchx": 1, "pitchy": 0, "pitchz": 0, "yawx": 0, "yawy": 0, "yawz": -1, "rollx": 0, "rolly": 1, "rollz": 0}
    frame = "<coordinateFrame>" + "".join(f"<{k}>{v}</{k}>" for k, v in axes.items()) + "</coordinateFrame>"
    about = f"<geometricUnit>mm</geometricUnit><originOf3DData>{origin}</originOf3DData>"
    text = document("a3", region("a", inner=frame), FILESET.format("a", about, ""))
    made = converted(tmp_path, text, **{"a.pfm": pfm(1e3 * points)})

    eye = np.array(made.values["views"][0]["eye"])
    assert eye[1] == (1.7 if origin == "floorCenter" else 0.0)
    shares, (low, right, high) = table(made, 0, tmp_path), corners(made, 0)
    seen = low + shares[..., :1] * (right - low) + (1.0 - shares[..., 1:]) * (high - low) - eye
    wanted = points[..., [0, 2, 1]] * [1, 1, -1] - eye
    sine = (
        np.linalg.norm(np.cross(seen, wanted), axis=-1)
        / np.linalg.norm(seen, axis=-1)
        / np.linalg.norm(wanted, axis=-1)
    )
    known = np.isfinite(points).all(axis=-1)
    assert sine[known].max() < 1e-6
    assert np.isnan(shares[~known]).all()
    assert (np.abs(shares[known] - 0.5) <= 0.5 + 1e-6).all()


def test_shader_lamps_are_eyes_of_their_own(tmp_path: Path) -> None:
    values = {
        "posx": 1,
        "posy": -2,
        "posz": 0.5,
        "pitchx": 1,
        "pitchy": 0,
        "pitchz": 0,
        "yawx": 0,
        "yawy": 0,
        "yawz": -1,
    }
    values |= {"rollx": 0, "rolly": 1, "rollz": 0}
    frame = "<coordinateFrame>" + "".join(f"<{k}>{v}</{k}>" for k, v in values.items()) + "</coordinateFrame>"
    made = converted(tmp_path, document("sl", region("a", inner=frustum(0, 0, 0, -10, 10) + frame)))
    (panel,) = made.values["wall"]["panels"]
    assert panel["eye"] == [1, 0.5, 2]
    np.testing.assert_allclose(
        corners(made, 0)[0] - panel["eye"], [-np.tan(np.radians(10)), -np.tan(np.radians(10)), -1]
    )


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ({}, "its file is not there"),
        ({"a.pfm": b"Pf\n3 3\n-1\n" + bytes(36)}, "is no colour PFM"),
        ({"a.pfm": b"PF\n24 15\n-1\n" + bytes(9)}, "has 9 bytes for 24 x 15 vectors"),
        ({"a.pfm": b"PF\n24 fifteen\n-1\n"}, "invalid literal"),
    ],
)
def test_a_warp_that_is_missing_or_wrong_is_listed_and_the_panel_stays(
    tmp_path: Path, files: dict[str, bytes], why: str
) -> None:
    made = converted(tmp_path, document("2d", region("a"), FILESET.format("a", "", "")), **files)
    (panel,) = made.values["wall"]["panels"]
    assert "warp" not in panel
    assert any(why in item.why for item in made.not_carried)


def test_what_is_no_mpcdi_is_refused_and_what_is_too_large_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(NotThisFormat, match=r"profile is 4d; accepted: 2d, 3d, a3, sl"):
        converted(tmp_path, document("4d", region("a")))
    with pytest.raises(NotThisFormat, match="no region that can be shown"):
        converted(tmp_path, document("3d", region("a")))
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as out:
        out.writestr("a.txt", "")
    with pytest.raises(NotThisFormat, match=r"has no mpcdi\.xml"):
        convert_file(tmp_path / "other.zip")
    monkeypatch.setattr(archives, "MOST_BYTES", 1000)
    made = converted(tmp_path, document("2d", region("a"), FILESET.format("a", "", "")), **{"a.pfm": bytes(1001)})
    assert any("more than 1000 bytes" in item.why for item in made.not_carried)
    with pytest.raises(ConfigError, match="more than 1000 bytes"):
        converted(tmp_path, document("2d", region("a")) + " " * 1000)


def test_a_description_may_come_through_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    text = document("3d", region("a", inner=frustum(0, 0, 0)))
    writer = threading.Thread(target=(tmp_path / "pipe").write_text, args=(text,), daemon=True)
    writer.start()
    made = convert_file(tmp_path / "pipe")[1]
    writer.join(10.0)
    assert not writer.is_alive()
    assert made.panels == 1


def test_wall_convert_writes_the_files_beside_the_yaml_and_the_wall_is_right(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    x, y = centres()
    alpha = "<alphaMap><path>a.png</path><gammaEmbedded>2.2</gammaEmbedded></alphaMap>"
    path = archive(
        tmp_path, document("3d", region("a", inner=frustum(0, 0, 0)), FILESET.format("a", "", alpha)),
        **{"a.pfm": pfm(np.stack([x, 1 - y, x], axis=-1)), "a.png": png(x)},
    )  # fmt: skip
    made = tmp_path / "made" / "room.yaml"
    made.parent.mkdir()
    with pytest.raises(SystemExit) as ended:
        cli.app(["convert", str(path), "-o", str(made)])
    assert ended.value.code == 0, capsys.readouterr()
    panel = load(made).config.wall.panels[0]
    assert panel.blend_mask == "room_files/1-a.mask.png"
    assert read_mask(made.parent / str(panel.blend_mask)).shape == (15, 24, 1)
    assert panel.warp.file == "room_files/0-a.warp.npy"  # type: ignore[union-attr]
    whole = Rect(x=0, y=0, width=24, height=15)
    np.testing.assert_allclose(
        read_positions(made.parent / panel.warp.file, (whole.width, whole.height))[..., 0], x, atol=1e-6
    )  # type: ignore[union-attr]
