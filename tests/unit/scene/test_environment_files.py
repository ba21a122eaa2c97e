"""Environments from files: Radiance pictures to the bit, EXR, PNG and JPEG, and errors that name what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from radiance_writer import write_hdr

from wall.config.scene import SceneConfig
from wall.core.data import Float32
from wall.core.errors import SceneError
from wall.scene.build import Scene, build
from wall.scene.environment import WIDEST_PX, read_environment
from wall.scene.needs import needs
from wall.scene.radiance_file import read_hdr

HEADER = b"#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\n"


def picture(height: int = 8) -> Float32:
    return np.random.default_rng(5).uniform(0.0, 30.0, (height, 2 * height, 3)).astype(np.float32)


def exr(path: Path, image: Float32) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(image)}).write(str(path))


def read(path: Path) -> Float32:
    return read_environment(path, rotation=0.0, strength=1.0)[0].texels


def test_radiance_pixels_share_an_exponent() -> None:
    """Value = mantissa 2^(exponent - 136); 0 is black; EXPOSURE divides."""
    flat = bytes([128, 64, 0, 129, 255, 255, 255, 0])
    got = read_hdr(HEADER + b"EXPOSURE=2\n\n-Y 1 +X 2\n" + flat)
    np.testing.assert_array_equal(got, np.array([[[0.5, 0.25, 0.0], [0.0, 0.0, 0.0]]], np.float32))


def test_runs_are_unpacked_channel_by_channel() -> None:
    channels = [bytes([128 + 8, 128]), bytes([8, *range(8)]), bytes([3, 1, 2, 3, 128 + 5, 9]), bytes([128 + 8, 136])]
    got = read_hdr(HEADER + b"\n-Y 1 +X 8\n" + bytes([2, 2, 0, 8]) + b"".join(channels))
    np.testing.assert_array_equal(got[0, :, 0], np.full(8, 128.0))
    np.testing.assert_array_equal(got[0, :, 1], np.arange(8.0))
    np.testing.assert_array_equal(got[0, :, 2], (1, 2, 3, 9, 9, 9, 9, 9))


def test_old_runs_repeat_the_pixel_before() -> None:
    got = read_hdr(HEADER + b"\n-Y 1 +X 5\n" + bytes([4, 5, 6, 136, 1, 1, 1, 3, 7, 8, 9, 136]))
    np.testing.assert_array_equal(got[0], [[4, 5, 6]] * 4 + [[7, 8, 9]])


def test_what_is_written_as_radiance_comes_back_within_a_256th(tmp_path: Path) -> None:
    image = picture()
    write_hdr(tmp_path / "a.hdr", image)
    got = read(tmp_path / "a.hdr")
    assert (np.abs(got - image) <= image.max(axis=-1, keepdims=True) / 128).all()
    write_hdr(tmp_path / "b.hdr", got)
    np.testing.assert_array_equal(read(tmp_path / "b.hdr"), got)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "its header has no end"),
        (b"P6\n\n-Y 1 +X 2\n" + bytes(8), r"does not begin with #\?RADIANCE"),
        (b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 2\n" + bytes(8), "its format is '32-bit_rle_xyze'"),
        (HEADER + b"\n+X 2 -Y 1\n" + bytes(8), "its size is given as '\\+X 2 -Y 1'"),
        (HEADER + b"\n-Y 0 +X 2\n", "it has 2x0 pixels"),
        (HEADER + b"\n-Y 400000 +X 800000\n", "it has 800000x400000 pixels"),
        (HEADER + b"\n-Y 4000 +X 8000\n" + bytes(64), "it ends after"),
        (HEADER + b"EXPOSURE=none\n\n-Y 1 +X 2\n" + bytes(8), "its exposure is 'none'"),
        (HEADER + b"\n-Y 2 +X 4\n" + bytes(28), "scanline 1 of 2 is broken"),
        (HEADER + b"\n-Y 1 +X 8\n" + bytes([2, 2, 0, 8, 128 + 9, 1, 0, 0, 0, 0]), "scanline 0 of 1 is broken"),
        (HEADER + b"\n-Y 1 +X 2\n" + bytes([1, 1, 1, 2, 0, 0, 0, 0]), "scanline 0 of 1 is broken"),
    ],
)
def test_broken_radiance_pictures_are_refused(data: bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read_hdr(data)


@given(st.binary(max_size=60), st.integers(1, 4), st.integers(1, 12))
def test_any_bytes_are_a_picture_or_a_value_error(data: bytes, height: int, width: int) -> None:
    try:
        got = read_hdr(HEADER + f"\n-Y {height} +X {width}\n".encode() + data)
    except ValueError:
        return
    assert got.shape == (height, width, 3)


def test_exr_png_and_jpeg_are_read_as_linear_light(tmp_path: Path) -> None:
    image = picture()
    exr(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(read(tmp_path / "a.exr"), image)
    Image.new("RGB", (8, 4), (255, 188, 0)).save(tmp_path / "a.png")
    Image.new("RGB", (8, 4), (188, 188, 188)).save(tmp_path / "a.jpg")
    np.testing.assert_allclose(read(tmp_path / "a.png")[0, 0], (1.0, 0.5029, 0.0), atol=1e-3)
    np.testing.assert_allclose(read(tmp_path / "a.jpg")[0, 0], 0.5029, atol=1e-2)


def test_strength_scales_and_rotation_is_kept(tmp_path: Path) -> None:
    exr(tmp_path / "a.exr", picture())
    environment, notes = read_environment(tmp_path / "a.exr", rotation=90.0, strength=0.5)
    np.testing.assert_allclose(environment.texels, 0.5 * picture())
    assert (environment.middle, notes) == (0.75, [])


def test_negative_light_counts_as_none_and_is_noted(tmp_path: Path) -> None:
    image = picture()
    image[0, 0, 1], image[1, 1, 2] = -1.0, -2.0
    exr(tmp_path / "a.exr", image)
    environment, (note,) = read_environment(tmp_path / "a.exr", rotation=0.0, strength=1.0)
    assert environment.texels.min() == 0.0
    assert note == "a.exr: 2 of its pixels have negative light, which counts as none"


def test_very_wide_images_are_reduced_to_their_means(tmp_path: Path) -> None:
    height = WIDEST_PX // 2 + 2
    image = np.ones((height, 2 * height, 3), np.float32)
    image[: height // 2] = 3.0
    exr(tmp_path / "a.exr", image)
    environment, (note,) = read_environment(tmp_path / "a.exr", rotation=0.0, strength=1.0)
    assert environment.texels.shape == (WIDEST_PX // 2, WIDEST_PX, 3)
    assert environment.texels.mean() == pytest.approx(2.0, abs=1e-3)
    assert "reduced to 4096x2048" in note


def test_files_that_are_no_environment_are_refused(tmp_path: Path) -> None:
    holes = picture()
    holes[2, 3, 0], holes[4, 5] = np.nan, np.inf
    exr(tmp_path / "holes.exr", holes)
    Image.new("RGB", (30, 20)).save(tmp_path / "photo.png")
    (tmp_path / "text.exr").write_text("no picture")
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "text.hdr").write_text("no picture")
    for name, said in {
        "none.hdr": "there is no such file",
        "sky.tiff": "cannot read '.tiff', wanted .hdr, .exr, .png",
        "holes.exr": "2 of its pixels are NaN or infinite",
        "photo.png": "is 30x20 pixels, wanted a lat-long image, twice as wide as high",
        "text.exr": "cannot be read as exr",
        "text.png": "cannot be read as png",
        "text.hdr": "cannot be read as hdr, its header has no end",
    }.items():
        with pytest.raises(SceneError, match=r"scene\.environment\.file = ") as caught:
            read(tmp_path / name)
        assert said in str(caught.value)
        assert name in str(caught.value)


def configured(folder: Path, **keys: object) -> Scene:
    return build(SceneConfig.model_validate(keys), folder)


def test_a_configured_environment_takes_the_place_of_the_sky(tmp_path: Path) -> None:
    exr(tmp_path / "a.exr", picture())
    scene = configured(tmp_path, source="courtyard", environment={"file": "a.exr", "rotation": 30.0})
    assert scene.environment is not None
    assert (scene.environment.name, scene.environment.rotation) == ("a.exr", 30.0)
    assert needs(scene).environment
    assert not needs(scene).relighting  # it moves, but an environment is not relit
    assert configured(tmp_path, source="courtyard").environment is None


def test_a_sky_and_an_environment_are_refused_together() -> None:
    with pytest.raises(ValueError, match="names both a sky and an environment"):
        SceneConfig.model_validate({"source": "courtyard", "sky": {}, "environment": {"file": "a.exr"}})
